"""Explicit steps as staged functions: orders, references, control, endings."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ephs
from benchmarks import families
from ephs.semantics.stage import Entry, Program, Vector, real, table, vector
from ephs.solve.march.control import DAMPING, HELD, STRICT, UNFELT, Proportional, held_back, length
from ephs.solve.march.records import Ending, MarchControl
from ephs.solve.march.steps import STEPS
from tests.numerics import EPS, largest
from tests.solve.marching import Field, Plain, field, program, start


def kepler(on, y, out, parameters):
    """A planet about a fixed sun."""
    square = y[0] * y[0] + y[1] * y[1]
    cube = square * on.sqrt(square)
    out[0], out[1], out[2], out[3] = y[2], y[3], -y[0] / cube, -y[1] / cube
    return 0


def van_der_pol(on, y, out, parameters):
    """ÿ = μ (1 − y²) ẏ − y."""
    out[0], out[1] = y[1], parameters[0] * (1.0 - y[0] * y[0]) * y[1] - y[0]
    return 0


def decay(on, y, out, parameters):
    """ẏ = −λ y."""
    out[0] = -parameters[0] * y[0]
    return 0


def guarded(on, y, out, parameters):
    """ẏ = 1, refused with status 13 beyond y = parameters[0]."""
    out[0] = 1.0
    return on.select(y[0] > parameters[0], 13, 0)


@dataclass(frozen=True)
class Pendulum(Plain):
    """q̈ = −c sin q with the element q, and y = (v, r, s) with an entropy that nothing changes."""

    parameters: Vector

    increments = freedoms = 1
    summed = counted = 3
    closes = False

    def rates(self, on, base, y, q, out):
        q[0] = base[0] + y[0]
        out[0], out[1], out[2] = y[1], -self.parameters[0] * on.sin(q[0]), 0.0
        return 0, 0

    def settle(self, on, base, y, q):
        q[0] = base[0] + y[0]
        return 0

    def correct(self, on, account, h, start, y, q, allowed):
        return 0

    def sizes(self, on, y0, y1, out):
        for j in (1, 2):
            out[j] = on.maximum(on.absolute(y0[j]), on.absolute(y1[j]))
        out[0] = 1.0

    def project(self, on, q, change):
        raise AssertionError


KEPLER, VAN_DER_POL, DECAY, GUARDED = (
    field(function).compiled()["run"] for function in (kepler, van_der_pol, decay, guarded)
)
PENDULUM = program(lambda parameters, size: Pendulum(parameters)).compiled()["run"]
ORBIT = [0.5, 0.0, 0.0, np.sqrt(3.0)]
"""Eccentricity 1/2, at the perihelion; the period is 2π."""
METHODS = ("rk54", "rk87")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.5, 3.0])
def test_another_program_finds_the_same_motion(method, mu):
    instants = np.linspace(0.5, 8.0, 6)
    run = start(VAN_DER_POL, method, [2.0, 0.0], 8.0, parameters=(mu,), rtol=1e-10, atol=1e-10, times=instants)
    assert run.advance(100_000) is Ending.DONE
    other = solve_ivp(
        lambda _, y: [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]], (0.0, 8.0), [2.0, 0.0], method="LSODA",
        rtol=1e-12, atol=1e-12, t_eval=instants,
    )  # fmt: skip
    found, states = run.rows()
    assert np.array_equal(found, instants)
    assert largest(states - other.y.T) <= 1e3 * 1e-10


@pytest.mark.parametrize(("method", "order", "steps"), [("rk54", 5, (40, 80)), ("rk87", 8, (10, 20))])
def test_orders_are_those_of_the_tableaux(method, order, steps):
    exact = start(KEPLER, "rk87", ORBIT, 1.0, grid=1.0 / 160)
    exact.advance(1000)
    errors = []
    for count in steps:
        run = start(KEPLER, method, ORBIT, 1.0, grid=1.0 / count)
        assert run.advance(1000) is Ending.DONE
        assert run.c.steps == count
        errors.append(largest(run.arrays["y"] - exact.arrays["y"]))
    assert order - 0.5 <= np.log2(errors[0] / errors[1]) <= order + 1.0


@pytest.mark.parametrize("method", METHODS)
@given(pause=st.integers(1, 30))
@settings(max_examples=8)
def test_a_march_that_was_broken_off_and_taken_up_is_the_same(method, pause):
    options = {"times": np.linspace(0.1, 3.0, 7)}
    whole = start(KEPLER, method, ORBIT, 3.0, **options)
    first, second = (start(KEPLER, method, ORBIT, 3.0, **options) for _ in range(2))
    assert whole.advance(1000) is Ending.DONE
    if first.advance(pause) is not Ending.DONE:
        second.restore(first.snapshot())
        assert second.advance(1000) is Ending.DONE
    else:
        second = first
    assert second.arrays["y"].tobytes() == whole.arrays["y"].tobytes()
    assert second.control.reals.array.tobytes() == whole.control.reals.array.tobytes()
    kept = [run.rows()[1] for run in ((first, second) if second is not first else (first,))]
    assert np.vstack(kept).tobytes() == whole.rows()[1].tobytes()


@pytest.mark.parametrize("method", METHODS)
def test_what_is_kept_does_not_change_the_steps(method):
    one, two = (start(KEPLER, method, ORBIT, 3.0, times=times) for times in (None, np.linspace(0.1, 3.0, 9)))
    assert one.advance(1000) is two.advance(1000) is Ending.DONE
    assert one.arrays["y"].tobytes() == two.arrays["y"].tobytes()
    assert len(one.rows()[0]) == one.c.steps == two.c.steps


@pytest.mark.parametrize("method", METHODS)
def test_a_pendulum_takes_the_steps_of_a_mechanism(method):
    """The same control in another evaluation: a scene's steps differ by the rounding of its sweeps only.

    Estimates of the first, short steps are rounding. Tolerances are such that these grow by as much as steps may.
    """
    allowed = 1e-8 if method == "rk54" else 1e-4
    sol = ephs.simulate(families.scene("revolute-chain", 1), 2.0, method=method, rtol=allowed, atol=allowed)
    inertia = families.MASS * families.LENGTH**2 / 4.0 + families.THICK[1]
    stiffness = families.MASS * 9.81 * 0.5 * families.LENGTH / inertia
    angle = sol.joint("j0").coordinate[:, 0]
    first = sol.t[1] - sol.t[0]
    run = start(
        PENDULUM, method, [0.0, 0.0, 0.0], 2.0, parameters=(stiffness,), rtol=allowed, atol=allowed, step=first,
        q=[1.0], increments=1,
    )  # fmt: skip
    assert run.advance(10_000) is Ending.DONE
    assert (run.c.steps, run.c.rejected) == (sol.stats["steps"], sol.stats["rejected"])
    times, _ = run.rows()
    assert times == pytest.approx(sol.t[1:], rel=1e-4)
    moved = run.arrays["rows_q"][: len(times), 0] - 1.0
    assert largest(moved - (angle[1:] - angle[0])) <= 1e-4 * 2.0 * np.sqrt(stiffness)


@dataclass(frozen=True)
class Conducting(Pendulum):
    """q̇ = 1 and the flow ṡ = q − c into a sum whose rounding is given."""

    summed = 2

    def rates(self, on, base, y, q, out):
        q[0] = base[0] + y[0]
        out[0], out[1], out[2] = y[1], 0.0, q[0] - self.parameters[0]
        return 0, 0

    def rounding(self, on, anchor, y):
        return self.parameters[1]

    def hold(self, on, change, low, high, *, made):
        change[0] = on.maximum(low[0], on.minimum(high[0], change[0]))


CONDUCTING = program(lambda parameters, size: Conducting(parameters)).compiled()["run"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("centre", "rounding", "counts"),
    [(0.501, 0.01, False), (0.501, 1e-4, True), (0.499, 0.01, True), (1.001, 1.0, True), (-1e-3, 1.0, True)],
)
def test_a_flow_both_ways_that_goes_back_by_less_than_rounding_is_none(method, centre, rounding, counts):
    """Over a step of 1 s ½ − c flows; one that only goes back, or goes back by more, or forth, counts."""
    run = start(
        CONDUCTING, method, [0.0, 1.0, 0.0], 1.0, parameters=(centre, rounding), grid=1.0, step=1.0, q=[0.0],
        increments=1,
    )  # fmt: skip
    for name in ("carry", "carry1", "carry2", "change", "size", "whole", "low"):
        run.arrays[name] = np.zeros(2 if name in ("whole", "low") else 1)
    assert run.advance(2) is Ending.DONE
    assert run.arrays["y"][2] == pytest.approx((0.5 - centre) * counts, abs=1e-14)


def test_backward_in_time_leads_back():
    there = start(KEPLER, "rk87", ORBIT, 3.0, rtol=1e-11, atol=1e-11)
    there.advance(1000)
    back = start(KEPLER, "rk87", there.arrays["y"], -3.0, rtol=1e-11, atol=1e-11, origin=3.0)
    assert back.advance(1000) is Ending.DONE
    assert largest(back.arrays["y"] - ORBIT) <= 1e3 * 1e-11


@given(
    h=st.floats(1e-6, 1.0), error=st.floats(1e-12, 1e4), before=st.floats(1e-4, 1.0), failed=st.booleans(),
    share=st.sampled_from([0.0, 0.5]), exponent=st.sampled_from([5.0, 8.0]),
)  # fmt: skip
def test_steps_are_judged_by_proportional_integral_control(h, error, before, failed, share, exponent):
    """Hairer and Wanner, II, IV.2: h · 0.9 · error^(−0.7/p) · before^(0.4/p), by the error's part of the tolerance."""
    part, power = (1.0 / h) ** share, exponent - share
    strict, shared = error * min(part, STRICT), error * part
    accepted = strict <= 1.0
    factor = max(0.2, 0.9 * strict ** (-1.0 / power))
    if accepted:
        factor = 0.9 * max(shared, UNFELT) ** (-0.7 / power) * before ** (0.4 / power)
        factor = min(1.0 if failed else 6.0, max(0.3, factor))
    following = h * factor
    control = MarchControl.table(1)
    c = control[0]
    c.span, c.step, c.exponent, c.share, c.damping, c.strict = 1.0, h, exponent, share, DAMPING, STRICT
    c.before, c.failed, c.most_step = before, int(failed), np.inf
    assert bool(JUDGE(control, h, error)) == accepted
    # Powers by exponential and logarithm: each rounds by its argument, which is at most 40, times ε.
    assert c.step == pytest.approx(following, rel=100.0 * EPS)
    assert c.before == pytest.approx(max(shared, 1e-4) if accepted else before)
    assert bool(c.failed) == (not accepted)
    policy = Proportional(SimpleNamespace(exponent=exponent, share=share, hold=1.0))
    policy.restore({"before": before, "failed": failed})
    assert policy.judge(h, error, 1.0) == (accepted, c.step)
    assert policy.snapshot() == {"before": c.before, "failed": bool(c.failed)}


JUDGE = STEPS.compiled()["judge"]
CONTROL = Program(
    "control",
    length=Entry(lambda on, control, rest: length(on, control[0], rest), control=table(MarchControl), rest=real()),
    held=Entry(lambda on, control: held_back(on, control[0]), control=table(MarchControl)),
).compiled()


def test_a_step_is_not_wanted_longer_than_is_allowed_nor_shorter_than_the_least():
    for bounds, h, error, wanted in (
        ({"most_step": 0.15}, 0.1, 1e-9, 0.15),
        ({"least_step": 0.09}, 0.1, 1.0, 0.09),
        ({"least_step": 0.5}, 0.1, 1.0, 0.1),  # what is accepted was long enough
        ({}, 0.05, 1e-6, 0.1),  # a step that was cut short does not lengthen the next ones
    ):
        control = MarchControl.table(1)
        settings = {"span": 1.0, "strict": STRICT, "before": 1e-4, "exponent": 5.0, "most_step": np.inf}
        for name, value in (settings | {"step": 0.1} | bounds).items():
            setattr(control[0], name, value)
        assert JUDGE(control, h, error)
        assert control[0].step == pytest.approx(wanted)


def test_the_size_of_an_estimate_is_a_root_mean_square_and_that_of_two_their_blend():
    rng, measure = np.random.default_rng(3), STEPS.compiled()["measure"]
    fine, coarse, allowed = rng.standard_normal(5), rng.standard_normal(5), rng.uniform(0.5, 2.0, 5)
    one, two = np.mean((fine / allowed) ** 2), np.mean((coarse / allowed) ** 2)
    order5, order8 = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64)
    assert measure(fine, coarse, allowed, order5) == pytest.approx(np.sqrt(one), rel=1e-14)
    # Hairer, Nørsett and Wanner, II.10: the estimate of order 5 times its share of both
    expected = np.sqrt(one) * np.sqrt(one / (one + 0.01 * two))
    assert measure(fine, coarse, allowed, order8) == pytest.approx(expected, rel=1e-14)
    assert measure(0.0 * fine, coarse, allowed, order8) == 0.0
    assert measure(np.zeros(0), np.zeros(0), np.zeros(0), order8) == 0.0


@pytest.mark.parametrize("h", [0.1, -0.1])
def test_stiffness_of_a_linear_equation_is_its_eigenvalue(h):
    rng, stiffness = np.random.default_rng(1), STEPS.compiled()["stiffness"]
    run, allowed = rng.standard_normal(5), rng.uniform(0.5, 2.0, 5)
    assert stiffness(-7.0 * run, run, allowed, h) == pytest.approx(0.7, rel=1e-13)
    assert stiffness(run, np.zeros(5), allowed, h) == 0.0


def test_stability_has_to_hold_steps_back_many_times_and_is_forgiven_after_six():
    control = MarchControl.table(1)
    c = control[0]
    c.limit, c.stiff = 3.0, 3.5
    assert [bool(CONTROL["held"](control)) for _ in range(HELD)] == [False] * (HELD - 1) + [True]
    c.stiff = 3.0
    for _ in range(6):
        assert c.held == HELD
        assert not CONTROL["held"](control)
    assert c.held == 0
    c.stiff = 3.5
    assert not CONTROL["held"](control)
    assert c.held == 1


@pytest.mark.parametrize(
    ("step", "rest", "taken"), [(1.0, 3.0, 1.0), (1.0, 1.005, 0.5025), (1.0, 1.0 + 1e-8, 1.0 + 1e-8), (1.0, 0.4, 0.4)]
)
def test_the_last_steps_are_not_tiny(step, rest, taken):
    control = MarchControl.table(1)
    control[0].step = step
    assert CONTROL["length"](control, rest) == taken


def test_a_march_ends_where_it_has_to():
    slow = start(DECAY, "rk54", [1.0], 1.0, parameters=(1.0,), rows=3)
    assert slow.advance(2) is Ending.PAUSED
    assert slow.advance(100) is Ending.FULL
    assert slow.c.rows == 3
    slow.c.rows = 0  # as a driver that has taken the rows
    assert slow.advance(1) is Ending.PAUSED


def test_stability_that_holds_steps_back_is_told():
    """rk54 is stable to h·|λ| = 3.3; the hint is of λ itself."""
    run = start(DECAY, "rk54", [1.0], 100.0, parameters=(1e3,), rtol=1e-3, atol=1e-3, limit=2.5)
    assert run.advance(10_000) is Ending.STIFF
    assert 2.5 < run.c.stiff < 5.0
    free = start(DECAY, "rk54", [1.0], 1.0, parameters=(1e3,), rtol=1e-3, atol=1e-3)
    assert free.advance(10_000) is Ending.DONE


def test_what_cannot_be_evaluated_makes_steps_shorter_until_they_are_too_short():
    run = start(GUARDED, "rk54", [0.0], 1.0, parameters=(0.25,), least_step=1e-6)
    assert run.advance(10_000) == Ending.REFUSED + 13
    assert 0.25 - 1e-5 <= run.arrays["y"][0] <= 0.25
    at_once = start(GUARDED, "rk54", [0.5], 1.0, parameters=(0.25,))
    assert at_once.advance(1) == Ending.REFUSED + 13
    on_grid = start(GUARDED, "rk54", [0.0], 1.0, parameters=(0.25,), grid=0.1)
    assert on_grid.advance(100) == Ending.REFUSED + 13
    assert on_grid.c.steps == 2


def test_tolerances_of_a_plain_right_hand_side_refer_to_the_larger_end():
    def sizes(on, y0, y1, out):
        Field(lambda *_: 0, None, y0.size).sizes(on, y0, y1, out)

    program = Program("sizes_of_fields", run=Entry(sizes, y0=vector(), y1=vector(), out=vector()))
    y0, y1, out = np.array([1.0, -5.0, 0.0]), np.array([-2.0, 4.0, 0.5]), np.zeros(3)
    program.compiled()["run"].bind(y0, y1, out)()
    assert out.tolist() == [2.0, 5.0, 0.5]
