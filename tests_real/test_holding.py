"""Shipped robots hold a pose by their own drives: sampled PD control of the actuators, 10 s under gravity."""

import numpy as np
import pytest

import ephs
from tests_real.robots import found

pytestmark = pytest.mark.filterwarnings("ignore::ephs.ModelWarning", "ignore::ephs.SceneWarning")

GAINS = {"hyq_no_sensors.urdf": (800.0, 20.0)}
"""Stiffness in N m/rad and damping in N m s/rad."""


@pytest.mark.parametrize("name", GAINS)
def test_a_robot_holds_a_pose_by_its_actuators(name):
    (path,) = (path for path in found(".urdf") if path.name == name)
    scene, (stiffness, damping) = ephs.load(path), GAINS[name]
    drives = {f"actuators.{key}": each for key, each in scene.actuators.items()}
    wanted = {each.joints[0]: float(scene.joint(each.joints[0]).coordinate[0]) for each in drives.values()}
    assert len(wanted) == sum(joint.dim for joint in scene.joints.values())

    def hold(t, state):
        out = []
        for each in drives.values():
            joint = state.joints[each.joints[0]]
            force = stiffness * (wanted[each.joints[0]] - joint.coordinate[0]) - damping * joint.rate[0]
            out.append(force / each.ratio[0])
        return out

    sol = ephs.simulate(scene, 10.0, inputs={tuple(drives): ephs.Sampled(0.002, hold)}, save_at=[0.0, 5.0, 10.0])
    ends = np.array([sol.joint(joint).coordinate[:, 0] for joint in wanted])
    assert np.abs(ends[:, 2] - ends[:, 1]).max() < 1e-3
    assert np.abs(ends[:, 2] - ends[:, 0]).max() < 0.1
    assert sol.energy_error.max() < 1e-11
    assert sol.work[-1] != 0.0
