"""Memory of staged programs: cells, and vectors, matrices and variables on them.

Cells load and store one number; only they know where numbers live. An index that is known is
checked against the size where that is known too: everywhere in plain evaluation.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar, cast, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.numbers import Integer, Real

Value = TypeVar("Value")


class Cells(ABC, Generic[Value]):
    """Memory of numbers."""

    __slots__ = ()

    @abstractmethod
    def load(self, index: Integer) -> Value:
        """Return the number at an index."""

    @abstractmethod
    def store(self, index: Integer, value: Value) -> None:
        """Keep a number at an index."""


RealCells: TypeAlias = Cells[Real]
IntegerCells: TypeAlias = Cells[Integer]


@final
@dataclass(frozen=True, slots=True, eq=False)
class HeldCells(Cells[Value]):
    """Cells in a Python list; floats divide by zero as in IEEE 754."""

    entries: list[Value]

    def load(self, index: Integer) -> Value:
        return self.entries[index]

    def store(self, index: Integer, value: Value) -> None:
        self.entries[index] = cast("Value", np.float64(value)) if type(value) is float else value


@final
class Variable(Generic[Value]):
    """A number that loops and branches change: read and set `value`."""

    __slots__ = ("cells",)

    def __init__(self, cells: Cells[Value]) -> None:
        self.cells = cells

    @property
    def value(self) -> Value:
        """The present value."""
        return self.cells.load(0)

    @value.setter
    def value(self, value: Value) -> None:
        self.cells.store(0, value)


@final
@dataclass(frozen=True, slots=True, eq=False)
class ArrayReals(RealCells):
    """Cells in a NumPy array of floats."""

    array: NDArray[np.float64]

    def load(self, index: Integer) -> Real:
        return self.array[cast("int", index)]

    def store(self, index: Integer, value: Real) -> None:
        if not isinstance(value, float | int):
            raise StageError("shared")
        self.array[cast("int", index)] = value


@final
@dataclass(frozen=True, slots=True, eq=False)
class ArrayIntegers(IntegerCells):
    """Cells in a NumPy array of 64-bit integers."""

    array: NDArray[np.int64]

    def load(self, index: Integer) -> Integer:
        return int(self.array[cast("int", index)])

    def store(self, index: Integer, value: Integer) -> None:
        self.array[cast("int", index)] = cast("int", value)


def inside(index: Integer, size: Integer, what: str) -> Integer:
    """Return an index; refuse one that is known and outside."""
    if isinstance(index, int) and (index < 0 or (isinstance(size, int) and index >= size)):
        raise StageError("index", index=index, what=what, last=size - 1)
    return index


def _part(start: Integer, length: Integer, size: Integer, what: str) -> None:
    if isinstance(start, int) and isinstance(length, int) and isinstance(size, int) and length:
        inside(start, size, what)
        inside(start + length - 1, size, what)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Vector:
    """Real numbers in a row.

    Attributes
    ----------
    cells, start
        Where they live, and the place of the first.
    size
        How many.
    """

    cells: RealCells
    start: Integer
    size: Integer

    __iter__ = None  # Python would ask for entries without end.

    def __getitem__(self, index: Integer) -> Real:
        return self.cells.load(self.start + inside(index, self.size, "a vector"))

    def __setitem__(self, index: Integer, value: Real) -> None:
        self.cells.store(self.start + inside(index, self.size, "a vector"), value)

    def part(self, start: Integer, length: Integer) -> "Vector":
        """Return a window of this memory: `length` entries from `start`."""
        _part(start, length, self.size, "a vector")
        return Vector(self.cells, self.start + start, length)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Integers:
    """Integers in a row, like `Vector`."""

    cells: IntegerCells
    start: Integer
    size: Integer

    __iter__ = None  # Python would ask for entries without end.

    def __getitem__(self, index: Integer) -> Integer:
        return self.cells.load(self.start + inside(index, self.size, "integers"))

    def __setitem__(self, index: Integer, value: Integer) -> None:
        self.cells.store(self.start + inside(index, self.size, "integers"), value)

    def part(self, start: Integer, length: Integer) -> "Integers":
        """Return a window of this memory: `length` entries from `start`."""
        _part(start, length, self.size, "integers")
        return Integers(self.cells, self.start + start, length)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """Real numbers in rows of equal length, row after row."""

    cells: RealCells
    start: Integer
    rows: Integer
    columns: Integer

    __iter__ = None  # Python would ask for entries without end.

    def _at(self, row: Integer, column: Integer) -> Integer:
        inside(row, self.rows, "the rows of a matrix")
        inside(column, self.columns, "the columns of a matrix")
        return self.start + (row * self.columns + column)

    def __getitem__(self, at: tuple[Integer, Integer]) -> Real:
        return self.cells.load(self._at(*at))

    def __setitem__(self, at: tuple[Integer, Integer], value: Real) -> None:
        self.cells.store(self._at(*at), value)

    def row(self, row: Integer) -> Vector:
        """Return a row as a window of this memory."""
        return Vector(
            self.cells, self.start + inside(row, self.rows, "the rows of a matrix") * self.columns, self.columns
        )
