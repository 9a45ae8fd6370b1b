"""Every URDF of example-robot-data that Pinocchio loads: the same mass, freedoms and accelerations."""

import numpy as np
import pinocchio as pin
import pytest

import ephs
from tests.mechanics.imports.pinocchio_robots import accelerations, compare, frictionless, random_state, robot
from tests_real.robots import found, named

pytestmark = pytest.mark.filterwarnings("ignore::ephs.ModelWarning", "ignore::ephs.SceneWarning")

ROBOTS = found(".urdf")
EMPTY = {"ur3.urdf"}  # neither links nor a name
UNDETERMINED = {"romeo.urdf", "romeo_laas_small.urdf"}  # fingers that move no mass: Pinocchio divides by zero


def test_the_robots_are_there():
    assert len(ROBOTS) > 60


@pytest.mark.parametrize("path", [path for path in ROBOTS if path.name not in EMPTY], ids=named)
@pytest.mark.parametrize("base", ["fixed", "free"])
def test_pinocchio_has_the_same_robot(path, base):
    scene, model = ephs.load(path, base=base), robot(path, base)
    assert sum(joint.dim for joint in scene.joints.values()) == model.nv
    if base == "free":
        mass = pin.computeTotalMass(model)
        assert abs(sum(body.mass for body in scene.bodies.values()) - mass) <= 1e-9 * mass
    rng = np.random.default_rng(7)
    if path.name in UNDETERMINED:
        dynamics = ephs.dynamics(frictionless(scene))
        *state, q, v = random_state(scene, model, rng)
        assert not all(np.isfinite(a).all() for a in accelerations(scene, model, q, v)[0].values())
        with pytest.raises(ephs.SimulationError, match="not determined"):
            dynamics.acceleration(dynamics.state(*state))
    elif model.nv:
        assert compare(scene, model, rng) <= 1e-9


def test_an_empty_robot_is_refused():
    for path in (path for path in ROBOTS if path.name in EMPTY):
        with pytest.raises(ephs.SceneError, match="at least one link"):
            ephs.load(path)
