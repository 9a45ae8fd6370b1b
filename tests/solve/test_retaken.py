"""Chosen steps taken again: what is missed is the error of the run, also where its own estimate knows nothing of it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import ephs
from ephs.show.charts import family_scenes as scenes
from ephs.solve.auditing.retaken import EACH, MOST, Missed, Retaken, share_missed
from ephs.solve.methods.paced import Paced
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.stepping import Attempt
from tests.solve.test_growth import off


@pytest.fixture
def found(monkeypatch):
    """What audits found to be missed."""
    kept, missed = [], Retaken.missed

    def keeping(self, *given):
        kept.append(missed(self, *given))
        return kept[-1]

    monkeypatch.setattr(Retaken, "missed", keeping)
    return kept


@pytest.mark.parametrize(("method", "tolerance"), [("natural4", 1e-6), ("natural4", 1e-7), ("natural", 1e-4)])
@pytest.mark.parametrize("blind", [True, False])
def test_steps_that_resolve_nothing_are_found_and_others_pass(method, tolerance, blind, found, monkeypatch):
    """Through a universal joint that is nearly locked, with estimates as they are, and with those that know nothing."""
    if blind:
        step = Paced.step
        monkeypatch.setattr(Paced, "step", lambda self, state, h: replace(step(self, state, h), error=0.0))
    scene, times = scenes.cardan_shaft(85.0), np.linspace(0.0, 0.5, 11)
    true = ephs.simulate(scene, 0.5, method="rk87", rtol=1e-12, atol=1e-12, save_at=times)
    run = ephs.simulate(scene, 0.5, method=method, rtol=tolerance, atol=tolerance, save_at=times, audit="off")
    assert off(run, true) > 1e3 * tolerance if blind else off(run, true) < 10.0 * tolerance
    assert run.audit.passed != blind
    assert (found[-1].size > 100.0) == blind
    assert all(finding.law == "accuracy" for finding in run.audit.findings)


@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_estimates_that_hold_are_not_doubted(method, found):
    """Where steps are of their order, the run errs by about one tolerance or less, by the policy's share a step."""
    ephs.simulate(scenes.pendulum(1.0), 1.0, method=method, rtol=1e-6, atol=1e-6)
    assert 0.0 < found[-1].size < 2.0


def test_methods_whose_energy_tells_are_not_asked(found):
    ephs.simulate(scenes.pendulum(1.0), 1.0, method="radau", rtol=1e-4, atol=1e-4, events=[])
    assert set(found) <= {None}


def test_inputs_that_read_the_state_are_not_asked_again(found):
    given = {"joints.pin": lambda t, state: 0.0}
    ephs.simulate(scenes.pendulum(1.0), 0.2, method="natural4", rtol=1e-4, inputs=given)
    assert found == [None]


class Errs:
    """A method that misses this many tolerances in a step of one second, by its length's third power."""

    def __init__(self, each):
        self.each = each

    def missed(self, attempt):
        if self.each is None:
            raise SolveError(Outcome.SINGULAR, "", "")
        return self.each * attempt.h**3


def steps(lengths, wanted=True):
    kept, t = Retaken(wanted=wanted), 0.0
    for h in lengths:
        kept.add(t, Attempt(SimpleNamespace(), SimpleNamespace(), h, 0.0, 0.0))
        t += h
    return kept


def test_errors_of_steps_add_up():
    h, count = 0.5, 10 * EACH
    found = steps([h] * count).missed(Errs(3.0), Breakpoints(0.0, h * count), 2.0)
    assert found.size == pytest.approx(count * 3.0 * h**3, rel=1e-12)
    assert 0.0 <= found.at <= 2.0 * count * h


def test_the_longest_step_is_among_them():
    lengths = [1e-3] * (EACH * MOST)
    lengths[101] = 2.0
    found = steps(lengths).missed(Errs(1.0), Breakpoints(0.0, 3.0), 1.0)
    assert found == Missed(8.0, pytest.approx(0.101))


def test_nothing_is_said_of_what_has_no_solution_or_was_not_wanted():
    breakpoints = Breakpoints(0.0, 1.0)
    assert steps([0.5, 0.5]).missed(Errs(None), breakpoints, 1.0).size == 0.0
    assert steps([0.5, 0.5], wanted=False).missed(Errs(1.0), breakpoints, 1.0) is None


@pytest.mark.parametrize("order", [1, 2, 4])
def test_thirds_differ_from_halves_by_a_known_part_of_their_error(order):
    """The error of n steps in place of one is C n (h / n)^(p + 1)."""
    halves, thirds = (n * n ** -(order + 1.0) for n in (2, 3))
    assert halves - thirds == pytest.approx(share_missed(order) * halves, rel=1e-12)
