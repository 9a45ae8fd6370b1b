"""The parts that documents may name: how each is made again from its ports and its numbers."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache, partial
from importlib import import_module
from types import FunctionType, MethodType
from typing import Any, cast, final

import numpy as np

from ephs.operad import Interface
from ephs.semantics import library
from ephs.semantics.primitives.primitives import Formula, Primitive


@final
@dataclass(frozen=True, slots=True)
class LibraryPart:
    """A kind of library part.

    Parameters
    ----------
    word
        Its name in documents.
    name
        The name of the primitives that it makes.
    make
        Called with the ports in their order, and with the primitive's parameters by name.
    """

    word: str
    name: str
    make: Callable[[Interface, Mapping[str, Any]], Primitive]


def find_part(word: str) -> LibraryPart | None:
    """The part of this name, or None."""
    return _scalar().get(word) or _mechanical().get(word)


def part_of(primitive: Primitive) -> LibraryPart | None:
    """The part that makes this very primitive again: of the same code and the same numbers. None if there is none."""
    return _maker(primitive, _scalar().values()) or _maker(primitive, _mechanical().values())


@cache
def _scalar() -> Mapping[str, LibraryPart]:
    return {word: LibraryPart(word, word, _from_parameters(getattr(library, word))) for word in library.__all__}


def _from_parameters(make: Callable[..., Primitive]) -> Callable[[Interface, Mapping[str, Any]], Primitive]:
    return lambda _ports, parameters: make(**parameters)


@cache
def _mechanical() -> Mapping[str, LibraryPart]:
    parts: tuple[LibraryPart, ...] = import_module("ephs.mechanics.elements.catalogue").PARTS
    return {part.word: part for part in parts}


def _maker(primitive: Primitive, parts: Iterable[LibraryPart]) -> LibraryPart | None:
    for part in parts:
        if part.name != primitive.name:
            continue
        try:
            made = part.make(primitive.interface, dict(primitive.parameters))
        except (ArithmeticError, LookupError, TypeError, ValueError):
            continue  # another part of the same name
        alike = type(made) is type(primitive) and list(made.interface) == list(primitive.interface)
        names = [each.name for each in fields(made) if each.init and each.name != "initial"]
        if alike and all(_same(getattr(made, name), getattr(primitive, name)) for name in names):
            return part
    return None


def _same(one: Any, two: Any, depth: int = 0) -> bool:
    """Whether two values are equal, functions by their code and by what they hold."""
    if one is two:
        return True
    if type(one) is not type(two) or depth > 8:
        return False
    if isinstance(one, FunctionType):
        held = [tuple(cell.cell_contents for cell in f.__closure__ or ()) for f in (one, two)]
        alike = one.__code__ is two.__code__ and one.__defaults__ == two.__defaults__
        return alike and all(_same(a, b, depth + 1) for a, b in zip(*held, strict=True))
    if isinstance(one, MethodType):
        return one.__func__ is two.__func__ and _same(one.__self__, two.__self__, depth + 1)
    if isinstance(one, partial):
        mine, theirs = cast("partial[Any]", one), cast("partial[Any]", two)
        held = (mine.args, mine.keywords) == (theirs.args, theirs.keywords)
        return held and _same(mine.func, theirs.func, depth + 1)
    if isinstance(one, Formula):
        return one.parameters == two.parameters and _same(one.function, two.function, depth + 1)
    if isinstance(one, dict):
        mine, theirs = cast("dict[Any, Any]", one), cast("dict[Any, Any]", two)
        return list(mine) == list(theirs) and all(_same(mine[key], theirs[key], depth + 1) for key in mine)
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(cast("Any", one), two))
    return bool(one == two)
