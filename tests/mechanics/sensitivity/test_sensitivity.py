"""Sensitivities are the derivatives of the computed motion: as extrapolated differences of whole runs say."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.sensitivity.readings import reading_of
from tests.mechanics.ball import BALL
from tests.numerics import largest, slope
from tests.oscillator import damped_oscillator
from tests.scenes import shipped
from tests.written import scene_of_text

GOOD = 1e-8
"""What extrapolated differences of runs are good for, relative to the largest; 1e-7 is asked for."""


def reading(solution, name):
    return reading_of(solution.scene or solution.system, name)(solution)


WOUND = """
format = 1
[bodies.arm]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.3, 0.0, 0.0]
[joints.pin]
type = "screw"
pitch = 0.1
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[motors.m]
joint = "pin"
constant = 0.2
resistance = 1.25
voltage = 1.3
"""
"""A motor without inductance: its current follows from a balance."""


HARD = BALL.replace("stiffness = 1e5\nloss = 0.2", "restitution = 0.5").replace("slip = {slip}\n", "").format()


@dataclass(frozen=True)
class Case:
    """Paths of a model, what is read of its motion, and how it is run; differences over a part of the numbers."""

    model: Callable[[], ephs.Scene]
    paths: str
    names: str
    until: float
    options: dict[str, Any]
    compared: dict[str, Any] | None = None
    tolerance: float = 1e-7
    part: float = 1e-2
    extrapolated: int = 2


FOUR_BAR = Case(
    lambda: shipped("four-bar"),
    "bodies.coupler.mass bodies.rocker.inertia[2] joints.main.friction joints.main.drive "
    "joints.knee.frame1.position[0] joints.main.coordinate world.gravity[1]",
    "joints.main.coordinate joints.knee.rate bodies.coupler.position heat work kinetic",
    0.16, {"method": "rk54", "step": 0.02}, tolerance=GOOD,
)  # fmt: skip
NATURAL = {"method": "natural", "step": 0.01}
DRIVEN = {"joints.pin": lambda t, _: [np.sin(9.0 * t)], "actuators.u": lambda t, _: [np.cos(7.0 * t)]}
EXACT = {"rtol": 1e-12, "atol": 1e-13}
CHAIN = Case(
    lambda: shipped("chain"),
    "bodies.rod1.mass joints.j0.coordinate joints.j2.frame2.position[1] joints.j1.rate",
    "joints.j3.coordinate joints.j0.rate bodies.rod3.velocity energy",
    0.5, EXACT | {"save_at": np.linspace(0.0, 0.5, 4)},
    {"method": "rk87", "save_at": np.linspace(0.0, 0.5, 4)} | EXACT,
)  # fmt: skip
MOTOR = Case(
    lambda: scene_of_text(WOUND),
    "motors.m.resistance motors.m.constant motors.m.voltage bodies.arm.mass",
    "joints.pin.coordinate heat",
    0.1, {"method": "rk87", "step": 0.02}, tolerance=GOOD,
)  # fmt: skip
THROWN = Case(
    lambda: scene_of_text(BALL.format(slip=2e-2).replace("1e5", "1e4").replace("0.3]", "0.12]")),
    "contacts.ball_floor.stiffness contacts.ball_floor.loss contacts.ball_floor.friction bodies.ball.mass",
    "bodies.ball.position bodies.ball.velocity",
    0.12, {"method": "rk54", "step": 2e-4}, tolerance=1e-5, part=1e-4, extrapolated=0,
)  # fmt: skip
DIFFERENCED = {
    "a loop, rk54": FOUR_BAR,
    "a loop, rk87": replace(FOUR_BAR, options={"method": "rk87", "step": 0.04}),
    "a loop, natural": replace(
        FOUR_BAR, paths="bodies.coupler.mass joints.main.friction joints.main.drive joints.main.coordinate", until=0.05,
        names="joints.main.coordinate joints.main.rate heat work potential", options=NATURAL, tolerance=1e-7,
    ),
    "heat, natural": Case(
        lambda: shipped("slider-crank"),
        "bodies.rod.mass joints.bearing.friction thermal.housing.capacity joints.bearing.rate",
        "joints.bearing.coordinate joints.bearing.rate heat work potential thermal.housing.temperature", 0.05, NATURAL,
    ),
    "chosen steps are held": CHAIN,
    "on a group": Case(
        lambda: shipped("heavy-top"),
        "bodies.top.inertia[0] bodies.top.mass joints.tip.rate[1]",
        "bodies.top.quaternion bodies.top.angular_velocity joints.tip.coordinate", 0.02,
        {"method": "rk87", "step": 2e-3},
    ),
    "a rest of zero, whose spring is another relation": replace(
        CHAIN, model=lambda: varied(shipped("chain"), {"joints.j0.stiffness": 5.0}), paths="joints.j0.rest",
        names="joints.j0.rate", until=0.2, options={"method": "rk54", "step": 0.02}, compared=None, tolerance=GOOD,
    ),
    "efforts that balances determine, rk87": MOTOR,
    "efforts that balances determine, natural": replace(MOTOR, options={"method": "natural", "step": 0.02}),
    "through a contact": THROWN,
    "what acts on inputs of time, at each stage": Case(
        lambda: scene_of_text(WOUND + '\n[actuators.u]\njoints = ["pin"]\nratio = 1.5\n'),
        "joints.pin.drive actuators.u.ratio[0]",
        "joints.pin.coordinate heat work", 0.2, {"method": "rk87", "step": 0.02, "inputs": DRIVEN}, tolerance=GOOD,
    ),
}  # fmt: skip


SHORT = ("a rest", "efforts", "through", "what acts")


def check_derivatives(case):
    """Compare with differences of whole runs: of the same steps, or of ones good to rounding."""
    model, names = case.model(), case.names.split()
    found = ephs.sensitivity(model, case.paths.split(), case.until, **case.options)
    got = {name: found[name] for name in names}
    for number, path in enumerate(case.paths.split()):
        value = read(model, path)

        def at(by, path=path, value=value):
            run = case.compared or case.options
            motion = ephs.simulate(varied(model, {path: value + by}, strict=False), case.until, audit="off", **run)
            return np.concatenate([reading(motion, name).ravel() for name in names])

        expected = slope(at, case.part * (abs(value) if abs(value) > 1e-9 else 1.0), case.extrapolated)
        for name in names:
            mine, expected = got[name][..., number].ravel(), np.atleast_1d(expected)
            theirs, expected = expected[: mine.size], expected[mine.size :]
            own = largest(reading(found.solution, name)) / max(abs(value), 1.0)
            assert largest(mine - theirs) < case.tolerance * max(largest(theirs), 1e-3 * own), (path, name)


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.long] * (not name.startswith(SHORT))) for name in DIFFERENCED]
)
def test_derivatives_are_differences_of_whole_runs(case):
    """Those of chosen steps are of the motion itself."""
    check_derivatives(DIFFERENCED[case])


def test_systems_by_components_and_initial_values():
    """The natural method on a linear system is the midpoint rule: its derivative by a complex step, to rounding."""
    paths = ["osc.pe.k", "mf.d", "osc.ke.m", "osc.pe.q"]
    found = ephs.sensitivity(damped_oscillator(), paths, 1.0, step=0.05, initial={"osc.pe.q": 1.0})

    def motion(k, d, m, q):
        a = np.array([[0.0, 1.0 / m], [-k, -d / m]])
        one = np.linalg.solve(np.eye(2) - 0.025 * a, np.eye(2) + 0.025 * a)
        states = [np.array([q, 0.0])]
        for _ in range(20):
            states.append(one @ states[-1])
        return np.array(states)

    at = np.array([1.5, 0.1, 2.0, 1.0])
    for i, unit in enumerate(np.eye(4)):
        expected = motion(*(at + 1e-40j * unit)).imag / 1e-40
        assert largest(found["osc.pe.q"][:, i] - expected[:, 0]) < 1e-12 * largest(expected)
        assert largest(found["osc.ke.p"][:, i] - expected[:, 1]) < 1e-12 * largest(expected)


def test_anything_read_from_a_solution_has_a_derivative():
    """A mean, the end, an integral of heat: by the chain rule, what their parts say."""
    found = ephs.sensitivity(damped_oscillator(), ["osc.pe.k", "mf.d"], 1.0, step=0.05, initial={"osc.pe.q": 1.0})
    q, dq = found.solution["osc.pe.q"], found["osc.pe.q"]
    assert found.of(lambda sol: sol["osc.pe.q"][-1] ** 2) == pytest.approx(2.0 * q[-1] * dq[-1], rel=1e-9)
    whole = found.of(lambda sol: np.trapezoid(sol["osc.pe.q"], sol.t))
    assert whole == pytest.approx(np.trapezoid(dq, found.t, axis=0), rel=1e-9)
    assert found["energy"] == pytest.approx(found["kinetic"] + found["potential"] + found["heat"], abs=1e-10)


def test_a_friction_of_zero_has_a_derivative_from_above():
    scene = shipped("chain")
    found = ephs.sensitivity(scene, ["joints.j0.friction"], 0.2, method="rk87", step=0.05)
    values = [
        ephs.simulate(varied(scene, {"joints.j0.friction": mu}), 0.2, method="rk87", step=0.05).joint("j0").rate[-1, 0]
        for mu in (0.0, 1e-3, 2e-3, 3e-3, 4e-3)
    ]
    expected = np.dot([-25.0, 48.0, -36.0, 16.0, -3.0], values) / 12e-3
    assert found["joints.j0.rate"][-1, 0, 0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("method", ["rk54", "natural"])
def test_numbers_that_are_in_equations_and_in_no_table_are_refused(method):
    """The pitch is in the code of the joint."""
    with pytest.raises(ephs.OptionError, match=r"joints.pin.pitch.*leaves equations as they are"):
        ephs.sensitivity(scene_of_text(WOUND), ["joints.pin.pitch"], 0.1, method=method, step=0.02)


SIMPLER = {
    "a product less": ["motors.m.resistance"],
    "parts less": ["joints.pin.friction", "joints.pin.stiffness"],
    "all at once": ["joints.pin.friction", "motors.m.resistance", "bodies.arm.mass"],
}


@pytest.mark.parametrize("method", ["rk54", "natural"])
@pytest.mark.parametrize("name", SIMPLER)
def test_numbers_by_which_equations_are_shorter_have_the_derivatives_of_those_beside_them(method, name):
    """Zeros and ones, several at once and beside others: each as differences of runs by it alone."""
    paths, scene = SIMPLER[name], scene_of_text(WOUND.replace("1.25", "1.0"))
    run = {"method": method, "step": 0.02}
    found = ephs.sensitivity(scene, paths, 0.1, **run)["joints.pin.rate"][-1, 0]
    for path, slope_of in zip(paths, found, strict=True):
        value, h = read(scene, path), 1e-3
        at = (0.0, 1.0, 2.0, 3.0, 4.0) if not value else (-2.0, -1.0, 1.0, 2.0)
        weights = np.array([-25.0, 48.0, -36.0, 16.0, -3.0] if not value else [1.0, -8.0, 8.0, -1.0]) / (12.0 * h)
        ways = [ephs.simulate(varied(scene, {path: value + k * h}), 0.1, **run) for k in at]
        expected = weights @ [way.joint("pin").rate[-1, 0] for way in ways]
        assert slope_of == pytest.approx(expected, rel=1e-7), path


def test_what_steps_made_is_not_known_of_a_motion_along_a_tangent():
    """The least production of entropy in a step has no derivative."""
    found = ephs.sensitivity(scene_of_text(WOUND), ["motors.m.resistance"], 0.1, method="rk54", step=0.02)
    assert np.isnan(found["entropy_production"]).all() and np.isnan(found.solution.entropy_production).all()
    assert np.isfinite(found["heat"]).all()


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        ({"method": "radau"}, "rk54, rk87, natural"),
        ({"method": "natural"}, "a number of seconds"),
        ({"parameters": []}, "one path or several"),
        ({"parameters": "bodies.crank.mass"}, "one path or several"),
        ({"save_at": [0.2, 0.1]}, "ascending"),
        ({"save_at": []}, "at least one time"),
        ({"save_at": [0.05], "until": -0.1}, r"times in \[-0.1, 0.0\]"),
        ({"save_at": [-0.1, -0.05], "until": -0.1}, "descending"),
        ({"model": scene_of_text(HARD), "method": "rk54"}, "impulses"),
    ],
)
def test_what_cannot_be_is_named(keys, what):
    given = {"model": shipped("four-bar"), "parameters": ["bodies.crank.mass"], "until": 0.1} | keys
    with pytest.raises(ephs.OptionError, match=what):
        ephs.sensitivity(**given)


SLIDER = """
format = 1
name = "slider"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.a]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "a"]
frame1 = {}
frame2 = {}
stiffness = 8.0
coordinate = 0.3
rate = -0.2
"""


@pytest.mark.parametrize("until", [1.5, -1.5])
def test_derivatives_at_times_between_steps_are_those_of_the_closed_form_either_way(until):
    """q = q₀ cos ω τ + (v₀/ω) sin ω τ with ω = 2, by q₀ and v₀, at times after a start that is not zero."""
    t0, parts = 4.0, np.array([0.0, 0.13, 0.5, 0.77, 1.0])
    paths, times = ["joints.rail.coordinate", "joints.rail.rate"], t0 + until * parts
    found = ephs.sensitivity(scene_of_text(SLIDER), paths, t0 + until, t0=t0, save_at=times, rtol=1e-12, atol=1e-13)
    assert found.t.tolist() == times.tolist()
    turn = 2.0 * (times - t0)
    wanted = np.stack([np.cos(turn), np.sin(turn) / 2.0], axis=-1)
    assert largest(found["joints.rail.coordinate"][:, 0] - wanted) < 1e-9


def test_unknown_readings_name_the_nearest():
    found = ephs.sensitivity(damped_oscillator(), ["osc.pe.k"], 0.1, step=0.05)
    with pytest.raises(ephs.OptionError, match="did you mean"):
        found["osc.pe.x"]
    with pytest.raises(ephs.SceneError, match="did you mean"):
        ephs.sensitivity(shipped("four-bar"), ["bodies.crnk.mass"], 0.1)


GEARED = """
format = 1
[bodies.arm]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.3, 0.0, 0.0]
[bodies.wheel]
mass = 0.5
inertia = [0.02, 0.02, 0.02]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.axle]
type = "revolute"
bodies = ["ground", "wheel"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[gears.g]
joints = ["pin", "axle"]
ratio = 0.5
"""


BOTH = pytest.mark.parametrize(
    "derived",
    [
        lambda scene, path, **run: ephs.sensitivity(scene, [path], 0.1, method="rk87", **run),
        lambda scene, path, **run: ephs.gradient(scene, [path], [0.1], {"joints.pin.rate": [1.0]}, **run),
    ],
    ids=["sensitivity", "gradient"],
)


@BOTH
def test_both_modes_refuse_the_same_by_the_same_words(derived):
    """A rigid gear becomes no belt, a start that contradicts its joints fails, motions are no functions."""
    moved = GEARED.partition("[gears")[0] + "motion = { polynomial = [0.0, 0.1] }\n"
    with pytest.raises(ephs.OptionError, match=r"gears.g.stiffness.*structure"):
        derived(scene_of_text(GEARED), "gears.g.stiffness")
    assert derived(scene_of_text(GEARED.replace("ratio = 0.5", "ratio = 0.5\nstiffness = 2.0")), "gears.g.stiffness")
    with pytest.raises(ephs.SimulationError, match=r"t = 0 s.*contradicts the constraints"):
        derived(scene_of_text(WOUND), "bodies.arm.velocity[0]")
    with pytest.raises(ephs.OptionError, match=r"motion.*constant rates"):
        derived(scene_of_text(moved), "bodies.wheel.mass")
    with pytest.raises(ephs.AssemblyError, match="neither a number"):
        derived(scene_of_text(WOUND).system(), "joints.pin.drive")


STOPPED = """
format = 1
[bodies.rod]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
limits = [-1.0, 0.3]
limit_stiffness = 80.0
limit_loss = 0.2
"""


@pytest.mark.parametrize("path", ["bodies.rod.mass", "bodies.rod.inertia[1]", "joints.pin.friction"])
def test_energies_balance_by_every_number_where_a_stop_begins(path, monkeypatch):
    """The balance holds for all numbers, so its derivative does not change, as steps that straddle a kink say it does.

    Rounding, 1e-12 of a joule, over a thousandth of 2⁻⁷ rad, and the curvature of the stop over as much.
    """
    found = ephs.sensitivity(scene_of_text(STOPPED), [path], 0.5, method="rk87", step=2e-3)

    def change():
        balance = found.of(lambda sol: sol.energy - sol.work)[:, 0]
        return largest(balance - balance[0])

    assert np.any(np.abs(found.solution.joint("pin").coordinate[:, 0] - 0.3) < 1e-3)
    assert change() < 1e-6
    monkeypatch.setattr(sys.modules[ephs.sensitivity.__module__], "FINE", 1.0)
    assert change() > 1e-5
