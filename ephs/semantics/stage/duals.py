"""Dual numbers over any evaluator: the exact derivative along directions, computed beside the value."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator, Function, Layered
from ephs.semantics.stage.memory import Cells, RealCells
from ephs.semantics.stage.numbers import ORDERS, Integer, Number, Operation, Order, Real, StagedCondition, Truth
from ephs.semantics.stage.reaching import Part

Ruled: TypeAlias = tuple[Real, tuple[Real, ...]]
"""The value of a function, and its derivative by each argument."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class StagedDual(Number):
    """A value, and its derivative along each direction.

    Attributes
    ----------
    level
        1, or beyond that of the numbers that value and slopes are: a number of a lower level is a constant.
    """

    value: Real
    slopes: tuple[Real, ...]
    level: int = 0

    def __post_init__(self) -> None:
        if not self.level:
            object.__setattr__(self, "level", 1 + (self.value.level if isinstance(self.value, StagedDual) else 0))

    def _split(self, number: Real) -> tuple[Real, tuple[Real, ...]]:
        if isinstance(number, StagedDual) and number.level == self.level:
            return number.value, number.slopes
        return number, (0.0,) * len(self.slopes)

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        (a, da), (b, db), level = *_pair(left, right), _level(left, right)
        pairs = list(zip(da, db, strict=True))
        match operation:
            case "+":
                return StagedDual(a + b, tuple(_plus(x, y) for x, y in pairs), level)
            case "-":
                return StagedDual(a - b, tuple(_plus(x, -y) for x, y in pairs), level)
            case "*":
                return StagedDual(a * b, tuple(_plus(_times(x, b), _times(y, a)) for x, y in pairs), level)
            case "/":
                quotient = a / b
                return StagedDual(quotient, tuple(_over(_plus(x, -_times(y, quotient)), b) for x, y in pairs), level)

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        (a, _), (b, _) = _pair(left, right)
        return ORDERS[order](a, b)

    def _negative(self) -> Real:
        return StagedDual(-self.value, tuple(-slope for slope in self.slopes), self.level)


def _level(left: Real, right: Real) -> int:
    return max(number.level for number in (left, right) if isinstance(number, StagedDual))


def _pair(left: Real, right: Real) -> tuple[Ruled, Ruled]:
    """Both numbers as ones of the higher level."""
    top = max((number for number in (left, right) if isinstance(number, StagedDual)), key=lambda number: number.level)
    return top._split(left), top._split(right)  # pyright: ignore[reportPrivateUsage]


def _nought(slope: Real) -> bool:
    """Tell whether a slope is identically zero: the number is a constant."""
    return type(slope) is float and slope == 0.0


def _plus(one: Real, other: Real) -> Real:
    return other if _nought(one) else one if _nought(other) else one + other


def _times(slope: Real, factor: Real) -> Real:
    return 0.0 if _nought(slope) else slope * factor


def _over(slope: Real, divisor: Real) -> Real:
    return 0.0 if _nought(slope) else slope / divisor


@final
@dataclass(frozen=True, slots=True, eq=False)
class DualCells(Cells[Real]):
    """Cells of dual numbers: of values, and of the slopes of each value in a row.

    Attributes
    ----------
    values, slopes
        Where they live. Without slopes the numbers are constants, and only constants are stored.
    directions
        How many slopes a value has.
    """

    values: RealCells
    slopes: RealCells | None
    directions: int

    @property
    def level(self) -> int:
        """Level of the numbers."""
        return 1 + (self.values.level if isinstance(self.values, DualCells) else 0)

    def load(self, index: Integer) -> Real:
        """Return the number at an index."""
        value, slopes = self.values.load(index), self.slopes
        if slopes is None:
            return StagedDual(value, (0.0,) * self.directions, self.level)
        first = index * self.directions
        return StagedDual(value, tuple(slopes.load(first + k) for k in range(self.directions)), self.level)

    def store(self, index: Integer, value: Real) -> None:
        """Keep a number at an index."""
        slopes: tuple[Real, ...] = (0.0,) * self.directions
        if isinstance(value, StagedDual) and value.level == self.level:
            value, slopes = value.value, value.slopes
        self.values.store(index, value)
        for k, slope in enumerate(slopes):
            if self.slopes is not None:
                self.slopes.store(index * self.directions + k, slope)
            elif isinstance(slope, Number) or slope != 0.0:
                raise StageError("passive")


@final
@dataclass(frozen=True, slots=True)
class Duals(Layered):
    """Evaluation with dual numbers of another evaluator's numbers.

    Attributes
    ----------
    base
        The evaluator of values and slopes.
    directions
        How many derivatives are computed at once.
    """

    base: Evaluator
    directions: int = 1

    @property
    def level(self) -> int:
        """Level of the numbers: 1, or one more than that of the numbers below."""
        return 1 + (self.base.level if isinstance(self.base, Duals) else 0)

    def dual(self, number: Real, slopes: tuple[Real, ...] | None = None) -> StagedDual:
        """Return a number of the base with slopes as a dual one; a constant has none, and a dual number its own."""
        if slopes is None and isinstance(number, StagedDual) and number.level == self.level:
            return number
        return StagedDual(number, (0.0,) * self.directions if slopes is None else slopes, self.level)

    def bare(self, number: Real) -> Real:
        """Return the base's number of one."""
        return number.value if isinstance(number, StagedDual) and number.level == self.level else number

    def constant(self, number: Real) -> Real:
        """Return a number of the base as a constant."""
        return self.dual(number)

    def along(self, value: Real, direction: int, slope: float = 1.0) -> StagedDual:
        """Return a number that changes with one direction."""
        return self.dual(value, tuple(slope if k == direction else 0.0 for k in range(self.directions)))

    def cells(self, values: RealCells, slopes: RealCells | None = None) -> RealCells:
        """Return cells of dual numbers."""
        return DualCells(values, slopes, self.directions)

    def _function(self, name: Function, *arguments: Real) -> Real:
        numbers = [self.dual(number) for number in arguments]
        value, factors = RULES[name](self.base, [number.value for number in numbers])
        slopes: tuple[Real, ...] = (0.0,) * self.directions
        for factor, number in zip(factors, numbers, strict=True):
            slopes = tuple(_plus(s, _times(n, factor)) for s, n in zip(slopes, number.slopes, strict=True))
        return self.dual(value, slopes)

    def scale(self, real: Real, power: Integer) -> Real:
        x = self.dual(real)
        return self.dual(self.base.scale(x.value, power), tuple(self.base.scale(slope, power) for slope in x.slopes))

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        if not isinstance(one, float | Number) and not isinstance(other, float | Number):
            return self.base.select(truth, one, other)
        a, b = self.dual(one), self.dual(other)
        return self.dual(self.base.select(truth, a.value, b.value), self.base.select(truth, a.slopes, b.slopes))

    def _reals(self, size: int) -> RealCells:
        return self.cells(self.base._reals(size), self.base._reals(size * self.directions))

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        constants = self.base._constants(values, whole)
        return constants if whole else self.cells(constants)

    def _handed(self, cells: Any, start: Integer) -> tuple[Part, Part]:
        if not isinstance(cells, DualCells) or cells.slopes is None:
            raise StageError("passive")
        return ("reals", (cells.values, start)), ("reals", (cells.slopes, start * self.directions))

    def _tape(self) -> list[Part]:
        return []

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return self.base._call(on, function, arguments)


def _atan2(on: Evaluator, x: Sequence[Real]) -> Ruled:
    square = x[0] * x[0] + x[1] * x[1]
    return on.atan2(x[0], x[1]), (x[1] / square, -x[0] / square)


def _sqrt(on: Evaluator, x: Sequence[Real]) -> Ruled:
    root = on.sqrt(x[0])
    return root, (0.5 / root,)


def _exp(on: Evaluator, x: Sequence[Real]) -> Ruled:
    power = on.exp(x[0])
    return power, (power,)


def _copysign(on: Evaluator, x: Sequence[Real]) -> Ruled:
    return on.copysign(x[0], x[1]), (on.copysign(1.0, x[0]) * on.copysign(1.0, x[1]), 0.0)


RULES: Final[dict[Function, Callable[[Evaluator, Sequence[Real]], Ruled]]] = {
    "sqrt": _sqrt,
    "absolute": lambda on, x: (on.absolute(x[0]), (on.copysign(1.0, x[0]),)),
    "floor": lambda on, x: (on.floor(x[0]), (0.0,)),
    "sin": lambda on, x: (on.sin(x[0]), (on.cos(x[0]),)),
    "cos": lambda on, x: (on.cos(x[0]), (-on.sin(x[0]),)),
    "exp": _exp,
    "log": lambda on, x: (on.log(x[0]), (1.0 / x[0],)),
    "atan2": _atan2,
    "copysign": _copysign,
}
"""Value of each function, and its derivatives by the arguments."""
