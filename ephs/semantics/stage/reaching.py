"""Functions called by address: their signatures, and calls from Python.

What a program calls so is not part of it: a table says which, and the program is compiled once. The float run calls
the same address, so that both give the same bits.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias, cast, final

import numpy as np

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals, Cells, HeldCells, Integers, Matrix, Vector
from ephs.semantics.stage.numbers import Integer, Number, Real

Atom: TypeAlias = Literal["reals", "integers", "real", "integer"]
"""Parts of an argument: an array of floats or of integers, a float, an integer."""
Argument: TypeAlias = Vector | Integers | Matrix | Real | Integer
"""Arguments of a function called by address."""
Part: TypeAlias = tuple[Atom, Any]
"""An atom and its value: a number, or cells and the place of the first."""


@final
@dataclass(frozen=True, slots=True)
class Signature:
    """Calling convention of a function.

    Attributes
    ----------
    arguments
        The atoms of each argument. An array that is one atom alone is handed over without its size.
    returns
        Whether it returns an integer, a status; else nothing.
    """

    arguments: tuple[tuple[Atom, ...], ...]
    returns: bool = True


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """A function at an address, with an unchecked signature."""

    signature: Signature
    address: Integer


def parts_of(function: Reached, arguments: Sequence[Argument]) -> list[Part]:
    """Return the atoms of arguments, checked against a signature.

    Raises
    ------
    StageError
        There are more or fewer arguments than the function takes, or others.
    """
    wanted = function.signature.arguments
    if len(arguments) != len(wanted):
        raise StageError("reached", expected=f"{len(wanted)} arguments", found=len(arguments))
    parts: list[Part] = []
    for place, (argument, atoms) in enumerate(zip(arguments, wanted, strict=True)):
        found = _atoms(argument)[: len(atoms)]
        if tuple(atom for atom, _ in found) != atoms:
            what = type(argument).__name__
            raise StageError("reached", expected=f"{' and '.join(atoms)} as argument {place + 1}", found=what)
        parts += found
    return parts


def _atoms(argument: Argument) -> list[Part]:
    match argument:
        case Vector(cells, start, size):
            return [("reals", (cells, start)), ("integer", size)]
        case Integers(cells, start, size):
            return [("integers", (cells, start)), ("integer", size)]
        case Matrix(cells, start, rows, columns):
            return [("reals", (cells, start)), ("integer", rows), ("integer", columns)]
        case float() | Number():
            return [("real", argument)]
        case _:
            return [("integer", argument)]


_TYPES: Final[dict[Atom, Any]] = {
    "reals": ctypes.c_void_p,
    "integers": ctypes.c_void_p,
    "real": ctypes.c_double,
    "integer": ctypes.c_int64,
}


def called(function: Reached, parts: Sequence[Part]) -> int:
    """Call a function from Python; its status, 0 where it returns none.

    Raises
    ------
    StageError
        An argument is not made of floats, or the address of integers.
    """
    copies: dict[int, tuple[HeldCells[Any], np.ndarray[Any, Any]]] = {}

    def passed(atom: Atom, value: Any) -> Any:
        if atom in ("real", "integer"):
            return _known(value)
        cells, start = cast("tuple[Cells[Any], Any]", value)
        if isinstance(cells, ArrayReals | ArrayIntegers):
            array: np.ndarray[Any, Any] = cells.array
        elif isinstance(cells, HeldCells):
            array = copies.setdefault(id(cells), (cells, _copied(cells, atom)))[1]
        else:
            raise StageError("unreached", what=type(cells).__name__)
        return array.__array_interface__["data"][0] + 8 * _known(start)

    types = [_TYPES[atom] for atom, _ in parts]
    prototype = ctypes.CFUNCTYPE(ctypes.c_int64 if function.signature.returns else None, *types)
    found = prototype(_known(function.address))(*(passed(atom, value) for atom, value in parts))
    for cells, array in copies.values():
        cells.entries[:] = array.tolist() if array.dtype == np.int64 else list(array)
    return int(found) if function.signature.returns else 0


def _known(value: Any) -> Any:
    if not isinstance(value, float | int):
        raise StageError("unreached", what=type(value).__name__)
    return value


def _copied(cells: HeldCells[Any], atom: Atom) -> "np.ndarray[Any, Any]":
    entries = [_known(entry) for entry in cells.entries]
    return np.array(entries, dtype=np.float64 if atom == "reals" else np.int64)
