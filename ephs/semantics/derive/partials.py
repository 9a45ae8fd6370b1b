"""Partial derivatives: numbers that know how they change with each of some directions.

A function that is run with such numbers gives its value and its exact Jacobian. Directions on which a number does not
depend have no entry, so that zero columns cost nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, final

from ephs.semantics.derive.errors import DeriveError
from ephs.semantics.stage.evaluator import Evaluator, Function, Interpreted
from ephs.semantics.stage.numbers import Condition, Integer, Number, Operation, Order, Real, Truth

__all__ = ["Partial", "Partials"]

Entries = Mapping[int, Real]
"""Direction -> derivative along it; none where there is no dependence."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Partial(Number):
    """A number and its derivatives.

    Parameters
    ----------
    value
        The number.
    slopes
        Its derivatives by the directions.
    """

    value: Real
    slopes: Entries

    def _negative(self) -> Real:
        return Partial(-self.value, {i: -s for i, s in self.slopes.items()})

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        a, b = raised(left).value, raised(right).value
        return {"<": lambda: a < b, "<=": lambda: a <= b, ">": lambda: a > b, ">=": lambda: a >= b}[order]()

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        a, b = raised(left), raised(right)
        if operation == "+":
            return Partial(a.value + b.value, combined(a.slopes, 1.0, b.slopes, 1.0))
        if operation == "-":
            return Partial(a.value - b.value, combined(a.slopes, 1.0, b.slopes, -1.0))
        if operation == "*":
            return Partial(a.value * b.value, combined(a.slopes, b.value, b.slopes, a.value))
        value = a.value / b.value
        slopes = combined(a.slopes, 1.0, b.slopes, -value)
        return Partial(value, {i: s / b.value for i, s in slopes.items()})


def raised(x: Real) -> Partial:
    """A number on which no direction acts."""
    return x if isinstance(x, Partial) else Partial(x, {})


def combined(one: Entries, by: Real, other: Entries, too: Real) -> Entries:
    """Entries of one times a number plus those of another times a number."""
    out = {i: s * by for i, s in one.items()}
    for i, s in other.items():
        out[i] = out[i] + s * too if i in out else s * too
    return out


_DERIVATIVES: Final[Mapping[str, Callable[[Evaluator, Real, Real], Real]]] = {
    "sqrt": lambda _, x, y: 0.5 / y,
    "absolute": lambda on, x, _: on.copysign(1.0, x),
    "floor": lambda _, x, y: 0.0,
    "sin": lambda on, x, _: on.cos(x),
    "cos": lambda on, x, _: -on.sin(x),
    "exp": lambda _, x, y: y,
    "log": lambda _, x, y: 1.0 / x,
}
"""f'(x) from x and y = f(x)."""


@final
class Partials(Interpreted):
    """Evaluates a function with its derivatives, with the numbers of another evaluator."""

    __slots__ = ("base",)

    def __init__(self, base: Evaluator) -> None:
        self.base: Evaluator = base

    def _function(self, name: Function, *arguments: Real) -> Real:
        on, given = self.base, [raised(x) for x in arguments]
        x = given[0]
        if name == "copysign":
            sign = on.copysign(1.0, x.value) * on.copysign(1.0, given[1].value)
            return Partial(on.copysign(x.value, given[1].value), combined(x.slopes, sign, {}, 0.0))
        if name == "atan2":
            y, x = given
            square = x.value * x.value + y.value * y.value
            slopes = combined(y.slopes, x.value / square, x.slopes, -(y.value / square))
            return Partial(on.atan2(y.value, x.value), slopes)
        value = on._function(name, x.value)  # pyright: ignore[reportPrivateUsage] - one evaluator within another
        if not x.slopes:
            return Partial(value, {})
        slope = _DERIVATIVES[name](on, x.value, value)
        return Partial(value, {i: s * slope for i, s in x.slopes.items()})

    def _choose(self, truth: Condition, one: Any, other: Any) -> Any:
        on = self.base
        if not isinstance(one, Partial | float) or not isinstance(other, Partial | float):
            return on.select(truth, one, other)
        a, b = raised(one), raised(other)
        places = [*a.slopes, *(i for i in b.slopes if i not in a.slopes)]
        slopes = {i: on.select(truth, a.slopes.get(i, 0.0), b.slopes.get(i, 0.0)) for i in places}
        return Partial(on.select(truth, a.value, b.value), slopes)

    def _known(self, truth: Condition) -> bool:
        raise DeriveError("compared", order="a condition")

    def _both(self, one: Truth, other: Truth) -> Truth:
        return self.base.both(one, other)

    def _negate(self, truth: Condition) -> Truth:
        return self.base.negate(truth)

    def real(self, integer: Integer) -> Real:
        return self.base.real(integer)

    def integer(self, real: Real) -> Integer:
        return self.base.integer(raised(real).value)

    def scale(self, real: Real, power: Integer) -> Real:
        x = raised(real)
        return Partial(self.base.scale(x.value, power), {i: self.base.scale(s, power) for i, s in x.slopes.items()})
