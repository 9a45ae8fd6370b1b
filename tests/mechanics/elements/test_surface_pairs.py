"""All pairs of surfaces: what hard blows in free space keep.

Each kind of shape has one size, since gaps of meshes and cylinders take seconds to compile.
"""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.shapes.pairs import PAIRS, SIZES, touches
from ephs.operad import Path
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

CORNERS = [[-0.08, -0.06, -0.05], [0.09, -0.05, -0.05], [0.0, 0.1, -0.05], [0.0, 0.0, 0.11]]
SHAPES = {
    "sphere": 0.1, "capsule": [0.05, 0.16], "cylinder": [0.08, 0.14], "box": [0.16, 0.12, 0.2], "mesh": CORNERS
}  # fmt: skip
FAR = 0.4
"""Beyond which no two of them touch."""
FREE = list(combinations_with_replacement(SHAPES, 2))
CLOSE = [pair for pair in FREE if pair != ("cylinder", "cylinder")]
"""Pairs whose gaps are continuous: that of two cylinders may jump by a hundredth of their size, and so their start."""
ROUNDING = 4e-14
"""Of sums of some twenty terms, relative to these: 8 n ε."""
HEAD = 'format = 1\nname = "pair"\n[world]\ngravity = [0.0, 0.0, {gravity}]\n'
BODY = """
[bodies.{name}]
mass = {mass}
inertia = {inertia}
position = {position}
rotation = {rotation}
velocity = {velocity}
angular_velocity = {spin}
[surfaces.{name}]
body = "{name}"
shape = {{ {shape} }}
{law}
"""


def test_every_kind_of_shape_is_drawn():
    assert set(SHAPES) | {"plane"} == set(SIZES)
    assert {frozenset(pair) for pair in FREE} == {frozenset(pair) for pair in PAIRS if "plane" not in pair}


def unit(vector):
    return vector / np.linalg.norm(vector)


def law_of(rng):
    return f"friction = {rng.choice([0.0, 0.1, 0.4, 1.5])}\nrestitution = {rng.choice([0.0, 0.3, 0.8, 1.0])}\n"


def body_of(rng, name, kind, position, turn, velocity, spin):
    mass = float(rng.uniform(0.5, 2.0))
    key = "points" if kind == "mesh" else kind
    return BODY.format(
        name=name, mass=mass, inertia=(4e-3 * mass * np.array([1.0, 1.2, 1.4])).tolist(), position=position.tolist(),
        rotation=turn.tolist(), velocity=velocity.tolist(), spin=spin.tolist(), shape=f"{key} = {SHAPES[kind]}",
        law=law_of(rng),
    )  # fmt: skip


def distance_of(pair):
    """The smallest gap between two shapes, a function of both poses (7,)."""
    (one, other), here = ({kind: SHAPES[kind]} for kind in pair), SE3.identity()
    points, swapped = touches(one, here, other, here)
    ends = [(SE3.inverse(near), far, gap.distance) for near, far, gap in points]

    def distance(first, second):
        relative = SE3.compose(SE3.inverse(second), first) if swapped else SE3.compose(SE3.inverse(first), second)
        return min(float(gap(SE3.compose(near, SE3.compose(relative, far)))) for near, far, gap in ends)

    return distance


def colliding(rng, pair):
    """Text of two bodies that touch and approach each other without weight; both turn, and move along."""
    turns, way = [unit(rng.normal(size=4)) for _ in pair], unit(rng.normal(size=3))
    aside, distance = 0.03 * rng.normal(size=3), distance_of(pair)
    near, far = 0.0, FAR
    for _ in range(50):
        middle = 0.5 * (near + far)
        ends = [np.concatenate([turns[0], np.zeros(3)]), np.concatenate([turns[1], aside + middle * way])]
        near, far = (near, middle) if distance(*ends) > 0.0 else (middle, far)
    along, spins = rng.normal(size=3), rng.normal(size=(2, 3))
    speeds = along + 2.0 * way, along - rng.uniform(1.0, 2.0) * way
    places = np.zeros(3), aside + far * way
    bodies = zip("ab", pair, places, turns, speeds, spins, strict=True)
    return HEAD.format(gravity=0.0) + "".join(body_of(rng, *numbers) for numbers in bodies)


def scene_of(folder, rng, pair):
    file = folder.mktemp("pair") / "pair.toml"
    file.write_text(colliding(rng, pair), encoding="utf-8")
    return ephs.load(file)


def lawful(sol):
    """Both laws, in every step."""
    assert np.abs(sol.energy_error).max() <= 1e-11
    assert sol.stats["least_production"] >= 0.0
    assert np.all(np.diff(sol.heat) >= 0.0)


def carried(scene, state):
    """Linear and angular momentum (6,) of all bodies about the origin at a state, and the sum of the terms' sizes."""
    total, size = np.zeros(6), 0.0
    for name, _ in scene.all_bodies():
        pose, own = (state[Path.of(f"bodies.{name}.{part}")] for part in ("pe.q", "ke.p"))
        turn = quaternion_to_matrix(pose[:4])
        spin, linear = turn @ own[:3], turn @ own[3:]
        total += np.concatenate([linear, spin + np.cross(pose[4:], linear)])
        size += np.abs(spin).sum() + (1.0 + np.abs(pose[4:]).sum()) * np.abs(linear).sum()
    return total, size


@pytest.mark.parametrize("pair", CLOSE, ids="-".join)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**20))
def test_a_hard_blow_in_free_space_keeps_all_momenta(pair, seed, tmp_path_factory):
    """Impulses act on both bodies at one point; the flight before it is too short to add an error of its own."""
    scene = scene_of(tmp_path_factory, np.random.default_rng(seed), pair)
    sol = ephs.simulate(scene, 2.0**-20, method="rk54", step=2.0**-20, audit="off")
    first = sol.events[0]
    assert first.name.endswith("strikes")
    (before, size), (after, _) = carried(scene, sol.state_at(0)), carried(scene, first.state)
    assert np.abs(after - before).max() <= ROUNDING * size
    lawful(sol)
