"""Entropy that each component of a mechanism made: to the tolerance, as its stages say, and the sum to rounding."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.methods.tableaux import MIDPOINT
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.sensitivity.explicit import ExplicitTangent
from ephs.mechanics.sensitivity.family import ParameterFamily
from ephs.mechanics.tree.equations.accounts import Accounts
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.solve.posing.errors import SolveError
from tests.mechanics.methods.test_heat import arms
from tests.numerics import EPS, largest
from tests.scenes import shipped
from tests.solve.test_gas_heat import HOT, PISTON
from tests.written import scene_of_text

UNTIL = 20.0
INERTIA, FRICTION, DISC, CALLIPER, PADS, AIR = 0.8, 1.2, 60.0, 180.0, 25.0, 4.0
"""Numbers of scenes/hot-brake.toml."""
BRAKE = f"""
    format = 1
    name = "brake"
    [world]
    gravity = [0.0, 0.0, 0.0]
    [bodies.wheel]
    mass = 1.0
    inertia = [1.0, 1.0, {INERTIA}]
    angular_velocity = [0.0, 0.0, 30.0]
    [joints.axle]
    type = "revolute"
    bodies = ["ground", "wheel"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    friction = {FRICTION}
    heat = "disc"
    [thermal.disc]
    capacity = {DISC}
    temperature = 300.0
    [thermal.calliper]
    capacity = {CALLIPER}
    temperature = 301.5
    [conduction.pads]
    between = ["disc", "calliper"]
    conductance = {PADS}
    """


@cache
def exact(until, speed, disc, calliper, around, air):
    """Entropies in J/K made by friction, pads and air."""

    def rates(_, y):
        w, a, b = y[:3]
        heat, pads, out = FRICTION * w * w, PADS * (a - b), air * (b - around)
        warming = [(heat - pads) / DISC, (pads - out) / CALLIPER]
        return [-FRICTION * w / INERTIA, *warming, heat / a, pads * (1 / b - 1 / a), out * (1 / around - 1 / b)]

    start = [speed, disc, calliper, 0.0, 0.0, 0.0]
    return solve_ivp(rates, (0.0, until), start, method="DOP853", rtol=1e-12, atol=1e-13).y[3:, -1]


def made(sol):
    """Entropies made by components, in the order of the mechanism."""
    names = ("axle", "pads", "air")
    return np.array(
        [v[-1] for name in names for path, v in sol.ledgers.makers.items() if name in str(path)],
    )


def hot_brake(sol):
    return exact(UNTIL, 150.0, 293.15, 293.15, sol.ledgers.temperature, AIR)


@pytest.mark.parametrize("inputs", [None, {"joints.axle": lambda t: 0.0 * t}], ids=["compiled", "step by step"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-9])
@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_each_component_makes_its_own_to_the_tolerance(method, rtol, inputs):
    sol = ephs.simulate(shipped("hot-brake"), UNTIL, method=method, rtol=rtol, inputs=inputs)
    error = np.abs(made(sol) - hot_brake(sol))
    assert np.all(error <= 10.0 * rtol * hot_brake(sol).sum())
    rise = sol.ledgers.entropy[-1] - sol.ledgers.entropy[0]
    assert abs(rise - made(sol).sum()) <= 8.0 * EPS * len(sol) * rise


def test_semi_implicit_steps_do_so_too():
    sol = ephs.simulate(shipped("hot-brake"), UNTIL, method="semi", rtol=1e-6)
    assert np.all(np.abs(made(sol) - hot_brake(sol)) <= 1e-5 * hot_brake(sol).sum())


def by_means(monkeypatch):
    """Stages that have nothing to do with the step: mean temperatures are taken."""
    booked = Accounts.booked

    def without(self, start, scheme, k, *given, **more):
        a = scheme["a"].copy()
        a[:-1] *= 1e6
        return booked(self, start, {**scheme, "a": a}, k, *given, **more)

    monkeypatch.setattr(Accounts, "booked", without)


def test_mean_temperatures_alone_do_not(monkeypatch):
    """The control: the sum is right, and each is of order two in the step."""
    by_means(monkeypatch)
    sol = ephs.simulate(
        shipped("hot-brake"), UNTIL, method="radau", rtol=1e-9, inputs={"joints.axle": lambda t: 0.0 * t}
    )
    assert largest(made(sol) / hot_brake(sol) - 1.0) > 1e-3
    assert abs(made(sol).sum() / hot_brake(sol).sum() - 1.0) < 1e-9


@pytest.mark.parametrize("inputs", [None, {"joints.axle": lambda t: 0.0 * t}], ids=["compiled", "step by step"])
@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_heat_that_turns_around_within_a_step_makes_entropy(method, inputs):
    """The disc begins cooler, and overtakes the calliper in the first step of h λ = 0.6, of which rk54 has (h λ)⁵."""
    sol = ephs.simulate(scene_of_text(BRAKE), 0.6, method=method, step=0.2, inputs=inputs)
    expected = exact(0.6, 30.0, 300.0, 301.5, 300.0, 0.0)[:2]
    assert np.all(np.abs(made(sol) - expected) <= 0.6**5 / 120.0 * expected.sum())


def test_by_mean_temperatures_such_a_step_is_refused(monkeypatch):
    by_means(monkeypatch)
    with pytest.raises(ephs.SimulationError, match="pads"):
        ephs.simulate(scene_of_text(BRAKE), 0.6, method="radau", step=0.2, inputs={"joints.axle": lambda t: 0.0 * t})


@pytest.mark.parametrize("inputs", [None, {"joints.pin": lambda t: 0.1 * t}], ids=["constant", "of time"])
@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_a_step_with_derivatives_makes_what_a_step_makes(method, inputs):
    """Within one step rates are corrected after it; derivatives are those of what it makes, by differences."""
    h, capacity = 0.05, 0.05

    def model(share):
        return arms((0.1, 0.3), (capacity * share, 0.02), 0.1, (2.0, -3.0))

    def run(share):
        sol = ephs.simulate(model(share), h, method=method, step=h, inputs=inputs, audit="off")
        return np.array([values[-1] for values in sol.ledgers.makers.values()])

    family = ParameterFamily(model(1.0), ["thermal.one.capacity"], None, inputs, None, joints=True)
    steps = ExplicitTangent(family, 0.0, tableau(method))
    point = steps.step(steps.begin(), h)
    expected = run(1.0)
    assert np.all(np.abs(point.state.totals[-expected.size :] - expected) <= 1e-13 * expected)
    d = 1e-4  # errors of the difference: d² and ε / d
    slopes = (run(1.0 + d) - run(1.0 - d)) / (2.0 * d * capacity)
    assert np.all(np.abs(point.y[0][-expected.size :] - slopes) <= 1e-6 * np.abs(slopes))


def test_a_step_that_takes_more_heat_from_a_store_than_there_is_says_so():
    """Three quarters of it leave a temperature; five quarters do not, and the store is named."""
    eq = ReducedEquations(problem_of_scene(shipped("hot-brake")), 0.0)
    start = eq.start(0.0)
    rates = np.zeros((1, eq.size))
    rates[0, eq.nv + eq.n] = -0.75 * DISC * 293.15
    eq.accounts.booked(start, MIDPOINT, rates, 1.0, eq.vector(start))
    rates *= 5.0 / 3.0
    with pytest.raises(SolveError, match="temperature") as refused:
        eq.accounts.booked(start, MIDPOINT, rates, 1.0, eq.vector(start))
    assert refused.value.path == "thermal.disc"


def test_stages_share_what_they_miss_and_a_step_beyond_that_takes_means():
    """Heat of a brake and through its pads: by a stage in the middle, and by one that has nothing to do with it."""
    eq = ReducedEquations(problem_of_scene(shipped("hot-brake")), 0.0)
    start = eq.start(0.0)
    h, y0 = 0.5, eq.vector(start)
    rates = eq.rates(0.0, start.q, y0)
    middle = eq.rates(0.5 * h, start.q, y0 + 0.5 * h * rates)[None]

    def made(a):
        y, _ = eq.accounts.booked(start, {**MIDPOINT, "a": np.array([[a], [1.0]])}, middle, h, y0 + h * middle[0])
        heats, totals = np.split(y[eq.nv + eq.n :], [eq.ns])
        rise = eq.heats.entropies(heats) - eq.heats.entropies(start.heats)
        assert abs(totals[TOTALS:].sum() - rise.sum()) <= 8.0 * EPS * np.abs(eq.heats.entropies(heats)).sum()
        return totals[TOTALS:]

    means = eq.heats.taken(start.heats, h * middle[0][-len(eq.reduced.made) :])[1]
    parts, far = made(0.5) - means, made(1e6) - means
    assert 1e-9 < largest(parts) / means.sum() < 1e-2
    assert largest(far) <= 64.0 * EPS * means.sum()


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_so_do_gases_that_warm_a_store(method):
    """A component at a gas and a store has two flows, of which one goes out."""
    model, rtol = scene_of_text(PISTON + HOT), 1e-6

    def run(method, rtol):
        return np.array(
            [values[-1] for values in ephs.simulate(model, 0.5, method=method, rtol=rtol).ledgers.makers.values()]
        )

    expected = run("rk87", 1e-11)
    assert np.all(np.abs(run(method, rtol) - expected) <= 10.0 * rtol * expected.sum())
