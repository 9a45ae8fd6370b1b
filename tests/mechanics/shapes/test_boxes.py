"""Boxes that meet boxes and capsules: distances against bounded least squares, and boxes that rest on boxes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import ephs
from ephs.mechanics.shapes.pairs import ROUNDED, touches
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.numerics import largest
from tests.written import scene_of_text

UNIT = np.array([1.0, 0.0, 0.0, 0.0])
LENGTH = st.floats(0.1, 1.0)
SHAPES = st.one_of(
    st.tuples(LENGTH, LENGTH, LENGTH).map(lambda sizes: {"box": list(sizes)}),
    st.tuples(LENGTH, LENGTH).map(lambda sizes: {"capsule": list(sizes)}),
)
SOME = st.floats(-1.0, 1.0)
G = 9.81
BOX = """
[bodies.{name}]
mass = 1.0
inertia = {inertia}
position = {at}
[surfaces.{name}]
body = "{name}"
shape = {{ box = {sizes} }}
{law}
"""
HEAD = 'format = 1\nname = "boxes"\n[world]\ngravity = [0.0, 0.0, -9.81]\n[surfaces.floor]\nbody = "ground"\n'
SOFT = "stiffness = 1e5\nloss = 0.5\nfriction = 0.5\n"
HARD = "restitution = 0.0\nfriction = 0.5\n"


def core(shape):
    """Half lengths of what is rounded, and the radius."""
    if "capsule" in shape:
        radius, length = shape["capsule"]
        return np.array([0.0, 0.0, length / 2.0]), radius
    radius = ROUNDED * min(shape["box"])
    return np.array(shape["box"]) / 2.0 - radius, radius


def distance(shape1, shape2, pose):
    """Between the first shape and the second one at a pose (7,): least squares over points of both cores."""
    (half1, radius1), (half2, radius2) = core(shape1), core(shape2)
    most = np.concatenate([half1, half2])
    free = most > 0.0
    whole = np.hstack([np.eye(3), -quaternion_to_matrix(pose[:4])])[:, free]
    found = lsq_linear(whole, pose[4:], (-most[free], most[free]), tol=1e-15, max_iter=500)
    return float(np.linalg.norm(whole @ found.x - pose[4:])) - radius1 - radius2


def beyond(shape1, shape2, far):
    """By how much the least gap may be larger than the distance, where cores are so far apart.

    Edges of two boxes cross at ends that are left to corners, of half a radius each: a third of a radius aside of a
    corner, or of the edges' ends, where both are as far.
    """
    if "capsule" in shape1 or "capsule" in shape2:
        return 0.0
    return float(np.hypot(far, max(core(shape)[1] for shape in (shape1, shape2)) / 3.0)) - far


@settings(max_examples=150, deadline=None)
@given(SHAPES, SHAPES, st.tuples(*[SOME] * 4), st.tuples(*[SOME] * 3))
def test_the_least_gap_is_the_distance(shape1, shape2, turn, place):
    turn = np.array(turn)
    turn = turn / np.linalg.norm(turn) if np.linalg.norm(turn) > 0.1 else UNIT
    pose = np.concatenate([turn, 2.0 * np.array(place)])
    expected = distance(shape1, shape2, pose)
    if expected < -0.9 * (core(shape1)[1] + core(shape2)[1]):
        return  # cores overlap, or nearly
    identity = SE3.identity()
    points, swapped = touches(shape1, identity, shape2, identity)
    relative = SE3.inverse(pose) if swapped else pose
    least, normal = np.inf, None
    for one, two, gap in points:
        here = SE3.compose(SE3.inverse(one), SE3.compose(relative, two))
        found = float(gap.distance(here))
        if found < least:
            least, (normal, _) = found, gap.contact(here)
    far = expected + core(shape1)[1] + core(shape2)[1]
    assert expected - 2e-6 <= least <= expected + beyond(shape1, shape2, far) + 2e-6
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)


def scene_of(law, *boxes, pairs=()):
    parts = [HEAD, "shape = { plane = {} }\n", law]
    for name, at, sizes in boxes:
        x, y, z = (size**2 for size in sizes)
        inertia = [(y + z) / 12.0, (x + z) / 12.0, (x + y) / 12.0]
        parts.append(BOX.format(name=name, at=list(at), sizes=list(sizes), inertia=inertia, law=law))
    parts += [f'[contacts.{one}_{other}]\nsurfaces = ["{one}", "{other}"]\n' for one, other in pairs]
    return scene_of_text("".join(parts))


@pytest.mark.parametrize(
    ("lower", "upper", "at"),
    [
        ([0.2, 0.2, 0.2], [0.2, 0.2, 0.2], [0.0, 0.0, 0.3]),
        ([0.2, 0.2, 0.2], [0.2, 0.2, 0.2], [0.05, 0.03, 0.3]),
        ([0.6, 0.1, 0.2], [0.1, 0.6, 0.1], [0.0, 0.0, 0.25]),
    ],
    ids=["equal", "aside", "across"],
)
def test_a_hard_box_rests_on_a_box(lower, upper, at):
    """By corners, or across by edges alone: it does not move at all, and presses with its weight."""
    scene = scene_of(HARD, ("a", [0.0, 0.0, 0.1], lower), ("b", at, upper))
    sol = ephs.simulate(scene, 2.0**-5, method="rk54", step=2.0**-5, save_at=[2.0**-5], audit="off")
    assert sol.body("b").position[-1] == pytest.approx(at, abs=1e-12)
    assert sol.contact("a_b").force[-1] == pytest.approx([0.0, 0.0, G], abs=1e-6)
    assert np.abs(sol.contact("floor_a").force[-1]) == pytest.approx([0.0, 0.0, 2.0 * G], abs=1e-6)


def test_a_box_beyond_the_edge_tips_over():
    scene = scene_of(HARD, ("a", [0.0, 0.0, 0.1], [0.2] * 3), ("b", [0.11, 0.0, 0.3], [0.2] * 3))
    sol = ephs.simulate(scene, 0.1, method="rk54", step=2.0**-7, audit="off")
    assert sol.body("b").angular_velocity[-1, 1] > 0.1
    assert largest(sol.energy_error) <= 1e-11


def test_a_stack_of_ten_elastic_boxes_stands():
    """It sinks by less than four times what four points would give way, and does not turn or move aside."""
    names = [f"b{i}" for i in range(10)]
    boxes = [(name, [0.0, 0.0, 0.1 + 0.2 * i], [0.2] * 3) for i, name in enumerate(names)]
    pairs = list(zip(["floor", *names], names, strict=False))
    scene = scene_of(SOFT, *boxes, pairs=pairs)
    sol = ephs.simulate(scene, 0.1, method="radau", rtol=1e-3, atol=1e-6, save_at=np.linspace(0.0, 0.1, 11))
    assert largest(sol.energy_error) <= 1e-11
    assert sol.stats["least_production"] >= 0.0
    sunk = 0.0
    for i, name in enumerate(names):
        sunk += (10 - i) * G / (4.0 * 1e5)
        motion = sol.body(name)
        assert largest(motion.position[:, :2]) <= 1e-6
        assert largest(motion.quaternion[:, 1:]) <= 1e-6
        assert np.all(motion.position[:, 2] <= 0.1 + 0.2 * i + 1e-9)
        assert np.all(motion.position[:, 2] >= 0.1 + 0.2 * i - 4.0 * sunk)
