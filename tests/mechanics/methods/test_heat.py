"""Heat of friction: what a brake takes is what its disc had, and entropies change by what is made, by every method."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.hard.brakes import ENERGY, brake
from ephs.mechanics.methods import radau as implicit
from ephs.mechanics.methods.variational import Variational
from ephs.mechanics.tree.engine.heats import held_between
from ephs.mechanics.tree.equations.accounts import Accounts
from ephs.semantics.stage import Entry, Program
from ephs.solve.methods.collocation import radau
from ephs.solve.methods.paced import Paced
from examples.failing import scene
from tests.numerics import EPS, largest

CONSTANT = {"radau": 0.0, "variational": 0.0, "rk54": 0.0, "rk87": 0.0}
"""Methods that take constant steps, and the part of a stiff brake's heat that they may miss."""


def arms(frictions, capacities, conductance, rates):
    """Two arms in gravity, friction in both pins, each pad warming, heat passing between the pads."""
    pin, elbow = frictions
    return scene(
        f"""
        [bodies.upper]
        mass = 1.0
        inertia = [0.1, 0.1, 0.1]
        position = [0.5, 0.0, 0.0]
        velocity = [0.0, {0.5 * rates[0]}, 0.0]
        angular_velocity = [0.0, 0.0, {rates[0]}]
        [bodies.lower]
        mass = 0.7
        inertia = [0.05, 0.05, 0.05]
        position = [1.3, 0.0, 0.0]
        velocity = [0.0, {rates[0] + 0.3 * (rates[0] + rates[1])}, 0.0]
        angular_velocity = [0.0, 0.0, {rates[0] + rates[1]}]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "upper"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        friction = {pin}
        heat = "one"
        [joints.elbow]
        type = "revolute"
        bodies = ["upper", "lower"]
        at = [1.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        friction = {elbow}
        heat = "two"
        [thermal.one]
        capacity = {capacities[0]}
        temperature = 300.0
        [thermal.two]
        capacity = {capacities[1]}
        temperature = 290.0
        [conduction.gap]
        between = ["one", "two"]
        conductance = {conductance}
        """,
        "[world]\ngravity = [0.0, -9.81, 0.0]\n",
    )


FAST = (0.1, 0.3), (0.05, 0.02), 0.1, (2.0, -3.0)
"""Numbers of arms that warm small pads."""


def run(model, until, method, step, **more):
    return ephs.simulate(model, until, method=method, step=step, audit="off", **more)


def laws(sol):
    return {finding.law for finding in sol.audit.findings}


@pytest.mark.parametrize("capacity", [None, 1e-2, 1e-3])
@pytest.mark.parametrize(("friction", "step"), [(1e6, 0.002), (1e6, 0.5), (100.0, 0.05), (20.0, 0.05), (0.5, 0.05)])
def test_radau_books_what_the_disc_had_at_any_step(friction, step, capacity):
    sol = run(brake(friction, capacity), 1.0, "radau", step)
    ledgers = sol.ledgers
    assert ledgers.heat[-1] + ledgers.kinetic[-1] == pytest.approx(ENERGY, rel=100 * EPS * math.sqrt(len(sol)))
    assert sol.audit.passed
    if capacity:  # in closed form
        entropy = capacity * math.log1p(ledgers.heat[-1] / (capacity * 300.0))
        assert ledgers.entropy[-1] - ledgers.entropy[0] == pytest.approx(entropy, rel=1e-12)


def test_a_quadrature_alone_does_not(monkeypatch):
    booked = Accounts.booked
    monkeypatch.setattr(Accounts, "booked", lambda *given, damped=None, **more: booked(*given, **more))
    monkeypatch.setattr(implicit.Implicit, "many", lambda *_: None)
    sol = run(brake(1e4), 0.2, "radau", 0.01)
    assert abs(sol.ledgers.heat[-1] / ENERGY - 1.0) > 0.5
    assert "energy" in laws(sol)


def test_vibrations_that_radau_damps_are_heat():
    model = scene(
        """
        [bodies.disc]
        mass = 1.0
        inertia = [0.5, 0.5, 1.0]
        angular_velocity = [0.0, 0.0, 100.0]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "disc"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        friction = 1e-6
        stiffness = 1e6
        """,
        "[world]\ngravity = [0.0, 0.0, 0.0]\n",
    )
    sol = run(model, 0.5, "radau", 0.01)
    assert sol.ledgers.heat[-1] == pytest.approx(ENERGY, rel=1e-12)
    assert "energy" not in laws(sol)


@pytest.mark.parametrize("method", sorted(CONSTANT))
@settings(max_examples=6)
@given(
    st.tuples(st.floats(0.01, 0.3), st.floats(0.01, 0.3)),
    st.tuples(st.floats(0.5, 50.0), st.floats(0.5, 50.0)),
    st.floats(0.05, 1.0),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
)
@example(*FAST)
def test_entropies_change_by_what_is_made(method, frictions, capacities, conductance, rates):
    sol = run(arms(frictions, capacities, conductance, rates), 0.3, method, 0.01)
    ledgers = sol.ledgers
    change = sum(values - values[0] for values in ledgers.entropies.values())
    terms = sum(np.abs(values - values[0]) for values in ledgers.entropies.values()) + np.abs(ledgers.made)
    rounding = 8.0 * EPS * len(sol) * (terms.max() + sum(largest(v) for v in ledgers.entropies.values()))
    assert largest(change - (ledgers.made - ledgers.made[0])) <= rounding
    assert np.diff(ledgers.heat).min() >= 0.0
    for made in ledgers.makers.values():
        assert np.diff(made).min() >= -rounding
    heats = sum(
        ledgers.storages[path] - ledgers.storages[path][0] for path in ledgers.entropies if ledgers.exergies[path].any()
    )
    assert heats == pytest.approx(ledgers.heat, abs=1e-11 * (1.0 + largest(ledgers.heat)))


@pytest.mark.parametrize(("stages", "until", "steps"), [(3, 0.4, (8, 16)), (5, 0.8, (8, 16)), (7, 0.8, (4, 6))])
def test_the_order_of_radau_is_kept(stages, until, steps, monkeypatch):
    """2 s − 1 with s stages: coarse steps are far above rounding, fine ones a hundred times above the reference."""
    monkeypatch.setattr(implicit, "scheme_of", lambda *_: radau(stages))
    model = arms((0.2, 0.1), (5.0, 2.0), 0.3, (1.0, -2.0))
    exact = ephs.simulate(model, until, method="rk87", rtol=1e-13, atol=1e-13).ledgers.heat[-1]
    errors = [abs(run(model, until, "radau", until / n).ledgers.heat[-1] - exact) for n in steps]
    order = math.log(errors[0] / errors[1]) / math.log(steps[1] / steps[0])
    assert order > 2 * stages - 1 - 0.35, errors


INSTANTS = np.linspace(0.0, 0.6, 241)
"""Twenty to a step of 0.05 s; some differ from the ends of steps by rounding."""


def within(keep):
    """Two arms that exchange heat, at instants within long steps."""
    model = arms(*FAST)
    options = {"keep": keep}
    return run(model, 0.6, "variational", 0.05, save_at=INSTANTS, options=options), run(
        model, 0.6, "variational", 0.05, options=options
    )


@pytest.mark.parametrize("keep", ["momentum", "energy", "energy and momenta"])
def test_within_steps_of_the_variational_method_no_component_loses_heat_or_entropy(keep):
    sol, steps = within(keep)
    ledgers = sol.ledgers
    assert np.diff(ledgers.heat).min() >= -EPS * ledgers.heat[-1]
    for made in ledgers.makers.values():
        assert np.diff(made).min() >= -EPS * made[-1]
    change = sum(values - values[0] for values in ledgers.entropies.values())
    assert largest(change - ledgers.made) <= 64.0 * EPS * sum(largest(v) for v in ledgers.entropies.values())
    same = np.isin(sol.t, steps.t), np.isin(steps.t, sol.t)
    assert same[0].sum() > 6 and np.array_equal(sol.heat[same[0]], steps.heat[same[1]])  # instants leave the steps
    if keep != "momentum":
        assert sol.energy_error.max() < 64.0 * EPS


def test_parts_of_a_step_alone_may_lose_what_the_whole_has_not(monkeypatch):
    """The control."""
    monkeypatch.setattr(Variational, "tried", lambda self, state, h, *, part: self._step(state, h, part=False))
    sol, _ = within("energy")
    assert np.diff(sol.heat).min() < -1e-5


DENSE = {
    "rk54": {}, "rk87": {}, "radau": {}, "semi": {}, "auto": {}, "natural4": {"step": 0.02},
    "variational": {"step": 0.01},
}  # fmt: skip


@pytest.mark.parametrize("method", DENSE)
@pytest.mark.parametrize("seed", range(3))
def test_between_instants_within_steps_no_component_loses_heat_or_entropy(method, seed):
    rng = np.random.default_rng(seed)
    model = arms(rng.uniform(0.05, 0.5, 2), rng.uniform(0.02, 0.1, 2), rng.uniform(0.0, 0.2), rng.uniform(-3.0, 3.0, 2))
    sol = ephs.simulate(model, 0.6, method=method, save_at=np.linspace(0.0, 0.6, 601), audit="off", **DENSE[method])
    for made in (sol.heat, *sol.ledgers.makers.values()):
        assert np.diff(made).min() >= -64.0 * EPS * made[-1]


def damped(seed, inputs):
    """The largest fall, between instants in steps that damp, of heat and of what each component made, to what it is."""
    rng = np.random.default_rng(seed)
    model = arms(
        rng.uniform(5.0, 500.0, 2), rng.uniform(0.02, 0.1, 2), rng.uniform(0.0, 0.2), rng.uniform(-3.0, 3.0, 2)
    )
    sol = run(model, 0.4, "radau", 0.05, save_at=np.linspace(0.0, 0.4, 161), inputs=inputs)
    return max(float(np.max(-np.diff(made) / made[-1])) for made in (sol.heat, *sol.ledgers.makers.values()))


STEP_BY_STEP = {"joints.pin": lambda t: 0.0 * t}


@pytest.mark.parametrize("inputs", [None, STEP_BY_STEP], ids=["compiled", "step by step"])
@pytest.mark.parametrize("seed", range(3))
def test_between_instants_within_steps_that_damp_no_component_loses_heat_or_entropy(seed, inputs):
    assert damped(seed, inputs) <= 64.0 * EPS


def test_parts_of_such_a_step_alone_lose_what_the_whole_has_not(monkeypatch):
    """The control."""
    monkeypatch.setattr(implicit.Implicit, "tried", lambda self, state, h, *, part: self._step(state, h, part=False))
    assert damped(1, STEP_BY_STEP) > 1e-3


def near_ends(method):
    """Heat just before the ends of steps of a run, and what it is there, relative to all."""
    model, options = arms(*FAST), {"method": method, "rtol": 1e-4, "audit": "off"}
    ends = ephs.simulate(model, 0.6, **options).t[1:]
    sol = ephs.simulate(model, 0.6, save_at=np.sort(np.concatenate([ends - 1e-9, ends])), **options)
    return largest(sol.heat[1::2] - sol.heat[::2]) / sol.heat[-1]


@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_instants_within_chosen_steps_of_natural_methods_lead_to_their_ends(method, monkeypatch):
    assert near_ends(method) < 1e-7  # what a nanosecond of 0.6 s makes, with its largest power
    monkeypatch.setattr(Paced, "inside", lambda self, attempt, t: self.shorter(attempt.start, t))
    assert near_ends(method) > 1e-7  # the control: the end is that of two steps


HOLD = Program("held", made=Entry(held_between))


@given(st.lists(st.tuples(*[st.floats(0.01, 1.0)] * 3), min_size=1, max_size=4))
def test_entropies_held_between_those_of_two_parts_keep_their_sum(rows):
    """Where the bounds allow their sum; else they are as they were."""
    low, more, made = np.ascontiguousarray(np.array(rows).T)
    high = low + more
    made *= float(low.sum() + 0.5 * more.sum()) / float(made.sum())
    hold, held, beyond = HOLD.compiled()["made"], made.copy(), high + 1.0
    hold(held, low, high)
    assert abs(held.sum() - made.sum()) <= 32.0 * EPS * (high.sum() + made.sum())
    rounding = 8.0 * EPS * high.max()
    assert np.all((held >= low - rounding) & (held <= high + rounding))
    hold(beyond, low, high)
    assert np.array_equal(beyond, high + 1.0)  # a sum that they do not
