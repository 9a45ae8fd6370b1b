"""An explicit method of one's own is like the built-in ones: both laws, events, instants, audit, derivatives."""

from dataclasses import dataclass

import numpy as np
import pytest

import ephs
from benchmarks.cases import CASES
from ephs.mechanics.methods import registry
from ephs.mechanics.methods.registry import METHODS, register_method
from ephs.mechanics.scene.parameters import read, varied
from tests.numerics import largest
from tests.solve.test_own_methods import Kutta

BY_NAME = {case.name: case for case in CASES}
SCENES = ("heavy-top", "four-bar-windows-1", "revolute-chain-4")


@dataclass(frozen=True)
class Dormand(ephs.Method):
    """The coefficients of rk54, as a user writes them; ``parts`` of a stage change nothing."""

    parts: int = 1

    def stages(self, step):
        from ephs.mechanics.methods.tableaux import A5, B5

        rates = [step.rates()]
        for row in A5:
            rates.append(step.rates(step.h * sum(w * k for w, k in zip(row, rates, strict=True))))
        return step.h * sum(w * k for w, k in zip(B5, rates, strict=True))

    def estimate(self, step, rates, end):
        from ephs.mechanics.methods.tableaux import E5

        return step.h * sum(w * k for w, k in zip(E5, (*rates, end), strict=True))


class Euler(ephs.Method):
    """The explicit Euler method, with an estimate by the trapezoidal rule."""

    def stages(self, step):
        return step.h * step.rates()

    def estimate(self, step, rates, end):
        return step.h * (end - rates[0]) / 2


def places(sol, i=-1):
    return np.concatenate([sol.body(name).position[i] for name, _ in sol.problem.scene.all_bodies()])


@pytest.mark.parametrize("name", SCENES)
def test_the_coefficients_of_rk54_give_its_steps(name):
    scene = BY_NAME[name].scene()
    options = {"rtol": 1e-7, "save_at": np.linspace(0.0, 0.2, 5)}
    own, known = (ephs.simulate(scene, 0.2, method=method, **options) for method in (Dormand(), "rk54"))
    assert own.stats["method"] == "Dormand(parts=1)"
    assert own.stats["steps"] == known.stats["steps"]
    assert all(np.array_equal(places(own, i), places(known, i)) for i in range(5))


@pytest.mark.parametrize("name", SCENES)
def test_a_rule_of_order_4_is_of_order_4_and_keeps_the_energy(name):
    scene, h = BY_NAME[name].scene(), 0.0005
    exact = places(ephs.simulate(scene, 0.1, method="rk87", rtol=1e-12, atol=1e-12))
    runs = [ephs.simulate(scene, 0.1, method=Kutta(), step=step, audit="off") for step in (4 * h, 2 * h)]
    errors = [largest(places(sol) - exact) for sol in runs]
    assert errors[1] <= max(errors[0] / 12.0, 1e-13)
    for sol in runs:
        assert sol.energy_error.max() <= 1e-13 * max(1.0, largest(sol.energy))
    free = ephs.simulate(scene, 0.1, method=Kutta(), rtol=1e-8, atol=1e-8)
    assert largest(places(free) - exact) <= 1e-6
    assert free.audit.passed


def test_a_step_too_long_is_flagged():
    scene = BY_NAME["heavy-top"].scene()
    with pytest.raises(ephs.AuditError, match="take a shorter step"):
        ephs.simulate(scene, 0.3, method=Kutta(), step=0.01)


def test_one_stage_is_enough_and_time_runs_backward():
    scene = BY_NAME["revolute-chain-4"].scene()
    run = {"method": Euler(), "step": 1e-4, "audit": "off"}
    ahead = ephs.simulate(scene, 0.01, **run)
    back = ephs.simulate(scene.at(ahead, 0.01), -0.01, **run)
    assert largest(places(back) - places(ahead, 0)) <= 1e-3


def test_events_are_found_and_a_run_is_resumed(tmp_path):
    scene = BY_NAME["revolute-chain-4"].scene()
    crossing = ephs.Event(lambda t, state: t - 0.0371, "here")
    sol = ephs.simulate(scene, 0.05, method=Kutta(), rtol=1e-7, events=[crossing])
    assert [event.t for event in sol.events] == [pytest.approx(0.0371, abs=1e-9)]
    journal = tmp_path / "run.journal"
    first = ephs.simulate(scene, 0.05, method=Kutta(), rtol=1e-7, journal=journal)
    again = ephs.simulate(scene, 0.05, method=Kutta(), rtol=1e-7, journal=journal)
    assert np.array_equal(places(first), places(again))

    class Other(ephs.Method):
        name = "Kutta"

        def stages(self, step):
            return step.h * step.rates(step.h * step.rates() / 2)

    with pytest.raises(ephs.OptionError, match="coefficients"):
        ephs.simulate(scene, 0.05, method=Other(), rtol=1e-7, journal=journal)


def test_derivatives_are_those_of_its_steps():
    """Of a few constant steps: as neighbouring runs, which rk54 misses."""
    scene, end, h = BY_NAME["revolute-chain-4"].scene(), 0.2, 0.05
    path = next(f"bodies.{name}.mass" for name, body in scene.all_bodies() if body.mass > 0.0)
    joint = next(name for name, _ in scene.all_joints())
    reading = f"joints.{joint}.coordinate"
    value, change = read(scene, path), 1e-4

    def runs(method):
        return [
            ephs.simulate(varied(scene, {path: value * (1.0 + s)}), end, method=method, step=h, audit="off")
            for s in (-change, change)
        ]

    def slope(method):
        low, high = (float(sol.joint(joint).coordinate[-1, 0]) for sol in runs(method))
        return (high - low) / (2.0 * change * value)

    found = ephs.sensitivity(scene, [path], end, method=Kutta(), step=h)
    own = float(np.ravel(found[reading])[-1])
    assert own == pytest.approx(slope(Kutta()), rel=1e-5)
    assert own != pytest.approx(slope("rk54"), rel=1e-5), "a control: another method has another derivative"


class Heun(ephs.Method):
    """Heun's method, with as many stages as the midpoint rule."""

    def stages(self, step):
        k1 = step.rates()
        return step.h * (k1 + step.rates(step.h * k1)) / 2


class Midpoint(ephs.Method):
    """The explicit midpoint rule."""

    def stages(self, step):
        return step.h * step.rates(step.h * step.rates() / 2)


def test_methods_with_as_many_stages_share_a_model_but_no_coefficients():
    scene = BY_NAME["revolute-chain-4"].scene()
    shared = ephs.dynamics(scene)
    for method in (Heun(), Midpoint(), Heun()):
        alone = ephs.dynamics(scene)
        found, expected = (m.step(m.state0, 0.05, method).array for m in (shared, alone))
        assert np.array_equal(found, expected)
    assert not np.array_equal(*(shared.step(shared.state0, 0.05, method).array for method in (Heun(), Midpoint())))


def test_it_is_registered_under_its_name(monkeypatch):
    monkeypatch.setattr(registry, "METHODS", dict(METHODS))
    register_method(Kutta())
    with pytest.raises(ephs.OptionError, match="a name that is not taken"):
        register_method(Kutta())
    scene = BY_NAME["revolute-chain-4"].scene()
    assert ephs.simulate(scene, 0.01, method="Kutta").stats["method"] == "Kutta"


def test_what_is_no_method_is_refused_and_the_old_name_of_an_entry_warns():
    scene = BY_NAME["revolute-chain-4"].scene()
    with pytest.raises(ephs.OptionError, match=r"or an ephs\.Method"):
        ephs.simulate(scene, 0.01, method=Kutta)
    with pytest.warns(DeprecationWarning, match="MethodEntry"):
        assert registry.Method is registry.MethodEntry
