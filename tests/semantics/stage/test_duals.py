"""Dual numbers: derivatives by rules, compared with a second evaluation in complex numbers."""

import cmath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.stage import (
    PLAIN,
    Duals,
    Entry,
    Program,
    Record,
    StageError,
    function,
    integer,
    matrix,
    real,
    reals,
    signature_of,
    staged,
    table,
    vector,
)
from ephs.semantics.stage.duals import StagedDual
from ephs.semantics.stage.evaluator import FUNCTIONS
from tests.numerics import EPS

EPSILON = EPS
COMPLEX = {
    "sqrt": cmath.sqrt,
    "absolute": lambda x: x if x.real > 0 else -x,
    "floor": lambda x: complex(np.floor(x.real)),
    "sin": cmath.sin,
    "cos": cmath.cos,
    "exp": cmath.exp,
    "log": cmath.log,
    "atan2": lambda y, x: cmath.atan(y / x),
    "copysign": lambda x, s: (x if x.real > 0 else -x) * np.copysign(1.0, s.real),
}
"""The functions continued to complex numbers: the imaginary part of f(x + ih) is h·f′."""


OPERATORS = {
    "+": lambda a, b: a + b + 1.0,
    "-": lambda a, b: 2.0 - (a - b),
    "*": lambda a, b: a * b * 3.0,
    "/": lambda a, b: 1.0 / (a / b) - a / 2.0,
    "negative": lambda a: -a,
}


@pytest.mark.parametrize("name", OPERATORS)
@given(data=st.data())
def test_every_operator_has_its_derivative(name, data):
    count = 1 if name == "negative" else 2
    points = [data.draw(st.integers(1, 400)) / 100 for _ in range(count)]
    slopes = [data.draw(st.integers(-200, 200)) / 100 for _ in range(count)]
    number = OPERATORS[name](*(StagedDual(np.float64(x), (s,)) for x, s in zip(points, slopes, strict=True)))
    step = 1e-100
    moved = OPERATORS[name](*(complex(x, step * s) for x, s in zip(points, slopes, strict=True)))
    terms = sum(abs(s) for s in slopes) * (4 + max(points) / min(points) ** 2)
    assert abs(number.slopes[0] - moved.imag / step) <= 8 * EPSILON * terms * 3
    assert abs(number.value - moved.real) <= 8 * EPSILON * (4 + sum(points) * max(points) / min(points))


@pytest.mark.parametrize("name", FUNCTIONS)
@given(data=st.data())
def test_every_function_has_its_derivative(name, data):
    count = FUNCTIONS[name]
    low = 0.01 if name in ("sqrt", "log") else -5.0
    points = [data.draw(st.floats(low, 5.0).filter(lambda x: abs(x) > 0.01)) for _ in range(count)]
    slopes = [data.draw(st.integers(-200, 200)) / 100 for _ in range(count)]
    number = getattr(Duals(PLAIN), name)(*(StagedDual(x, (s,)) for x, s in zip(points, slopes, strict=True)))
    step = 1e-100
    expected = COMPLEX[name](*(complex(x, step * s) for x, s in zip(points, slopes, strict=True))).imag / step
    assert abs(number.slopes[0] - expected) <= 32 * EPSILON * sum(abs(s) for s in slopes) * (200 + abs(expected))


class Point(Record):
    kind = integer()
    place = reals(2)
    weight = real()


@staged
def product(on, a, b):
    return a * b / (1.0 + a * a)


def run(on, x, a, points, gain, out):
    """All that memory offers, in one function."""
    total = on.variable(0.0)
    local = on.scratch(2)

    def body(i):
        point = points[i]
        local[0] = point.place[0] * x[i]
        total.value = total.value + product(on, local[0], a[i, 1]) * gain
        on.when(x[i] > 0.0, lambda: out.part(1, 2).__setitem__(0, on.sin(x[i] * gain)))
        point.weight = on.select(x[i] > 0.5, x[i] * x[i], 3.0 * point.place[1] + on.real(point.kind))

    on.loop(points.size, body)
    out[0] = total.value


PROGRAM = Program(
    "sloped",
    value=(entry := Entry(run, x=vector(), a=matrix(), points=table(Point), gain=real(), out=vector())),
    tangent=entry.tangent("x", "a", "points", "gain", "out"),
    three=entry.tangent("x", "a", "points", "gain", "out", directions=3),
    part=entry.tangent("x", "points", "out"),
)


def drawn(seed):
    draw = np.random.default_rng(seed)
    points = Point.table(4)
    points.reals.array[:] = draw.normal(size=12)
    points.integers.array[:] = 2
    return [draw.normal(size=4), draw.normal(size=(4, 2)), points, draw.normal(), np.zeros(3)]


def results(calls, name, arguments, slopes=None):
    x, a, points, gain, out = arguments
    table = Point.table(4)
    table.reals.array[:], table.integers.array[:] = points.reals.array, points.integers.array
    values = [x, a, table, gain, out.copy()]
    if slopes is None:
        calls[name](*values)
        return np.r_[values[4], table.reals.array]
    rates = [np.array(slope) for slope in slopes]
    calls[name](*zip(values, rates, strict=True))
    return values[4], table.reals.array, rates[4], rates[2]


def tangent_slopes(draw, directions):
    shape = [4, 8, 12, 1, 3]
    return [draw.normal(size=(n, directions)) * (k < 4) for k, n in enumerate(shape)]


@pytest.mark.parametrize("seed", range(5))
def test_slopes_are_the_same_in_machine_code_and_for_one_direction_or_three(seed):
    arguments, slopes = drawn(seed), tangent_slopes(np.random.default_rng(seed), 3)
    compiled, plain = (results(calls, "three", arguments, slopes) for calls in (PROGRAM.compiled(), PROGRAM.plain()))
    for one, other in zip(compiled, plain, strict=True):
        assert np.array_equal(one, other)
    for direction in range(3):
        alone = results(PROGRAM.compiled(), "tangent", arguments, [s[:, direction] for s in slopes])
        assert np.array_equal(alone[0], compiled[0])
        assert np.array_equal(alone[2], compiled[2].reshape(3, 3)[:, direction])
        assert np.array_equal(alone[3], compiled[3].reshape(12, 3)[:, direction])


def test_a_slope_that_nobody_keeps_is_named():
    with pytest.raises(StageError, match=r"run.*, test_duals.py:\d+: a number with a derivative is stored where"):
        Program("lost", lost=entry.tangent("x", "points")).compiled()


def test_an_argument_that_is_not_there_is_named():
    with pytest.raises(StageError, match="has no argument y, expected some of x, a, points, gain, out"):
        entry.tangent("y")


def test_second_derivatives_are_duals_of_duals():
    inner, outer = Duals(PLAIN), Duals(Duals(PLAIN))
    x = StagedDual(StagedDual(0.3, (1.0,)), (StagedDual(1.0, (0.0,)),))
    assert inner.base is PLAIN
    twice = outer.sin(x * x).slopes[0].slopes[0]
    assert abs(twice - (2 * np.cos(0.09) - 4 * 0.09 * np.sin(0.09))) <= 8 * EPSILON * 3


def test_members_have_derivatives_of_their_own():
    entry = Entry(lambda on, x, out: out.__setitem__(0, product(on, x[0], x[1])), x=vector(), out=vector())
    straight = Program("straight", product=entry.tangent("x", "out"))
    x, dx = np.random.default_rng(0).normal(size=(2, 2, 4))
    alone = np.zeros((2, 1, 4))
    for k in range(4):
        y, dy = np.zeros(1), np.zeros(1)
        straight.plain()["product"]((x[:, k].copy(), dx[:, k].copy()), (y, dy))
        alone[:, 0, k] = y[0], dy[0]
    for calls in (straight.compiled(members=4), straight.arrays()):
        found = np.zeros((2, 1, 4))
        calls["product"]((x, dx), tuple(found))
        assert np.array_equal(found, alone)


def test_constants_of_a_lower_level_are_constants():
    """d/dx (x · d/dy (x y²)) at (2, 3): the inner derivative 2 x y is differentiated by x, and y is not."""
    outer = Duals(PLAIN)
    inner = Duals(outer)
    x = outer.along(np.float64(2.0), 0)
    y = inner.along(np.float64(3.0), 0)
    along = (x * y * y).slopes[0]
    assert outer.dual(along).value == 12.0
    assert (x * along).slopes[0] == 2.0 * 2.0 * 2.0 * 3.0
    assert outer.dual(inner.sqrt(x * y * y).slopes[0]).slopes[0] == pytest.approx(0.5 / np.sqrt(2.0))


class Reaching(Record):
    """A function that another program calls."""

    law = function(signature_of(x=vector(2), out=vector(1)))


def law(on, x, out):
    out[0] = x[0] * on.sin(x[1])
    return 0


def squared(on, table, x, out):
    """The square of the law of a table."""
    on.reach(table[0].law, x, out)
    out[0] = out[0] * out[0]


def test_tangents_go_through_functions_that_are_called_by_address():
    inside = Program("inside", law=Entry(law, x=vector(2), out=vector(1)))
    entry = Entry(squared, table=table(Reaching), x=vector(2), out=vector(1))
    tangent = Program("along", outer=entry.tangent("x", "out", directions=2))
    rows = Reaching.table(1)
    rows[0].law = inside.tangent(2).compiled()["law"].address
    x, out = (np.array([1.5, 0.4]), np.eye(2)), (np.zeros(1), np.zeros((1, 2)))
    for calls in (tangent.compiled(), tangent.plain()):
        calls["outer"](rows, x, out)
        s, c = np.sin(0.4), np.cos(0.4)
        assert out[1][0] == pytest.approx([2.0 * 1.5 * s * s, 2.0 * 1.5 * s * 1.5 * c], rel=1e-14)
    passive = Program("passive", outer=entry.tangent("out", directions=2))
    with pytest.raises(StageError):
        passive.compiled()
