"""Forecast of the work of a run: right for a motion that repeats itself, said once, and of long runs only."""

import warnings

import pytest

import ephs
from ephs.solve.auditing import forecast
from ephs.solve.auditing.forecast import Forecast
from examples.failing import pendulum
from tests.scenes import shipped

SPRING = pendulum(1.0, "stiffness = 100.0")


@pytest.mark.parametrize(("method", "rtol"), [("natural", 1e-4), ("natural4", 1e-8)])
def test_a_motion_that_repeats_itself_takes_what_was_forecast(method, rtol, monkeypatch):
    monkeypatch.setattr(forecast, "MANY", 1)
    with pytest.warns(ephs.CostWarning, match=rf"^{method} will take about .* steps .*rk87") as said:
        sol = ephs.simulate(SPRING, 2.0, method=method, rtol=rtol, atol=rtol)
    assert len(said) == 1
    told = sol.stats["forecast"]
    assert told["after"] == forecast.FIRST < sol.stats["steps"]
    assert told["steps"] == pytest.approx(sol.stats["steps"], rel=0.5)
    assert told["iterations"] == pytest.approx(sol.stats["iterations"], rel=0.6)


def test_long_runs_are_told_after_their_first_steps():
    scene = shipped("four-bar")
    with pytest.warns(ephs.CostWarning), pytest.raises(ephs.SimulationError, match="33"):
        ephs.simulate(scene, 2.0, method="natural", max_steps=33)


def test_short_runs_and_methods_of_high_order_are_not():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for method in ("rk54", "radau", "auto", "natural4"):
            assert "forecast" not in ephs.simulate(SPRING, 0.5, method=method, rtol=1e-4, audit="off").stats


def test_steps_that_get_shorter_are_forecast_again(monkeypatch):
    monkeypatch.setattr(forecast, "MANY", 1000)
    method = ("natural", 2, 1.0, lambda _: True)
    watch, t = Forecast(*method), 0.0
    for steps in range(1, 300):
        t += 0.01 if steps <= 40 else 1e-4
        if 128 == steps:
            with pytest.warns(ephs.CostWarning, match="about 6 000 steps"):
                watch.look(steps, t, lambda n=steps: {"iterations": n})
        else:
            watch.look(steps, t, lambda n=steps: {"iterations": n})
    assert watch.stats() == {"forecast": {"steps": 6040, "iterations": 6040, "after": 128}}
    again = Forecast(*method)
    again.restore(watch.snapshot())
    assert again.stats() == watch.stats()
