"""Kinds of arguments: the arrays and numbers that a program is handed for each, and what they make inside."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias, cast, final

import numpy as np

from ephs.semantics.stage.duals import Dual, DualCells
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals, Integers, Matrix, RealCells, Vector
from ephs.semantics.stage.records import Record, Table

__all__ = ["INTEGER", "REAL", "Atom", "Kind", "described", "dual", "indices", "matrix", "table", "vector"]

Atom: TypeAlias = Literal["reals", "integers", "real", "integer"]
"""What an argument is made of: an array of floats or of integers, a float, an integer."""


@final
@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of argument.

    Attributes
    ----------
    expected
        What it takes, in words.
    atoms
        What it is handed over as.
    split
        Returns the atoms of a value, arrays and numbers; None where the value is not of this kind.
    join
        Returns the argument that cells and numbers make.
    """

    expected: str
    atoms: tuple[Atom, ...]
    split: Callable[[Any], tuple[Any, ...] | None]
    join: Callable[[list[Any]], Any]


def _array(value: Any, dtype: type[np.generic], shape: tuple[int | None, ...]) -> bool:
    """Tell whether a value is a contiguous array of a type and a shape."""
    if not isinstance(value, np.ndarray):
        return False
    array = cast("np.ndarray[Any, np.dtype[Any]]", value)
    fits = len(array.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    return fits and array.dtype == dtype and array.flags.c_contiguous and array.flags.aligned


def _is_integer(value: Any) -> bool:
    return isinstance(value, int | np.integer)


def _of_real(value: Any) -> tuple[Any, ...] | None:
    return (float(cast("float", value)),) if isinstance(value, float | int) or _is_integer(value) else None


def _of_integer(value: Any) -> tuple[Any, ...] | None:
    return (int(cast("int", value)),) if _is_integer(value) else None


REAL: Final = Kind("a real number", ("real",), _of_real, lambda parts: parts[0])
INTEGER: Final = Kind("an integer", ("integer",), _of_integer, lambda parts: parts[0])


def vector(size: int | None = None) -> Kind:
    """Describe an argument that is an array of floats of one dimension."""
    return Kind(
        f"a contiguous array of float64 of shape ({'n' if size is None else size},)",
        ("reals", "integer"),
        lambda value: (value, len(value)) if _array(value, np.float64, (size,)) else None,
        lambda parts: Vector(parts[0], 0, parts[1] if size is None else size),
    )


def indices(size: int | None = None) -> Kind:
    """Describe an argument that is an array of integers of one dimension."""
    return Kind(
        f"a contiguous array of int64 of shape ({'n' if size is None else size},)",
        ("integers", "integer"),
        lambda value: (value, len(value)) if _array(value, np.int64, (size,)) else None,
        lambda parts: Integers(parts[0], 0, parts[1] if size is None else size),
    )


def matrix(columns: int | None = None) -> Kind:
    """Describe an argument that is an array of floats of two dimensions."""
    return Kind(
        f"a contiguous array of float64 of shape (m, {'n' if columns is None else columns})",
        ("reals", "integer", "integer"),
        lambda value: (value, *value.shape) if _array(value, np.float64, (None, columns)) else None,
        lambda parts: Matrix(parts[0], 0, parts[1], parts[2] if columns is None else columns),
    )


def table(record: type[Record]) -> Kind:
    """Describe an argument that is a table of records."""

    def split(value: Any) -> tuple[Any, ...] | None:
        match value:
            case Table(record=kind, integers=ArrayIntegers(whole), reals=ArrayReals(real), size=size):
                return (whole, real, size) if kind is record else None
            case _:
                return None

    name = record.__name__
    return Kind(
        f"a table of {name}, as {name}.table(…) makes it",
        ("integers", "reals", "integer"),
        split,
        lambda parts: Table(record, *parts),
    )


def dual(kind: Kind, directions: int, active: bool) -> Kind:
    """Return the kind of an argument of dual numbers: a value and its slopes, or, not active, a constant."""

    def split(value: Any) -> tuple[Any, ...] | None:
        match value:
            case (values, slopes) if (parts := kind.split(values)) is not None:
                size = sum(part.size for part, atom in zip(parts, kind.atoms, strict=True) if atom == "reals")
                size = directions * (size + kind.atoms.count("real"))
                fits = isinstance(slopes, np.ndarray) and _array(slopes.reshape(-1), np.float64, (size,))
                return (*parts, cast("Any", slopes)) if fits and slopes.flags.c_contiguous else None
            case _:
                return None

    def join(parts: list[Any]) -> Any:
        slopes: RealCells | None = parts[len(kind.atoms)] if active else None
        made: list[Any] = []
        for part, atom in zip(parts, kind.atoms, strict=False):
            if atom == "reals":
                made.append(DualCells(part, slopes, directions))
            elif atom == "real":
                rates = tuple(0.0 if slopes is None else slopes.load(k) for k in range(directions))
                made.append(Dual(part, rates))
            else:
                made.append(part)
        return kind.join(made)

    if not active or not {"reals", "real"}.intersection(kind.atoms):
        return Kind(kind.expected, kind.atoms, kind.split, join)
    shape = "of its shape" if directions == 1 else f"of its shape and {directions} directions after it"
    return Kind(f"a pair: {kind.expected}, and its slopes, float64 {shape}", (*kind.atoms, "reals"), split, join)


def described(value: Any) -> str:
    """Describe a value that was found, for errors."""
    if isinstance(value, np.ndarray):
        array = cast("np.ndarray[Any, np.dtype[Any]]", value)
        order = "an" if array.flags.c_contiguous else "a non-contiguous"
        return f"{order} array of {array.dtype} of shape {array.shape}"
    if isinstance(value, Table):
        return f"a table of {cast('Table[Record]', value).record.__name__}"
    return f"{value!r} ({type(value).__name__})"
