"""The heat of friction is that of friction alone where gases give heat to what is around them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs.operad import Path
from tests.written import scene_of_text

PISTON = """
    format = 1
    name = "piston"
    [bodies.b]
    mass = 1.0
    inertia = [0.01, 0.01, 0.01]
    [joints.rail]
    type = "prismatic"
    bodies = ["ground", "b"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    friction = 2.0
    [gas_springs.gas]
    joint = "rail"
    area = 4e-4
    volume = 3e-4
    pressure = 3e5
    conductance = 2.0
    """
HOT = '\nheat = "wall"\n[thermal.wall]\ncapacity = 5.0\ntemperature = 300.0\n'
BEAM = """
    format = 1
    name = "beam"
    [beams.rod]
    from = [0.0, 0.0, 0.0]
    to = [1.0, 0.0, 0.0]
    elements = 2
    section = { circle = 0.02, E = 2e6, nu = 0.3, rho = 1000.0 }
    ends = ["ground"]
    damping = 0.01
    thermal = { capacity = 20.0, conduction = 0.1, temperature = 300.0, expansion = 1e-4 }
    """


DAMPING, AREA, VOLUME, PRESSURE, CONDUCTANCE, AROUND = 2.0, 4e-4, 3e-4, 3e5, 2.0, 293.15
METHODS = {
    "rk54": {"rtol": 1e-9}, "rk87": {"rtol": 1e-9}, "radau": {"rtol": 1e-9}, "semi": {"rtol": 1e-7},
    "natural": {"step": 5e-5}, "natural4": {"step": 1e-3}, "variational": {"step": 2e-4},
}  # fmt: skip
EXACT = {"semi": 1e-5, "natural": 1e-6, "variational": 2e-5}
"""Relative errors by the order of a method at these steps; of others 1e-8."""


def integrated(capacity, until):
    """(heat of friction, energy that the wall takes up) of the piston, in J, by SciPy."""
    heats = 2.5

    def rates(t, y):
        v, at, gas, wall = y[:4]
        volume = VOLUME + AREA * at
        p, theta = gas / heats / volume, gas * 293.15 / (heats * PRESSURE * VOLUME)
        around = 300.0 + wall / capacity if capacity else AROUND
        passed, force = CONDUCTANCE * (theta - around), AREA * (p - 101325.0) - DAMPING * v - 9.81
        return [force, v, -p * AREA * v - passed, passed, DAMPING * v**2]

    found = solve_ivp(
        rates, (0.0, until), [0.0, 0.0, heats * PRESSURE * VOLUME, 0.0, 0.0], rtol=1e-12, atol=1e-13, method="DOP853"
    )
    return found.y[4, -1], found.y[3, -1]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("capacity", [5.0, 0.0], ids=["store", "environment"])
def test_the_heat_of_friction_is_told_from_what_a_gas_gives(method, capacity):
    """The heat is ∫ d v² dt, whatever the gas gives to a store or the environment."""
    text = PISTON + HOT if capacity else PISTON
    sol = ephs.simulate(scene_of_text(text), 0.3, method=method, **METHODS[method], audit="off")
    friction, passed = integrated(capacity, 0.3)
    assert sol.heat[-1] == pytest.approx(friction, rel=EXACT.get(method, 1e-8))
    assert abs(passed) > 0.1 * friction  # the control: another number, were that counted
    assert sol.energy_error.max() < (1e-6 if method == "variational" else 1e-11)


@pytest.mark.parametrize("method", METHODS)
def test_a_beam_that_expands_has_the_heat_of_its_damping(method):
    """Where no heat is conducted, each element has the entropy of its damper: the heat is Σ ∫ θ ds, by trapezia."""
    text = BEAM.replace("conduction = 0.1, ", "")
    sol = ephs.simulate(scene_of_text(text), 0.05, method=method, **METHODS[method], audit="off")
    found = 0.0
    for name in ("rod-1", "rod-2"):
        theta, made = sol.temperature(f"thermal.{name}"), sol.ledgers.makers[Path.of(f"joints.{name}.mf")]
        found += (0.5 * (theta[1:] + theta[:-1]) * np.diff(made)).sum()
    assert sol.heat[-1] == pytest.approx(found, rel=1e-8)  # temperatures change by a millionth
    assert sol.heat[-1] > 1e-4


def test_heat_has_derivatives_where_gases_warm_stores():
    scene, vary = scene_of_text(PISTON + HOT), "joints.rail.friction"
    found = ephs.sensitivity(scene, [vary], 0.1, method="rk87", rtol=1e-10)["heat"][-1, 0]
    runs = ephs.sweep(
        scene, {vary: [2.0 - 1e-3, 2.0 + 1e-3]}, 0.1, save_at=[0.0, 0.1], method="rk87", rtol=1e-11, outputs=["heat"]
    )
    assert found == pytest.approx(float(np.diff(runs["heat"].values[:, -1])[0]) / 2e-3, rel=1e-6)


def test_a_sweep_has_the_heat_of_each_run():
    """Members that compiled code runs together have no ledgers by component."""
    scene, vary = scene_of_text(PISTON + HOT), {"gas_springs.gas.pressure": [2e5, 3e5]}
    swept = ephs.sweep(scene, vary, 0.5, save_at=[0.0, 0.5], method="rk87", outputs=["heat"])
    assert float(swept["heat"].values[1, -1]) == ephs.simulate(scene, 0.5, method="rk87", save_at=[0.0, 0.5]).heat[-1]


MIXED = """
    format = 1
    name = "mixed"
    [bodies.b]
    mass = {m}
    inertia = [0.01, 0.01, 0.01]
    [joints.rail]
    type = "prismatic"
    bodies = ["ground", "b"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    friction = {d}
    heat = "wall"
    [bodies.c]
    mass = 0.5
    inertia = [0.01, 0.01, 0.01]
    position = [0.2, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["b", "c"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    friction = {e}
    heat = "other"
    [gas_springs.gas]
    joint = "rail"
    area = 4e-4
    volume = 3e-4
    pressure = {p}
    conductance = {k}
    heat = "wall"
    [thermal.wall]
    capacity = {C}
    temperature = 310.0
    [thermal.other]
    capacity = 3.0
    temperature = 295.0
    [conduction.gap]
    between = ["wall", "other"]
    conductance = 0.7
    """


def changes(sol):
    """What all ledgers change by over a run, by component."""
    ledgers = sol.ledgers
    books = {"energy": ledgers.storages, "entropy": ledgers.entropies, "made": ledgers.makers}
    found = {f"{name} {path}": v[-1] - v[0] for name, book in books.items() for path, v in book.items()}
    return found | {name: getattr(ledgers, name)[-1] for name in ("heat", "work", "made")}


@pytest.mark.parametrize("seed", range(3))
def test_methods_agree_on_every_ledger_of_gases_and_stores_that_share_heat(seed):
    """At tolerances of 1e-9; a gas and two frictions warm two stores that conduct, beside a beam that expands."""
    rng = np.random.default_rng(seed)
    numbers = {"m": (0.5, 2.0), "d": (0.5, 5.0), "e": (0.01, 0.1), "p": (1e5, 4e5), "k": (0.5, 4.0), "C": (1.0, 10.0)}
    text = MIXED.format(**{name: rng.uniform(*bounds) for name, bounds in numbers.items()})
    scene = scene_of_text(text + BEAM[BEAM.index("[beams.rod]") :].replace("[0.0, 0.0, 0.0]", "[0.0, 3.0, 0.0]"))
    first = None
    for method in ("rk87", "rk54", "radau", "natural4"):
        sol = ephs.simulate(scene, 0.05, method=method, audit="off", **METHODS[method])
        first, found = first or changes(sol), changes(sol)
        assert sol.energy_error.max() < 1e-12
        for name, value in first.items():
            assert found[name] == pytest.approx(value, rel=1e-7, abs=1e-12), (method, name)
    assert abs(first["energy thermal.wall"]) > 1e-3 < first["heat"]
