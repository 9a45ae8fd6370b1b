"""Evaluation with intervals, rounded outwards: bounds of a function on a box.

An operation that is undefined somewhere on the box (a divisor of zero, the root or logarithm of a negative number, a
difference of infinities) has no bounds, nor has what is computed from it, and comparisons with it are undecided: where
it is not a number they are false, whatever the order.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Function, Interpreted
from ephs.semantics.stage.numbers import Integer, Number, Operation, Order, Real, StagedCondition, Truth

NEAR = 1e-9
"""Angle in rad by which extrema are taken to lie within an interval: more than turns round by."""

_ULPS: Final = 4
"""Roundings by which elementary functions may be wrong."""
_FAR: Final = 1e6
"""Beyond it sine and cosine are only known to be from −1 to 1."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Interval(Number):
    """A real number from `low` to `high`, both included."""

    low: float
    high: float

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        (a, b), (c, d) = _ends(left), _ends(right)
        match operation:
            case "+":
                return _out((a + c, b + d))
            case "-":
                return _out((a - d, b - c))
            case "*":
                return _out([x * y for x in (a, b) for y in (c, d)])
            case "/":
                return _WHOLE if c <= 0.0 <= d else _out([x / y for x in (a, b) for y in (c, d)])

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        if order in (">", ">="):
            left, right = right, left
        (a, b), (c, d) = _ends(left), _ends(right)
        if _BOUNDLESS in ((a, b), (c, d)):
            return Undecided()
        if order in ("<", ">"):
            return True if b < c else False if a >= d else Undecided()
        return True if b <= c else False if a > d else Undecided()

    def _negative(self) -> Real:
        return Interval(-self.high, -self.low)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Undecided(StagedCondition):
    """A condition that is true at some points of the box and false at others."""


def _ends(number: Real) -> tuple[float, float]:
    if isinstance(number, Interval):
        return number.low, number.high
    assert isinstance(number, float | int)
    return number, number


def _out(values: list[float] | tuple[float, ...], ulps: int = 1) -> Interval:
    """Return the hull of values, widened by their rounding, which changes no sign."""
    if any(math.isnan(value) for value in values):
        return _WHOLE
    low, high = min(values, key=_signed), max(values, key=_signed)
    for _ in range(ulps):
        low = low if _signed(low) == (0.0, 1.0) else math.nextafter(low, -math.inf)
        high = high if _signed(high) == (0.0, -1.0) else math.nextafter(high, math.inf)
    return Interval(low, high)


def _signed(value: float) -> tuple[float, float]:
    return value, math.copysign(1.0, value)


_BOUNDLESS: Final = (-math.inf, math.inf)
_WHOLE: Final = Interval(*_BOUNDLESS)


def _clipped(interval: Interval, least: float, most: float = math.inf) -> Interval:
    return Interval(min(max(interval.low, least), most), max(min(interval.high, most), least))


def _sqrt(low: float, high: float) -> Interval:
    return _WHOLE if low < 0.0 else _out((math.sqrt(low), math.sqrt(high)))


def _absolute(low: float, high: float) -> Interval:
    return Interval(0.0 if low <= 0.0 <= high else min(abs(low), abs(high)), max(abs(low), abs(high)))


def _floor(x: float) -> float:
    return float(math.floor(x)) if math.isfinite(x) else x


def _exp(low: float, high: float) -> Interval:
    values = [math.exp(x) if x < 709.0 else math.inf for x in (low, high)]
    return _clipped(_out((min(values[0], 1.7e308), values[1]), _ULPS), 0.0)


def _log(low: float, high: float) -> Interval:
    if low < 0.0:
        return _WHOLE
    return _out([math.log(end) if end else -math.inf for end in (low, high)], _ULPS)


def extrema(low: float, high: float) -> tuple[bool, bool]:
    """Whether the cosine may be −1, and 1, at angles between two."""
    turn = 2.0 * math.pi
    bottom, top = (
        math.floor((high + shift + NEAR) / turn) >= math.ceil((low + shift - NEAR) / turn) for shift in (math.pi, 0.0)
    )
    return bottom, top


def _wave(low: float, high: float, peak: float) -> Interval:
    """Bound the cosine of x − peak."""
    if math.isinf(low) or math.isinf(high):
        return _WHOLE
    if max(abs(low), abs(high)) > _FAR:
        return Interval(-1.0, 1.0)
    bottom, top = extrema(low - peak, high - peak)
    of = math.sin if peak else math.cos
    ends = _out((of(low), of(high)), _ULPS)
    return _clipped(Interval(-1.0 if bottom else ends.low, 1.0 if top else ends.high), -1.0, 1.0)


def _atan2(y: tuple[float, float], x: tuple[float, float]) -> Interval:
    if x[0] <= 0.0 and y[0] <= 0.0 <= y[1]:
        return _out((-math.pi, math.pi))
    return _out([math.atan2(b, a) for a in x for b in y], _ULPS)


def _copysign(x: tuple[float, float], sign: tuple[float, float]) -> Interval:
    size = _absolute(*x)
    if sign[0] > 0.0:
        return size
    return Interval(-size.high, -size.low if sign[1] < 0.0 else size.high)


_ONE: Final[dict[Function, Callable[[float, float], Interval]]] = {
    "sqrt": _sqrt,
    "absolute": _absolute,
    "floor": lambda low, high: Interval(_floor(low), _floor(high)),
    "sin": lambda low, high: _wave(low, high, math.pi / 2.0),
    "cos": lambda low, high: _wave(low, high, 0.0),
    "exp": _exp,
    "log": _log,
}
_TWO: Final[dict[Function, Callable[[tuple[float, float], tuple[float, float]], Interval]]] = {
    "atan2": _atan2,
    "copysign": _copysign,
}


@final
class Intervals(Interpreted):
    """Evaluation with intervals; a condition that is not decided chooses both."""

    def _function(self, name: Function, *arguments: Real) -> Real:
        ends = [_ends(argument) for argument in arguments]
        if _BOUNDLESS in ends:
            return _WHOLE
        return _ONE[name](*ends[0]) if name in _ONE else _TWO[name](ends[0], ends[1])

    def _known(self, truth: StagedCondition, what: str) -> bool:
        raise StageError("undecided", what=what, found="on the box")

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        if isinstance(one, bool | StagedCondition):
            return Undecided()
        if not isinstance(one, Number) and not isinstance(other, Number) and isinstance(one, int):
            raise StageError("undecided", what="an integer", found="on the box")
        (a, b), (c, d) = _ends(one), _ends(other)
        return Interval(min(a, c), max(b, d))

    def _both(self, one: Truth, other: Truth) -> Truth:
        return Undecided()

    def _negate(self, truth: StagedCondition) -> Truth:
        return Undecided()

    def _same(self, one: Integer, other: Integer) -> Truth:
        return one == other

    def real(self, integer: Integer) -> Real:
        return float(integer)

    def integer(self, real: Real) -> Integer:
        low, high = _ends(real)
        if not (math.isfinite(low) and math.isfinite(high)) or int(low) != int(high):
            raise StageError("undecided", what="on.integer", found="on the box")
        return int(low)

    def scale(self, real: Real, power: Integer) -> Real:
        low, high = _ends(real)
        return _out((low * 2.0 ** int(power), high * 2.0 ** int(power)))


INTERVALS: Final = Intervals()
