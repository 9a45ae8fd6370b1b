"""Joints that are walked backward: frames, twists of their rates, rates of twists, by the poses of their elements."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.road.pack import STANDARD
from ephs.mechanics.road.records import LinkConstants, LinkState, Tree
from ephs.mechanics.road.tree import axes_of, moved_by, outward, rates_of
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix
from ephs.semantics.stage import PLAIN, Vector
from ephs.semantics.stage.memory import ArrayReals
from tests.numerics import EPS, largest

BACKWARD = {"planar": 7, "spherical": 8, "free": 9}
"""Pair -> where `STANDARD` has its joint that is walked backward."""
numbers = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6).map(np.array)


class Only:
    """The constants of one link on the ground, at a pose there."""

    def __init__(self, pose):
        self.link = LinkConstants.table(1)[0]
        self.link.sense, self.link.parent, self.link.kind = 1.0, 1, 0
        self.link.rotation, self.link.place = quaternion_to_matrix(pose[:4]).tolist(), pose[4:].tolist()
        self.link.mass, self.link.inertia = 1.0, [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]

    def of(self, i, kind):
        return self.link


@pytest.mark.parametrize(("name", "place"), BACKWARD.items())
@given(numbers, numbers, numbers)
def test_a_joint_that_is_walked_backward(name, place, coordinates, r, way):
    of, joint = pair(name), STANDARD[place]
    assert joint.backward and (joint.code, joint.size) == (of.code, of.size)
    there, x, r = SE3.exp(way), of.element(coordinates[: of.dim]), r[: of.dim]
    only, states = Only(there), LinkState.table(2)
    tree = Tree((joint,), 1, only, states, [0.0, 0.0, 0.0], planar=False)
    outward(PLAIN, tree, Vector(ArrayReals(x), 0, x.size), Vector(ArrayReals(r), 0, r.size))
    state, ground = states[0], states[1]
    pose = SE3.compose(there, SE3.inverse(of.include(x)))
    near = 64.0 * EPS * (1.0 + largest(pose[4:])) ** 2 * 10.0
    turn = quaternion_to_matrix(pose[:4])
    assert largest(np.array(state.turn) - turn) <= near and largest(np.array(state.at) - pose[4:]) <= near
    # The link has the joint's first frame, in whose own axes it moves by -Ad B r; here in those of the world.
    own = -SE3.adjoint(of.include(x)) @ (of.basis @ r)
    expected = np.concatenate([turn @ own[:3], turn @ own[3:]])
    for found in (state.twist, moved_by(joint, only.link, state, r.tolist())):
        assert largest(np.array(found) - expected) <= near * (1.0 + largest(r))
    axes = np.array(axes_of(joint, only.link, state))
    assert largest(r @ axes - expected) <= near * (1.0 + largest(r))
    back = rates_of(joint, only.link, state, ground, expected.tolist())
    assert largest(np.array(back) - r) <= near * (1.0 + largest(r))
    assert np.abs(matrix_to_quaternion(turn) @ pose[:4]) >= 1.0 - near
