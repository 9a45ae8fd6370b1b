"""MuJoCo computes the same accelerations, of the robots that gymnasium ships and of a model with all joint types."""

from importlib.util import find_spec
from pathlib import Path as File

import mujoco
import numpy as np
import pytest

import ephs
from ephs.mechanics.imports.mjcf_names import MjcfNames
from tests.mechanics.dynamics.mujoco_scenes import accelerations, random_state, stripped

MODELS = sorted((File(find_spec("gymnasium").submodule_search_locations[0]) / "envs/mujoco/assets").glob("*.xml"))
ALL_JOINTS = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="1 2 -9"/>
  <worldbody>
    <body pos="0 0 1" quat="0.9 0.1 0.3 0.2">
      <joint type="free" damping="0.2" stiffness="1.5"/>
      <inertial pos="0.1 0.2 0.05" quat="0.8 0.2 0.1 0.5" mass="2" diaginertia="0.3 0.2 0.25"/>
      <body pos="0.3 0 0.1" euler="0.3 0.2 0.1">
        <joint type="ball" pos="0.1 0 0" damping="0.1" stiffness="2"/>
        <inertial pos="0.1 0 0.3" mass="1" fullinertia="0.1 0.2 0.15 0.01 0.02 -0.01"/>
        <body pos="0 0.4 0">
          <joint type="hinge" axis="1 2 0.5" pos="0 0.1 0" ref="0.2" springref="0.5" stiffness="3" damping="0.1"/>
          <joint type="slide" axis="0 1 1" springref="-0.1" stiffness="30" damping="0.3"/>
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


@pytest.mark.filterwarnings("ignore::ephs.ModelWarning", "ignore:.*deprecated:DeprecationWarning")
@pytest.mark.parametrize("source", [*MODELS, ALL_JOINTS], ids=lambda s: s.stem if isinstance(s, File) else "all-joints")
def test_mujoco_accelerates_alike(source, tmp_path):
    file = source if isinstance(source, File) else tmp_path / "all-joints.xml"
    if file is not source:
        file.write_text(source)
    model = stripped(mujoco.MjModel.from_xml_path(str(file)))
    data = mujoco.MjData(model)
    scene = ephs.load(file)
    dynamics = ephs.dynamics(scene)
    names = MjcfNames(model)
    assert sum(joint.dim for _, joint in scene.all_joints()) == model.nv
    mass = sum(body.mass for _, body in scene.all_bodies())
    assert abs(mass - model.body_mass.sum()) <= 1e-14 * mass * model.nbody
    rng = np.random.default_rng(3)
    for _ in range(20):
        coordinates, rates, data.qpos[:], data.qvel[:] = random_state(model, rng)
        mujoco.mj_forward(model, data)
        state = dynamics.state(coordinates, rates)
        found, expected = dynamics.acceleration(state), accelerations(model, data)
        largest = max(np.abs(a).max() for a in expected.values())
        for name, a in expected.items():
            assert np.abs(found[name] - a).max() <= 1e-9 * largest, name
        bodies = dynamics.bodies(state)
        for b in range(1, model.nbody):
            assert np.allclose(bodies[names.bodies[b]].position, data.xipos[b], atol=1e-12)
            turn = bodies[names.bodies[b]].pose[:4]
            assert abs(abs(turn @ data.xquat[b]) - 1.0) <= 1e-12
