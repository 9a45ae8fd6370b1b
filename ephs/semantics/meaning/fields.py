"""Fields of numbers: rational numbers, and floats that know their error.

A field decides one question: is this number zero? Rational numbers decide it. A float that is larger than the bound of
its error is not zero in ℚ either, after the same operations; within the bound it counts as zero and keeps its bound.
No threshold depends on units: whoever scales an equation or a variable scales numbers and bounds alike.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar, final

import numpy as np

N = TypeVar("N")
Row: TypeAlias = dict[Any, N]
"""A linear form that vanishes: variable -> coefficient; without zeros, but for those that are known to an error."""
EPSILON = float(np.finfo(float).eps)
ROUNDED = 8.0 * EPSILON
"""Relative error of a number that was computed in a few operations."""


class Field(ABC, Generic[N]):
    """Numbers in which relations are computed."""

    __slots__ = ()
    one: N
    decides: ClassVar[bool] = False
    """Whether zero is decided, of the numbers as they are read."""
    rounding: float = ROUNDED
    """Relative error of coefficients that were computed."""

    @abstractmethod
    def number(self, value: float | Fraction, error: float = 0.0) -> N:
        """A number that is known to an error; without one it is meant exactly."""

    @abstractmethod
    def value(self, number: N) -> float:
        """The nearest float."""

    @abstractmethod
    def quotient(self, number: N, by: N) -> N:
        """One number by another, which is not zero."""

    @abstractmethod
    def subtract(self, row: Row[N], factor: N, other: Mapping[Any, N]) -> None:
        """Row ← row − factor · other, in place."""

    @abstractmethod
    def opposite(self, one: N, other: N) -> bool:
        """Whether two numbers are exactly opposite."""

    @abstractmethod
    def certain(self, number: N) -> bool:
        """Whether a number is certainly not zero."""

    @abstractmethod
    def pivot(self, rows: Sequence[Row[N]], variable: Any) -> int:
        """Index of the pivot row for the elimination of a variable, which is certainly there in all rows."""

    def exact(self, terms: Mapping[Any, float | Fraction]) -> Row[N]:
        """A linear form whose coefficients are meant exactly."""
        return {key: self.number(value) for key, value in terms.items() if value}

    def rounded(self, terms: Mapping[Any, float], sizes: Mapping[Any, float] | None = None) -> Row[N]:
        """A linear form whose coefficients were computed, with rounding beside themselves or beside larger sizes."""
        beside = sizes or {}
        return {
            key: self.number(value, self.rounding * max(abs(value), beside.get(key, 0.0)))
            for key, value in terms.items()
            if value
        }

    def support(self, row: Row[N]) -> list[Any]:
        """The variables that are certainly in a linear form."""
        return [key for key, number in row.items() if self.certain(number)]


def as_written(value: float) -> Fraction:
    """The shortest decimal fraction that is read as a float."""
    return Fraction(repr(float(value)))


@final
class Rational(Field[Fraction]):
    """ℚ: every decision is right for the numbers as they are read.

    Parameters
    ----------
    read
        The rational number of a float: itself, or for instance `as_written`.
    """

    __slots__ = ("_read",)
    one = Fraction(1)
    decides = True

    def __init__(self, read: Callable[[float], Fraction] = Fraction) -> None:
        self._read = read

    def number(self, value: float | Fraction, error: float = 0.0) -> Fraction:
        """The rational number of a float; ℚ knows no error."""
        return value if isinstance(value, Fraction) else self._read(value)

    def value(self, number: Fraction) -> float:
        """The nearest float."""
        return float(number)

    def quotient(self, number: Fraction, by: Fraction) -> Fraction:
        """One number by another."""
        return number / by

    def subtract(self, row: Row[Fraction], factor: Fraction, other: Mapping[Any, Fraction]) -> None:
        """Row ← row − factor · other."""
        for variable, value in other.items():
            left = row.get(variable, 0) - factor * value
            if left:
                row[variable] = left
            else:
                row.pop(variable, None)

    def opposite(self, one: Fraction, other: Fraction) -> bool:
        """Whether two numbers are opposite."""
        return one == -other

    def certain(self, number: Fraction) -> bool:
        """Whether a number is not zero."""
        return bool(number)

    def pivot(self, rows: Sequence[Row[Fraction]], variable: Any) -> int:
        """The shortest row."""
        return min(range(len(rows)), key=lambda i: len(rows[i]))


Bounded: TypeAlias = tuple[float, float]
"""A float, and the bound of its error; the float is zero where it may be."""


@final
class Rounded(Field[Bounded]):
    """Floats with bounds of their errors (running error analysis).

    Parameters
    ----------
    rounding
        Relative error of coefficients that were computed.
    """

    __slots__ = ("rounding",)
    one = (1.0, 0.0)

    def __init__(self, rounding: float = ROUNDED) -> None:
        self.rounding = rounding

    def number(self, value: float | Fraction, error: float = 0.0) -> Bounded:
        """A float and the bound of its error."""
        nearest = float(value)
        size = abs(nearest)
        return (nearest, error) if size > error else (0.0, error + size)

    def value(self, number: Bounded) -> float:
        """The float."""
        return number[0]

    def quotient(self, number: Bounded, by: Bounded) -> Bounded:
        """One number by another, which is larger than its error."""
        (a, da), (b, db) = number, by
        quotient = a / b
        size = abs(quotient)
        return quotient, (da + size * db) / max(abs(b) - db, EPSILON * abs(b)) + EPSILON * size

    def subtract(self, row: Row[Bounded], factor: Bounded, other: Mapping[Any, Bounded]) -> None:
        """Row ← row − factor · other; what is within its error bound is zero with that bound."""
        f, df = factor
        size = abs(f)
        for variable, (b, db) in other.items():
            product = f * b
            a, da = row.get(variable, (0.0, 0.0))
            left = a - product
            error = da + size * db + df * (abs(b) + db) + EPSILON * (abs(product) + abs(left))
            if abs(left) > error:
                row[variable] = (left, error)
            elif error:
                row[variable] = (0.0, error + abs(left))
            else:
                row.pop(variable, None)

    def opposite(self, one: Bounded, other: Bounded) -> bool:
        """Whether two numbers are exactly opposite."""
        return one[0] == -other[0] and one[1] == other[1] == 0.0

    def certain(self, number: Bounded) -> bool:
        """Whether a number is above its error bound."""
        return bool(number[0])

    def pivot(self, rows: Sequence[Row[Bounded]], variable: Any) -> int:
        """Of the rows in which the variable is large the shortest; sizes are beside those of columns, then of rows."""
        if len(rows) == 1:
            return 0
        columns: dict[Any, float] = {}
        for row in rows:
            for key, (value, _) in row.items():
                if value:
                    columns[key] = max(columns.get(key, 0.0), abs(value))
        largest = columns[variable]
        shares = [
            abs(row[variable][0]) / largest / max(abs(value) / columns[key] for key, (value, _) in row.items() if value)
            for row in rows
        ]
        enough = 0.1 * max(shares)
        return min((i for i, share in enumerate(shares) if share >= enough), key=lambda i: len(rows[i]))
