"""What a motion was computed with is found again in its record; with noise, within what the errors say."""

from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.parameters import read, varied
from ephs.solve.equations.model import Evaluation
from ephs.solve.posing.errors import Outcome, SimulationError
from tests.numerics import largest
from tests.oscillator import damped_oscillator
from tests.scenes import shipped

FOUR_BAR = ("joints.pivot.friction", "bodies.rocker.inertia[2]", "joints.main.friction")
DOUBLE = ("joints.j0.friction", "joints.j1.friction", "bodies.rod1.inertia[1]", "bodies.rod1.mass")
search = import_module("ephs.mechanics.sensitivity.fit")
STEPS = {"method": "rk87", "step": 0.025}


def double_pendulum():
    """Two links of the chain, damped."""
    scene = shipped("chain")
    bodies = {name: body for name, body in scene.bodies.items() if name in ("rod0", "rod1")}
    joints = {name: joint for name, joint in scene.joints.items() if name in ("j0", "j1")}
    short = replace(scene, name="double-pendulum", bodies=bodies, joints=joints)
    short = short.with_state({"j0": 1.0, "j1": -0.7})
    return varied(short, {"joints.j0.friction": 0.3, "joints.j1.friction": 0.2})


def record(scene, joints, until, count):
    times = np.linspace(0.0, until, count)
    motion = ephs.simulate(scene, until, method="rk87", save_at=times, rtol=1e-12, atol=1e-13)
    return {"t": times} | {f"joints.{name}.coordinate": motion.joint(name).coordinate for name in joints}


CASES = {
    "double pendulum": (double_pendulum, DOUBLE, ("j0", "j1"), 0.6),
    "four-bar": (lambda: shipped("four-bar"), FOUR_BAR, ("main", "pivot"), 0.5),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    make, paths, joints, until = CASES[request.param]
    scene = make()
    return scene, list(paths), record(scene, joints, until, 13)


def test_a_motion_without_noise_gives_the_numbers_back(case):
    scene, paths, data = case
    start = {path: factor * read(scene, path) for path, factor in zip(paths, (1.5, 0.8, 1.4, 1.3), strict=False)}
    found = ephs.fit(scene, data, paths, start=start, rtol=1e-9, atol=1e-11)
    for path in paths:
        assert found.values[path] == pytest.approx(read(scene, path), rel=1e-6)
        assert read(found.model, path) == found.values[path]
    assert found.converged and found.deviation < 1e-8
    assert all(largest(values) < 1e-7 for values in found.residuals.values())


def test_a_noisy_motion_gives_them_within_three_deviations(case):
    scene, paths, data = case
    rng, noise = np.random.default_rng(1), 1e-3
    noisy = {
        name: values if name == "t" else values + noise * rng.standard_normal(values.shape)
        for name, values in data.items()
    }
    found = ephs.fit(scene, noisy, paths, sigma=dict.fromkeys(noisy, 2.0 * noise), **STEPS)
    off = np.array([found.values[path] - read(scene, path) for path in paths])
    errors = np.array([found.errors[path] for path in paths])
    assert np.all(np.abs(off) < 3.0 * errors)
    assert 0.3 < found.deviation < 0.7  # in units of sigma
    tangent = ephs.sensitivity(found.model, paths, data["t"][-1], save_at=data["t"], **STEPS)
    names = [name for name in data if name != "t"]
    rows = np.concatenate([tangent[name].reshape(-1, len(paths)) for name in names])
    left = np.concatenate([found.residuals[name].ravel() for name in names])
    expected = left @ left / (left.size - len(paths)) * np.linalg.inv(rows.T @ rows)
    assert largest(found.covariance / expected - 1.0) < 1e-3
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(errors)


def test_a_system_is_fitted_with_its_initial_value():
    truth = ephs.simulate(damped_oscillator(), 1.0, step=0.05, initial={"osc.pe.q": 1.0})
    start = {"osc.pe.k": 1.0, "mf.d": 0.3, "osc.pe.q": 0.7}
    data = {"t": truth.t, "osc.pe.q": np.where(np.arange(truth.t.size) % 3, truth["osc.pe.q"], np.nan)}
    found = ephs.fit(damped_oscillator(), data, list(start), start=start, step=0.05)
    assert list(found.values.values()) == pytest.approx([1.5, 0.1, 1.0], rel=1e-9)
    assert "osc.pe.k = 1.5" in str(found)


def test_what_a_record_does_not_tell_has_no_error_bound():
    """Mass and stiffness of an oscillator whose displacement alone is seen."""
    truth = ephs.simulate(damped_oscillator(), 1.0, step=0.1, initial={"osc.pe.q": 1.0})
    data = {"t": truth.t, "osc.pe.q": truth["osc.pe.q"]}
    found = ephs.fit(
        damped_oscillator(),
        data,
        ["osc.pe.k", "osc.ke.m", "mf.d"],
        initial={"osc.pe.q": 1.0},
        step=0.1,
        max_evaluations=10,
    )
    assert all(np.isinf(error) for error in found.errors.values())


@pytest.mark.parametrize("size", [1e-12, 1e6])
def test_a_record_of_any_size_gives_the_same(size):
    """The oscillator is linear: its numbers do not depend on the unit of its displacement."""
    run = {"step": 0.05, "initial": {"osc.pe.q": size}}
    truth = ephs.simulate(damped_oscillator(), 1.0, **run)
    data = {"t": truth.t, "osc.pe.q": truth["osc.pe.q"]}
    found = ephs.fit(damped_oscillator(), data, ["osc.pe.k", "mf.d"], start={"osc.pe.k": 4.0, "mf.d": 0.5}, **run)
    assert list(found.values.values()) == pytest.approx([1.5, 0.1], rel=1e-9)
    assert found.converged and found.deviation < 1e-12 * size


def test_a_search_may_begin_at_zero():
    """Which has no size of its own."""
    truth = ephs.simulate(damped_oscillator(), 1.0, step=0.05, initial={"osc.pe.q": 1e-3, "osc.ke.p": 2e-3})
    data = {"t": truth.t, "osc.pe.q": truth["osc.pe.q"]}
    found = ephs.fit(damped_oscillator(), data, ["osc.pe.q", "osc.ke.p"], step=0.05)
    assert list(found.values.values()) == pytest.approx([1e-3, 2e-3], rel=1e-9)
    assert [read(found.model, path) for path in found.values] == list(found.values.values())


def test_masked_entries_of_a_record_are_missing():
    truth = ephs.simulate(damped_oscillator(), 1.0, step=0.05, initial={"osc.pe.q": 1.0})
    hidden = np.arange(truth.t.size) % 3 == 1
    values = np.where(hidden, 7.0, truth["osc.pe.q"])
    run = {"parameters": ["mf.d"], "start": {"mf.d": 0.3}, "step": 0.05, "initial": {"osc.pe.q": 1.0}}
    found = ephs.fit(damped_oscillator(), {"t": truth.t, "osc.pe.q": np.ma.masked_array(values, hidden)}, **run)
    assert found.values["mf.d"] == pytest.approx(0.1, rel=1e-9)


def test_a_longer_record_builds_no_more_equations(monkeypatch):
    built, of = [], Evaluation.__init__
    monkeypatch.setattr(Evaluation, "__init__", lambda self, model: (built.append(model), of(self, model))[1])

    def count(instants):
        built.clear()
        motion = ephs.sensitivity(damped_oscillator(), ["mf.d"], 1.0, step=1.0 / instants, initial={"osc.pe.q": 1.0})
        motion["osc.pe.q"]
        return len(built)

    assert count(5) == count(40) > 0


@pytest.mark.parametrize(
    ("failed", "outcome"), [(2, Outcome.DIVERGED), (2, Outcome.PYTHON), (1, Outcome.DIVERGED)], ids=str
)
def test_where_there_is_no_motion_a_fit_goes_a_shorter_way(monkeypatch, failed, outcome):
    """Unless it is the first run that fails, or a function of the user."""
    run = {"step": 0.05, "initial": {"osc.pe.q": 1.0}}
    truth = ephs.simulate(damped_oscillator(), 1.0, **run)
    data, runs, of = {"t": truth.t, "osc.pe.q": truth["osc.pe.q"]}, [], search.sensitivity

    def failing(*arguments, **options):
        runs.append(arguments)
        if len(runs) == failed:
            raise SimulationError(outcome, 1.0, "osc", "", None)
        return of(*arguments, **options)

    monkeypatch.setattr(search, "sensitivity", failing)
    with nullcontext() if (failed, outcome) == (2, Outcome.DIVERGED) else pytest.raises(SimulationError):
        found = ephs.fit(damped_oscillator(), data, ["mf.d"], start={"mf.d": 0.3}, **run)
        assert found.converged and found.values["mf.d"] == pytest.approx(0.1, rel=1e-9)


def test_a_number_alone_that_no_reading_shows_has_no_error_bound():
    """A rest without a stiffness: what its derivative has is rounding."""
    scene = double_pendulum()
    found = ephs.fit(scene, record(scene, ("j0",), 0.3, 4), ["joints.j0.rest"], **STEPS)
    assert found.values == {"joints.j0.rest": 0.0} and found.errors == {"joints.j0.rest": np.inf}


@pytest.mark.parametrize(
    ("data", "what"),
    [({"osc.pe.q": [0.0]}, "times t"), ({"t": [0.0, 1.0], "osc.pe.q": [0.0]}, "one row a time"),
     ({"t": [0.0, 1.0], "osc.pe.q": [0.0, np.nan]}, "2 or more"),
     ({"t": [1.0, 0.0], "osc.pe.q": [0.0, 1.0]}, "ascending times"),
     ({"t": [0.0, 1.0], "osc.pe.q": ["0", "1"]}, "expected finite numbers"), (None, "times t"),
     ({"t": [0.0, 1.0], "osc.pe.q": [0.0, 1.0j]}, "expected finite numbers"), ([0.0], "'list'.*times t"),
     ({"t": [0.0, 1.0], "osc.pe.q": [0.0, np.inf]}, "expected finite numbers"),
     ({"t": [-0.5, 1.0], "osc.pe.q": [0.0, 1.0]}, r"data\['t'\].*from t0 = 0 s on"),
     ({"t": [0.0], "osc.pe.q": [0.0]}, r"data\['t'\].*from t0 = 0 s on")],
)  # fmt: skip
def test_records_that_do_not_fit_are_refused(data, what):
    with pytest.raises(ephs.OptionError, match=what):
        ephs.fit(damped_oscillator(), data, ["osc.pe.k", "mf.d"], step=0.5)


@pytest.mark.parametrize(
    ("options", "what"),
    [({"start": {"osc.pe.m": 1.0}}, "start.*one of osc.pe.k.*did you mean"),
     ({"bounds": {"osc.pe": (0.0, 1.0)}}, "bounds.*one of"),
     ({"bounds": {"osc.pe.k": (1.0, 0.5)}}, "first below the second"),
     ({"bounds": {"osc.pe.k": 1.0}}, "first below the second"),
     ({"start": {"osc.pe.k": -1.0}}, r"start.*within \[0, inf\]"), ({"start": {"osc.pe.k": np.nan}}, "start.*within"),
     ({"start": {"osc.pe.k": "stiff"}}, "start.*within"), ({"max_evaluations": 0}, "a whole number > 0"),
     ({"sigma": {"osc.pe.q": "1"}}, "a number > 0"),
     ({"sigma": {"osc.pe.k": 1.0}}, "sigma.*one of osc.pe.q"),
     ({"sigma": {"osc.pe.q": 0.0}}, "a number > 0"), ({"sigma": {"osc.pe.q": np.nan}}, "a number > 0"),
     *(({key: value}, f"{key} is .*names with values") for key in ("start", "bounds", "sigma", "initial", "inputs")
       for value in ("x", [1.0], 2.0)),
     ({"metod": "rk87"}, "metod .*no such option.*did you mean 'method'"), ({"save_at": [0.5]}, "no such option"),
     ({"rtol": "fine"}, "rtol is 'fine'"), ({"t0": "now"}, "t0 is 'now'"), ({"t0": 2.0}, "from t0 = 2 s on")],
)  # fmt: skip
def test_options_that_would_change_nothing_or_have_no_meaning_are_refused(options, what):
    data = {"t": [0.0, 0.5, 1.0], "osc.pe.q": [0.1, 0.0, -0.1]}
    run = {"initial": {"osc.pe.q": 0.1}, "step": 0.5, "max_evaluations": 2}
    with pytest.raises(ephs.OptionError, match=what):
        ephs.fit(damped_oscillator(), data, ["osc.pe.k"], **(run | options))
    lawful = {"start": {"osc.pe.k": 1.0}, "bounds": {"osc.pe.k": (0.5, 2.0)}, "sigma": {"osc.pe.q": 1e-3}}
    assert 0.5 <= ephs.fit(damped_oscillator(), data, ["osc.pe.k"], **run, **lawful).values["osc.pe.k"] <= 2.0
