"""Kinds of arguments: arrays and numbers passed to a program, and their views while staging."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, Any, Final, TypeAlias, cast, final, get_args, get_origin

import numpy as np

from ephs.semantics.stage.duals import DualCells, StagedDual
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals, Integers, Matrix, RealCells, Vector
from ephs.semantics.stage.numbers import Integer, Real
from ephs.semantics.stage.reaching import Atom, Signature
from ephs.semantics.stage.records import IntegerField, RealField, Record, Table
from ephs.semantics.stage.taped import Taped, TapedCells

ANY: Final = 2**40
"""Size of memory without a known bound."""
Shape: TypeAlias = tuple[int | None, ...]
"""A shape, None where any size will do."""


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
        Returns the atoms of a value, arrays and numbers; None where the value is not of this kind. Arrays of real
        numbers, and real numbers, have a shape of members after their own.
    join
        Returns the argument that cells and numbers make.
    mapped
        Of a group: returns the group of its parts changed by a function.
    """

    expected: str
    atoms: tuple[Atom, ...]
    split: Callable[[Any, Shape], tuple[Any, ...] | None]
    join: Callable[[list[Any]], Any]
    mapped: "Callable[[Callable[[Kind], Kind]], Kind] | None" = None


_DTYPES: Final[dict[type[np.generic], np.dtype[Any]]] = {kind: np.dtype(kind) for kind in (np.float64, np.int64)}


def _array(value: Any, dtype: type[np.generic], shape: Shape) -> bool:
    """Tell whether a value is a contiguous array of a type and a shape."""
    if not isinstance(value, np.ndarray):
        return False
    array = cast("np.ndarray[Any, np.dtype[Any]]", value)
    if len(array.shape) != len(shape) or array.dtype != _DTYPES[dtype]:
        return False
    for want, have in zip(shape, array.shape, strict=True):
        if want is not None and want != have:
            return False
    flags = array.flags
    return flags.c_contiguous and flags.aligned


def _is_integer(value: Any) -> bool:
    return isinstance(value, int | np.integer)


def _of_real(value: Any, trail: Shape) -> tuple[Any, ...] | None:
    if trail:
        return (value,) if _array(value, np.float64, trail) else None
    return (float(cast("float", value)),) if isinstance(value, float | int) or _is_integer(value) else None


def _of_integer(value: Any, _: Shape) -> tuple[Any, ...] | None:
    return (int(cast("int", value)),) if _is_integer(value) else None


REAL: Final = Kind("a real number", ("real",), _of_real, lambda parts: parts[0])
INTEGER: Final = Kind("an integer", ("integer",), _of_integer, lambda parts: parts[0])


def vector(size: int | None = None) -> Kind:
    """Describe an argument that is an array of floats of one dimension."""
    return Kind(
        f"a contiguous array of float64 of shape ({'n' if size is None else size},)",
        ("reals", "integer"),
        lambda value, trail: (value, len(value)) if _array(value, np.float64, (size, *trail)) else None,
        lambda parts: Vector(parts[0], 0, parts[1] if size is None else size),
    )


def pointer(atom: Atom, size: int | None = None) -> Kind:
    """Describe an argument that is the address of so many numbers, or of any number of them."""

    def join(parts: list[Any]) -> Vector | Integers:
        kind = Vector if atom == "reals" else Integers
        return kind(parts[0], 0, ANY if size is None else size)

    def split(value: Any, _trail: object) -> tuple[Any, ...] | None:
        return (value,) if size is None or len(value) == size else None

    return Kind(f"an array of {'any number of' if size is None else size} numbers", (atom,), split, join)


def indices(size: int | None = None) -> Kind:
    """Describe an argument that is an array of integers of one dimension."""
    return Kind(
        f"a contiguous array of int64 of shape ({'n' if size is None else size},)",
        ("integers", "integer"),
        lambda value, _: (value, len(value)) if _array(value, np.int64, (size,)) else None,
        lambda parts: Integers(parts[0], 0, parts[1] if size is None else size),
    )


def matrix(columns: int | None = None) -> Kind:
    """Describe an argument that is an array of floats of two dimensions."""
    return Kind(
        f"a contiguous array of float64 of shape (m, {'n' if columns is None else columns})",
        ("reals", "integer", "integer"),
        lambda value, trail: (value, *value.shape[:2]) if _array(value, np.float64, (None, columns, *trail)) else None,
        lambda parts: Matrix(parts[0], 0, parts[1], parts[2] if columns is None else columns),
    )


def table(record: type[Record]) -> Kind:
    """Describe an argument that is a table of records."""

    def split(value: Any, trail: Shape) -> tuple[Any, ...] | None:
        match value:
            case Table(record=kind, integers=ArrayIntegers(whole), reals=ArrayReals(real), size=int(size)):
                fits = _array(whole, np.int64, (size * record.integer_width,))
                fits = fits and _array(real, np.float64, (size * record.real_width, *trail))
                return (whole, real, size) if fits and kind is record else None
            case _:
                return None

    name = record.__name__
    return Kind(
        f"a table of {name}, as {name}.table(…) makes it",
        ("integers", "reals", "integer"),
        split,
        lambda parts: Table(record, *parts),
    )


def group(cls: Callable[..., Any], **kinds: "Kind | Any") -> Kind:
    """Describe a composite argument by a mapping of its parts' names.

    Parameters
    ----------
    cls
        What is made of the parts inside: called with them by name.
    **kinds
        The parts, as the arguments of an entry function.
    """
    parts = {name: of_field(kind) for name, kind in kinds.items()}

    def split(value: Any, trail: Shape) -> tuple[Any, ...] | None:
        if not isinstance(value, Mapping) or not parts.keys() <= cast("Mapping[str, Any]", value).keys():
            return None
        out: list[Any] = []
        for name, kind in parts.items():
            found = kind.split(value[name], trail)
            if found is None:
                described_part = described(cast("object", value[name]))
                raise StageError("argument", where=name, argument=name, found=described_part, expected=kind.expected)
            out += found
        return tuple(out)

    def join(found: list[Any]) -> Any:
        rest = iter(found)
        return cls(**{name: kind.join([next(rest) for _ in kind.atoms]) for name, kind in parts.items()})

    atoms: tuple[Atom, ...] = tuple(atom for kind in parts.values() for atom in kind.atoms)
    return Kind(
        f"a mapping with the names {', '.join(parts)}", atoms, split, join,
        lambda change: group(cls, **{name: change(kind) for name, kind in parts.items()}),
    )  # fmt: skip


_SIZED: Final[dict[Any, Callable[..., Kind]]] = {Vector: vector, Integers: indices, Matrix: matrix}


def kind_of(annotation: Any) -> Kind | None:
    """Return the kind of an argument by its annotation; None where that says none.

    Numbers, `Vector`, `Integers`, `Matrix` and `Table[Record]` have their kinds, dataclasses are groups of their
    fields. ``Annotated[Matrix, 6]`` has six columns, ``Annotated[…, kind]`` the kind that is named there.
    """
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        of, mark = arguments
        return mark if isinstance(mark, Kind) else _SIZED[of](mark)
    if origin is Table:
        return table(arguments[0])
    if annotation in (Real, Integer):
        return REAL if annotation == Real else INTEGER
    if annotation in _SIZED:
        return _SIZED[annotation]()
    return group(cast("Callable[..., Any]", annotation), **members(annotation)) if is_dataclass(annotation) else None


def members(cls: Any) -> dict[str, Kind]:
    """Return the kinds of a dataclass's fields that their annotations say."""
    found = {each.name: kind_of(each.type) for each in fields(cls)}
    return {name: kind for name, kind in found.items() if kind is not None}


def of_field(kind: "Kind | RealField | IntegerField") -> Kind:
    """Return the kind of an argument that is declared as such, or as `real()` or `integer()`."""
    return kind if isinstance(kind, Kind) else REAL if isinstance(kind, RealField) else INTEGER


def dual(kind: Kind, directions: int, active: bool) -> Kind:
    """Return the kind of an argument of dual numbers: a value and its slopes, or, not active, a constant.

    Parts of a group are pairs each.
    """
    if kind.mapped is not None:
        return kind.mapped(lambda part: dual(part, directions, active))
    active = active and not {"reals", "real"}.isdisjoint(kind.atoms)

    def split(value: Any, trail: Shape) -> tuple[Any, ...] | None:
        match value:
            case (values, slopes) if (parts := kind.split(values, trail)) is not None:
                array = cast("np.ndarray[Any, np.dtype[Any]]", slopes)
                numbers = [part for part, atom in zip(parts, kind.atoms, strict=True) if atom in ("reals", "real")]
                members = np.shape(numbers[0])[-1:] if trail else ()
                shape = (*np.shape(array)[: np.ndim(array) - len(members)], *members)
                fits = _array(array, np.float64, shape) and array.size == directions * sum(map(np.size, numbers))
                return (*parts, array) if fits else None
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
                made.append(StagedDual(part, rates))
            else:
                made.append(part)
        return kind.join(made)

    if not active:
        return Kind(kind.expected, kind.atoms, kind.split, join)
    shape = "of its shape" if directions == 1 else f"of its shape and {directions} directions after it"
    return Kind(f"a pair: {kind.expected}, and its slopes, float64 {shape}", (*kind.atoms, "reals"), split, join)


def taped(kind: Kind) -> Kind:
    """Return the kind of an argument of a function that writes a tape: a pair of real numbers and their rows, int64.

    What it makes of the parts is called with the evaluation to have the argument.
    """
    if kind.mapped is not None:
        return kind.mapped(taped)
    atoms = tuple(atom for atom in kind.atoms if atom in ("reals", "real"))

    def split(value: Any, trail: Shape) -> tuple[Any, ...] | None:
        match value:
            case (values, places) if (parts := kind.split(values, trail)) is not None:
                sizes = [np.size(part) for part, atom in zip(parts, kind.atoms, strict=True) if atom == "reals"]
                rows = cast("np.ndarray[Any, np.dtype[Any]]", places)
                return (*parts, rows) if _array(rows, np.int64, np.shape(rows)) and rows.size == sum(sizes) else None
            case _:
                return None

    def join(parts: list[Any]) -> Callable[[Taped], Any]:
        def made(on: Taped) -> Any:
            own = [
                TapedCells(on, part, parts[-1]) if atom == "reals" else on.constant(part) if atom == "real" else part
                for part, atom in zip(parts, kind.atoms, strict=False)
            ]
            return kind.join(own)

        return made

    if not atoms or atoms == ("real",):
        return Kind(kind.expected, kind.atoms, kind.split, join)
    return Kind(f"a pair: {kind.expected}, and its rows, int64 of its shape", (*kind.atoms, "integers"), split, join)


def signature_of(*, returns: bool = True, **kinds: "Kind | RealField | IntegerField") -> Signature:
    """Return how an entry function with arguments of these kinds is called by its address.

    Parameters
    ----------
    returns
        Whether it returns an integer or a condition; else nothing.
    """
    return Signature(tuple(of_field(kind).atoms for kind in kinds.values()), returns)


def described(value: Any) -> str:
    """Describe a value that was found, for errors."""
    if isinstance(value, np.ndarray):
        array = cast("np.ndarray[Any, np.dtype[Any]]", value)
        order = "an" if array.flags.c_contiguous else "a non-contiguous"
        return f"{order} array of {array.dtype} of shape {array.shape}"
    if isinstance(value, Table):
        return f"a table of {cast('Table[Record]', value).record.__name__}"
    return f"{value!r} ({type(value).__name__})"
