"""Choices among numbers and vectors without branches, and points along lines."""

from collections.abc import Sequence
from typing import Any

from ephs.semantics.primitives.special import choose

Vector = tuple[Any, Any, Any]
"""Components of a vector."""


def moved(start: Vector, far: Any, way: Vector) -> Vector:
    """A point moved so far along a direction."""
    return start[0] + far * way[0], start[1] + far * way[1], start[2] + far * way[2]


def least(one: Any, other: Any) -> Any:
    """The lesser of two numbers, without a branch."""
    return 0.5 * (one + other - abs(one - other))


def most(values: Sequence[Any]) -> Any:
    """The largest of some numbers, without a branch."""
    found, *others = values
    for other in others:
        found = 0.5 * (found + other + abs(found - other))
    return found


def chosen(number: Any, one: Vector, other: Vector) -> Vector:
    """One of two vectors: the first where the number is positive."""
    return choose(number, one[0], other[0]), choose(number, one[1], other[1]), choose(number, one[2], other[2])
