"""Gears, belts and differentials of scene files."""

from dataclasses import replace

import numpy as np
import pytest

import ephs
from tests.numerics import largest
from tests.written import scene_of_text

MASS, TURNING, RATIO, LOSS, GRAVITY = 5.0, 0.02, 10.0, 0.05, 9.81
HOIST = f"""
format = 1
name = "hoist"
[bodies.drum]
mass = 2.0
inertia = [0.01, 0.01, {TURNING}]
[bodies.load]
mass = {MASS}
inertia = [0.01, 0.01, 0.01]
position = [0.1, 0.0, -1.0]
[joints.shaft]
type = "revolute"
bodies = ["ground", "drum"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "load"]
at = [0.1, 0.0, -1.0]
axis = [0.0, 0.0, 1.0]
[gears.rope]
joints = ["shaft", "rail"]
ratio = {RATIO}
friction = {LOSS}
heat = "bearing"
[thermal.bearing]
capacity = 10.0
temperature = 300.0
"""


@pytest.fixture
def hoist():
    return scene_of_text(HOIST)


def falling(t):
    """The load's rate: m r̈ = −m g − g² (J r̈ + d ṙ), g the ratio."""
    inertia, loss = MASS + RATIO**2 * 0.01, RATIO**2 * LOSS
    return -MASS * GRAVITY / loss * (1.0 - np.exp(-loss / inertia * t))


@pytest.mark.parametrize("method", ["rk87", "radau"])
def test_a_rope_on_a_drum_lets_a_load_down(hoist, method):
    sol = ephs.simulate(hoist, 0.4, method=method, rtol=1e-11, atol=1e-12)
    assert sol.stats["form"] == "reduced"
    assert np.isclose(sol.joint("rail").rate[-1, 0], falling(0.4), rtol=1e-9)
    assert largest(sol.joint("shaft").rate - RATIO * sol.joint("rail").rate) <= 1e-12
    assert np.isclose(sol["thermal.bearing.s"][-1], 10.0 * np.log1p(sol.heat[-1] / 3000.0), rtol=1e-9)
    assert sol.energy_error.max() < 1e-11


def test_its_force_is_in_the_wrench_of_the_joint(hoist):
    sol = ephs.simulate(hoist, 0.4, method="rk87", rtol=1e-11, atol=1e-12)
    rate = sol.joint("rail").rate[:, 0]
    slowing = (-MASS * GRAVITY - RATIO**2 * LOSS * rate) / (MASS + RATIO**2 * 0.01)
    assert np.allclose(sol.joint("rail").wrench[:, 5], MASS * (slowing + GRAVITY), rtol=1e-8)


def test_a_stiff_belt_moves_as_a_gear_does(hoist):
    """What it stretches by falls as one over its stiffness, once its damping has ended the ringing."""
    ends = []
    for stiffness in (0.0, 1e3, 1e5):
        belt = hoist.gears["rope"].changed(stiffness=stiffness, damping=10.0)
        sol = ephs.simulate(replace(hoist, gears={"rope": belt}), 0.4, method="radau", rtol=1e-9)
        assert sol.energy_error.max() < 1e-11
        ends.append(sol.joint("rail").rate[-1, 0])
    assert np.isclose((ends[1] - ends[0]) / (ends[2] - ends[0]), 1e5 / 1e3, rtol=1e-2)


def test_a_differential_divides_its_rate():
    text = HOIST.replace(
        'joints = ["shaft", "rail"]\nratio = 10.0', 'joints = ["shaft", "rail", "other"]\nratio = [5.0, 5.0]'
    )
    text += """
[bodies.mass]
mass = 5.0
inertia = [0.01, 0.01, 0.01]
position = [0.2, 0.0, -1.0]
[joints.other]
type = "prismatic"
bodies = ["ground", "mass"]
at = [0.2, 0.0, -1.0]
axis = [0.0, 0.0, 1.0]
"""
    sol = ephs.simulate(scene_of_text(text), 0.2, method="rk87")
    one, two, drum = (sol.joint(name).rate[:, 0] for name in ("rail", "other", "shaft"))
    assert largest(drum - 5.0 * (one + two)) <= 1e-12
    assert np.allclose(one, two, rtol=1e-12, atol=1e-12)
