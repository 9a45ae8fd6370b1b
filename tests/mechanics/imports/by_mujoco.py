"""What MuJoCo computes of a model, and whether an imported scene accelerates alike."""

import mujoco
import numpy as np

import ephs
from tests.numerics import largest

__all__ = ["assert_accelerates_alike", "compiled", "forward"]


def compiled(source):
    """MuJoCo's model of a file or a text."""
    read = mujoco.MjModel.from_xml_string if isinstance(source, str) else mujoco.MjModel.from_xml_path
    return read(str(source))


def forward(model, places=(), rates=(), controls=()):
    """MuJoCo's data where the first coordinates, rates and controls are these, and others are the model's."""
    data = mujoco.MjData(model)
    for field, given in ((data.qpos, places), (data.qvel, rates), (data.ctrl, controls)):
        field[: len(given)] = given
    mujoco.mj_forward(model, data)
    return data


def assert_accelerates_alike(model, scene, rates, places=(), within=1e-10, **controls):
    """Of the first joints, with one freedom each, relative to the largest; controls by actuator, in MuJoCo's order."""
    expected = forward(model, places, rates, list(controls.values())).qacc[: len(rates)]
    dynamics = ephs.dynamics(scene, inputs={f"actuators.{name}": value for name, value in controls.items()})
    names = list(scene.joints)[: len(rates)]  # in the order of the file, as MuJoCo's
    state = dynamics.state(*(dict(zip(names, given, strict=False)) for given in (places, rates)))
    accelerations = dynamics.acceleration(state)
    found = np.concatenate([accelerations[name] for name in names])
    assert largest(found - expected) <= within * max(1.0, largest(expected))
