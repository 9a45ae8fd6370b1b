"""Attributes of a resolved scene's elements: shape, dimension and range of numbers, kinds of names, meanings.

An attribute is declared once, as ``Annotated[float, Number(energy=1), "meaning, unit"]``. Keys of scene files with
their page of documentation, reading and writing, checks, other units, parameters by path and names seen from outside a
part follow. Attributes without a meaning are not keys of scene files.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from inspect import get_annotations
from typing import Any, ClassVar, Final, Self, TypeVar, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.semantics.bundles.bundle import Array

T = TypeVar("T")
GROUND = "ground"
ENVIRONMENT = "environment"
AXIS, SINGLE = "axis", "single"
"""Kinds of joints with one degree of freedom on whose rates elements act: without a prescribed motion, and all."""
FREE_END = "free"
"""A free end of a beam."""
JOINTS: Final[tuple[str, ...]] = (AXIS, SINGLE, "joint")
OUTSIDE: Final[Mapping[str, frozenset[str]]] = {
    "body": frozenset({GROUND}),
    "link": frozenset({GROUND}),
    "carrier": frozenset({GROUND}),
    "end": frozenset({GROUND, FREE_END}),
    "side": frozenset({GROUND, FREE_END}),
    "node": frozenset({ENVIRONMENT}),
    "joint": frozenset(),
    AXIS: frozenset(),
    SINGLE: frozenset(),
    "tendon": frozenset(),
    "surface": frozenset(),
}
"""Kind of a name that refers to something -> the names that are the same in all parts."""
HOLDERS: Final[Mapping[str, tuple[str, ...]]] = {
    **dict.fromkeys(("body", "link", "end", "side"), ("bodies",)),
    "carrier": ("bodies", "shells"),
    "node": ("thermal",),
    **dict.fromkeys(JOINTS, ("joints",)),
    "tendon": ("tendons",),
    "surface": ("surfaces",),
}
"""Kind of a name -> the sections that have what it refers to, as scenes do; files may name beams for sides.

Nodes of shells, ``SHELL.NUMBER``, are bodies for all but joints and what is joined: ``link``, ``end``, ``side``.
"""
POSITIVE, NON_NEGATIVE = (0.0, True), (0.0, False)
"""A lower bound, and whether it is excluded."""


def frozen(values: ArrayLike) -> Array:
    """A read-only float copy of ``values``."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def part_of(annotation: Any, kind: type[T]) -> T | None:
    """Entry of a kind in an attribute's annotation: its `NumberForm`, its `Named`, or its meaning."""
    return next((each for each in getattr(annotation, "__metadata__", ()) if isinstance(each, kind)), None)


@final
@dataclass(frozen=True, slots=True)
class Named:
    """Kind of the elements that an attribute names, one, several or None: a key of `OUTSIDE`."""

    kind: str


@final
@dataclass(frozen=True, slots=True)
class NumberForm:
    """Dimension, count and range of a number, or of a row or square of numbers.

    Parameters
    ----------
    energy, time, length
        Exponents of its dimension.
    first, others
        Exponents of the units of coordinates: of the first one; of each one's own, where there is a number for each.
    count
        Of a row of numbers; 0 for one number.
    each
        There is a number for each coordinate from this one on; −1 for none.
    square
        Whether there is such a row for each of them.
    head, ahead
        The first ``ahead`` numbers of a row have the exponent ``head`` of length instead.
    least
        Bound from below, and whether it is excluded.
    """

    energy: int = 0
    time: int = 0
    length: int = 0
    first: int = 0
    others: int = 0
    count: int = 0
    each: int = -1
    square: bool = False
    head: int = 0
    ahead: int = 0
    least: tuple[float, bool] | None = None

    def shape(self, coordinates: int) -> tuple[int, ...]:
        """Shape of its array where there are so many coordinates."""
        if self.each < 0 and not self.count:
            return ()
        return (coordinates - self.each if self.each >= 0 else self.count,) * (2 if self.square else 1)

    @lru_cache(maxsize=1024)  # noqa: B019 - all of these are class attributes
    def unit(self, length: float, mass: float, time: float, coordinates: tuple[float, ...]) -> Any:
        """Its unit, of those of length, mass and time, and of coordinates."""
        energy = mass * length**2 / time**2
        whole = energy**self.energy * time**self.time
        whole *= coordinates[0] ** self.first if self.first and len(coordinates) else 1.0
        powers = [self.head] * self.ahead + [self.length] * (max(self.count, 1) - self.ahead)
        if self.each >= 0:
            own = np.array([x**self.others for x in coordinates[self.each :]])
            return whole * length**self.length * (np.outer(own, own) if self.square else own)
        return whole * (np.array([length**x for x in powers]) if self.ahead else length**self.length)


POSE: Final = NumberForm(length=1, ahead=4, count=7)
TWIST: Final = NumberForm(time=-1, length=1, ahead=3, count=6)


class SceneElement(ABC):
    """Something in a scene: its numbers, and the names to which it refers.

    Attributes
    ----------
    numbers, names
        Attributes that are numbers, and their dimensions; attributes that name elements, and of which kind.
    frames
        Attributes that are points, and the attributes that have their bodies.
    """

    __slots__ = ()
    numbers: ClassVar[Mapping[str, NumberForm]] = {}
    names: ClassVar[Mapping[str, str]] = {}
    frames: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def changed(self, **keys: Any) -> Self:
        """Itself with other values at some attributes, which are not checked."""

    @abstractmethod
    def _inside(self, path: str) -> Self:
        """Itself with a path in front of its own name."""

    def references(self) -> Iterator[tuple[str, str, str]]:
        """Attribute, kind and name of all that it names."""
        for key, kind in self.names.items():
            given: Any = getattr(self, key, None)
            if isinstance(given, str):
                yield key, kind, given
            else:
                yield from ((f"{key}[{i}]", kind, each) for i, each in enumerate(given or ()))

    def named(self, kind: str) -> tuple[str, ...]:
        """The names of a kind to which it refers."""
        return tuple(name for _, of, name in self.references() if of == kind)

    def seen(self, path: str) -> Self:
        """Itself with names as seen from outside of the part at a path, which ends in a dot; itself at none."""
        if not path:
            return self
        changes: dict[str, Any] = {}
        for key, kind in self.names.items():
            same, given = OUTSIDE[kind], getattr(self, key)
            if isinstance(given, str):
                changes[key] = given if given in same else path + given
            elif given is not None:
                changes[key] = type(given)(each if each in same else path + each for each in given)
        return self.changed(**changes)._inside(path)

    def rescaled(self, length: float, mass: float, time: float, coordinates: tuple[float, ...] = ()) -> Self:
        """The same in other units; ``coordinates`` are those of its coordinates, or of its joints'."""
        changes: dict[str, Any] = {}
        for key, number in (dict.fromkeys(self.frames, NumberForm(length=1)) | dict(self.numbers)).items():
            given = getattr(self, key)
            if given is None:
                continue
            first = len(coordinates) - len(np.atleast_1d(given))
            if number.others and number.each != first:
                number = replace(number, each=first)
            found = np.asarray(given, dtype=float) * number.unit(length, mass, time, coordinates)
            changes[key] = frozen(found) if isinstance(given, np.ndarray) else found.tolist()
        return self.changed(**changes)


class Measured(SceneElement):
    """An element whose attributes are resolved: a dataclass, whose annotations have a `NumberForm` or are `Named`."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        given = get_annotations(cls).items()
        cls.numbers = {key: of for key, annotation in given if (of := part_of(annotation, NumberForm))}
        cls.names = {key: of.kind for key, annotation in given if (of := part_of(annotation, Named))}

    def changed(self, **keys: Any) -> Self:
        return replace(self, **keys)  # pyright: ignore[reportArgumentType] - all are dataclasses

    def _inside(self, path: str) -> Self:
        return self.changed(name=path + getattr(self, "name"))  # noqa: B009 - all that have names are in sections

    def values(self, coordinates: int = 0) -> dict[str, tuple[Any, tuple[int, ...]]]:
        """Its numbers with their required shapes, without omitted ones."""
        given = {key: (getattr(self, key), number.shape(coordinates)) for key, number in self.numbers.items()}
        return {key: pair for key, pair in given.items() if pair[0] is not None}
