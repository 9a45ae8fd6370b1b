"""Which ports joints have, and the bounds inside which their kernels answer."""

import numpy as np
import pytest

from ephs.mechanics.elements import joints
from ephs.semantics.derive.holonomic import half_turn

BOTH = {"p1", "p2"}
WITH = {(False, False): set(), (True, False): {"s"}, (False, True): {"p_r"}, (True, True): {"s", "p_r"}}


@pytest.mark.parametrize(("heat", "driven"), WITH)
def test_a_joint_has_the_ports_that_are_asked_for(heat, driven):
    made = joints.joint("revolute", friction=0.1, heat=heat, driven=driven)
    assert {str(path) for path in made.interface} == BOTH | WITH[heat, driven]


def test_without_being_asked_joints_keep_heat_and_torque_to_themselves():
    for made in (joints.joint("revolute"), joints.universal_joint(None, None, None)):
        assert {str(path) for path in made.interface} == BOTH


@pytest.mark.parametrize(("heat", "driven"), WITH)
def test_a_universal_joint_has_a_torque_for_each_angle(heat, driven):
    made = joints.universal_joint(None, None, None, 0.1, heat=heat, driven=driven)
    expected = BOTH | ({"s"} if heat else set()) | ({"p_r1", "p_r2"} if driven else set())
    assert {str(path) for path in made.interface} == expected


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", range(3))
def test_half_a_turn_is_too_far_about_any_axis_and_no_way_is(axis, sign):
    along = np.full(6, 100.0)
    along[:3] = 0.0
    assert not half_turn(along)
    along[axis] = sign * 3.1415
    assert not half_turn(along)
    along[axis] = sign * 3.1416
    assert half_turn(along)
    along[:3] = 1.82
    assert half_turn(along)
