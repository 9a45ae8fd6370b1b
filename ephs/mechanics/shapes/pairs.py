"""Contact pairs of shapes: their gap functions and frames.

Planes meet spheres, capsules, cylinders, boxes and meshes; spheres, capsules and boxes meet each other. A capsule meets
a plane at its two ends, a box at its corners, a convex mesh at its vertices, a cylinder at its two rims. Boxes meet
capsules and boxes as if their edges were rounded: each corner is a sphere that meets the other box, each edge a capsule
that meets the other's edges.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np

from ephs.mechanics.shapes.gap import (
    CENTRE,
    Gap,
    Vector,
    edges,
    plane_rim,
    plane_sphere,
    rounded_box_sphere,
    segments,
    sphere_rounded_box,
)
from ephs.semantics.bundle import Array
from ephs.semantics.errors import StructureError
from ephs.semantics.spaces import SE3

__all__ = ["PAIRS", "SIZES", "Touch", "touches"]

Touch = tuple[Array, Array, Gap]
"""Frames (7,) on the first and on the second surface's body, and the gap between them."""
Shape = Mapping[str, Any]
SIZES: Final[Mapping[str, tuple[int, ...] | None]] = {
    "plane": (), "sphere": (), "capsule": (2,), "cylinder": (2,), "box": (3,), "mesh": None
}  # fmt: skip
"""Shapes -> shape of their sizes in m; a plane has none, a mesh (n, 3) vertices."""


def touches(shape1: Shape, frame1: Array, shape2: Shape, frame2: Array) -> tuple[tuple[Touch, ...], bool]:
    """Return the gaps between two surfaces.

    Parameters
    ----------
    shape1, shape2
        ``{"sphere": r}``, ``{"capsule": [r, length]}``, ``{"cylinder": [r, length]}``, ``{"box": [x, y, z]}``,
        ``{"plane": {}}``, ``{"mesh": vertices}``; lengths in m, axes along z, planes solid below z = 0.
    frame1, frame2
        (7,) poses of the shapes in their bodies.

    Returns
    -------
    tuple
        The gaps, and whether the second surface comes first in them.

    Raises
    ------
    StructureError
        Shapes of no pair.
    """
    kinds = tuple(next(iter(shape)) for shape in (shape1, shape2))
    for swapped in (False, True):
        one, other = kinds[::-1] if swapped else kinds
        if (found := PAIRS.get((one, other))) is not None:
            given = ((shape2, frame2), (shape1, frame1)) if swapped else ((shape1, frame1), (shape2, frame2))
            (first, near), (second, far) = given
            points = found(first[one], second[other])
            return tuple((_shifted(near, here), _shifted(far, there), gap) for here, there, gap in points), swapped
    pairs = ", ".join(" and ".join(pair) for pair in PAIRS)
    raise StructureError("parameter", "contact", key="shapes", found=" and ".join(kinds), expected=pairs)


Points = Iterable[tuple[Any, Any, Gap]]
"""Witnesses of gaps on the first and on the second surface: points (3,) or poses (7,)."""


def _shifted(frame: Array, at: Any) -> Array:
    pose = np.asarray(at, dtype=float)
    return SE3.compose(frame, pose if pose.size == 7 else np.concatenate([[1.0, 0.0, 0.0, 0.0], pose]))


ROOT: Final = math.sqrt(0.5)
ROUNDED: Final = 0.05
"""Radius of a box's edges by its least length, where it meets boxes and capsules."""

SHORTER: Final = 0.5
"""Length at both ends of an edge, by its radius, where only corners meet other boxes: no edge meets a corner upon a
corner."""


def _ends(length: float) -> tuple[tuple[float, float, float], ...]:
    return ((0.0, 0.0, -0.5 * length), (0.0, 0.0, 0.5 * length))


def _corners(half: Sequence[float]) -> list[tuple[float, ...]]:
    return list(product(*((-x, x) for x in half)))


def _core(sizes: Sequence[float]) -> tuple[Vector, float]:
    """Half lengths of a box without its rounded edges, and their radius."""
    radius = ROUNDED * min(sizes)
    x, y, z = (0.5 * size - radius for size in sizes)
    return (x, y, z), radius


def _edges(half: Vector) -> list[tuple[Array, float]]:
    """Poses (7,) of the edges of a box, along z, and their half lengths."""
    x, y, z = half
    out: list[tuple[Array, float]] = []
    for turn, (a, b), length, place in (
        ((0.0, ROOT, 0.0), (y, z), x, lambda a, b: (0.0, a, b)),
        ((-ROOT, 0.0, 0.0), (x, z), y, lambda a, b: (a, 0.0, b)),
        ((0.0, 0.0, 0.0), (x, y), z, lambda a, b: (a, b, 0.0)),
    ):
        real = ROOT if any(turn) else 1.0
        out += [(np.array([real, *turn, *place(*at)]), length) for at in product((-a, a), (-b, b))]
    return out


def _boxes(one: Sequence[float], other: Sequence[float]) -> Points:
    (half1, radius1), (half2, radius2) = _core(one), _core(other)
    yield from ((CENTRE, at, rounded_box_sphere(half1, radius1, radius2)) for at in _corners(half2))
    yield from ((at, CENTRE, sphere_rounded_box(radius1, half2, radius2)) for at in _corners(half1))
    for (here, long1), (there, long2) in product(_edges(half1), _edges(half2)):
        yield here, there, edges(long1 - SHORTER * radius1, radius1, long2 - SHORTER * radius2, radius2)


def _box_capsule(sizes: Sequence[float], capsule: Sequence[float]) -> Points:
    half, rounding = _core(sizes)
    radius, length = capsule
    yield from ((CENTRE, at, rounded_box_sphere(half, rounding, radius)) for at in _ends(length))
    yield from ((here, CENTRE, segments(long, rounding, 0.5 * length, radius)) for here, long in _edges(half))


PAIRS: Final[Mapping[tuple[str, str], Callable[[Any, Any], Points]]] = {
    ("plane", "sphere"): lambda _, r: [(CENTRE, CENTRE, plane_sphere(r))],
    ("plane", "capsule"): lambda _, c: [(CENTRE, at, plane_sphere(c[0])) for at in _ends(c[1])],
    ("plane", "cylinder"): lambda _, c: [(CENTRE, at, plane_rim(c[0])) for at in _ends(c[1])],
    ("plane", "box"): lambda _, b: [(CENTRE, at, plane_sphere(0.0)) for at in _corners([0.5 * x for x in b])],
    ("plane", "mesh"): lambda _, mesh: [(CENTRE, at, plane_sphere(0.0)) for at in mesh],
    ("sphere", "sphere"): lambda one, other: [(CENTRE, CENTRE, rounded_box_sphere(CENTRE, one, other))],
    ("capsule", "sphere"): lambda c, r: [(CENTRE, CENTRE, rounded_box_sphere((0.0, 0.0, 0.5 * c[1]), c[0], r))],
    ("box", "sphere"): lambda b, r: [(CENTRE, CENTRE, rounded_box_sphere((b[0] / 2, b[1] / 2, b[2] / 2), 0.0, r))],
    ("capsule", "capsule"): lambda one, other: [(CENTRE, CENTRE, segments(one[1] / 2, one[0], other[1] / 2, other[0]))],
    ("box", "capsule"): _box_capsule,
    ("box", "box"): _boxes,
}
"""Kinds of both shapes -> the gaps, by where they are on both."""
