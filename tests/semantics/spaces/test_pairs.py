"""Lower pairs are subgroups of SE(3); every entry of the registry is held to it."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.spaces import PAIRS, SE2, SE3, PairEntry, SpaceError, codes, manifold, pair, register_pair
from tests.numerics import EPS, generators, largest
from tests.processes import printed
from tests.semantics.spaces.test_groups import same_point
from tests.semantics.spaces.test_spaces import Space

FREEDOMS = {
    "revolute": 1,
    "prismatic": 1,
    "screw": 1,
    "cylindrical": 2,
    "planar": 3,
    "spherical": 3,
    "fixed": 0,
    "free": 6,
}
kinds = pytest.mark.parametrize("kind", PAIRS)


def of_kind(kind, value=0.3):
    return pair(kind, **dict.fromkeys(PAIRS[kind].parameters, value))


same_pose = partial(same_point, SE3)


def test_what_is_known():
    assert {kind: of_kind(kind).dim for kind in PAIRS} == FREEDOMS


@kinds
@given(rng=generators, pitch=st.floats(-2.0, 2.0))
def test_subgroup_closure(kind, rng, pitch):
    """I(x·exp v) = I(x)·exp(B v): the inclusion is a homomorphism, and retractions agree with it."""
    joint = of_kind(kind, pitch)
    group = joint.manifold
    x, y, v = group.random(rng), group.random(rng), rng.standard_normal(joint.dim)
    scale = 10.0 * (1.0 + np.abs(x).sum()) * (1.0 + np.abs(y).sum() + np.abs(v).sum())
    assert same_pose(joint.include(group.retract(x, v)), SE3.retract(joint.include(x), joint.basis @ v), scale)
    product = SE3.compose(joint.include(x), joint.include(y))
    assert same_pose(joint.include(group.compose(x, y)), product, scale)
    assert same_pose(joint.include(group.inverse(x)), SE3.inverse(joint.include(x)), scale)
    assert same_pose(joint.include(group.identity()), SE3.identity(), 0.0)


@kinds
@given(rng=generators)
def test_basis_is_an_embedding_of_the_lie_algebra(kind, rng):
    joint = of_kind(kind)
    b, group = joint.basis, joint.manifold
    x, u, w = group.random(rng), rng.standard_normal(joint.dim), rng.standard_normal(joint.dim)
    assert b.shape == (6, joint.dim)
    assert not b.flags.writeable
    assert joint.dim == 0 or np.linalg.matrix_rank(b) == joint.dim
    size = 64 * EPS * (1 + np.abs(u).sum()) * (1 + np.abs(w).sum()) * (1 + np.abs(x).sum())
    assert largest(b @ group.ad(u) @ w - SE3.ad(b @ u) @ b @ w, initial=0.0) <= size
    assert largest(b @ group.adjoint(x) @ u - SE3.adjoint(joint.include(x)) @ b @ u, initial=0.0) <= size
    assert largest(b @ group.dexp(u) - SE3.dexp(b @ u) @ b, initial=0.0) <= 10 * size


@kinds
@given(rng=generators)
def test_coordinates_and_elements(kind, rng):
    joint = of_kind(kind)
    x = joint.manifold.random(rng)
    coordinates = joint.coordinates(x)
    assert coordinates.shape == (joint.dim,)
    size = 100.0 * (1.0 + np.abs(x).sum())
    assert same_pose(joint.include(joint.element(coordinates)), joint.include(x), size)
    again = joint.coordinates(joint.element(coordinates))
    assert largest(again - coordinates, initial=0.0) <= 64 * EPS * size


@pytest.mark.parametrize("kind", ["revolute", "screw", "cylindrical", "planar"])
@given(angle=st.floats(-1e3, 1e3))
def test_single_angles_are_not_wrapped(kind, angle):
    joint = of_kind(kind)
    x = joint.manifold.retract(joint.manifold.identity(), np.eye(joint.dim)[0] * angle)
    assert joint.coordinates(x)[0] == angle


def test_where_coordinates_lie():
    """The pose of the second frame in the first, in the order that scene files use."""
    half = np.array([np.cos(0.2), 0.0, 0.0, np.sin(0.2)])

    def pose(kind, *coordinates):
        joint = of_kind(kind, 0.5)
        return joint.include(joint.element(np.array(coordinates)))

    for found, rotation, position in (
        (pose("revolute", 0.4), half, (0, 0, 0)),
        (pose("prismatic", 0.4), (1, 0, 0, 0), (0, 0, 0.4)),
        (pose("screw", 0.4), half, (0, 0, 0.2)),
        (pose("cylindrical", 0.4, 3.0), half, (0, 0, 3)),
        (pose("planar", 0.4, 3.0, 5.0), half, (3, 5, 0)),
        (pose("spherical", 0.0, 0.0, 0.4), half, (0, 0, 0)),
        (pose("free", 0.0, 0.0, 0.4, 3.0, 5.0, 7.0), half, (3, 5, 7)),
        (pose("fixed"), (1, 0, 0, 0), (0, 0, 0)),
    ):
        assert largest(found - np.concatenate((rotation, position))) <= 4 * EPS


def test_pairs_are_values():
    assert pair("screw", pitch=0.1) == pair("screw", pitch=0.1)
    assert pair("screw", pitch=0.1) != pair("screw", pitch=0.2)
    assert len({pair("planar"), pair("planar"), pair("free")}) == 2


@kinds
def test_a_space_names_a_pair(kind):
    joint = of_kind(kind)
    from_space = type(joint).from_space(Space(kind, joint.dim, joint.size, joint.parameters))
    assert from_space == joint
    assert np.array_equal(from_space.basis, joint.basis)
    assert manifold(Space(kind, joint.dim, joint.size, joint.parameters)) == joint.manifold
    assert manifold(Space(kind + "*", joint.dim, joint.dim, joint.parameters)).code == codes.VECTOR


def test_a_new_pair_is_one_entry():
    """Translations of the plane: registered like the shipped ones, and a space at once."""
    name = "translations of the plane"
    register_pair(PairEntry(name, "ℝ²", lambda: np.eye(6)[:, 3:5]))
    joint = pair(name)
    try:
        assert joint.dim == 2
        assert np.array_equal(joint.include(np.array([3.0, 5.0])), [1, 0, 0, 0, 3, 5, 0])
        assert manifold(Space(name, 2, 2)) == joint.manifold
    finally:
        forget(name)


def test_a_basis_of_the_wrong_shape_is_refused():
    name = "planar of four columns"
    register_pair(PairEntry(name, "?", lambda: np.eye(6)[:, :4], SE2))
    try:
        with pytest.raises(SpaceError, match=r"\(6, 4\).*\(6, 3\)"):
            pair(name)
    finally:
        forget(name)


def forget(name):
    """Take a pair out again, so that the registry's tests see the shipped ones only."""
    from ephs.operad.quantities import _PAIRS
    from ephs.semantics.spaces.manifold import _FACTORIES
    from ephs.semantics.spaces.pairs import _ENTRIES

    del _ENTRIES[name], _FACTORIES[name], _PAIRS[name]


OWN_PAIR = """
import math, tempfile
from pathlib import Path
import numpy as np
import ephs
from ephs.semantics.spaces import PairEntry, register_pair

register_pair(PairEntry("table", "ℝ²", lambda: np.eye(6)[:, [3, 4]]))
register_pair(PairEntry("ramp", "ℝ", lambda slope: np.array([[0, 0, 0, 1, 0, slope]]).T, parameters=("slope",)))
assert ephs.quantity.relative_pose("ramp", slope=0.5).space.dim == 1
file = Path(tempfile.mkdtemp()) / "puck.toml"
file.write_text('''
format = 1
[bodies.puck]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
velocity = [1.0, 0.5, 0.0]
[joints.top]
type = "table"
bodies = ["ground", "puck"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
friction = 0.2
''')
sol = ephs.simulate(ephs.load(file), 1.0, method="natural4", step=0.02)
way = (1.0 - math.exp(-0.2)) / 0.2
assert np.abs(sol.joint("top").coordinate[-1] - way * np.array([1.0, 0.5])).max() < 1e-9
assert sol.energy_error.max() < 1e-13
"""


def test_a_pair_of_ones_own_makes_joints_and_scenes():
    # In a process of its own: a pair that is known stays known.
    printed(OWN_PAIR)
