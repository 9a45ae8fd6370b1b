"""The contest of methods: little is spent on tries, and the method that costs least takes the steps; counted."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

import ephs
from benchmarks.touching import bouncing
from ephs.mechanics.methods import auto, contest
from ephs.mechanics.methods.contest import Contest
from ephs.mechanics.methods.marching import March
from tests.numerics import largest
from tests.written import scene_of_text

CHANGE, STARTS = 50.0, 200.0
BALLS = scene_of_text(bouncing(4).scene)


def run(made, prices, phases):
    """Cost of all steps and of changes, and the methods at the ends of phases, (duration, rate of each method)."""
    spent, homes = 0.0, []
    for duration, rates in phases:
        left = duration
        while left > 0.0:
            cost, seconds = 0.0, 0.0
            for _ in range(made.length):
                cost, seconds = cost + prices[made.at], seconds + prices[made.at] / rates[made.at]
            spent, left = spent + cost, left - seconds
            if made.weigh(cost, seconds):
                spent += 0.5 * CHANGE
        homes.append(made.home)
    return spent, homes


@st.composite
def races(draw):
    """Prices of steps, and phases, in each of which the best method takes a number of windows."""
    count = draw(st.integers(2, 3))
    prices = draw(st.lists(st.integers(3, 60), min_size=count, max_size=count))
    phases = []
    for windows in draw(st.lists(st.integers(20, 2000), min_size=1, max_size=3)):
        rates = draw(st.lists(st.floats(1.0, 10.0), min_size=count, max_size=count))
        phases.append((windows * contest.WINDOW * max(prices) / min(rates), rates))
    return prices, phases


def began(prices):
    made = Contest(prices, [STARTS] * len(prices), CHANGE)
    made.stiff()  # there is something to choose: others are tried when they cost no more than all before
    return made


@given(races())
def test_a_run_costs_little_more_than_by_the_best_method_of_each_phase(race):
    prices, phases = race
    spent, homes = run(began(prices), prices, phases)
    best = sum(duration * min(rates) for duration, rates in phases)
    price = (contest.SETTLING + contest.WINDOW) * max(prices) + STARTS + CHANGE
    # The last method may go on until all others are tried, and a try may take as long as it does.
    wait = 2.0 * len(prices) * price / contest.PART
    late = sum(max(rates) / min(rates) * (wait + len(prices) * price) for _, rates in phases)
    assert spent <= best / contest.GAIN * (1.0 + contest.PART) + late
    for home, (duration, rates) in zip(homes, phases, strict=True):
        if duration * min(rates) > wait:
            assert rates[home] <= min(rates) / contest.GAIN * (1.0 + 1e-9)


def test_without_tries_the_first_method_goes_on(monkeypatch):
    prices, phases = [6, 7, 40], [(10.0, [1e3, 5e3, 2e3]), (100.0, [1e4, 1e3, 5e3])]
    assert run(began(prices), prices, phases)[1] == [0, 1]
    assert run(Contest(prices, [STARTS] * 3, CHANGE), prices, phases)[1] == [0, 0]  # nothing called for another one
    for name in ("PART", "EARLY", "FIRST"):
        monkeypatch.setattr(contest, name, 0.0)
    assert run(began(prices), prices, phases)[1] == [0, 0]


@given(races(), st.integers(1, 40))
def test_a_contest_goes_on_from_its_state(race, windows):
    prices, phases = race
    made, rates = began(prices), phases[0][1]

    def goes(one, count):
        out = []
        for _ in range(count):
            cost = prices[one.at] * one.length
            out.append((one.weigh(cost, cost / rates[one.at]), one.at, one.home, one.tries))
        return out

    goes(made, windows)
    again = Contest(prices, [STARTS] * len(prices), CHANGE)
    again.restore(made.snapshot())
    assert goes(again, 60) == goes(made, 60)


def test_steps_without_solution_are_left_for_the_last_method():
    made = Contest([6, 7, 40], [STARTS] * 3, CHANGE)
    made.fail()
    assert made.at == made.home == 2
    assert not made.weigh(40.0, 1.0)
    made = began([6, 7, 40])
    made.weigh(1e4, 1.0)
    assert made.stiff()
    assert made.at == 1
    made.fail()
    assert made.at == 2  # the next one that is due
    made.fail()
    assert made.at == made.home == 0


@pytest.mark.parametrize("rtol", [3e-5, 1e-6])
def test_many_bodies_take_the_steps_that_cost_least(rtol, monkeypatch):
    """Losses hold explicit steps of bouncing balls back, and factors of their matrix cost hundreds of evaluations."""
    scene = scene_of_text(bouncing(24).scene)
    options = {"rtol": rtol, "audit": "off"}

    def run(method):
        solution = ephs.simulate(scene, 0.2, method=method, **options)
        return solution, solution.stats["evaluations"]

    (_, semi), (_, explicit) = run("semi"), run("rk87" if rtol < auto.DIGITS else "rk54")
    found, cost = run("auto")
    assert cost < 1.5 * min(explicit, semi)
    assert "semi" in [switch["to"] for switch in found.stats["switches"]] and found.stats["tries"] > 0
    assert largest(found.energy_error) <= 1e-12 and found.stats["least_production"] >= 0.0
    for name in ("PART", "EARLY", "FIRST"):
        monkeypatch.setattr(contest, name, 0.0)
    assert run("auto")[1] > 1.5 * cost


@pytest.mark.parametrize(("rtol", "first"), [(1e-3, "semi"), (1e-4, "semi"), (3e-5, "rk54"), (1e-6, "rk87")])
def test_the_tolerance_says_which_method_begins(rtol, first):
    assert ephs.simulate(BALLS, 0.01, rtol=rtol, audit="off").stats["chosen"] == first


def test_steps_go_on_as_if_each_leg_were_prepared_anew(monkeypatch):
    monkeypatch.setattr(contest, "FIRST", 10.0)
    options = {"rtol": 1e-4, "audit": "off"}
    found = ephs.simulate(BALLS, 0.2, **options)
    assert found.stats["tries"] > 2
    monkeypatch.setattr(March, "serves", lambda *_: False)
    again = ephs.simulate(BALLS, 0.2, **options)
    assert again.stats["switches"] == found.stats["switches"] and again.stats["steps"] == found.stats["steps"]
    for name in again.freedoms:
        np.testing.assert_array_equal(again.joint(name).coordinate, found.joint(name).coordinate)
