"""Discrete gradients: numbers with values at both ends of a step and the slope of their difference.

A function of a state is evaluated once with such numbers in place of the state's. What comes out is its value before
and after the step v and entries s with f(after) − f(before) = Σ sᵢ vᵢ, exact but for rounding, unchanged where the
ends are exchanged, and the gradient where v = 0: a discrete gradient of whatever was written down. Products take the
mean of one factor times the slope of the other; each elementary function has its own rule, in which nothing cancels.
So E = ½ k x² gives k (x⁰ + x¹)/2, E = c exp(s/C) gives c (exp(s¹/C) − exp(s⁰/C))/(s¹ − s⁰), and the length of a vector
gives the sum of both vectors over the sum of both lengths.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

from ephs.semantics.derive.errors import DeriveError
from ephs.semantics.derive.functions import FUNCTIONS, SlopeRule, angle_ratio, squared_turn_slope, turn
from ephs.semantics.stage.evaluator import Evaluator, Function, Interpreted
from ephs.semantics.stage.numbers import Integer, Number, Operation, Order, Real, StagedCondition, Truth

Entries = Mapping[int, Real]
"""Place of an increment -> the slope along it; none where there is no dependence."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Slope(Number):
    """A number over a step.

    Parameters
    ----------
    start, end
        Its values at the ends.
    slopes
        end − start = Σ slopes[i] v[i].
    """

    start: Real
    end: Real
    slopes: Entries

    @property
    def mean(self) -> Real:
        """The mean of both ends."""
        return 0.5 * (self.start + self.end) if self.slopes else self.start

    def _negative(self) -> Real:
        return Slope(-self.start, -self.end, {i: -s for i, s in self.slopes.items()})

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        raise DeriveError("compared", order=order)

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        return _OPERATIONS[operation](lifted(left), lifted(right))


def lifted(x: Real) -> Slope:
    """A number that the step does not change."""
    return x if isinstance(x, Slope) else Slope(x, x, {})


def _sum(a: Slope, b: Slope) -> Slope:
    return Slope(a.start + b.start, a.end + b.end, combined(a.slopes, 1.0, b.slopes, 1.0))


def _difference(a: Slope, b: Slope) -> Slope:
    return Slope(a.start - b.start, a.end - b.end, combined(a.slopes, 1.0, b.slopes, -1.0))


def _product(a: Slope, b: Slope) -> Slope:
    return Slope(a.start * b.start, a.end * b.end, combined(a.slopes, b.mean, b.slopes, a.mean))


def _quotient(a: Slope, b: Slope) -> Slope:
    start, end = a.start / b.start, a.end / b.end
    mean = 0.5 * (start + end) if a.slopes or b.slopes else start
    slopes = combined(a.slopes, 1.0, b.slopes, -mean)
    below = b.mean
    return Slope(start, end, {i: s / below for i, s in slopes.items()})


def combined(one: Entries, by: Real, other: Entries, too: Real) -> Entries:
    """Entries of one times a number plus those of another times a number."""
    out = {i: s * by for i, s in one.items()}
    for i, s in other.items():
        out[i] = out[i] + s * too if i in out else s * too
    return out


_OPERATIONS: Final[Mapping[Operation, Callable[[Slope, Slope], Slope]]] = {
    "+": _sum,
    "-": _difference,
    "*": _product,
    "/": _quotient,
}


@final
class Slopes(Interpreted):
    """Evaluates a function over a step, with the numbers of another evaluation for values and slopes."""

    __slots__ = ("base",)

    def __init__(self, base: Evaluator) -> None:
        self.base: Evaluator = base

    def along(self, x: Slope, rule: SlopeRule) -> Slope:
        """A function of one number, by its value and its slope between two arguments."""
        start = rule.value(self.base, x.start)
        if not x.slopes:
            return Slope(start, start, {})
        slope = rule.slope(self.base, x.start, x.end)
        return Slope(start, rule.value(self.base, x.end), {i: slope * s for i, s in x.slopes.items()})

    def _function(self, name: Function, *arguments: Real) -> Real:
        given = [lifted(x) for x in arguments]
        if name == "atan2":
            return self._angle(given[0], given[1])
        rule = FUNCTIONS.get(name)
        if rule is None:
            raise DeriveError("jumps", function=name)
        return self.along(given[0], rule)

    def _angle(self, y: Slope, x: Slope) -> Slope:
        """The angle of (x, y): the step turns it by the angle of (dot, cross) of both ends."""
        on = self.base
        start = on.atan2(y.start, x.start)
        if not (x.slopes or y.slopes):
            return Slope(start, start, {})
        cross = x.start * y.end - y.start * x.end
        dot = x.start * x.end + y.start * y.end
        turned = on.atan2(cross, dot)
        wide = dot <= 0.5 * on.absolute(cross)  # there the angle over its sine is a plain quotient
        dot = on.select(wide, 1.0, dot)
        ratio = on.select(wide, turned / on.select(wide, cross, 1.0), angle_ratio(on, cross / dot) / dot)
        entries = combined(y.slopes, ratio * x.mean, x.slopes, -(ratio * y.mean))
        # on the other side of the cut the angle is that of the turn, whole turns off
        return Slope(start, start + turned, entries)

    def squared_turn(self, q: Sequence[Slope]) -> Slope:
        """θ² of a unit quaternion: it changes with the size of the scalar alone."""
        on, scalar = self.base, self.along(q[0], FUNCTIONS["absolute"])
        one, other = turn(on, [x.start for x in q]), turn(on, [x.end for x in q])
        slope = squared_turn_slope(on, one, other)
        return Slope(one * one, other * other, {i: slope * s for i, s in scalar.slopes.items()})

    def _known(self, truth: StagedCondition, what: str) -> bool:
        raise DeriveError("compared", order=what)

    def _same(self, one: Integer, other: Integer) -> Truth:
        return self.base.same(one, other)

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        raise DeriveError("compared", order="a condition")

    def _both(self, one: Truth, other: Truth) -> Truth:
        raise DeriveError("compared", order="a condition")

    def _negate(self, truth: StagedCondition) -> Truth:
        raise DeriveError("compared", order="a condition")

    def real(self, integer: Integer) -> Real:
        return self.base.real(integer)

    def integer(self, real: Real) -> Integer:
        raise DeriveError("jumps", function="integer")

    def scale(self, real: Real, power: Integer) -> Real:
        x = lifted(real)
        scaled = {i: self.base.scale(s, power) for i, s in x.slopes.items()}
        return Slope(self.base.scale(x.start, power), self.base.scale(x.end, power), scaled)
