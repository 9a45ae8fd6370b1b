"""Inputs that jump: a mass on a spring, pushed by forces whose effect is known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.hard.case import WEIGHTLESS, read
from benchmarks.hard.pushes import MASS, OMEGA, SPRING, TIMES, error, motion, push, sprung
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.posing import probe
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.probe import WIDTH, ProbedInput
from tests.mechanics.plain import uncorrected
from tests.methods import FIXED_OF_SCENES
from tests.numerics import largest

SCENE = sprung()
UNTIL = 1.0


def run(method, until=UNTIL, function=push, **options):
    return ephs.simulate(SCENE, until, method=method, inputs={"joints.rail": function}, **options)


ADAPTIVE = ["auto", *(name for name, method in METHODS.items() if method.adaptive and method.scenes)]


@pytest.mark.parametrize("method", ADAPTIVE)
def test_chosen_steps_end_on_declared_jumps_and_keep_the_tolerance(method):
    sol = run(method, rtol=1e-5, jumps=TIMES)
    assert set(TIMES) <= set(sol.t.tolist())
    assert error(sol) <= 100.0 * 1e-5
    assert sol.stats["jumps"] == {"declared": 4, "found": [], "divided_steps": 0}


@pytest.mark.parametrize("method", FIXED_OF_SCENES)
def test_constant_steps_keep_their_order_over_jumps_that_divide_them(method):
    with uncorrected():  # corrections are largest where the mass turns back, which a grid meets by chance
        sols = [run(method, step=1.0 / n, jumps=TIMES, audit="off") for n in (30, 60)]
    for n, sol in zip((30, 60), sols, strict=True):
        off = [t for t in TIMES if abs(t * n - round(t * n)) > 1e-6]
        assert set(TIMES) <= set(sol.t.tolist())
        assert sol.stats["jumps"]["divided_steps"] == len(off) == len(sol) - 1 - n
        assert np.abs(sol.t[:, None] - np.arange(n + 1) / n).min(axis=0).max() <= 1e-15
    coarse, fine = map(error, sols)
    order = METHODS[method].order
    assert fine <= max(1.3 * coarse / 2.0**order, 1e-13)


@pytest.mark.parametrize("method", ["natural", "radau", "rk54"])
def test_without_them_constant_steps_are_of_order_one(method, monkeypatch):
    monkeypatch.setattr(probe, "SHARP", np.inf)  # and nothing is found
    assert error(run(method, step=1.0 / 60, audit="off")) > 1e-3


@pytest.mark.parametrize("method", ["rk54", "natural4", "radau"])
def test_jumps_are_found_where_they_are_not_declared(method):
    sol = run(method, rtol=1e-5)
    found = [one["t"] for one in sol.stats["jumps"]["found"]]
    assert found == pytest.approx(TIMES, rel=1e-14)
    assert {one["input"] for one in sol.stats["jumps"]["found"]} == {"joints.rail"}
    assert error(sol) <= 100.0 * 1e-5


@pytest.mark.parametrize(("method", "until"), [("auto", 5.0), ("radau", 5.0), ("natural", 0.5)])
def test_a_pulse_as_wide_as_the_search_is_found_and_a_shorter_one_need_not_be(method, until):
    start = 0.6001 * until
    for width, found in ((1.01 * WIDTH * until, True), (1e-3 * WIDTH * until, False)):
        times, forces = (start, start + width), (0.0, 50.0, 0.0)
        sol = run(method, until, lambda t, e=start + width: 50.0 * (start <= t < e), save_at=[until])
        assert ("jumps" in sol.stats) == found
        size = 50.0 * width / MASS / OMEGA
        assert error(sol, times, forces) <= 0.05 * size if found else largest(sol.joint("rail").coordinate) == 0.0


def test_a_steep_ramp_is_found_by_both_its_ends():
    def ramp(t):
        return float(np.clip((t - 0.5) / 1e-4, 0.0, 1.0))

    sol = run("rk54", function=ramp, rtol=1e-7, max_step=0.1)
    assert error(sol, (0.50005,), (0.0, 1.0)) < 1e-5
    assert len(sol.stats["jumps"]["found"]) >= 1


@settings(max_examples=60)
@given(st.floats(0.1, 300.0), st.floats(0.0, 6.3), st.floats(-5.0, 5.0), st.sampled_from([-1.0, 1.0]))
def test_nothing_is_found_in_smooth_functions(rate, phase, mean, sign):
    asked = ProbedInput("wave", lambda t, _state: mean + np.sin(rate * t + phase), stateful=False)
    found = Breakpoints(0.0, sign, None, [asked])
    t, h = 0.0, min(0.1, 1.0 / rate)
    while abs(t) < 1.0:
        found.end(t, h, dict)
        t += sign * h
    assert not found.stats()


@settings(max_examples=60)
@given(st.floats(0.1, 300.0), st.floats(-5.0, 5.0), st.sampled_from([-1.0, 1.0]), st.floats(1e-5, 2e-3))
def test_a_slope_of_zero_at_the_start_is_no_fast_change(rate, mean, sign, spot):
    """Neither of cosines nor of parabolas; but steep changes as early as these are found."""
    functions = {
        "cosine": lambda t, _state: mean + np.cos(rate * t),
        "parabola": lambda t, _state: mean + rate * t * t,
        "edge": lambda t, _state: mean + np.cos(rate * t) + (1.0 if abs(t) >= spot else 0.0),
    }
    for name, function in functions.items():
        found = Breakpoints(0.0, sign, None, [ProbedInput(name, function, stateful=False)])
        t, h = 0.0, min(0.1, 1.0 / rate)
        while abs(t) < 1.0:
            end = found.end(t, h, dict)
            t = end if 0.0 < abs(end - t) <= h else t + sign * h
        assert bool(found.stats()) == (name == "edge"), name


@settings(max_examples=60)
@given(st.floats(0.01, 0.99), st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 1e-3), st.sampled_from([-1.0, 1.0]))
def test_any_jump_is_found_to_rounding(at, size, sign):
    asked = ProbedInput("edge", lambda t, _state: np.cos(t) + (size if abs(t) >= at else 0.0), stateful=False)
    found = Breakpoints(0.0, sign, None, [asked])
    t = 0.0
    while abs(t) < at:
        end = found.end(t, 0.02, dict)
        t = end if abs(end - t) <= 0.02 else t + sign * 0.02
    assert found.stats()["jumps"]["found"][0]["t"] == pytest.approx(sign * at, rel=1e-13)


def test_functions_of_the_state_are_searched_at_the_states_of_their_steps():
    def control(t, state):
        return push(t) - 2.0 * float(state["joints.rail.pe.q_r"][0])

    sol = run("rk54", function=control, rtol=1e-8)
    assert [one["t"] for one in sol.stats["jumps"]["found"]] == pytest.approx(TIMES, rel=1e-14)


def test_runs_go_backward_over_jumps():
    there = run("rk87", rtol=1e-9, jumps=TIMES)
    initial = {str(path): value for path, value in there.state_at(len(there) - 1).items()}
    back = ephs.simulate(
        SCENE, 0.0, t0=UNTIL, method="rk87", rtol=1e-9, jumps=TIMES, inputs={"joints.rail": push}, initial=initial
    )
    assert set(TIMES) <= set(back.t.tolist())
    assert error(back) <= 1e-7


def test_dense_output_is_piecewise():
    times = np.sort([*np.linspace(0.0, UNTIL, 41), *TIMES, *(np.array(TIMES) - 1e-9), *(np.array(TIMES) + 1e-9)])
    for method in ("rk87", "radau", "natural4"):
        assert error(run(method, rtol=1e-8, jumps=TIMES, save_at=np.unique(times))) <= 1e-5


def test_jumps_of_one_input_among_others():
    assert error(run("rk87", rtol=1e-8, jumps={"joints.rail": TIMES})) <= 1e-6


@pytest.mark.parametrize(
    "jumps",
    [[0.2, 0.1], [0.1, 0.1], [-0.1], [1.5], [np.nan], "soon", [[0.1]], {"joints.other": [0.1]}, {"joints.rail": [2.0]}],
)
def test_jumps_that_are_none_are_one_clear_error(jumps):
    with pytest.raises(ephs.OptionError, match="jumps"):
        run("rk54", jumps=jumps)


def test_noise_is_found_to_be_no_input(monkeypatch):
    for module in ("posing.breakpoints", "auditing.audit"):
        monkeypatch.setattr(f"ephs.solve.{module}.MOST_FOUND", 50)
    rng = np.random.default_rng(1)
    with pytest.raises(ephs.AuditError, match=r"input: .* at joints\.rail"):
        run("rk54", function=lambda t: float(rng.standard_normal() ** 9), max_step=0.3, rtol=1e-1, atol=1e9)


def test_jumps_are_those_of_the_mechanism_in_its_own_units():
    text = SPRING.replace("mass = 2.0", "mass = 2e-9").replace("0.1, 0.1, 0.1", "1e-22, 1e-22, 1e-22")
    light = read(text.replace("18.0", "18.0e-9"), WEIGHTLESS)
    for options in ({"jumps": TIMES}, {}):
        sol = ephs.simulate(light, UNTIL, rtol=1e-6, inputs={"joints.rail": lambda t: 1e-9 * push(t)}, **options)
        found = sol.stats["jumps"]
        assert found["declared"] or [one["t"] for one in found["found"]] == pytest.approx(TIMES, rel=1e-14)
        assert error(sol) <= 1e-4


@pytest.mark.parametrize("options", [{"jumps": TIMES}, {}])
def test_members_of_a_sweep_know_them(options):
    found = ephs.sweep(
        SCENE, {"bodies.mass.mass": [2.0, 2.0, 2.0]}, UNTIL, outputs=["joints.rail.coordinate"], paired=True,
        inputs={"joints.rail": push}, rtol=1e-7, workers=1, **options,
    )  # fmt: skip
    assert set(found["status"].values.tolist()) == {"done"}
    assert found["joints.rail.coordinate"].values[:, -1].ravel() == pytest.approx(motion(UNTIL)[0], abs=1e-5)
