"""The entropy that searched components make is looked at in every step; a destruction beyond rounding is a fault."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs import Pattern, library
from ephs import quantity as Q
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.operad import Path
from ephs.solve.auditing.production import Production
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.stepping import Row
from examples.failing import driving
from tests.semantics.zoo import conduct, drag, hidden

SYSTEMS = [method.name for method in METHODS.values() if method.systems]


def walls(*parts):
    """Two bodies of 300 K with these between them."""
    between = {f"wall{i}": part for i, part in enumerate(parts)}
    text = "a: entropy; b: entropy; hot(s=a); cold(s=b);" + "".join(f"{name}(a, b);" for name in between)
    body = library.thermal_capacity(c1=300.0, c2=1.0)
    return Pattern.from_text(text)(hot=body, cold=body, **between)


SEEN, HIDDEN = conduct(lambda a, b: 2.0)(), conduct(hidden(lambda a, b: 2.0))()


def watch(system, sign=1.0):
    """The watch, and how many states and components there are, at rest with nothing made so far."""
    problem = problem_of_system(system, None)
    found = Production(problem, sign)
    d = problem.descriptor
    x, energies = d.pack(problem.initial), np.zeros(len(d.components))
    found.start(Row(x, energies, np.zeros(4)))
    at = {str(slot.path): i for i, slot in enumerate(d.components)}
    return found, SimpleNamespace(x=x, energies=energies, at=at)


def test_what_is_proved_is_not_watched():
    assert not watch(walls(SEEN))[0].active
    assert watch(walls(SEEN, HIDDEN))[0].active


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_destruction_beyond_rounding_names_the_component_and_the_size(sign):
    found, run = watch(walls(SEEN, HIDDEN), sign)
    proved, searched = run.at["wall0"], run.at["wall1"]
    moved = run.x + 1e-3
    run.energies[proved] = -sign  # not looked at
    found.step(0.1, Row(moved, run.energies, np.zeros(4)))
    worse = run.energies.copy()
    worse[searched] -= sign * 1e-17  # of 2e-3 J/K exchanged, rounding
    found.step(0.2, Row(moved + 1e-3, worse, np.zeros(4)))
    bad = worse.copy()
    bad[searched] -= sign * 1e-9
    with pytest.raises(SolveError) as caught:
        found.step(0.3, Row(moved + 2e-3, bad, np.zeros(4)))
    assert (caught.value.outcome, caught.value.path) == (Outcome.ENTROPY, "wall1")
    assert "-1e-09 J/K in the step to t = 0.3 s" in caught.value.equation


@pytest.mark.parametrize("method", SYSTEMS)
def test_a_run_in_equilibrium_is_none_that_destroys_entropy(method):
    """Rounding makes and destroys next to nothing."""
    solution = ephs.simulate(walls(HIDDEN), 1.0, method=method, step=0.1, audit="off")
    assert solution.t[-1] == 1.0


@pytest.mark.parametrize("method", SYSTEMS)
def test_the_steps_before_are_kept(method):
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(driving(), 1.0, method=method, step=1e-4, initial={"ke.p": 7.75})
    assert caught.value.path == "mf" and caught.value.time == caught.value.partial.t[-1] == 0.0


def test_domains_are_bounds_of_ports():
    energy = {"ports": {"s": Q.entropy}, "energy": lambda s: 300.0 * s + 50.0 * s**2}
    body = ephs.storage(**energy, domain={"s": (-2.9, np.inf)})
    assert body.verdict == "proved" and body.kernel is not None
    (port,) = body.bundle.ports
    assert np.isnan(body.energy({port: np.array([-2.95])})) and np.isnan(body.energy_gradient({port: np.array([-3.0])}))
    with pytest.raises(ephs.StructureError, match="witness: s = -3"):
        ephs.storage(**energy, domain={"s": (-3.5, np.inf)})
    for wrong in ({"x": (0.0, 1.0)}, {"s": (1.0, 1.0)}):
        with pytest.raises(ephs.StructureError, match="parameter domain of"):
            ephs.storage(**energy, domain=wrong)
    slow = drag(lambda p, s: 1.0 - 0.01 * p * p, domain={"p": (-9.0, 9.0)})()
    assert slow.verdict == "proved"


def heated(conduction):
    """A body with a resistor on it, and one with which it exchanges heat."""
    pattern = Pattern.from_text(
        "b: flux_linkage, exposed; a: entropy; s: entropy; coil(b, s); other(s=a); body(s); wall(a, b=s)"
    )
    bodies = {name: library.thermal_capacity(c1=300.0 * c, c2=c) for name, c in (("other", 60.0), ("body", 20.0))}
    return pattern(coil=library.resistor(r=100.0), wall=conduction, **bodies)


CONDUCTANCES = {"linear": lambda a, b: 1.5 + 0.0 * a, "radiation": lambda a, b: 4e-8 * (a * a + b * b) * (a + b)}


@pytest.mark.parametrize("law", CONDUCTANCES)
@pytest.mark.parametrize("steps", [{"step": 4.0}, {"rtol": 1e-4}, {"rtol": 1e-8}], ids=str)
@pytest.mark.parametrize("ahead", [3.0, 12.0, 40.0])
def test_heat_that_turns_around_within_a_step_makes_the_entropy_of_its_component(law, steps, ahead):
    """The other body begins hotter by some K, and is overtaken: no component loses entropy, and each makes its own."""
    k, current, until = CONDUCTANCES[law], 0.8, 60.0
    start, inputs = {"other.s": 60.0 * np.log1p(ahead / 300.0)}, {"b": {"effort": current}}
    sol = ephs.simulate(heated(conduct(k)()), until, initial=start, inputs=inputs, method="radau", **steps)

    def rates(_, y):
        a, b = y[:2]
        passed, heat = k(a, b) * (a - b), 100.0 * current**2
        return [-passed / 60.0, (passed + heat) / 20.0, passed * (1.0 / b - 1.0 / a), heat / b]

    exact = solve_ivp(rates, (0.0, until), [300.0 + ahead, 300.0, 0.0, 0.0], rtol=1e-11, atol=1e-12).y[2:, -1]
    found = np.array([sol.ledgers.makers[Path.of(path)][-1] for path in ("wall", "coil")])
    assert np.all(np.abs(found - exact) <= 10.0 * steps.get("rtol", 1e-4) * exact.sum())
