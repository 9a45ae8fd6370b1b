"""Convex meshes as surfaces: what an STL file says, what is refused, and a cube that is the box to rounding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import ephs
from ephs.mechanics.scene.polytope import MOST_VERTICES, largest_hull, vertices_of
from tests.numerics import seeds

SCENE = """
format = 1
name = "mesh"
[bodies.block]
mass = 2.0
inertia = [0.01, 0.02, 0.03]
position = [0.0, 0.0, 0.27]
velocity = [1.0, 0.5, 0.0]
angular_velocity = [1.0, 2.0, 3.0]
[surfaces.block]
body = "block"
shape = {{ {shape} }}
{law}
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
{law}
"""
OPTIONS = {"elastic": {"method": "rk87", "rtol": 1e-7}, "hard": {"method": "rk54", "step": 2.0**-7}}
LAWS = {"elastic": "stiffness = 1e5\nloss = 0.2\nfriction = 0.5", "hard": "restitution = 0.5\nfriction = 0.5"}
EPS = float(np.finfo(float).eps)
SIZES = np.array([0.25, 0.125, 0.5])


def cube():
    """(12, 3, 3) triangles of a box, outwards."""
    points = SIZES * np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    hull = ConvexHull(points)
    return points[hull.simplices]


def prism(count, low, high):
    """(2 count, 3) corners of a regular prism about z, on a circle of radius 1."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.concatenate([np.stack([np.cos(angle), np.sin(angle), 0.0 * angle + z], axis=1) for z in (low, high)])


def text_stl(triangles):
    corners = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle.tolist())
        + "endloop\nendfacet\n"
        for triangle in triangles
    )
    return f"solid made\n{corners}endsolid made\n".encode()


def binary_stl(triangles):
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    out = np.zeros(len(triangles), record)
    out["corners"] = triangles
    return b"\0" * 80 + len(triangles).to_bytes(4, "little") + out.tobytes()


WRITERS = {"text": text_stl, "binary": binary_stl}


def scene_of(tmp_path, shape, law="elastic"):
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.format(shape=shape, law=LAWS[law]), encoding="utf-8")
    return ephs.load(file)


@pytest.mark.parametrize("kind", WRITERS)
def test_each_vertex_is_read_once(kind, tmp_path):
    file = tmp_path / "cube.stl"
    file.write_bytes(WRITERS[kind](cube()))
    found = vertices_of(file)
    assert sorted(found.tolist()) == sorted(np.unique(cube().reshape(-1, 3), axis=0).tolist())


@pytest.mark.parametrize("law", LAWS)
def test_a_mesh_of_a_box_moves_as_the_box(law, tmp_path):
    (tmp_path / "cube.stl").write_bytes(binary_stl(cube()))
    runs = [
        ephs.simulate(scene_of(tmp_path, shape, law), 0.08, save_at=[0.04, 0.08], audit="off", **OPTIONS[law])
        for shape in (f"box = {SIZES.tolist()}", 'mesh = "cube.stl"')
    ]
    one, other = (sol.body("block").position for sol in runs)
    assert other == pytest.approx(one, abs=1e-8)
    assert runs[1].heat[-1] == pytest.approx(runs[0].heat[-1], abs=1e-8)
    assert runs[0].heat[-1] > 1e-3


def test_points_are_the_corners_of_a_mesh(tmp_path):
    (tmp_path / "cube.stl").write_bytes(binary_stl(cube()))
    inner = [*np.unique(cube().reshape(-1, 3), axis=0).tolist(), [0.0, 0.01, 0.02]]
    mesh, points = (
        scene_of(tmp_path, shape).surfaces["block"].shape for shape in ('mesh = "cube.stl"', f"points = {inner}")
    )
    assert points == mesh


def test_the_largest_hull_says_how_far_points_are_outside():
    """Corners of a prism on a circle: a chord over k steps of angle h leaves the sagitta 1 − cos(k h / 2) outside."""
    count = 2 * MOST_VERTICES
    corners, depth = largest_hull(prism(count, -1.0, 1.0))
    assert len(corners) == MOST_VERTICES
    steps = np.arccos(1.0 - depth) / (np.pi / count)
    assert steps == pytest.approx(round(steps), abs=1e-6) and 4 <= round(steps) <= 8
    assert largest_hull(corners)[1] == 0.0


@given(count=st.integers(4, 300), way=seeds, share=st.sampled_from([0.0, 0.01, 0.1]))
def test_a_coarse_hull_leaves_no_point_farther_outside_than_it_says(count, way, share):
    points = np.random.default_rng(way).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]  # all are corners
    corners, depth = largest_hull(points, 32, share)
    faces = ConvexHull(corners).equations
    outside = float((faces[:, :3] @ points.T + faces[:, 3:]).max(initial=0.0))
    assert outside == pytest.approx(depth, abs=8 * count * EPS)
    if count <= 32:
        assert len(corners) == count
    else:
        assert 32 <= len(corners) <= MOST_VERTICES
        assert depth <= share * np.ptp(points, axis=0).max() or len(corners) == MOST_VERTICES or share == 0.0


@pytest.mark.parametrize("other", ["plane = {}", "sphere = 1.0"])
def test_a_mesh_with_many_faces_meets_planes_alone(other, tmp_path):
    shape = f"shape = {{ points = {prism(64, 2.0, 3.0).tolist()} }}"
    file = tmp_path / "scene.toml"
    file.write_text(
        'format = 1\nname = "prism"\n[bodies.b]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\n[joints.j]\ntype = "free"\n'
        f'bodies = ["ground", "b"]\nframe1 = {{}}\nframe2 = {{}}\n[surfaces.b]\nbody = "b"\n{shape}\nstiffness = 1e4\n'
        f'[surfaces.g]\nbody = "ground"\nshape = {{ {other} }}\n',
        encoding="utf-8",
    )
    if "plane" in other:
        assert len(ephs.load(file).contacts) == 1
    else:
        with pytest.raises(
            ephs.SceneError, match=r"contacts\..*: found b with 258 faces and edges or more, expected at"
        ):
            ephs.load(file)


@pytest.mark.parametrize("first", ["", 'group = "it"'])
@pytest.mark.parametrize("second", ["", 'group = "it"'])
def test_surfaces_of_a_group_do_not_meet_each_other(first, second, tmp_path):
    """A free joint to the ground does not keep a surface from meeting it."""
    text = SCENE.format(shape="sphere = 0.1", law="stiffness = 1e5").replace(
        'body = "ground"', f'body = "ground"\n{first}'
    )
    text = text.replace("shape = { sphere", f"{second}\nshape = {{ sphere")
    text += (
        '[joints.root]\ntype = "free"\nbodies = ["ground", "block"]\nat = [0.0, 0.0, 0.27]\naxis = [0.0, 0.0, 1.0]\n'
    )
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    assert len(ephs.load(tmp_path / "scene.toml").contacts) == (0 if first and second else 1)


def test_a_scene_with_a_mesh_is_read_as_it_was_written(tmp_path):
    (tmp_path / "cube.stl").write_bytes(binary_stl(cube()))
    scene = scene_of(tmp_path, 'mesh = "cube.stl"')
    ephs.simulate(scene, 0.01, method="rk54", audit="off").save(tmp_path / "kept")
    assert ephs.load_solution(tmp_path / "kept").scene.surfaces["block"].shape == scene.surfaces["block"].shape
