"""Tables of records with named fields: rows of integers in one array, of real numbers in another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, ClassVar, Generic, Self, TypeVar, cast, final, overload

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals, Cells, IntegerCells, RealCells, inside
from ephs.semantics.stage.numbers import Integer, Real
from ephs.semantics.stage.reaching import Reached, Signature


class _RecordField:
    """A named place in a record, its offset fixed when the class is made."""

    __slots__ = ("name", "offset", "shape")

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.name, self.shape, self.offset = "", shape, 0

    @final
    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @final
    def _nested(self, cells: Cells[Any], start: Integer) -> list[Any]:
        """Return lists of the shape, filled in order."""

        def rows(shape: tuple[int, ...], first: int) -> Any:
            if not shape:
                return cells.load(start + first)
            step = prod(shape[1:])
            return [rows(shape[1:], first + k * step) for k in range(shape[0])]

        return rows(self.shape, self.offset)

    @final
    def _keep(self, cells: Cells[Any], start: Integer, value: object) -> None:
        """Keep lists of the shape, in order."""
        for place, entry in enumerate(self._entries(value, self.shape)):
            cells.store(start + (self.offset + place), entry)

    @final
    def _entries(self, value: object, shape: tuple[int, ...]) -> Iterator[Any]:
        """Yield the numbers of lists of the shape, in order."""
        if not shape:
            yield value
            return
        if not isinstance(value, list | tuple) or len(cast("list[Any]", value)) != shape[0]:
            found = len(cast("list[Any]", value)) if isinstance(value, list | tuple) else type(value).__name__
            raise StageError("shape", field=self.name, expected=self.shape, found=found)
        for entry in cast("list[Any]", value):
            yield from self._entries(entry, shape[1:])


@final
class RealField(_RecordField):
    """One real number of a record."""

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> Real: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | Real":
        return self if row is None else row.reals.load(row.real_start + self.offset)

    def __set__(self, row: "Record", value: Real) -> None:
        row.reals.store(row.real_start + self.offset, value)


@final
class IntegerField(_RecordField):
    """One integer of a record."""

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> Integer: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | Integer":
        return self if row is None else row.integers.load(row.integer_start + self.offset)

    def __set__(self, row: "Record", value: Integer) -> None:
        row.integers.store(row.integer_start + self.offset, value)


@final
class FunctionField(_RecordField):
    """A function of a record: its address, an integer, with a signature that is known while staging."""

    __slots__ = ("signature",)

    def __init__(self, signature: Signature) -> None:
        super().__init__(())
        self.signature = signature

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> Reached: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | Reached":
        return self if row is None else Reached(self.signature, row.integers.load(row.integer_start + self.offset))

    def __set__(self, row: "Record", value: Integer) -> None:
        row.integers.store(row.integer_start + self.offset, value)


@final
class IntegersField(_RecordField):
    """Integers of a record."""

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> list[Integer]: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | list[Integer]":
        return self if row is None else self._nested(row.integers, row.integer_start)

    def __set__(self, row: "Record", value: Sequence[Integer]) -> None:
        self._keep(row.integers, row.integer_start, value)


@final
class VectorField(_RecordField):
    """Real numbers of a record, as a list."""

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> list[Real]: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | list[Real]":
        return self if row is None else self._nested(row.reals, row.real_start)

    def __set__(self, row: "Record", value: Sequence[Real]) -> None:
        self._keep(row.reals, row.real_start, value)


@final
class MatrixField(_RecordField):
    """Real numbers of a record, as a list of rows."""

    @overload
    def __get__(self, row: None, owner: type) -> Self: ...
    @overload
    def __get__(self, row: "Record", owner: type) -> list[list[Real]]: ...
    def __get__(self, row: "Record | None", owner: type) -> "Self | list[list[Real]]":
        return self if row is None else self._nested(row.reals, row.real_start)

    def __set__(self, row: "Record", value: Sequence[Sequence[Real]]) -> None:
        self._keep(row.reals, row.real_start, value)


def real() -> RealField:
    """Declare one real number of a record, or a real argument of a program."""
    return RealField(())


def integer() -> IntegerField:
    """Declare one integer of a record, or an integer argument of a program."""
    return IntegerField(())


def function(signature: Signature) -> FunctionField:
    """Declare a function of a record: set its address, and call what is read by `Evaluator.reach`."""
    return FunctionField(signature)


def integers(size: int) -> IntegersField:
    """Declare integers of a record."""
    return IntegersField((size,))


@overload
def reals(rows: int) -> VectorField:
    """Declare a list of real numbers."""


@overload
def reals(rows: int, columns: int) -> MatrixField:
    """Declare a list of rows of real numbers."""


def reals(rows: int, columns: int | None = None) -> VectorField | MatrixField:
    """Declare real numbers of a record: a list, or a list of rows."""
    return VectorField((rows,)) if columns is None else MatrixField((rows, columns))


class Record:
    """A row of a table: subclass it with fields, `mass = real()`, `rotation = reals(3, 3)`, `parent = integer()`."""

    __slots__ = ("integer_start", "integers", "real_start", "reals")
    integers: IntegerCells
    integer_start: Integer
    reals: RealCells
    real_start: Integer
    integer_width: ClassVar[int] = 0
    real_width: ClassVar[int] = 0

    def __init_subclass__(cls) -> None:
        cls.integer_width = cls.real_width = 0
        for field in (field for field in vars(cls).values() if isinstance(field, _RecordField)):
            if isinstance(field, IntegerField | IntegersField | FunctionField):
                field.offset, cls.integer_width = cls.integer_width, cls.integer_width + prod(field.shape)
            else:
                field.offset, cls.real_width = cls.real_width, cls.real_width + prod(field.shape)

    @final
    def __init__(self, integers: IntegerCells, integer_start: Integer, reals: RealCells, real_start: Integer) -> None:
        object.__setattr__(self, "integers", integers)
        object.__setattr__(self, "integer_start", integer_start)
        object.__setattr__(self, "reals", reals)
        object.__setattr__(self, "real_start", real_start)

    @final
    def __setattr__(self, name: str, value: object) -> None:
        if not isinstance(getattr(type(self), name, None), _RecordField):
            raise _no_field(type(self), name)
        object.__setattr__(self, name, value)

    @final
    def __getattr__(self, name: str) -> Any:
        raise _no_field(type(self), name)

    @final
    @classmethod
    def table(cls, size: int, members: int | None = None) -> "Table[Self]":
        """Return a table of `size` rows of zeros in NumPy arrays of its own; real numbers for so many members."""
        return Table(
            cls,
            ArrayIntegers(np.zeros(size * cls.integer_width, dtype=np.int64)),
            ArrayReals(np.zeros((size * cls.real_width, *([] if members is None else [members])))),
            size,
        )


def _no_field(cls: type[Record], name: str) -> StageError:
    fields = [key for key, field in vars(cls).items() if isinstance(field, _RecordField)]
    return StageError("field", record=cls.__name__, found=name, expected=", ".join(fields))


Row = TypeVar("Row", bound=Record)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Table(Generic[Row]):
    """Rows of one class of records: their integers in one array, their real numbers in another.

    Attributes
    ----------
    record
        The class of the rows.
    integers, reals
        Where the numbers live, row after row.
    size
        How many rows.
    """

    record: type[Row]
    integers: IntegerCells
    reals: RealCells
    size: Integer

    __iter__ = None  # Python would ask for rows without end.

    def __getitem__(self, index: Integer) -> Row:
        inside(index, self.size, f"a table of {self.record.__name__}")
        record = self.record
        return record(self.integers, index * record.integer_width, self.reals, index * record.real_width)

    @property
    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The integers and the real numbers of a table of NumPy arrays, as `Record.table` makes it."""
        assert isinstance(self.integers, ArrayIntegers)
        assert isinstance(self.reals, ArrayReals)
        return self.integers.array, self.reals.array

    def column(self, field: "IntegerField | FunctionField") -> NDArray[np.int64]:
        """(size,) one integer of all rows, a view."""
        return self.arrays[0].reshape(-1, self.record.integer_width)[:, field.offset]
