"""Runs with a closed form: a finding where the error is above what is allowed, and only there; advice that helps."""

import re

import numpy as np
import pytest

import ephs
from ephs.solve.auditing.audit import COARSE, MOTION
from examples.failing import pendulum, scene, slide
from tests.methods import FIXED_OF_SCENES, OF_SCENES

RATE, SPEED, STEPS = 20.0, 3.0, 20
"""Of the motions in 1/s; at the start in m/s; in a run."""
DRIVEN = [(0.7, 11.0), (-2.0, 15.0), (6.0, 6.0)]
"""Rates in rad/s of two axes one on another."""


def driven(orbit: float, spin: float) -> ephs.Scene:
    """Two bodies on parallel axes that turn at given rates: everything is prescribed, all energies are constant."""
    return scene(
        f"""
    [assembly]
    adjust = true
    [bodies.arm]
    mass = 1.0
    inertia = [0.1, 0.1, 0.1]
    [bodies.wheel]
    mass = 2.0
    inertia = [0.3, 0.3, 0.4]
    position = [3.0, 0.0, 0.0]
    [joints.orbit]
    type = "revolute"
    bodies = ["ground", "arm"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    motion = {{ rate = {orbit} }}
    [joints.spin]
    type = "revolute"
    bodies = ["arm", "wheel"]
    at = [3.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    motion = {{ rate = {spin} }}
    """,
        "[world]\ngravity = [0.0, 0.0, 0.0]\n",
    )


def errors(sol: ephs.Solution, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """(n,) largest error of an energy, in parts of the gross energies; and of the position, in lengths."""
    t, ledgers = sol.t, sol.ledgers
    if kind == "driven":
        return np.abs(sol.kinetic - sol.kinetic[0]) / ledgers.scale, np.zeros(len(sol))
    if kind == "brake":
        x, v = SPEED / RATE * (1.0 - np.exp(-RATE * t)), SPEED * np.exp(-RATE * t)
        potential, heat = 0.0 * t, 0.5 * (SPEED**2 - v**2)
    else:
        x, v = SPEED / RATE * np.sin(RATE * t), SPEED * np.cos(RATE * t)
        potential, heat = 0.5 * RATE**2 * x**2, 0.0 * t
    held = ((sol.kinetic, 0.5 * v**2), (sol.potential, potential), (ledgers.heat, heat))
    energy = np.max([np.abs(found - found[0] - (true - true[0])) for found, true in held], axis=0) / ledgers.scale
    return energy, np.abs(sol.joint("rail").coordinate[:, 0] - x) / sol.problem.length


def models() -> dict[str, ephs.Scene]:
    return {
        "brake": slide(f"friction = {RATE}", SPEED),
        "spring": slide(f"stiffness = {RATE**2}", SPEED),
        **{f"driven {rates}": driven(*rates) for rates in DRIVEN},
    }


@pytest.mark.parametrize("kind", list(models()))
@pytest.mark.parametrize("method", FIXED_OF_SCENES)
def test_a_finding_says_an_error_and_an_error_is_found(kind, method):
    """Of steps from a hundredth of a time constant to a hundred; of prescribed motions up to half a radian."""
    kinds, rate = kind.split()[0], RATE
    if kinds == "driven":
        rate = max(abs(sum(rates)) for rates in DRIVEN if str(rates) in kind)
    judged = set()
    for size in (0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)[: 4 if kinds == "driven" else None]:
        step = size / rate
        try:
            sol = ephs.simulate(models()[kind], STEPS * step, step=step, method=method, audit="off")
        except ephs.SimulationError:
            judged.add(False)
            continue
        energy, place = errors(sol, kinds)
        for found in sol.audit.findings:
            # the balance of all energies is off by no more than the sum of what is wrong with three of them
            least = found.allowed / 3.0 if found.law == "energy" else 0.5 * min(COARSE, MOTION)
            assert max(energy.max(), place.max()) > least, (size, found)
        if max(energy[-1] / COARSE, place[-1] / MOTION) > 5.0:
            assert not sol.audit.passed, size
        judged.add(sol.audit.passed)
    assert True in judged
    assert kinds != "spring" or False in judged  # radau stops a block right at any length of steps


@pytest.mark.parametrize("method", FIXED_OF_SCENES)
def test_entropy_at_times_inside_steps_is_no_finding(method):
    """Times inside a step are ends of shorter ones from its start, and nothing goes on from there."""
    for friction, step in ((20.0, 0.05), (200.0, 0.02), (2000.0, 0.02)):
        brake, inside = pendulum(6.0, f"friction = {friction}"), np.linspace(0.0, 0.4, 83)
        laws = []
        for times in (None, inside):
            try:
                sol = ephs.simulate(brake, 0.4, method=method, step=step, save_at=times, audit="off")
            except ephs.SimulationError:
                continue
            laws.append([found.law for found in sol.audit.findings])
        assert all("entropy" not in each for each in laws), friction


STOP = "limits = [-1.0, 0.6]\nlimit_restitution = 0.5"


@pytest.mark.parametrize("method", OF_SCENES)
@pytest.mark.parametrize("more", ["friction = 20.0", "friction = 2000.0", "stiffness = 400.0", STOP])
def test_an_advice_names_another_method_that_accepts_the_model(method, more):
    for options in ({"step": 0.05}, {"rtol": 1e-2, "atol": 1e-2}):
        try:
            sol = ephs.simulate(pendulum(6.0, more), 0.5, method=method, audit="off", **options)
            advice = [found.advice for found in sol.audit.findings]
        except ephs.SimulationError as failed:
            advice = [failed.advice]
        except ephs.OptionError:
            continue
        for name in re.findall(r"or take (\w+), which", " ".join(advice)):
            assert name != method
            try:
                ephs.simulate(pendulum(6.0, more), 0.05, method=name, audit="off", **options)
            except ephs.SimulationError:
                continue
