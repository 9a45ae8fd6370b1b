"""The Cassie robots, SDF with closed loops: they stay closed while they move."""

import numpy as np
import pytest

import ephs
from tests_real.robots import found, named

pytestmark = pytest.mark.filterwarnings("ignore::ephs.ModelWarning", "ignore::ephs.SceneWarning")

ROBOTS = found(".sdf")
HIPS = {"left-roll-op": 1.0, "left-pitch-op": -2.0, "right-yaw-op": 1.5, "right-knee-op": 1.0}


@pytest.mark.parametrize("path", ROBOTS, ids=named)
def test_loops_are_closed_at_the_start(path):
    scene = ephs.load(path)
    dynamics = ephs.dynamics(scene)
    assert np.abs(dynamics.constraints(dynamics.state0).gaps).max(initial=0.0) < 1e-12


def test_cassie_moves_for_two_seconds_with_its_loops_closed():
    (path,) = (path for path in ROBOTS if path.name == "cassie_v2.sdf")
    scene = ephs.load(path).with_state(rates=HIPS, adjust=True)
    sol = ephs.simulate(scene, 2.0)
    assert sol.t[-1] == 2.0
    assert np.abs(sol.constraint_error).max() < 1e-10
    assert max(np.ptp(sol.joint(name).coordinate) for name in HIPS) > 0.1
    assert sol.energy_error.max() < 1e-6
    assert sol.stats["cut_joints"]
    mass = sum(body.mass for body in scene.bodies.values())
    centre = sum(body.mass * sol.body(name).position for name, body in scene.bodies.items()) / mass
    speed = sum(body.mass * sol.body(name).velocity[0] for name, body in scene.bodies.items()) / mass
    fall = centre[0] + speed * sol.t[:, None] + 0.5 * np.array([0, 0, -9.81]) * sol.t[:, None] ** 2
    assert np.abs(centre - fall).max() < 1e-6
