"""Every way to fail: the outcome, when, where, why, what to do, and what was computed until then."""

import re
from contextlib import suppress

import numpy as np
import pytest

import ephs
from ephs import Outcome
from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.registry import METHODS, MethodEntry, on_joints
from ephs.solve.methods.solvers import dense
from ephs.solve.posing.errors import SolveError
from ephs.solve.running import loop
from examples.failing import oscillator, pendulum, scene
from examples.failures import ALL, CASES, ELSEWHERE, Case, pushed, runs
from tests.numerics import largest
from tests.oscillator import free_oscillator
from tests.scenes import ROOT
from tests.written import scene_of_text


def named(error: ephs.SimulationError) -> bool:
    """Whether the path is that of a component, a state, a junction, a port, or of something in a scene."""
    partial = error.partial
    if not error.path or partial is None:
        return not error.path
    d = partial.problem.descriptor
    known = {str(slot.path) for slots in (d.components, d.states, d.junctions, d.outer) for slot in slots}
    return any(path == error.path or path.startswith(f"{error.path}.") for path in known)


@pytest.fixture
def asked(monkeypatch):
    """Progress is told at every step."""
    monkeypatch.setattr(loop, "RESPONSE", -1.0)


@pytest.mark.usefixtures("asked")
@pytest.mark.parametrize(
    ("case", "method"),
    list(runs()),
    ids=lambda value: value if isinstance(value, str) else value.words.replace(" ", "-"),
)
def test_a_failure_says_what_when_where_why_and_keeps_what_there_is(case: Case, method: str, capfd):
    with pytest.raises(ephs.SimulationError) as caught:
        case.run(method)
    error, partial = caught.value, caught.value.partial
    assert error.outcome is case.outcome and isinstance(error, ephs.Interrupted) is (
        case.outcome is Outcome.INTERRUPTED
    )
    assert case.within[0] <= error.time <= case.within[1]
    assert re.fullmatch(case.path, error.path) and named(error)
    assert re.search(case.equation, error.equation) if case.equation else not error.equation
    assert str(error).endswith(error.advice) and case.outcome.value in str(error)
    other = re.search(r", or take (\w+), which .*$", error.advice)
    stiff = re.search(r", or make \S+ softer, or rigid: a joint in its place", error.advice)
    assert error.advice == "".join([case.outcome.advice, *(found[0] for found in (stiff, other) if found)])
    if other:  # a method that is not in use, and accepts the problem
        assert other[1] != method
        with suppress(ephs.SimulationError):
            case.run(other[1])
    assert capfd.readouterr().err == ""
    assert all(np.isfinite(values).all() for values in partial.states.values())
    if len(partial):
        assert partial.t[-1] == error.time
    if len(partial) > 1 and case.step is not None and METHODS[method].fixed:
        assert_prefix(case, method, partial)


def assert_prefix(case: Case, method: str, partial: ephs.Solution) -> None:
    """What is kept is what a run that ends there finds."""
    whole = case.run(method, float(partial.t[-1]), audit="off")
    assert np.allclose(whole.t, partial.t, rtol=1e-14, atol=0.0)
    for path, values in partial.states.items():
        size = float(largest(values, initial=0.0))
        assert largest(whole[str(path)] - values) <= 1e-9 * size


def test_every_outcome_has_its_case():
    assert {case.outcome for case in CASES} ^ set(ELSEWHERE) == set(Outcome)
    assert all(outcome.advice for outcome in Outcome)


def test_what_only_falls_has_no_rest():
    falling = oscillator(lambda q: -9.81 * q)
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.equilibrium(falling)
    assert caught.value.outcome is Outcome.RESTLESS and caught.value.advice and caught.value.equation
    assert caught.value.partial is None


def test_the_page_has_every_outcome():
    page = (ROOT / "docs/failures.md").read_text("utf-8")
    assert "for outcome in ephs.Outcome" in page and "from examples.failures import CASES" in page


def test_auto_fails_by_the_same_names():
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(pendulum(), 0.2, **pushed(ValueError("lost"))())
    assert caught.value.outcome is Outcome.INPUT and caught.value.path == "joints.pin"


@pytest.mark.parametrize("method", ALL)
def test_an_input_that_has_no_value_to_begin_with_is_told_before_the_run(method):
    with pytest.raises(
        ephs.SimulationError, match=r"t = 2 s at joints\.pin: an input's function has no value"
    ) as caught:
        ephs.simulate(pendulum(), 3.0, t0=2.0, method=method, step=0.01, inputs={"joints.pin": lambda t: "much"})
    assert caught.value.time == 2.0 and caught.value.partial is None


@pytest.mark.parametrize("model", [pendulum(), free_oscillator()], ids=["scene", "system"])
@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"until": "soon"}, "until is 'soon'"),
        ({"until": "1.0"}, "until is '1.0', expected a number of seconds"),
        ({"until": True}, "until is True"),
        ({"until": np.inf}, "until is inf"),
        ({"until": 0.0}, "until is 0.0"),
        ({"t0": None}, "t0 is None"),
        ({"t0": 1e9, "until": 1e9 + 1.0, "step": 1e-9}, "step is 1e-09, expected at least 1.91e-06 s"),
        ({"t0": 1e16, "until": 1e16 + 8.0}, "at least 2e\\+06 s from t0"),
        ({"rtol": "1e-3"}, "rtol is '1e-3'"),
        ({"rtol": -1.0}, "rtol is -1.0"),
        ({"rtol": np.nan}, "rtol is nan"),
        ({"rtol": 0.0, "atol": 0.0}, "rtol or atol > 0"),
        ({"atol": np.nan}, "atol is nan"),
        ({"atol": {"entropy": False}}, r"atol\['entropy'\] is False"),
        ({"atol": {"entropi": 1e-3}}, r"atol\['entropi'\]"),
        ({"step": [0.1, 0.2]}, r"step is \[0.1, 0.2\]"),
        ({"step": np.nan}, "step is nan"),
        ({"step": -0.1}, "step is -0.1, expected a number of seconds > 0"),
        ({"step": 0.0}, "step is 0.0"),
        ({"step": 1e-20}, "step is 1e-20, expected at least"),
        ({"min_step": "short"}, "min_step is 'short'"),
        ({"min_step": -1.0}, "min_step"),
        ({"min_step": 1.0, "max_step": 0.1}, "min_step is 1.0"),
        ({"max_step": -1.0}, "max_step is -1.0"),
        ({"max_step": 0.0}, "max_step is 0.0"),
        ({"max_steps": "many"}, "max_steps is 'many'"),
        ({"max_steps": 2.5}, "max_steps is 2.5, expected a whole number > 0"),
        ({"max_steps": 0}, "max_steps is 0"),
        ({"max_steps": 3, "step": 0.1}, "max_steps.*10 steps"),
        ({"progress": 3}, "progress is 3, expected a function"),
        ({"jumps": ["0.5"]}, r"jumps is \['0.5'\]"),
        ({"options": 3}, "options is 3"),
        ({"options": {"rho": 0.5}, "method": "rk54"}, "options of rk54: keep"),
        ({"save_at": ["now"]}, r"save_at is \['now'\]"),
        ({"save_at": ["0.5"]}, r"save_at is \['0.5'\]"),
        ({"save_at": [2.0]}, r"times in \[0.0, 1.0\]"),
        ({"save_at": [0.5, 0.2]}, "save_at.*ascending"),
        ({"events": [3]}, "events is 3"),
        ({"events": [ephs.Event(len, "a"), ephs.Event(len, "a")]}, "names that differ"),
        ({"method": "rk45"}, f"method is 'rk45', expected one of auto, {', '.join(METHODS)}, or an "),
        ({"method": "variational"}, "takes constant steps"),
        ({"form": "shiny"}, "form is 'shiny', expected .*reduced"),
        ({"form": "folded", "method": "radau"}, "form is 'folded', expected reduced"),
        ({"form": "paper", "method": "rk87"}, "form is 'paper', expected reduced"),
    ],
)
def test_options_that_are_none_are_refused_by_name(given, wanted, model):
    with pytest.raises(ephs.OptionError, match=wanted):
        ephs.simulate(model, **{"until": 1.0, **given})


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"inputs": {"joints.pin": np.nan}}, "joints.pin: the input is nan, expected 1 finite number"),
        ({"inputs": {"joints.pin": [1.0, 2.0]}}, "joints.pin: the input is"),
        ({"inputs": {"bodies.rod": "much"}}, "bodies.rod: the input is 'much', expected 6 finite numbers"),
        ({"inputs": {"nothing": 1.0}}, "nothing"),
        ({"initial": {"joints.pin.pe.x": 1.0}}, r"joints\.pin\.pe\.x.*joints\.pin\.pe\.q_r"),
        ({"initial": {"joints.pin.pe.q_r": [1.0, 2.0]}}, r"joints\.pin\.pe\.q_r.*\(1,\)"),
        ({"initial": {"joints.pin.pe.q_r": "left"}}, "joints.pin.pe.q_r: the initial value is left"),
        ({"initial": {"joints.pin.pe.q_r": np.inf}}, r"joints.pin.pe.q_r: the initial value is \[inf\]"),
    ],
)
def test_values_that_are_none_are_refused_by_name(given, wanted):
    with pytest.raises(ephs.AssemblyError, match=wanted):
        ephs.simulate(pendulum(), 1.0, **given)


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.full((2, 2), np.nan), np.array([[1.0, 1.0], [1.0, 1.0]]) + 0j])
def test_a_matrix_without_factors_is_an_outcome_and_no_warning(matrix):
    with pytest.raises(SolveError) as caught:
        dense(matrix, lambda _: SolveError(Outcome.SINGULAR, "", ""))
    assert caught.value.outcome is Outcome.SINGULAR


def test_arithmetic_of_a_method_of_ones_own_fails_by_name():
    class Wrong(ReducedMethod):
        name, exponent = "wrong", 2.0

        def step(self, state, h):
            if state.t > 0.05:
                np.linalg.inv(np.zeros((2, 2)))
            return mine.step(state, h)

    def make(equations, control):
        nonlocal mine
        mine = Explicit(equations, control, tableau("rk54"))
        return Wrong(equations, control)

    mine: object = None
    method = MethodEntry("wrong", 5, False, True, False, True, "", on_joints(make))
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(pendulum(), 1.0, step=0.01, method=method)
    assert caught.value.outcome is Outcome.SINGULAR and caught.value.equation == "Singular matrix"
    assert len(caught.value.partial) > 5


@pytest.mark.parametrize("method", ["natural", "radau", "rk54"])
@pytest.mark.parametrize("key", ["gravity", "mass", "position", "velocity", "at", "stiffness", "friction", "drive"])
@pytest.mark.parametrize("value", ["9e99", "1e-300"])
def test_numbers_at_the_edge_of_what_there_is_end_a_run_by_name_or_not_at_all(key, value, method):
    numbers = {"gravity": "-9.81", "mass": "1.0", "position": "0.5", "velocity": "0.0", "at": "0.0"}
    numbers |= {"stiffness": "1.0", "friction": "0.1", "drive": "0.1"} | {key: value}
    try:
        sol = ephs.simulate(swing(**numbers), 0.02, method=method, step=0.01)
    except (ephs.SimulationError, ephs.SceneError, ephs.StructureError) as error:
        assert str(error)
    else:
        assert all(np.isfinite(values).all() for values in sol.states.values())


def swing(gravity, mass, position, velocity, at, stiffness, friction, drive) -> ephs.Scene:
    """A rod on a pin that has everything."""
    return scene(
        f"""
    [bodies.rod]
    mass = {mass}
    inertia = [0.1, 0.1, 0.01]
    position = [{position}, 0.0, 0.0]
    velocity = [0.0, 0.0, {velocity}]
    [assembly]
    adjust = true
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "rod"]
    at = [{at}, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    stiffness = {stiffness}
    friction = {friction}
    drive = {drive}
    """,
        f"[world]\ngravity = [0.0, 0.0, {gravity}]\n",
    )


SPRUNG = """
format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[assembly]
adjust = true
[bodies.hub]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.0, 0.0, 0.0]
angular_velocity = [0.0, 0.0, RATE]
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
elements = 4
section = { circle = 0.01, E = 3e6, nu = 0.3, rho = 1000.0 }
ends = ["ground", "hub"]
"""


@pytest.mark.parametrize(("rate", "until"), [("6.0", 1.6), ("2.0", 0.5)])
def test_an_element_that_is_bent_by_half_a_turn_is_named(rate, until):
    """Its strain is a logarithm, which ends there; the stiffness of the rod is not to blame."""
    scene = scene_of_text(SPRUNG.replace("RATE", rate))
    if rate == "2.0":
        assert ephs.simulate(scene, until, method="rk54", rtol=1e-4).t[-1] == until
        return
    with pytest.raises(
        ephs.SimulationError, match=r"joints\.rod-4\.pe has turned by half a turn.*more elements"
    ) as told:
        ephs.simulate(scene, until, method="rk54", rtol=1e-4)
    assert "fastest" not in str(told.value)
