"""Elementary functions of the staged language: accuracy against 60 digits, the same bits by every evaluation."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from ephs.semantics.stage import PLAIN, Entry, Evaluator, Program, Vector, elementary, vector
from tests.semantics.stage.coefficients import made
from tests.staged import bits, run_both

ULPS = {"sin": 0.8, "cos": 0.8, "exp": 0.8, "log": 0.9, "atan2": 1.5}
"""Errors that the module promises, in units in the last place."""
EDGES = (0.0, -0.0, 5e-324, -5e-324, 1.0, -1.0, 2.0**-1022, 1e308, -1e308, math.inf, -math.inf, math.nan)
HARD = st.integers(1, 2**25).map(lambda n: float(n * mp.pi / 2))
"""Floats nearest to multiples of π/2: there almost all digits cancel."""
ANGLES = st.one_of(st.floats(-10.0, 10.0), st.floats(-(2.0**26), 2.0**26), HARD)
POSITIVE = st.floats(5e-324, 1.7e308)
DRAWN = {
    "sin": ANGLES,
    "cos": ANGLES,
    "exp": st.one_of(st.floats(-1.0, 1.0), st.floats(-745.0, 709.7)),
    "log": st.one_of(st.floats(0.5, 2.0), POSITIVE),
}


def all_of(on: Evaluator, x: Vector, y: Vector, out: Vector) -> None:
    """Every function of every pair."""

    def each(i: Any) -> None:
        for k, name in enumerate(DRAWN):
            out[5 * i + k] = getattr(on, name)(x[i])
        out[5 * i + 4] = on.atan2(y[i], x[i])

    on.loop(x.size, each)


PROGRAM = Program("elementary", all_of=Entry(all_of, x=vector(), y=vector(), out=vector()))


def error(found: float, true: Any) -> float:
    """Error in units in the last place of the true value."""
    if not true:
        return 0.0 if not found else math.inf
    exponent = max(int(mp.floor(mp.log(abs(true), 2))), -1022)
    return float(abs(mpf(float(found)) - true) / mpf(2) ** (exponent - 52))


@pytest.mark.parametrize("name", DRAWN)
@given(data=st.data())
@settings(max_examples=300)
def test_errors_are_as_promised(name, data):
    x = data.draw(DRAWN[name])
    assert error(getattr(PLAIN, name)(x), getattr(mp, name)(mpf(x))) < ULPS[name]


@given(y=st.floats(-1e300, 1e300), x=st.floats(-1e300, 1e300), share=st.floats(0.0, 1.0))
@settings(max_examples=300)
def test_errors_of_the_arctangent_are_as_promised(y, x, share):
    for a, b in ((y, x), (share * x, x), (x, share * x)):
        if a and b:
            assert error(PLAIN.atan2(a, b), mp.atan2(mpf(a), mpf(b))) < ULPS["atan2"]


def test_constants_are_those_of_sixty_digits():
    for name, values in made().items():
        assert getattr(elementary, name) == values, name


def test_a_coefficient_that_is_off_is_noticed(monkeypatch):
    """The bound on the error is not idle: 1e-13 more in one coefficient breaks it."""
    monkeypatch.setattr(elementary, "SINE", (elementary.SINE[0] * (1.0 + 1e-13), *elementary.SINE[1:]))
    points = np.linspace(0.5, 0.78, 400)
    assert max(error(PLAIN.sin(x), mp.sin(mpf(x))) for x in points) > ULPS["sin"]


@pytest.mark.parametrize("y", EDGES)
@pytest.mark.parametrize("x", EDGES)
def test_edges_of_the_arctangent_are_those_of_ieee(y, x):
    found, true = PLAIN.atan2(y, x), math.atan2(y, x)
    assert math.isnan(found) == math.isnan(true)
    if not math.isnan(true):
        assert math.copysign(1.0, found) == math.copysign(1.0, true)
        assert error(found, mpf(true)) <= 2.0


def test_edges_of_the_others():
    assert [PLAIN.exp(x) for x in (-math.inf, -746.0, 0.0, 710.0, math.inf)] == [0.0, 0.0, 1.0, math.inf, math.inf]
    assert PLAIN.exp(-745.0) == 5e-324
    assert [PLAIN.log(x) for x in (0.0, -0.0, 1.0, math.inf)] == [-math.inf, -math.inf, 0.0, math.inf]
    assert math.copysign(1.0, PLAIN.sin(-0.0)) == -1.0 and PLAIN.cos(-0.0) == 1.0
    unanswered = [PLAIN.log(-1.0), PLAIN.sin(math.inf), PLAIN.cos(-math.inf)]
    unanswered += [getattr(PLAIN, name)(math.nan) for name in DRAWN]
    assert all(map(math.isnan, unanswered))


@given(st.floats(2.0**26, 2.0**55), st.booleans())
@settings(max_examples=200)
def test_errors_of_large_angles_are_absolute(x, negative):
    x = -x if negative else x
    for name in ("sin", "cos"):
        assert abs(float(getattr(PLAIN, name)(x)) - float(getattr(mp, name)(mpf(x)))) < 1e-15


def test_angles_whose_neighbours_are_turns_apart_are_whole_turns():
    for x in (2.0**56, -1e300):
        assert (PLAIN.sin(x), PLAIN.cos(x)) == (0.0, 1.0)


@given(ANGLES)
@settings(max_examples=200)
def test_sine_is_odd_and_cosine_even(x):
    assert PLAIN.sin(-x) == -PLAIN.sin(x) and PLAIN.cos(-x) == PLAIN.cos(x)


def inputs() -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(7)
    edges = np.array(list(itertools.product(EDGES, EDGES))).T
    wide = draw.normal(size=(2, 400)) * 10.0 ** draw.uniform(-12.0, 12.0, (2, 400))
    x, y = np.concatenate([edges, wide, draw.uniform(-20.0, 20.0, (2, 400))], axis=1)
    return x, y


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_floats_machine_code_and_members_give_the_same_bits():
    x, y = inputs()
    *_, whole = run_both(PROGRAM, "all_of", x, y, np.zeros(5 * x.size))
    members = 4
    size = x.size // members
    xs, ys = (np.ascontiguousarray(v[: size * members].reshape(size, members)) for v in (x, y))
    out = np.zeros((5 * size, members))
    PROGRAM.compiled(members)["all_of"](xs, ys, out)
    found = out.reshape(size, 5, members).transpose(0, 2, 1)
    assert bits(found) == bits(whole[: 5 * size * members])


def test_machine_code_calls_no_library():
    declared = [line for line in PROGRAM.text().splitlines() if line.startswith("declare")]
    assert declared and all("@llvm." in line for line in declared)
    assert not any(name in line for line in declared for name in ULPS)
