"""What all methods share: control of the step, events, time backwards, registration; and what each one promises."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.cases import CASES
from ephs.mechanics.methods import registry
from ephs.mechanics.methods.registry import METHODS
from tests.methods import OF_SCENES
from tests.numerics import largest
from tests.oscillator import free_oscillator, oscillator
from tests.scenes import shipped
from tests.written import scene_of_text

BY_NAME = {case.name: case for case in CASES}
OSCILLATOR = free_oscillator()
OF_SYSTEMS = [m.name for m in METHODS.values() if m.systems]
ADAPTIVE = [m.name for m in METHODS.values() if m.adaptive and m.scenes]
BALANCED = ("natural", "natural4")


def setting(method: str, step: float = 0.005, tolerance: float = 1e-7) -> dict:
    """Steps chosen where the method can, a constant one else."""
    if METHODS[method].adaptive and method != "natural":
        return {"method": method, "rtol": tolerance, "atol": tolerance}
    return {"method": method, "step": step}


def bodies(sol, i):
    return np.concatenate(
        [np.r_[sol.body(n).position[i], sol.body(n).rotation[i].ravel()] for n, _ in sol.problem.scene.all_bodies()]
    )


# ---- events ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", OF_SYSTEMS)
def test_events_are_located_on_the_oscillator(method):
    event = ephs.Event(lambda t, state: state["pe.q"][0] - 0.5, "half")
    sol = ephs.simulate(OSCILLATOR, 6.0, initial={"pe.q": 1.0}, events=[event], **setting(method, 0.002))
    assert [c.name for c in sol.events] == ["half", "half"]
    assert np.allclose([c.t for c in sol.events], [np.pi / 3, 2.0 * np.pi - np.pi / 3], atol=1e-5)
    assert all(abs(c.state["pe.q"][0] - 0.5) <= 1e-14 for c in sol.events)


@pytest.mark.parametrize("method", OF_SCENES)
def test_an_event_stops_a_scene_where_it_happens(method):
    scene = shipped("chain")
    name = next(n for n, _ in scene.all_bodies())
    path = f"bodies.{name}.pe.q"
    full = ephs.simulate(scene, 0.4, **setting(method, 0.01))
    z = full[path][:, 6]
    height = 0.5 * (z[0] + z[-1])
    event = ephs.Event(lambda t, state: state[path][6] - height, "height", stop=True)
    sol = ephs.simulate(scene, 0.4, events=[event], **setting(method, 0.01))
    assert len(sol.events) == 1 and sol.t[-1] == sol.events[0].t < 0.4
    assert abs(sol[path][-1, 6] - height) <= 1e-13
    if method in BALANCED:
        assert sol.energy_error.max() <= 1e-12


@given(st.floats(0.1, 0.9), st.sampled_from([-1, 0, 1]))
@settings(max_examples=10)
def test_directions_of_events(level, direction):
    event = ephs.Event(lambda t, state: state["pe.q"][0] - level, "level", direction)
    sol = ephs.simulate(OSCILLATOR, 2.0 * np.pi, initial={"pe.q": 1.0}, events=[event], rtol=1e-9, atol=1e-9)
    falls, rises = np.arccos(level), 2.0 * np.pi - np.arccos(level)
    expected = {-1: [falls], 0: [falls, rises], 1: [rises]}[direction]
    assert np.allclose([c.t for c in sol.events], expected, atol=1e-6)


def test_a_function_without_value_is_an_error_that_keeps_the_solution():
    with pytest.raises(ephs.SimulationError, match="an event's function has no value") as caught:
        ephs.simulate(OSCILLATOR, 1.0, initial={"pe.q": 1.0}, events=[lambda t, s: np.nan if t > 0.5 else 1.0])
    assert caught.value.partial is not None and caught.value.partial.t[-1] <= 0.6


# ---- backward -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", OF_SCENES)
def test_there_and_back_again(method):
    """A reversible motion run forward and then backward ends where it began."""
    scene = BY_NAME["spherical-chain-2"].scene()
    there = ephs.simulate(scene, 0.3, **setting(method, 0.005, 1e-9))
    ahead = {str(path): there[path][-1] for path in there.states}
    back = ephs.simulate(scene, 0.0, t0=0.3, initial=ahead, **setting(method, 0.005, 1e-9))
    assert back.t[0] == 0.3 and back.t[-1] == 0.0 and np.all(np.diff(back.t) < 0.0)
    bound = {"natural": 1e-9, "variational": 1e-9}.get(method, 3e-7)
    assert largest(bodies(back, -1) - bodies(there, 0)) <= bound


def test_friction_does_not_run_backward():
    with pytest.raises(ephs.OptionError, match=r"until is -1.*mf produces entropy"):
        ephs.simulate(shipped("mbs"), -1.0)


# ---- steps ----------------------------------------------------------------------------------------------------------


@cache
def exactly(name, until):
    """Where the bodies of a case are, but for rounding."""
    scene = BY_NAME[name].scene()
    return bodies(ephs.simulate(scene, until, method="rk87", rtol=1e-13, atol=1e-13, save_at=[until]), -1)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("name", ["spherical-chain-2", "andrews-squeezer", "revolute-chain-4"])
def test_tolerances_are_met_within_ten(name, method):
    case = BY_NAME[name]
    until = min(case.time, 0.5)
    tolerance = 1e-4 if METHODS[method].order == 2 else 1e-7
    sol = ephs.simulate(case.scene(), until, method=method, rtol=tolerance, atol=tolerance, save_at=[until])
    assert largest(bodies(sol, -1) - exactly(name, until)) <= 10.0 * tolerance
    assert sol.constraint_error.max() <= 1e-10


@pytest.mark.parametrize("method", ADAPTIVE)
def test_steps_keep_their_limits(method):
    scene = BY_NAME["spherical-chain-2"].scene()
    sol = ephs.simulate(scene, 0.2, method=method, rtol=1e-3, atol=1e-3, max_step=0.01)
    assert np.diff(sol.t).max() <= 0.01 * (1.0 + 1e-12)
    assert sol.stats["longest_step"] <= 0.01 * (1.0 + 1e-12)
    with pytest.raises(ephs.SimulationError, match="below the smallest"):
        ephs.simulate(scene, 0.2, method=method, rtol=1e-13, atol=1e-13, min_step=0.05)


def test_a_tolerance_for_one_joint_steers_by_it():
    scene = shipped("chain")
    joint = next(n for n, _ in scene.all_joints())
    loose = ephs.simulate(scene, 1.0, method="rk54", rtol=0.0, atol=1e-3)
    tight = ephs.simulate(scene, 1.0, method="rk54", rtol=0.0, atol={"*": 1e-3, f"joints.{joint}": 1e-9})
    assert tight.stats["steps"] > 2 * loose.stats["steps"]


@pytest.mark.parametrize("former", registry.REPLACED)
def test_names_of_former_methods_take_what_is_in_their_place_with_a_warning(former):
    scene, run = BY_NAME["heavy-top"].scene(), {"rtol": 1e-6, "atol": 1e-9}
    options = {"options": {"rho": 0.8}} if former == "alpha" else {}
    with pytest.warns(FutureWarning, match=registry.REPLACED[former]):
        found = ephs.simulate(scene, 0.02, method=former, **run, **options)
    known = ephs.simulate(scene, 0.02, method=registry.REPLACED[former], **run)
    assert found.stats["method"] == known.stats["method"]
    assert np.array_equal(bodies(found, -1), bodies(known, -1))


def test_systems_without_bodies_are_left_to_radau():
    with pytest.raises(ephs.OptionError, match="method is 'semi', expected radau, which took its place for systems wi"):
        ephs.simulate(OSCILLATOR, 1.0, initial={"pe.q": 1.0}, method="semi", step=0.1)
    sol = ephs.simulate(OSCILLATOR, 1.0, initial={"pe.q": 1.0}, method="radau", step=0.1)
    assert sol["pe.q"][-1] == pytest.approx(np.cos(1.0), abs=1e-6)


@pytest.mark.parametrize("method", OF_SCENES)
def test_initial_states_off_the_joints_are_refused(method):
    scene = shipped("slider-crank")
    first = ephs.simulate(scene, 1e-3)
    moved = np.array(first["bodies.crank.pe.q"][0])
    moved[4] += 0.01
    with pytest.raises(ephs.AssemblyError, match=r"leave a joint open by 1\.0e-02"):
        ephs.simulate(scene, 0.1, initial={"bodies.crank.pe.q": moved}, **setting(method))
    with pytest.raises(ephs.AssemblyError, match=r"^bodies\.\w+\.ke\.p: the initial value contradicts the joints"):
        ephs.simulate(scene, 0.1, initial={"bodies.crank.ke.p": np.ones(6)}, **setting(method))


# ---- promises -------------------------------------------------------------------------------------------------------

FREE = """
[bodies.one]
mass = 0.5
inertia = [0.04, 0.03, 0.04, 0.01, 0.0, 0.0]
[bodies.two]
mass = 2.0
inertia = [0.07, 0.15, 0.13]
[joints.one]
type = "free"
bodies = ["ground", "one"]
frame1 = { position = [-0.8, 0.9, 0.1], rotation = [0.8, -0.4, -0.4, 0.2] }
frame2 = { position = [1.5, 0.2, 0.3], rotation = [0.8, 0.0, 0.0, 0.6] }
friction = [0.1, 0.4, 0.2, 0.2, 0.2, 0.2]
[joints.two]
type = "free"
bodies = ["ground", "two"]
frame1 = { position = [-0.9, 0.2, -0.7], rotation = [0.9, -0.3, -0.3, -0.1] }
frame2 = { position = [-0.3, -0.5, 0.8], rotation = [0.9, -0.1, -0.3, -0.3] }
friction = [0.3, 0.2, 0.2, 0.3, 0.5, 0.2]
"""


@pytest.mark.parametrize("method", BALANCED)
def test_a_force_that_is_zero_but_for_rounding_stops_no_step(method):
    scene, rng = scene_of_text("format = 1\nname = 'free'\n" + FREE), np.random.default_rng(3)
    for _ in range(60):
        pose, rate = rng.uniform(-1.0, 1.0, (2, 2, 6))
        start = scene.with_state(
            coordinates=dict(zip(("one", "two"), pose, strict=True)), rates={"one": rate[0], "two": rate[1]}
        )
        assert ephs.simulate(start, 0.01, method=method, step=2e-3).stats["cut_steps"] == 0


@pytest.mark.parametrize("step", [2e-3, 1e-3])
def test_what_repeats_by_build_stays_left_out(step):
    """Bricard's loop is closed once too often wherever it is; rounding in what is left out must not count as rank."""
    sol = ephs.simulate(shipped("bricard"), 1.0, method="natural", step=step)
    assert sol.energy_error.max() <= 1e-12 and sol.constraint_error.max() <= 1e-12
    assert sol.stats["dependent_equations"] == 1


def test_natural4_is_of_order_four_with_friction_heat_and_loops():
    scene = shipped("slider-crank")
    exact = bodies(ephs.simulate(scene, 0.3, method="rk87", rtol=1e-13, atol=1e-13), -1)
    errors = [largest(bodies(ephs.simulate(scene, 0.3, method="natural4", step=h), -1) - exact) for h in (0.02, 0.01)]
    assert np.log2(errors[0] / errors[1]) >= 3.9


def test_feedback_keeps_the_order_of_natural4():
    """A force that reads the state is taken at the stages themselves."""
    system = oscillator(k=1.0)
    inputs = {"p": {"flow": lambda t, state: -0.5 * state["pe.q"]}}
    exact = np.cos(2.0 * 1.5**0.5)
    errors = [
        abs(
            ephs.simulate(system, 2.0, initial={"pe.q": 1.0}, inputs=inputs, method="natural4", step=h)["pe.q"][-1]
            - exact
        )
        for h in (0.2, 0.1)
    ]
    assert np.log2(errors[0] / errors[1]) >= 3.9


STIFF = """
format = 1
[bodies.a]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.0, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "a"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
friction = 1e5
stiffness = 1.0
"""


@pytest.mark.parametrize("method", ["auto", *(name for name in OF_SCENES if not METHODS[name].posed)])
@pytest.mark.parametrize("form", ["scene", "system"])
def test_where_nothing_is_nothing_moves(method, form):
    scene = scene_of_text('format = 1\nname = "nothing"\n')
    sol = ephs.simulate(
        scene if form == "scene" else scene.system(), 0.1, **(setting(method) if method in METHODS else {})
    )
    assert not sol.states and sol.t[-1] == 0.1


def test_auto_changes_to_radau_where_a_scene_is_stiff():
    scene = scene_of_text(STIFF)
    sol = ephs.simulate(scene, 10.0)
    (switch,) = sol.stats["switches"]
    assert switch["to"] == "radau" and "radau" in sol.stats["method"]
    assert "holds its steps" in switch["reason"] or "fail" in switch["reason"]
    assert sol.stats["steps"] < 1000
    slow = ephs.simulate(
        scene, 10.0, method="radau", rtol=1e-9, atol=1e-9, audit="off"
    )  # 1.4e-7 of the heat is missing
    assert largest(bodies(sol, -1) - bodies(slow, -1)) <= 1e-5


def test_auto_stays_explicit_where_nothing_is_stiff():
    sol = ephs.simulate(BY_NAME["spherical-chain-2"].scene(), 1.0, rtol=1e-8)
    assert sol.stats["switches"] == [] and sol.stats["method"] == "rk87"
