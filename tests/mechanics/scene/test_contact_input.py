"""Shapes that are no bodies: meshes and points that are refused, and what is said of overlaps at the start."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import ephs
from ephs.mechanics.scene import polytope
from ephs.mechanics.scene.polytope import MOST_VERTICES
from tests.mechanics.scene.test_refusals import SOUND
from tests.written import scene_of_text

ELASTIC, HARD = SOUND["elastic"], SOUND["hard"]
WELDS = "".join(
    f'[joints.{name}]\ntype = "fixed"\nbodies = ["ground", "{name}"]\nat = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n'
    for name in ("ball", "other")
)
ROUND = np.random.default_rng(0).normal(size=(MOST_VERTICES + 10, 3))
ROUND /= np.linalg.norm(ROUND, axis=1)[:, None]
DENTED = "a mesh that is not convex:"
CUBE = np.array(list(np.ndindex(2, 2, 2))) * 0.2 - 0.1


def stl(points):
    """Text of the hull of points (n, 3); of flat ones, a fan of triangles."""
    flat = np.ptp(points, axis=0).min() == 0.0
    faces = [(0, i, i + 1) for i in range(1, len(points) - 1)] if flat else ConvexHull(points).simplices
    corners = ("\n".join(f"vertex {x!r} {y!r} {z!r}" for x, y, z in points[list(face)].tolist()) for face in faces)
    return "solid it\n" + "\n".join(f"facet\nouter loop\n{text}\nendloop\nendfacet" for text in corners)


MESHES = {  # text, what is found
    "empty.stl": ("", "a file without triangles"),
    "words.stl": ("no mesh at all", "a file without triangles"),
    "torn.stl": ("vertex 1 2", "a file that is no STL"),
    "flat.stl": (stl(CUBE[:4]), "a mesh without volume"),
    "thin.stl": (stl(CUBE * [1.0, 1.0, 1e-7]), "a mesh without volume"),
    "tiny.stl": (stl(1e-150 * CUBE), "a mesh without volume"),
    "endless.stl": (stl(CUBE).replace("vertex 0.1", "vertex nan"), "a mesh with numbers that are not finite"),
    "open.stl": (stl(CUBE).rpartition("facet\nouter")[0], f"{DENTED} of volume 0.007333 m³, its convex hull 0.008 m³"),
    "dented.stl": (stl(CUBE) + "\n" + stl(0.5 * CUBE), f"{DENTED} a vertex lies 0.05 m inside its convex hull"),
    "twice.stl": (stl(CUBE) + "\n" + stl(CUBE), f"{DENTED} of volume 0.016 m³, its convex hull 0.008 m³"),
    "round.stl": (stl(ROUND), "a mesh of 266 vertices, more than 256"),
    "large.stl": (" " * 1_000_001, "a file of more than 1 MB"),
}


def faults_of(tmp_path, text):
    """The faults of a scene beside the meshes."""
    for name, (content, _) in MESHES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    (tmp_path / "folder.stl").mkdir()
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(file)
    assert str(caught.value).startswith(str(file))
    return caught.value.faults


BALL = "shape = { sphere = 0.1 }"
IN_A_PLANE = "points in a plane, or nearly, expected points of a body with volume"


def fault_of(tmp_path, shape):
    """What is said of a ball of another shape."""
    (fault,) = faults_of(tmp_path, ELASTIC.replace(BALL, f"shape = {shape}", 1))
    return str(fault).removeprefix("surfaces.ball.shape.")


@pytest.mark.parametrize("name", [*MESHES, "folder.stl"])
def test_a_mesh_that_is_no_convex_body_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.setattr(polytope, "MOST_BYTES", 1_000_000)
    found = MESHES[name][1] if name in MESHES else "no file"
    expected = f"mesh: found {name}, {found}, expected an STL file of a convex body"
    assert fault_of(tmp_path, f'{{ mesh = "{name}" }}').startswith(expected)


@pytest.mark.parametrize(
    ("points", "told"),
    [(ROUND, "of 266 entries, expected 4 to 256 points"), (CUBE * [1, 1, 1e-14], IN_A_PLANE)],
)
def test_points_that_are_no_body_are_refused(points, told, tmp_path):
    assert told in fault_of(tmp_path, f"{{ points = {points.tolist()} }}")


def test_bodies_that_fixed_joints_connect_do_not_meet():
    """Neither is an overlap of theirs, which nothing changes, a fault."""
    assert not scene_of_text(HARD.replace("0.5, 0.15]", "0.0, 0.3]") + WELDS).contacts


def test_an_overlap_of_elastic_surfaces_at_the_start_is_told():
    with pytest.warns(
        ephs.SceneWarning, match=r"contacts\.ball_floor: found ball and floor 0\.03 m deep in each other"
    ):
        scene_of_text(ELASTIC.replace("0.0, 0.15]", "0.0, 0.07]"))
