"""The audit of a run: each law finds what breaks it, and nothing else; policies; what is recorded."""

import pickle
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import ephs
from ephs import library as lib
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.auditing import audit as auditing
from ephs.solve.auditing import rounding
from ephs.solve.auditing.audit import CLOSED, COARSE, LAWFUL, LAWS, LEAST, PRODUCTION, Bounds, audit
from ephs.solve.auditing.findings import Audit, Finding
from ephs.solve.auditing.resolution import natural_trials
from ephs.solve.posing.breakpoints import MOST_FOUND
from ephs.solve.running import ending
from ephs.solve.running.control import Control, Tolerance
from examples.failing import oscillator, pendulum
from tests.methods import FIXED_OF_SCENES
from tests.numerics import EPS, largest
from tests.written import scene_of_text

BRAKE = "friction = 20.0"
TIGHT = Bounds(0.0, 0.005, lawful=True)


def brake(rate: float = 6.0) -> ephs.Scene:
    """A rod on a pin with much friction."""
    return pendulum(rate, BRAKE)


def unstable(audit: str) -> ephs.Solution:
    """A run of it by steps that are too long."""
    return ephs.simulate(brake(), 2.0, method="rk54", step=0.1, audit=audit)


@pytest.fixture(scope="module", params=["scene", "system"])
def sound(request) -> ephs.Solution:
    """A run of brake and pendulum that keeps every law, of the scene and of its system."""
    model = brake() if request.param == "scene" else brake().system()
    return ephs.simulate(model, 0.2, method="natural", step=0.005)


def altered(sol: ephs.Solution, **parts) -> ephs.Solution:
    """The solution with other states, ledgers or statistics."""
    given = {"states": sol.states, "ledgers": sol.ledgers, "stats": sol.stats} | parts
    ledgers = given["ledgers"]
    return ephs.Solution(sol.name, sol.t, given["states"], lambda: ledgers, given["stats"], sol.problem, sol.labels)


def bent(sol: ephs.Solution, **ledgers) -> ephs.Solution:
    """The solution with other ledgers."""
    return altered(sol, ledgers=replace(sol.ledgers, **ledgers))


def kick(values, size: float):
    """The values with one that is off, in the middle."""
    out = np.array(values)
    out[len(out) // 2] += size
    return out


def opened(sol: ephs.Solution, by: float) -> ephs.Solution:
    """The solution with its rod apart from the pin at one instant."""
    states = dict(sol.states)
    pose = next(path for path in states if str(path) == "bodies.rod.pe.q")
    states[pose] = states[pose].copy()
    states[pose][10, 4] += by
    return altered(sol, states=states)


def broken(law: str, sol: ephs.Solution, times: float) -> ephs.Solution:
    """The solution with one law broken by so many times what is allowed."""
    ledgers = sol.ledgers
    entropies = float(np.max(sum(np.abs(s - s[0]) for s in ledgers.entropies.values()) + ledgers.made))
    if law == "energy":
        return bent(sol, kinetic=kick(ledgers.kinetic, times * LAWFUL * ledgers.scale))
    if law == "entropy":
        least = -times * PRODUCTION * entropies
        return altered(sol, stats={**sol.stats, "least_production": least})
    if law == "input":
        found = [{"t": 0.1, "input": "joints.pin"}] * int(times * MOST_FOUND)
        return altered(sol, stats={**sol.stats, "jumps": {"declared": 0, "found": found, "divided_steps": 0}})
    if law == "constraint":
        return opened(sol, times * CLOSED * sol.problem.length)
    path, held = next((path, s) for path, s in ledgers.entropies.items() if np.ptp(s))
    return bent(
        sol, entropies={**ledgers.entropies, path: held + np.linspace(0.0, times * LEAST * entropies, len(held))}
    )


@pytest.mark.parametrize("law", [name for name in LAWS if name != "accuracy"])
def test_each_law_finds_what_breaks_it_and_nothing_else(law, sound):
    assert audit(sound, TIGHT).passed
    assert audit(broken(law, sound, 0.5), TIGHT).passed
    (found,) = audit(broken(law, sound, 2.0), TIGHT).findings
    assert found.law == law
    assert found.size == pytest.approx(2.0 * found.allowed, rel=0.2)
    assert found.advice == LAWS[law].advice[0]  # without a method: none is known to accept the problem
    assert 0.0 <= found.at <= sound.t[-1]


def test_a_total_entropy_that_falls_is_found_though_every_component_makes_some(sound):
    ledgers = sound.ledgers
    fallen = bent(sound, entropy=ledgers.entropy - 1e-3 * np.ptp(ledgers.entropy) * (sound.t > 0.1))
    (found,) = audit(fallen, TIGHT).findings
    assert found.law == "entropy"
    assert found.at == pytest.approx(0.105)


def test_findings_say_where(sound):
    (gap,) = audit(opened(sound, 1e-3), TIGHT).findings
    assert (gap.path, gap.at) == ("joints.pin", sound.t[10])
    (unbalanced,) = audit(broken("energy", sound, 1e3), TIGHT).findings
    assert unbalanced.at == pytest.approx(0.1)


def test_what_is_no_number_does_not_pass_and_can_be_written(sound):
    (found,) = audit(bent(sound, kinetic=kick(sound.kinetic, np.nan)), TIGHT).findings
    assert found.law == "energy"
    assert np.isfinite(found.size)


@pytest.mark.parametrize(
    ("lawful", "step", "rtol", "energy", "accuracy"),
    [
        (True, 0.1, 1e-6, LAWFUL, COARSE),
        (True, None, 1e-6, LAWFUL, 1e-4),
        (False, 0.1, 1e-6, COARSE, COARSE),
        (False, None, 1e-6, 1e-4, 1e-4),
        (False, None, 1e-13, LEAST, LEAST),
    ],
)
def test_what_is_allowed_follows_from_method_and_steps(lawful, step, rtol, energy, accuracy):
    control = Control(Tolerance(rtol, {}), Tolerance(1e-9, {}), step, 0.0, np.inf, None)
    bounds = Bounds(control.tolerance, step, lawful)
    assert (bounds.energy, bounds.accuracy, bounds.step) == (pytest.approx(energy), pytest.approx(accuracy), step)


def test_a_run_beyond_stability_does_not_end_well():
    with pytest.raises(ephs.AuditError) as caught:
        unstable("fail")
    error = caught.value
    assert isinstance(error, ephs.SimulationError)
    assert error.outcome is ephs.Outcome.UNLAWFUL
    assert error.partial.t[-1] == 2.0  # the whole solution
    assert {finding.law for finding in error.findings} >= {"energy", "accuracy"}
    assert error.findings == error.partial.audit.findings
    assert pickle.loads(pickle.dumps(error.findings)) == error.findings
    assert error.partial.summary()["audit"] == {
        "passed": False,
        "findings": error.partial.audit.record()["findings"],
    }
    with pytest.warns(ephs.AuditWarning, match="is allowed"):
        warned = unstable("warn")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kept = unstable("off")
        fine = ephs.simulate(brake(), 2.0, method="rk54", step=0.01)
    assert warned.audit == kept.audit == error.partial.audit
    assert fine.audit.passed
    assert fine.summary()["audit"] == {"passed": True, "findings": []}


@pytest.mark.parametrize("policy", ["fail", "off"])
def test_an_audit_that_is_off_is_made_once_it_is_asked_for(policy, monkeypatch):
    made = []
    monkeypatch.setattr(ending, "audit", lambda *given: made.append(1) or audit(*given))
    sol = ephs.simulate(brake(), 0.2, step=0.01, method="rk54", audit=policy)
    assert len(made) == (policy == "fail")
    later = sol[1:]
    assert sol.audit == later.audit and sol.audit.passed
    assert len(made) == 1


def test_an_audit_that_is_off_is_in_the_file(tmp_path):
    run = unstable("off")
    run.save(tmp_path / "run.nc")
    found = ephs.load_solution(tmp_path / "run.nc").audit
    assert not found.passed and found == run.audit


@pytest.mark.parametrize("times", [[2.0], [1.9, 2.0], [0.0, 2.0], []])
@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_instants_that_are_kept_hide_nothing(times, method):
    sol = ephs.simulate(brake(), 2.0, method=method, step=0.1, save_at=times, audit="off")
    assert len(sol) == len(times)
    assert sol.audit.findings[0].law == "energy"


def test_instants_that_are_kept_hide_nothing_of_systems():
    sol = ephs.simulate(oscillator(), 1.0, step=0.1, save_at=[1.0])
    assert sol.audit.passed


def test_an_unknown_policy_is_refused():
    with pytest.raises(ephs.OptionError, match="audit is 'fial', expected one of fail, warn, off; did you mean 'fail'"):
        ephs.simulate(brake(), 1.0, audit="fial")


def test_a_solution_without_audit_passes_and_prints():
    assert str(Audit()) == "passed"
    finding = Finding("energy", 0.5, 1e-9, 0.25, "joints.pin", "take a smaller step")
    assert str(Audit((finding,))) == "energy: 0.5 where 1e-09 is allowed, t = 0.25 s at joints.pin; take a smaller step"
    assert Audit.of_record(Audit((finding,)).record()) == Audit((finding,))


def test_reports_show_findings():
    from ephs.show.report import _audit

    sol = SimpleNamespace(audit=Audit((Finding("entropy", 1.0, 1e-12, 0.5, "joints.pin", "take a smaller step"),)))
    page = _audit({"audit": sol.audit.record()})
    assert "does not pass its audit" in page
    assert "joints.pin" in page
    assert not _audit({"audit": Audit().record()})


def test_what_stands_still_passes_though_all_of_it_is_rounding():
    """A pendulum that hangs, with friction: velocities, heat and entropies are rounding."""
    scene = pendulum(0.0, BRAKE)
    hanging = scene.with_state(coordinates={"pin": 0.5 * np.pi})
    for options in ({"method": "natural", "step": 0.01}, {"method": "rk54"}, {"method": "radau"}):
        sol = ephs.simulate(hanging, 1.0, **options)
        assert sol.kinetic.max() < 1e-12
        assert sol.audit.passed, sol.audit


@pytest.mark.parametrize(
    ("method", "truth"), [("natural", False), ("natural4", False), ("variational", False), ("radau", True)]
)
def test_a_balance_that_hides_an_unresolved_brake_is_found(method, truth):
    """The rod stops at once; steps of 2 ms that damp nothing let it go on for long, in perfect balance."""
    scene = pendulum(6.0, "friction = 1e5")
    options = {"step": 0.002} if not truth else {}
    sol = ephs.simulate(scene, 0.1, method=method, audit="off", **options)
    if truth:
        assert sol.audit.passed
        assert abs(sol.joint("pin").rate[-1, 0]) < 1e-3
        return
    assert sol.energy_error.max() < 1e-9
    assert abs(sol.joint("pin").rate[-1, 0]) > 0.1
    (found,) = sol.audit.findings
    assert (found.law, found.path.partition(".")[0]) in {("accuracy", "bodies"), ("accuracy", "joints")}
    needed = float(found.advice.split()[5])
    assert needed < 1e-4
    short = ephs.simulate(scene, 20 * needed, method=method, step=needed)
    assert short.audit.passed


@pytest.mark.parametrize(("method", "order", "step"), [("natural", 2, 0.1), ("natural4", 4, 0.4)])
def test_the_estimate_is_that_of_an_oscillation(method, order, step):
    """Of an oscillator at hω a method of order p errs by C (hω)ᵖ of what it moves, or less."""
    start, make = {"pe.q": 1.0, "ke.p": 1.0}, METHODS[method].undamped
    runs = {h: ephs.simulate(oscillator(), 3.0, initial=start, method=method, step=h) for h in (step, 0.5 * step)}
    parts = [
        natural_trials(sol, make, h).error(h, sol.stats["steps"], sol.ledgers.scale).size for h, sol in runs.items()
    ]
    sizes = [part / (2.0**order - 1.0) for part in parts]
    assert sizes[0] / sizes[1] >= 0.8 * 2.0**order
    assert sizes[0] < 0.01


@pytest.mark.parametrize("name", FIXED_OF_SCENES)
def test_the_error_of_constant_steps_is_estimated_for_every_method(name, monkeypatch):
    """Of a spring's oscillation it is C (hω)ᵖ of what a step moves, or less; at hω = 2 to 5 the run does not pass."""
    found, order = [], METHODS[name].order
    coarse = 2.0 if order == 2 else 5.0
    spring, rate = pendulum(1.0, "stiffness = 100.0"), 17.0

    def judged(sol, bounds, trials=None):
        error = trials.error(bounds.step, sol.stats["steps"], sol.ledgers.scale)
        found.append(np.nan if error is None else error.size)  # none where energies grow beyond all that steps move
        return audit(sol, bounds, trials)

    monkeypatch.setattr("ephs.solve.running.ending.audit", judged)
    for size in (coarse, 0.1 * order, 0.05 * order):
        sol = ephs.simulate(spring, 20.0 * size / rate, method=name, step=size / rate, audit="off")
        passed = sol.audit.passed
        assert size < 1.0 or not passed
    assert found[1] / found[2] >= 0.7 * 2.0**order


def test_members_of_a_sweep_say_what_was_found():
    scene = brake()
    data = ephs.sweep(scene, {"joints.pin.friction": [0.1, 20.0]}, 2.0, method="rk54", step=0.1, workers=1)
    fine, wrong = data["status"].values.tolist()
    assert fine == "done"
    assert wrong.startswith("energy: ")


@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_entropies_of_radau_are_sums_of_what_is_made(rtol):
    sol = ephs.simulate(brake(), 2.0, method="radau", rtol=rtol)
    ledgers = sol.ledgers
    rounding = 8.0 * len(sol) * EPS * ledgers.made[-1]
    assert largest(ledgers.entropy - ledgers.entropy[0] - ledgers.made) <= rounding
    assert np.diff(ledgers.entropy).min() >= -rounding


GAS = lib.ideal_gas(c1=300.0, c2=2.0, v0=1.0, c=1.5)
UNMOVED = {
    "rubbed": (
        "s: entropy; v: volume; p: momentum, exposed; gas(s, v); rub(p, s)",
        {"gas": GAS, "rub": lib.friction(d=200.0)}, {"gas.v": 1.0}, {"p": {"effort": 1.0}},
    ),
    "fed with heat": (
        "s: entropy, exposed; v: volume; gas(s, v)", {"gas": GAS}, {"gas.v": 1.0}, {"s": {"flow": np.sin}}
    ),
    "fed with heat, beside an oscillator": (
        "s: entropy, exposed; hot(s); q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)",
        {"hot": lib.thermal_capacity(capacity=5.0, temperature=300.0), "pe": lib.spring(k=1.0), "pkc": lib.pkc(),
         "ke": lib.point_mass(m=1.0)}, {"pe.q": 1.0}, {"s": {"flow": np.sin}},
    ),
    "two gases": (
        "s: entropy; v: volume; z: entropy; w: volume; gas(s, v); other(s=z, v=w); wall(s1=s, s2=z)",
        {"gas": GAS, "other": GAS, "wall": lib.heat_transfer(h=0.5)}, {"gas.v": 1.0, "other.v": 0.5}, None,
    ),
}  # fmt: skip
"""Systems in which entropy alone moves, or a part of them, so that no state can take up what a step misses."""


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("name", UNMOVED)
def test_what_no_state_can_take_up_is_allowed_as_the_error_that_it_is(name, rtol):
    text, parts, start, inputs = UNMOVED[name]
    options = {"initial": start, "inputs": inputs, "method": "radau", "save_at": np.linspace(0.0, 3.0, 61)}
    system = ephs.Pattern.from_text(text)(**parts)
    sol = ephs.simulate(system, 3.0, rtol=rtol, atol=1e-3 * rtol, **options)
    assert LAWFUL < sol.energy_error.max() < 10.0 * rtol
    defect = sol.stats["plain_defect"]
    assert defect["left"] == pytest.approx(sol.energy_error.max() * sol.ledgers.scale, rel=0.1)
    kept = altered(sol, stats=sol.stats | {"plain_defect": defect | {"left": 0.0}})
    assert [one.law for one in audit(kept, Bounds(rtol)).findings] == ["energy"], "the control"
    worse = bent(sol, work=kick(sol.work, 3.0 * defect["left"]))
    assert [one.law for one in audit(worse, Bounds(rtol)).findings] == ["energy"], "another"


RESTING = """
format = 1
[bodies.mass]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [FAR, 0.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "mass"]
at = [FAR, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
[springs.spring]
bodies = ["ground", "mass"]
at1 = [ORIGIN, 0.0, 0.0]
at2 = [0.0, 0.0, 0.0]
length = 1.0
stiffness = 1e6
"""


@pytest.mark.parametrize("options", [{"step": 1e-3}, {}])
@pytest.mark.parametrize("far", [2.0, 1000.0])
def test_what_rests_is_not_held_to_the_energy_of_its_rounding(far, options, monkeypatch):
    scene = scene_of_text(RESTING.replace("FAR", repr(far)).replace("ORIGIN", repr(far - 1.0)))
    assert ephs.simulate(scene, 0.1, method="natural4", **options).audit.passed
    for module in (rounding, auditing):
        monkeypatch.setattr(module, "trembling", lambda _: 0.0)
    run = ephs.simulate(scene, 0.1, method="natural4", audit="off", **options)
    assert run.ledgers.scale < 1e-20, "the control: all that moves is rounding, of which the balance is no small part"
    assert not run.audit.passed
