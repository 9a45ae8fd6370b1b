"""MuJoCo computes the same accelerations, of the robots that gymnasium ships and of a model with all joint types."""

from importlib.util import find_spec
from pathlib import Path as File

import mujoco
import numpy as np
import pytest

import ephs
from tests.mechanics.dynamics.mujoco_scenes import accelerations, random_state, scene_of, stripped

MODELS = sorted((File(find_spec("gymnasium").submodule_search_locations[0]) / "envs/mujoco/assets").glob("*.xml"))
ALL_JOINTS = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body pos="0 0 1" quat="0.9 0.1 0.3 0.2">
      <freejoint/>
      <inertial pos="0.1 0.2 0.05" quat="0.8 0.2 0.1 0.5" mass="2" diaginertia="0.3 0.2 0.25"/>
      <body pos="0.3 0 0.1" euler="0.3 0.2 0.1">
        <joint type="ball" pos="0.1 0 0"/>
        <inertial pos="0.1 0 0.3" mass="1" diaginertia="0.1 0.2 0.15"/>
        <body pos="0 0.4 0">
          <joint type="hinge" axis="1 2 0.5" pos="0 0.1 0" ref="0.2"/>
          <joint type="slide" axis="0 1 1"/>
          <inertial pos="0 0 0.2" mass="0.7" diaginertia="0.1 0.1 0.15"/>
          <body pos="0.1 0.1 0.1"><inertial pos="0 0 0" mass="0.4" diaginertia="0.01 0.02 0.015"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(autouse=True)
def without_a_log_file():
    """Files of older versions make MuJoCo warn, into the working folder."""
    mujoco.set_mju_user_warning(lambda text: None)
    yield
    mujoco.set_mju_user_warning(None)


@pytest.mark.parametrize("source", [*MODELS, ALL_JOINTS], ids=lambda s: s.stem if isinstance(s, File) else "all-joints")
def test_mujoco_accelerates_alike(source):
    is_file = isinstance(source, File)
    load = mujoco.MjModel.from_xml_path if is_file else mujoco.MjModel.from_xml_string
    model = stripped(load(str(source)))
    data = mujoco.MjData(model)
    scene = scene_of(model)
    dynamics = ephs.dynamics(scene)
    rng = np.random.default_rng(3)
    for _ in range(5):
        coordinates, rates, data.qpos[:], data.qvel[:] = random_state(model, rng)
        mujoco.mj_forward(model, data)
        state = dynamics.state(coordinates, rates)
        found, expected = dynamics.acceleration(state), accelerations(model, data)
        condition = np.linalg.cond(dynamics.mass_matrix(state))
        largest = max(np.abs(a).max() for a in expected.values())
        weight = model.body_mass.sum() * np.linalg.norm(model.opt.gravity)  # what may cancel, at arms of about 1 m
        scale = max(largest, weight, np.abs(dynamics.bias(state)).max()) * np.finfo(float).eps * condition
        for name, a in expected.items():
            assert np.abs(found[name] - a).max() <= 10.0 * scale + 1e-11 * largest, name
        for b in range(1, model.nbody):
            assert np.allclose(dynamics.bodies(state)[f"b{b}"].position, data.xipos[b], atol=1e-12)
