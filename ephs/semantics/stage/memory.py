"""Memory of staged programs: cells, and vectors, matrices and variables on them.

Cells load and store one number; only they know where numbers live. An index that is known is
checked against the size where that is known too: everywhere in plain evaluation.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Generic, Self, TypeAlias, TypeVar, cast, final

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


@dataclass(frozen=True, slots=True, eq=False)
class _Window(Generic[Value]):
    """Numbers in a row."""

    cells: Cells[Value]
    start: Integer
    size: Integer
    what: ClassVar[str]
    """Its kind in the texts of errors."""

    __iter__ = None  # Python would ask for entries without end.

    @final
    def __getitem__(self, index: Integer) -> Value:
        return self.cells.load(self.start + inside(index, self.size, self.what))

    @final
    def __setitem__(self, index: Integer, value: Value) -> None:
        self.cells.store(self.start + inside(index, self.size, self.what), value)

    @final
    def part(self, start: Integer, length: Integer) -> Self:
        """Return a window of this memory: `length` entries from `start`."""
        if isinstance(start, int) and isinstance(length, int) and isinstance(self.size, int) and length:
            inside(start, self.size, self.what)
            inside(start + length - 1, self.size, self.what)
        return type(self)(self.cells, self.start + start, length)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Vector(_Window[Real]):
    """Real numbers in a row.

    Attributes
    ----------
    cells, start
        Where they live, and the place of the first.
    size
        How many.
    """

    what = "a vector"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Integers(_Window[Integer]):
    """Integers in a row, like `Vector`."""

    what = "integers"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """Real numbers in rows of equal length, row after row."""

    cells: RealCells
    start: Integer
    rows: Integer
    columns: Integer

    __iter__ = None  # Python would ask for entries without end.

    def _index(self, row: Integer, column: Integer) -> Integer:
        inside(row, self.rows, "the rows of a matrix")
        inside(column, self.columns, "the columns of a matrix")
        return self.start + (row * self.columns + column)

    def __getitem__(self, at: tuple[Integer, Integer]) -> Real:
        return self.cells.load(self._index(*at))

    def __setitem__(self, at: tuple[Integer, Integer], value: Real) -> None:
        self.cells.store(self._index(*at), value)

    def row(self, row: Integer) -> Vector:
        """Return a row as a window of this memory."""
        return Vector(
            self.cells, self.start + inside(row, self.rows, "the rows of a matrix") * self.columns, self.columns
        )
