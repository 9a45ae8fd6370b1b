"""Intervals contain what points in them give; expressions of SymPy are what they print."""

import math
from random import Random

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, example, given
from hypothesis import strategies as st

from ephs.semantics.stage import PLAIN, StageError
from ephs.semantics.stage.evaluator import FUNCTIONS
from ephs.semantics.stage.intervals import INTERVALS, Interval
from ephs.semantics.stage.symbolic import SYMBOLIC, Expression
from tests.semantics.stage.drawn import BINARY, INPUTS, OUTPUTS, UNARY, Draw, bodies, run
from tests.semantics.stage.test_evaluators import POINTS

OPERATIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


@st.composite
def boxes(draw, count):
    """Intervals, and a point in each."""
    made = []
    for _ in range(count):
        ends = st.one_of(st.floats(-8.0, 8.0), st.sampled_from([0.0, -0.0, 1.0, math.pi, -math.pi / 2, 1e-300, 700.0]))
        low, high = sorted([draw(ends), draw(ends)])
        share = draw(st.floats(0.0, 1.0))
        made.append((low, high, min(max(low + share * (high - low), low), high)))
    return made


@pytest.mark.parametrize("name", [*FUNCTIONS, *OPERATIONS])
@given(data=st.data())
def test_an_interval_contains_what_its_points_give(name, data):
    drawn = data.draw(boxes(FUNCTIONS.get(name, 2)))
    apply = OPERATIONS.get(name)
    with np.errstate(all="ignore"):
        points = [np.float64(point) for _, _, point in drawn]
        value = apply(*points) if apply else getattr(PLAIN, name)(*points)
    intervals = [Interval(low, high) for low, high, _ in drawn]
    found = apply(*intervals) if apply else getattr(INTERVALS, name)(*intervals)
    assert math.isnan(value) or found.low <= value <= found.high


@pytest.mark.parametrize("order", ["<", "<=", ">", ">="])
@given(data=st.data())
def test_a_comparison_is_decided_where_all_points_agree(order, data):
    (a, b, x), (c, d, y) = data.draw(boxes(2))
    compare = {"<": lambda p, q: p < q, "<=": lambda p, q: p <= q, ">": lambda p, q: p > q, ">=": lambda p, q: p >= q}
    found = compare[order](Interval(a, b), Interval(c, d))
    corners = {compare[order](p, q) for p in (a, b) for q in (c, d)}
    assert corners == {found} if isinstance(found, bool) else len(corners) == 2
    assert compare[order](x, y) == found or not isinstance(found, bool)


@given(body=bodies(branches=False), x=POINTS, y=POINTS, share=st.floats(0.0, 1.0))
@example(  # compares the logarithm of an interval around zero
    body=Draw(Random(194), (*UNARY, *BINARY), False).body(4),
    x=[4 / 3, 3 / 2, -3.0],
    y=[7 / 3, 5 / 3, -1 / 6],
    share=0.5,
)
def test_a_program_stays_within_its_bounds(body, x, y, share):
    ends = [sorted(pair) for pair in zip(x, y, strict=True)]
    bounds, values = [Interval(0.0, 0.0)] * OUTPUTS, [0.0] * OUTPUTS
    point = [np.float64(min(max(low + share * (high - low), low), high)) for low, high in ends]
    try:
        run(INTERVALS, body, [Interval(*pair) for pair in ends], bounds, lambda c: Interval(c, c))
    except StageError:
        assume(False)
    with np.errstate(all="ignore"):
        run(PLAIN, body, point, values, np.float64)
    for bound, value in zip(bounds, values, strict=True):
        assert not math.isfinite(value) or bound.low <= value <= bound.high
    assert len(point) == INPUTS


def test_bounds_are_tight_where_nothing_is_lost():
    assert [(n.low, n.high) for n in [INTERVALS.cos(Interval(-1.0, 7.0)), INTERVALS.absolute(Interval(-2.0, 1.0))]] == [
        (-1.0, 1.0),
        (0.0, 2.0),
    ]
    wave = INTERVALS.sin(Interval(0.1, 0.2))
    assert 0.0 < wave.high - wave.low < math.sin(0.2) - math.sin(0.1) + 1e-15


def test_what_may_be_undefined_has_no_bounds_and_decides_nothing():
    root = INTERVALS.sqrt(Interval(-1.0, 4.0))
    for found in (root, INTERVALS.sin(root), INTERVALS.log(Interval(-1.0, 4.0)), 1.0 / Interval(0.0, 1.0)):
        assert (found.low, found.high) == (-math.inf, math.inf)
        assert not isinstance(found <= math.inf, bool)
    zero = INTERVALS.sqrt(Interval(0.0, 2.0) * Interval(0.0, 2.0))
    assert zero.low == 0.0  # rounding outwards makes nothing negative
    assert zero.high <= 2.0 + 1e-15


def test_an_integer_of_an_interval_is_known_or_refused():
    assert INTERVALS.integer(Interval(2.1, 2.9)) == 2
    with pytest.raises(StageError, match=r"on.integer depends on a condition that has no single answer on the box"):
        INTERVALS.integer(Interval(1.9, 2.1))


def test_expressions_say_what_is_computed():
    x, y = (Expression(symbol) for symbol in sp.symbols("x y", real=True))
    chosen = SYMBOLIC.select(SYMBOLIC.both(x < y, SYMBOLIC.negate(y < 0.1)), SYMBOLIC.sqrt(x * x), 2.0 * y)
    a, b = x.value, y.value
    assert chosen.value == sp.Piecewise((sp.Abs(a), (a < b) & (b >= sp.Rational(1, 10))), (2 * b, True))
    assert SYMBOLIC.atan2(y, x).value == sp.atan2(b, a)
    assert SYMBOLIC.copysign(2.5, x).value.subs(a, -3) == -sp.Rational(5, 2)
    assert SYMBOLIC.scale(x, 3).value == 8 * a
    assert SYMBOLIC.integer(SYMBOLIC.floor(Expression(sp.Rational(7, 2)))) == 3
    assert (x * 0.0, x + 0.0 is x, x * 1.0 is x) == (0.0, True, True)
    with pytest.raises(StageError, match=r"on.integer depends on a condition"):
        SYMBOLIC.integer(x)
    with pytest.raises(StageError, match=r"on.when depends on a condition .* \(x < y\); write on.select"):
        SYMBOLIC.when(x < y, lambda: None)
