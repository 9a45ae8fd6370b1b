"""Constraint directions in words: "translation along x and y, rotation about z".

What a joint holds is a space of wrenches. A force holds the translation along it of the point that it acts at, a moment
the rotation about it; a force with a moment along it, as of a screw, couples both. Words need axes and a point, so that
the few that a reader knows are tried: the axes of the world and of the joint, the origins of the joints.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares, svd

ALIGNED = 1e-6
"""Largest relative distance of a direction from a named axis."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class NamedAxes:
    """Axes for texts: columns of a rotation (3, 3) to the world, and their name, "" for the world's."""

    rotation: Array
    name: str = ""


@final
@dataclass(frozen=True, slots=True, eq=False)
class NamedPoint:
    """A point (3,) in the world in m, and its name, "" for the joint's own origin."""

    point: Array
    name: str = ""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Direction:
    """A constrained direction, as its constraint wrench.

    Attributes
    ----------
    moment, force
        (3,) about the place, in the axes. The force has length 1; without a force, the moment has.
    """

    moment: Array
    force: Array
    axes: NamedAxes
    place: NamedPoint

    @property
    def wrench(self) -> Array:
        """(6,) moment and force in world axes about the world's origin."""
        moment, force = self.axes.rotation @ self.moment, self.axes.rotation @ self.force
        return np.concatenate([moment + np.cross(self.place.point, force), force])

    @property
    def kind(self) -> str:
        """The held direction up to its sense."""
        if not np.any(self.force):
            return "rotation about"
        return "translation along" if not np.any(self.moment) else "coupled"

    def __str__(self) -> str:
        return describe([self])


def name_directions(
    space: Array, axes: Sequence[NamedAxes], places: Sequence[NamedPoint], length: float
) -> tuple[Direction, ...]:
    """A basis of a space of wrenches along axes, for messages.

    Parameters
    ----------
    space
        (6, r) wrenches in world axes about the first place, N m and N.
    axes, places
        What may be spoken of, the preferred first.
    length
        In m, by which moments are compared with forces.
    """
    local = [(place, _about(space, places[0].point - place.point, length)) for place in places]
    for place, about in local:
        for frame in axes:
            chosen = _units_within(_turned(about, frame.rotation.T))
            if len(chosen) == space.shape[1]:
                zero = np.zeros(3)
                return tuple(
                    Direction(zero, np.eye(3)[i - 3], frame, place)
                    if i >= 3
                    else Direction(np.eye(3)[i], zero, frame, place)
                    for i in chosen
                )
    place, about = max(local, key=lambda option: _pure(option[1]))  # the first of the best
    return tuple(_sparse(_turned(about, axes[0].rotation.T), axes[0], place, length))


def describe(directions: Iterable[Direction]) -> str:
    """Directions of one joint in words; axes other than the world's are named."""
    phrases: list[str] = []
    found = list(directions)
    for (kind, at), members in groupby(found, key=lambda d: (d.kind, d.place.name if np.any(d.force) else "")):
        if kind == "coupled":
            phrases += [
                f"translation along {_vector(d.force)} in step with rotation about {_vector(d.moment)}{_place_text(at)}"
                for d in members
            ]
            continue
        vectors = [d.force if np.any(d.force) else d.moment for d in members]
        phrases.append(f"{kind} {enumerated(map(_vector, vectors))}{_place_text(at)}")
    whose = next((d.axes.name for d in found if d.axes.name), "")
    return ", ".join(phrases) + (f" ({whose})" if whose else "")


def enumerated(words: Iterable[str]) -> str:
    """Words as in "a, b and c"."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _place_text(place: str) -> str:
    return f" at {place}" if place else ""


def _vector(direction: Array) -> str:
    if np.count_nonzero(direction) == 1:
        return "xyz"[int(np.flatnonzero(direction)[0])]
    return "(" + ", ".join(f"{round(float(entry), 3) + 0.0:g}" for entry in direction / np.linalg.norm(direction)) + ")"


def _about(space: Array, arm: Array, length: float) -> Array:
    """An orthonormal basis of the space about a point from which the former one is seen at ``arm``; unit ``length``."""
    moved = space.copy()
    moved[:3] += np.cross(arm, space[3:].T).T
    moved[:3] /= length
    return svd(moved, full_matrices=False)[0]


def _turned(space: Array, rotation: Array) -> Array:
    return np.vstack([rotation @ space[:3], rotation @ space[3:]])


def _units_within(space: Array) -> list[int]:
    """Unit vectors in a space, forces first."""
    order = [3, 4, 5, 0, 1, 2]
    return [i for i in order if np.linalg.norm(np.eye(6)[i] - space @ space[i]) < ALIGNED]


def _pure(space: Array) -> int:
    """Number of independent pure forces in a space; pure moments are the same about all places."""
    return _null(space[:3]).shape[1]


def _null(matrix: Array) -> Array:
    _, sigma, vt = svd(matrix)
    return vt[int(np.sum(sigma > ALIGNED)) :].T


def _sparse(space: Array, axes: NamedAxes, place: NamedPoint, length: float) -> Iterable[Direction]:
    """Pure forces, then pure moments, then coupled directions."""
    forces, moments = _null(space[:3]), _null(space[3:])
    zero = np.zeros(3)
    yield from (Direction(zero, force, axes, place) for force in _echelon((space @ forces)[3:]).T)
    yield from (Direction(moment, zero, axes, place) for moment in _echelon((space @ moments)[:3]).T)
    rest = space @ _null(np.hstack([forces, moments]).T)
    if rest.shape[1]:
        simple = _echelon(rest[3:])
        both = rest @ least_squares(rest[3:], simple)
        for i in range(both.shape[1]):
            moment, force = _cleaned(length * both[:3, i], length), simple[:, i]
            yield _line(Direction(moment, force, axes, place), length)


def _line(found: Direction, length: float) -> Direction:
    """A force with a moment across it is the same force at another place."""
    if abs(found.moment @ found.force) > ALIGNED * length:
        return found
    point = found.place.point + found.axes.rotation @ np.cross(found.force, found.moment)
    shown = ", ".join(f"{round(float(entry), 4) + 0.0:g}" for entry in point)
    return replace(found, moment=np.zeros(3), place=NamedPoint(point, f"the point ({shown})"))


def _echelon(vectors: Array) -> Array:
    """Columns of length 1 with the same span (of independent columns) and many zeros."""
    rows = vectors.T.copy()
    left = list(range(rows.shape[0]))
    while left:
        r, c = np.unravel_index(np.argmax(np.abs(rows[left])), (len(left), rows.shape[1]))
        pivot = left.pop(int(r))
        rows[pivot] /= rows[pivot, c]
        for other in range(rows.shape[0]):
            if other != pivot:
                rows[other] -= rows[other, c] * rows[pivot]
    rows = np.array([_cleaned(row / np.linalg.norm(row), 1.0) for row in rows]).reshape(rows.shape)
    return rows[np.lexsort(-rows.T[::-1])].T


def _cleaned(vector: Array, scale: float) -> Array:
    return np.where(np.abs(vector) > ALIGNED * scale, vector, 0.0)
