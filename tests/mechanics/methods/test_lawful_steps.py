"""Explicit steps keep both laws: the balance of energy to rounding at the method's order, heat that never falls."""

from math import fsum

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.hard.brakes import brake
from ephs.mechanics.tree.equations.led import Led
from ephs.semantics.linear.sums import grown
from ephs.solve.posing.errors import Outcome
from tests.numerics import EPS, largest
from tests.scenes import shipped

BALANCE = 1e-12
"""Of the gross energies."""
SCENES = ("mbs", "slider-crank", "bricard", "universal", "screw-press", "body")
"""Heat and conduction; friction, a drive and a loop; loops; springs; a screw; a body that turns freely."""
INSTANTS = np.linspace(0.0, 0.5, 41)


@pytest.fixture
def uncorrected(monkeypatch):
    """A function that turns corrections off: an account is kept of mechanisms that have something free to move."""
    return lambda: monkeypatch.setattr(Led, "counting", property(lambda _: True))


def run(scene, method, **options):
    return ephs.simulate(shipped(scene), 0.5, method=method, audit="warn", **options)


def rounding(sol):
    """Of a sum of all energies that are stored, relative to the gross energies."""
    stored = sum(float(largest(held)) for held in sol.ledgers.storages.values())
    return 8.0 * len(sol.ledgers.storages) * EPS * stored / sol.ledgers.scale


@pytest.mark.parametrize("method", ["rk54", "rk87"])
@pytest.mark.parametrize("scene", SCENES)
def test_the_balance_is_kept_in_every_step_and_within(scene, method, uncorrected):
    options = {"rtol": 1e-5, "atol": 1e-6}
    for sol in (run(scene, method, **options), run(scene, method, save_at=INSTANTS, **options)):
        assert largest(sol.energy_error) <= BALANCE + rounding(sol)
        made = np.array(list(sol.ledgers.makers.values()) or [np.zeros(len(sol))])
        assert np.all(np.diff(made, axis=1) >= -100.0 * EPS * largest(made))
        defect = sol.stats["plain_defect"]
        assert defect["largest"] <= defect["sum"]
    plain = defect["largest"] / sol.ledgers.scale
    uncorrected()
    missed = largest(run(scene, method, **options).energy_error)
    assert missed > 10.0 * (BALANCE + rounding(sol))
    assert plain > 0.01 * missed


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_inputs_that_jump_work_on_what_is_kept(method, uncorrected):
    """A torque that is a function of time and turns round: steps are taken one by one, and end where it jumps."""

    def error():
        torque = {"joints.bearing": lambda t: 0.3 if t < 0.31 else -0.2 - t}
        sol = run("slider-crank", method, inputs=torque, jumps=[0.31], rtol=1e-5, atol=1e-6, save_at=INSTANTS)
        return largest(sol.energy_error), rounding(sol)

    found, allowed = error()
    assert found <= BALANCE + allowed
    uncorrected()
    assert error()[0] > 100.0 * (BALANCE + allowed)


@pytest.mark.parametrize(("method", "order", "step"), [("rk54", 5, 0.025), ("rk87", 8, 0.1)])
@pytest.mark.parametrize("scene", ["mbs", "chain", "bricard"])
def test_orders_stay(scene, method, order, step, uncorrected):
    exact = run(scene, "rk87", rtol=1e-13, atol=1e-14, save_at=[0.5])

    def errors():
        found = []
        for h in (step, 0.5 * step):
            sol = run(scene, method, step=h)
            found.append(max(float(largest(sol[path][-1] - exact[path][-1])) for path in sol.states))
        return np.array(found)

    corrected = errors()
    uncorrected()
    plain = errors()
    assert np.log2(corrected[0] / corrected[1]) >= order - 1.0
    assert np.all(corrected <= 3.0 * plain)


def test_ten_thousand_steps_do_not_drift(uncorrected):
    scene = shipped("chain")

    def error():
        sol = ephs.simulate(scene, 50.0, method="rk54", step=5e-3, save_at=np.linspace(0.0, 50.0, 101), audit="off")
        assert sol.stats["steps"] == 10_000
        return largest(sol.energy_error)

    kept = error()
    assert kept <= BALANCE
    uncorrected()
    assert error() > 1e3 * kept


def test_a_step_in_which_a_component_loses_entropy_is_refused():
    """Weights of rk54 at h·|λ| = 2.5: a disc in a brake, whose rate would change its sign again and again."""
    scene = brake(25.0, 1e4)
    with pytest.raises(ephs.SimulationError) as failed:
        ephs.simulate(scene, 1.0, method="rk54", step=0.1, audit="off")
    assert failed.value.outcome is Outcome.LAWLESS
    sol = ephs.simulate(scene, 1.0, method="rk54", rtol=1e-5, audit="off")
    assert sol.stats["least_production"] >= 0.0
    assert largest(sol.energy_error) <= BALANCE


def summed(changes):
    total = carry = 0.0
    for change in changes:
        total, carry = grown(total, carry, change)
    return total


@settings(max_examples=30)
@given(st.lists(st.floats(-1e6, 1e6), max_size=40))
def test_sums_lose_rounding_of_their_terms_only(changes):
    assert abs(summed(changes) - fsum(changes)) <= 2.0 * EPS * fsum(map(abs, changes))


def test_a_plain_sum_loses_more():
    changes, plain = [0.1] * 100_000, 0.0
    for change in changes:
        plain += change
    assert abs(plain - fsum(changes)) > 1e-9
    assert abs(summed(changes) - fsum(changes)) < 1e-11
