"""Meshes and cylinders against all shapes: distances by convex optimisation, meshes that are boxes, bodies at rest."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

import ephs
from ephs.mechanics.shapes.gap import UPRIGHT
from ephs.mechanics.shapes.hull import inside_of
from ephs.mechanics.shapes.pairs import PAIRS, ROUNDED, touches
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.numerics import largest, seeds

SHAPES = ("plane", "sphere", "capsule", "cylinder", "box", "mesh")
NEW = [pair for pair in PAIRS if {"mesh", "cylinder"} & set(pair) and "plane" not in pair]
BOUND = 1e-6
"""Of what is regularised along a segment, and of the rounding of iterations, beside what is said of rims."""


ALIGNED = np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]])
"""Rotations by which axes are parallel or at right angles; poses are near these, or any."""


def core(shape, sharp):
    """Support function of what is rounded, its size, and the radius."""
    (kind, sizes), radius = next(iter(shape.items())), 0.0
    if kind == "cylinder":
        radius = 0.0 if sharp else ROUNDED * min(2.0 * sizes[0], sizes[1])
        size, half = sizes[0] - radius, 0.5 * sizes[1] - radius

        def support(way):
            return np.array([*(size * way[:2] / max(np.hypot(*way[:2]), 1e-300)), half * np.sign(way[2])])

        return support, max(size, half), radius
    if kind == "sphere":
        corners, radius = np.zeros((1, 3)), sizes
    elif kind == "capsule":
        corners, radius = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * sizes[1], sizes[0]
    else:
        corners = np.array(
            sizes if kind == "mesh" else list(np.ndindex(2, 2, 2)) * np.array(sizes) - np.array(sizes) / 2
        )
        if not sharp:
            hull, radius = inside_of(corners.tolist(), 2.0 * ROUNDED)
            corners = hull.corners
    return (lambda way: corners[np.argmax(corners @ way)]), float(largest(corners)), radius


def distance(one, other, pose):
    """Distance of two convex bodies by their support functions: the shortest vector of their difference (Wolfe)."""
    turn, weight = quaternion_to_matrix(pose[:4]), 1e3

    def support(way):
        return turn @ other(turn.T @ way) + pose[4:] - one(-way)

    points = [support(-pose[4:])]
    for _ in range(300):
        rows = np.vstack([np.array(points).T, weight * np.ones(len(points))])
        shares, _ = nnls(rows, np.array([0.0, 0.0, 0.0, weight]))
        points = [p for p, share in zip(points, shares, strict=True) if share > 0.0]
        found = rows[:3] @ shares / shares.sum()
        size = float(np.linalg.norm(found))
        further = support(-found)
        if size < BOUND or size - further @ found / size < 1e-10:
            break
        points.append(further)
    return size


def drawn(rng, kind):
    if kind == "mesh":
        return {"mesh": (0.4 * rng.normal(size=(6, 3))).tolist()}
    sizes = rng.uniform(0.1, 1.0, {"sphere": (), "capsule": 2, "cylinder": 2, "box": 3}[kind])
    return {kind: sizes.tolist()}


@pytest.mark.parametrize("pair", NEW, ids="-".join)
@given(seed=seeds)
@settings(max_examples=12, deadline=None)
def test_the_least_gap_is_the_distance(pair, seed):
    """At poses where cores are about as far apart as their radii, and sides, caps and faces often nearly parallel."""
    rng = np.random.default_rng(seed)
    shapes = [drawn(rng, kind) for kind in pair]
    (one, size1, radius1), (other, size2, radius2) = (core(shape, "sphere" in pair) for shape in shapes)
    way, turn, wanted = rng.normal(size=3), ALIGNED[seed % 3].copy(), (radius1 + radius2) * rng.uniform(0.2, 1.5)
    turn += 10.0 ** rng.uniform(-6.0, 1.0) * rng.normal(size=4)
    low, high = 0.0, 5.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        pose = np.concatenate([turn / np.linalg.norm(turn), middle * way / np.linalg.norm(way)])
        low, high = (middle, high) if distance(one, other, pose) < wanted else (low, middle)
    expected = distance(one, other, pose) - radius1 - radius2
    points, swapped = touches(shapes[0], SE3.identity(), shapes[1], SE3.identity())
    relative = SE3.inverse(pose) if swapped else pose
    found = []
    for here, there, gap in points:
        at = SE3.compose(SE3.inverse(here), SE3.compose(relative, there))
        found.append((float(gap.distance(at)), float(np.linalg.norm(gap.contact(at)[0]))))
    rounded, size = radius1 + radius2, max(size1, size2)
    flat = UPRIGHT * size * max(1.0, 0.5 * rounded / wanted)  # of a rim; of an edge, whose square is added
    above = BOUND + (flat if "cylinder" in pair else rounded / 36.0)
    least, length = min(found)
    assert expected - BOUND <= least <= expected + above
    assert length == pytest.approx(1.0, abs=1e-9)


def test_all_solids_meet_each_other_and_the_plane():
    pairs = {frozenset(pair) for pair in PAIRS}
    assert pairs == {frozenset(pair) for pair in combinations_with_replacement(SHAPES, 2)} - {frozenset(["plane"])}
    assert len(pairs) == len(PAIRS)


def cube(sizes):
    points = np.array(sizes) * (np.array(list(np.ndindex(2, 2, 2))) - 0.5)
    return points[ConvexHull(points).simplices]


def test_what_is_inside_of_a_box_is_a_box():
    hull, depth = inside_of(cube([1.0, 0.4, 2.0]).reshape(-1, 3).tolist(), 2.0 * ROUNDED)
    assert depth == pytest.approx(ROUNDED * 0.4, rel=1e-12)
    assert largest(hull.corners, axis=0) == pytest.approx([0.5 - depth, 0.2 - depth, 1.0 - depth], rel=1e-12)
    assert (len(hull.corners), len(hull.edges), len(hull.faces)) == (8, 12, 6)


SCENE = """
format = 1
name = "solids"
[world]
gravity = [0.0, 0.0, -9.81]
[surfaces.low]
body = "ground"
shape = {{ {low} }}
stiffness = 1e5
loss = 20.0
friction = 0.5
[bodies.up]
mass = 1.0
inertia = [7e-3, 7e-3, 7e-3]
position = {at}
{more}
[surfaces.up]
body = "up"
shape = {{ {up} }}
stiffness = 1e5
loss = 20.0
friction = 0.5
"""
BOX, CYLINDER, MESH = "box = [0.2, 0.2, 0.2]", "cylinder = [0.1, 0.2]", 'mesh = "cube.stl"'


def fallen(tmp_path, low, up, at, more="", until=0.05):
    facets = "".join(
        "facet\nouter loop\n" + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle) + "endloop\nendfacet\n"
        for triangle in cube([0.2, 0.2, 0.2]).tolist()
    )
    (tmp_path / "cube.stl").write_text(f"solid cube\n{facets}endsolid cube\n", encoding="utf-8")
    file = tmp_path / "solids.toml"
    file.write_text(SCENE.format(low=low, up=up, at=at, more=more), encoding="utf-8")
    return ephs.simulate(ephs.load(file), until, method="radau", rtol=1e-5, save_at=[0.0, until], audit="off")


@pytest.mark.parametrize(
    ("low", "up"), [(CYLINDER, BOX), (BOX, CYLINDER), (MESH, CYLINDER)], ids=["box", "cylinder", "on a mesh"]
)
def test_what_stands_stays(low, up, tmp_path):
    """It sinks by what its points give way, and its energy is where it belongs."""
    sol = fallen(tmp_path, low, up, [0.02, 0.01, 0.2])
    up = sol.body("up")
    assert up.position[-1] == pytest.approx([0.02, 0.01, 0.2], abs=2e-4)
    assert largest(up.quaternion[-1, 1:]) <= 2e-3
    assert largest(sol.energy_error) <= 1e-11
    assert sol.stats["least_production"] >= 0.0
