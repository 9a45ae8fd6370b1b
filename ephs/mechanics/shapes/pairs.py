"""Contact pairs of shapes: their gap functions and frames.

All shapes meet each other, but no plane meets a plane. A capsule meets a plane at its two ends, a box at its corners, a
convex mesh at its vertices, a cylinder at its two rims. Boxes, meshes and cylinders meet each other and capsules as if
their edges were rounded: each corner is a sphere that meets the other body, each edge a capsule that meets the other's
edges or, as a rim does, a cylinder; each rim meets each face.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.shapes.gap import (
    CENTRE,
    Gap,
    edges,
    plane_rim,
    plane_sphere,
    rounded_box_sphere,
    segments,
    sphere_rounded_box,
)
from ephs.mechanics.shapes.hull import Hull, hull_of, inside_of
from ephs.mechanics.shapes.selecting import Vector
from ephs.mechanics.shapes.solids import ConvexBody, cylinder, faces, meeting, point, polyhedron, rim, segment, side
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.spaces import SE3

Touch = tuple[Array, Array, Gap]
"""Frames (7,) on the first and on the second surface's body, and the gap between them."""
Shape = Mapping[str, Any]


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

FLIPPED: Final = 1e-12
"""1 + cos of the angle from z at which the least rotation is not unique."""
SHORTER: Final = 0.5
"""Length at both ends of an edge, by its radius, where only corners meet other boxes: no edge meets a corner upon a
corner."""


def _ends(length: float) -> tuple[tuple[float, float, float], ...]:
    return ((0.0, 0.0, -0.5 * length), (0.0, 0.0, 0.5 * length))


def _corners(half: Sequence[float]) -> list[tuple[float, ...]]:
    return list(product(*((-x, x) for x in half)))


def _hull_of_box(sizes: Sequence[float]) -> list[tuple[float, ...]]:
    return _corners([0.5 * size for size in sizes])


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


@final
@dataclass(frozen=True, slots=True, eq=False)
class _RoundedSolid:
    """A polyhedron with rounded edges.

    Parameters
    ----------
    core, radius
        Without the rounding, and its radius, m.
    """

    core: Hull
    radius: float

    @staticmethod
    def of(vertices: Any) -> "_RoundedSolid":
        """Rounded as a box is, by the largest sphere inside."""
        return _RoundedSolid(*inside_of(vertices, 2.0 * ROUNDED))

    @property
    def frame(self) -> Array:
        """(3,) the middle of the core, the origin of its body."""
        return 0.5 * (self.core.corners.min(axis=0) + self.core.corners.max(axis=0))

    @property
    def body(self) -> ConvexBody:
        """The body that points meet."""
        return polyhedron(self.core, self.frame, self.radius)

    def edges(self) -> Iterator[tuple[Array, float]]:
        """Poses (7,) along z, and half lengths."""
        for i, j in self.core.edges:
            one, other = self.core.corners[i], self.core.corners[j]
            way = other - one
            yield np.array([*_turned(way), *(0.5 * (one + other))]), 0.5 * float(np.linalg.norm(way))


def _turned(way: Array) -> Array:
    """The quaternion (4,) of the least rotation from z to a direction, or of half a turn about x."""
    x, y, z = way / np.linalg.norm(way)
    if z < -1.0 + FLIPPED:
        return np.array([0.0, 1.0, 0.0, 0.0])
    turn = np.array([1.0 + z, -y, x, 0.0])
    return turn / np.linalg.norm(turn)


def _polyhedra(one: _RoundedSolid, other: _RoundedSolid) -> Points:
    yield from ((one.frame, at, meeting(point(other.radius), one.body, first=False)) for at in other.core.corners)
    yield from ((at, other.frame, meeting(point(one.radius), other.body, first=True)) for at in one.core.corners)
    for (here, long1), (there, long2) in product(one.edges(), other.edges()):
        half1, half2 = long1 - SHORTER * one.radius, long2 - SHORTER * other.radius
        if min(half1, half2) > 0.0:
            yield here, there, edges(half1, one.radius, half2, other.radius)


def _sphere_mesh(radius: float, vertices: Any) -> Points:
    solid = _RoundedSolid(hull_of(vertices), 0.0)
    yield CENTRE, solid.frame, meeting(point(radius), solid.body, first=True)


def _capsule_mesh(capsule: Sequence[float], vertices: Any) -> Points:
    radius, length = capsule
    solid = _RoundedSolid.of(vertices)
    yield from ((at, solid.frame, meeting(point(radius), solid.body, first=True)) for at in _ends(length))
    yield from ((CENTRE, there, segments(0.5 * length, radius, long, solid.radius)) for there, long in solid.edges())


def _cylinder(sizes: Sequence[float], domed: float = 0.0) -> tuple[ConvexBody, tuple[Array, ...]]:
    """A cylinder with rounded rims, and the centres of their cores."""
    size, length = sizes
    radius = _rounding(sizes)
    half = 0.5 * length - radius
    return cylinder(size - radius, half, radius, domed), tuple(np.array([0.0, 0.0, z]) for z in (-half, half))


def _rounding(sizes: Sequence[float]) -> float:
    """Radius of the rims of a cylinder."""
    return ROUNDED * min(2.0 * sizes[0], sizes[1])


def _capsule_cylinder(capsule: Sequence[float], sizes: Sequence[float]) -> Points:
    radius, length = capsule
    body, _ = _cylinder(sizes)
    yield from ((at, CENTRE, meeting(point(radius), body, first=True)) for at in _ends(length))
    yield CENTRE, CENTRE, meeting(segment(0.5 * length, radius), body, first=True)


def _polyhedron_cylinder(solid: _RoundedSolid, sizes: Sequence[float]) -> Points:
    body, rims = _cylinder(sizes)
    circle = rim(body.halves[0], body.radius)
    yield from ((at, CENTRE, meeting(point(solid.radius), body, first=True)) for at in solid.core.corners)
    yield from ((at, CENTRE, meeting(segment(long, solid.radius), body, first=True)) for at, long in solid.edges())
    for face, at in product(faces(solid.core, solid.frame, solid.radius), rims):
        yield solid.frame, at, meeting(circle, face, first=False)


def _cylinders(one: Sequence[float], other: Sequence[float]) -> Points:
    touching = _rounding(one) + _rounding(other)
    (body1, rims1), (body2, rims2) = _cylinder(one, touching), _cylinder(other, touching)
    yield from ((CENTRE, at, meeting(rim(body2.halves[0], body2.radius), body1, first=False)) for at in rims2)
    yield from ((at, CENTRE, meeting(rim(body1.halves[0], body1.radius), body2, first=True)) for at in rims1)
    yield CENTRE, CENTRE, meeting(side(body1.halves[0], body1.halves[2], body1.radius), body2, first=True)


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
    ("sphere", "mesh"): _sphere_mesh,
    ("capsule", "mesh"): _capsule_mesh,
    ("box", "mesh"): lambda b, mesh: _polyhedra(_RoundedSolid.of(_hull_of_box(b)), _RoundedSolid.of(mesh)),
    ("mesh", "mesh"): lambda one, other: _polyhedra(_RoundedSolid.of(one), _RoundedSolid.of(other)),
    ("sphere", "cylinder"): lambda r, c: [
        (CENTRE, CENTRE, meeting(point(r), cylinder(c[0], 0.5 * c[1], 0.0), first=True))
    ],
    ("capsule", "cylinder"): _capsule_cylinder,
    ("box", "cylinder"): lambda b, c: _polyhedron_cylinder(_RoundedSolid.of(_hull_of_box(b)), c),
    ("mesh", "cylinder"): lambda mesh, c: _polyhedron_cylinder(_RoundedSolid.of(mesh), c),
    ("cylinder", "cylinder"): _cylinders,
}
"""Kinds of both shapes -> the gaps, by where they are on both."""
