"""Rates and forces of joints on their way into the sweeps: Ad of the pose, its inverse, and equal power."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.tree.sweeps.joints import force_inside, force_outside, frame, rate_inside, rate_outside
from ephs.mechanics.tree.sweeps.pack import STANDARD
from ephs.mechanics.tree.sweeps.records import Link
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage import PLAIN

EPS = np.finfo(float).eps
BACKWARD = {"planar": 7, "spherical": 8, "free": 9}
"""Pair -> where `STANDARD` has its joint that is walked backward."""
numbers = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6).map(np.array)


def link():
    """One link whose frame is its parent's."""
    one = Link.table(1)[0]
    one.sense, one.rotation = 1.0, np.eye(3).tolist()
    return one


@pytest.mark.parametrize(("name", "place"), BACKWARD.items())
@given(numbers, numbers, numbers)
def test_a_joint_that_is_walked_backward(name, place, coordinates, r, force):
    of, joint, one = pair(name), STANDARD[place], link()
    assert joint.backward and (joint.code, joint.size) == (of.code, of.size)
    x = of.element(coordinates[: of.dim])
    r, force, pose = r[: of.dim], force[: of.dim], of.include(x)
    near = 64.0 * EPS * (1.0 + np.abs(pose[4:]).max()) ** 2 * 10.0
    rho = rate_inside(PLAIN, joint, one, x, r.tolist())
    expected = -SE3.adjoint(pose) @ (of.basis @ r)
    assert np.abs(of.basis @ np.array(rho) - expected).max() <= near
    assert np.abs(np.array(rate_outside(PLAIN, joint, one, x, rho)) - r).max() <= near
    inside = force_inside(PLAIN, joint, one, x, force.tolist())
    assert abs(np.dot(inside, rho) - force @ r) <= 10.0 * near
    assert np.abs(np.array(force_outside(PLAIN, joint, one, x, inside)) - force).max() <= near
    rotation, at = frame(PLAIN, joint, one, x)
    undone = SE3.inverse(pose)
    assert np.abs(np.array(rotation) - quaternion_to_matrix(undone[:4])).max() <= near
    assert np.abs(np.array(at) - undone[4:]).max() <= near
