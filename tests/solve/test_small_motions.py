"""Motions that are small beside what is stored, and none at all: rounding of the states is what remains, no error."""

import math

import numpy as np
import pytest

import ephs
from examples.failing import scene, truss

EPS = float(np.finfo(float).eps)
METHODS = {
    "natural": 0.01, "natural4": 0.01, "variational": 0.01, "alpha": 0.01, "radau": 0.01, "rk54": 0.01, "rk87": 0.01,
    "auto": None,
}  # fmt: skip
MASS, SPIN, AWAY, HEIGHT, GRAVITY = 2.0, 0.02, 0.1, 0.3, 9.81


def screw(pitch):
    """A nut on an upright screw, its centre 0.1 m off the axis and 0.3 m up."""
    return scene(
        f"""
        [bodies.nut]
        mass = {MASS}
        inertia = [0.01, 0.01, {SPIN}]
        position = [{AWAY}, 0.0, {HEIGHT}]
        [joints.screw]
        type = "screw"
        bodies = ["ground", "nut"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        pitch = {pitch!r}
        """,
        f"[world]\ngravity = [0.0, 0.0, {-GRAVITY}]\n",
    )


@pytest.mark.parametrize("pitch", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("method", METHODS)
def test_a_fine_screw_falls_as_its_one_equation_says(method, pitch):
    """(J + m a² + m p²) α = −m g p. Its energies are known to the rounding of m g z, not of what it fell."""
    step = {"step": METHODS[method]} if METHODS[method] else {}
    sol = ephs.simulate(screw(pitch), 1.0, method=method, **step)
    exact = -MASS * GRAVITY * pitch / (SPIN + MASS * (AWAY**2 + pitch**2))
    rate, angle = sol.joint("screw").rate[:, 0], sol.joint("screw").coordinate[:, 0]
    assert np.abs(rate - exact * sol.t).max() <= 1e-9 * abs(exact)
    assert np.abs(angle - 0.5 * exact * sol.t**2).max() <= 1e-9 * abs(exact)
    stored = MASS * GRAVITY * HEIGHT
    moved = 0.5 * (SPIN + MASS * (AWAY**2 + pitch**2)) * exact**2
    bound = 10.0 * math.sqrt(sol.stats["steps"]) * 10.0 * EPS * (stored + moved)
    assert sol.energy_error.max() * moved <= bound


def hanging():
    """A rod that hangs from a pin, 1 m above the origin."""
    return scene(
        """
        [bodies.rod]
        mass = 1.0
        inertia = [0.1, 0.1, 0.01]
        position = [0.0, 0.0, 0.5]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "rod"]
        at = [0.0, 0.0, 1.0]
        axis = [0.0, 1.0, 0.0]
        """
    )


@pytest.mark.parametrize("method", METHODS)
def test_what_is_at_rest_stays_there(method):
    """A rod in equilibrium, whose weight is balanced to 8 n ε of n = 10 terms, and two bars in line without a load."""
    step = {"step": METHODS[method]} if METHODS[method] else {}
    for model, body, weight in ((hanging(), "rod", GRAVITY), (truss(0.0), "left", 0.0)):
        sol = ephs.simulate(model, 1.0, method=method, **step)
        moved = np.abs(sol.body(body).position - sol.body(body).position[0]).max()
        bound = 8.0 * 10.0 * EPS * (1.0 + weight)
        assert moved <= bound and np.abs(sol.body(body).angular_velocity).max() <= bound
        assert not sol.audit.findings
