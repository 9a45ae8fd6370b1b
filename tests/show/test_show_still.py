"""Schematics as SVG: every mark and every name, within the frame."""

from xml.etree import ElementTree

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.show.motions.lines import lines_of
from ephs.show.motions.sketch import sketch
from ephs.show.motions.solids import Solid, coarse
from ephs.show.motions.stage import stage_of
from ephs.show.motions.still import HIGHEST, WIDTH, still_svg
from tests.numerics import seeds
from tests.scenes import SCENES, of_all_scenes


@of_all_scenes
def test_an_svg_has_every_mark_and_every_name_within_its_frame(file):
    scene = ephs.load(file)
    poses = {name: np.asarray(body.pose) for name, body in scene.all_bodies()}
    made, picture = sketch(scene, poses), ElementTree.fromstring(still_svg(scene, poses))
    kinds = [element.tag.rpartition("}")[2] for element in picture]
    assert kinds.count("polygon") == sum(mark.fill is not None for mark in made.marks)
    assert kinds.count("polyline") == sum(mark.fill is None for mark in made.marks)
    said = " ".join(element.text or "" for element in picture)
    assert all(name in said for name in [*poses, *(name for name, _ in scene.all_joints())])
    height = float(picture.attrib["viewBox"].split()[3])
    assert height <= HIGHEST
    points = [pair.split(",") for element in picture for pair in element.attrib.get("points", "").split()]
    corners = np.array(points, dtype=float)
    assert (corners >= 0.0).all() and (corners <= [WIDTH, height]).all()


def test_names_cannot_break_the_picture(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("format = 1\n[bodies.'<b>&']\ndensity = 1.0\nshape = { sphere = 1.0 }\n")
    scene = ephs.load(file)
    picture = ElementTree.fromstring(still_svg(scene, {"<b>&": np.array([1.0, 0, 0, 0, 0, 0, 0])}))
    assert "<b>&" in [element.text for element in picture]


def test_the_outline_of_a_system_is_where_the_scene_is():
    """A system has no shapes and no names: bodies, joints and their frames are those of the scene it was built from."""
    scene = ephs.load(next(file for file in SCENES if file.stem == "four-bar"))
    problem = problem_of_scene(scene)
    initial = {str(path): value for path, value in problem.initial.items()}
    inputs = {str(path): {"flow": signal.value} for path, signal in problem.signals.items()}
    sol = ephs.simulate(problem.system, 0.2, initial=initial, inputs=inputs, save_at=[0.0, 0.1, 0.2])
    known = ephs.simulate(scene, 0.2, save_at=[0.0, 0.1, 0.2])
    for name, joint in scene.all_joints():
        found = sol.outline.joint(f"joints.{name}")
        assert (found.kind, found.body1.rpartition(".")[2], found.body2.rpartition(".")[2]) == (
            joint.kind, joint.body1, joint.body2,
        )  # fmt: skip
        np.testing.assert_allclose(found.frame1, joint.frame1, atol=1e-12)
        np.testing.assert_allclose(found.frame2, joint.frame2, atol=1e-12)
    own = stage_of(sol, wrenches=True, fps=10.0, duration=None)
    for name, _ in scene.all_bodies():
        np.testing.assert_allclose(own.frames.poses[f"bodies.{name}"][-1, 4:], known.body(name).position[-1], atol=1e-6)
    assert own.loads is not None and own.size() > 1.0


def test_tendons_are_drawn_straight_from_point_to_point(tmp_path):
    text = "format = 1\n[bodies.a]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\nposition = [1.0, 0.0, 0.0]\n"
    text += '[tendons.t]\nbodies = ["ground", "a", "a", "ground"]\nstiffness = 1.0\n'
    text += "points = [[0.0, 0.0, 1.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [2.0, 0.0, 1.0]]\n"
    (tmp_path / "scene.toml").write_text(text)
    lines = lines_of(ephs.load(tmp_path / "scene.toml"))
    assert [(line.body1, line.body2, line.coiled) for line in lines.values()] == [
        ("ground", "a", False), ("a", "a", False), ("a", "ground", False)
    ]  # fmt: skip
    assert lines["t-2"].at1.tolist() == [0.0, 0.1, 0.0]


@given(count=st.integers(1500, 3000), way=seeds)
def test_a_fine_mesh_is_drawn_with_corners_of_its_own_within_a_dot(count, way):
    points = np.random.default_rng(way).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    fine = Solid(points, tuple(np.asarray(face) for face in ConvexHull(points).simplices), "mesh")
    cell = 0.2
    found = coarse(fine, cell)
    drawn = np.unique(np.concatenate(found.faces))
    assert found.vertices is fine.vertices and len(found.faces) < len(fine.faces)
    assert all(len(set(face)) == 3 for face in found.faces)
    gaps = np.linalg.norm(points[:, None] - points[None, drawn], axis=2).min(axis=1)
    assert gaps.max() <= np.sqrt(3.0) * cell
