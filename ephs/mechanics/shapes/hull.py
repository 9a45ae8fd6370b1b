"""Convex polyhedra: faces, edges and corners of a convex hull, and of what is left inside of its faces."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd

FLAT: Final = 1e-5
"""Relative tolerance within which triangles are one face: that of files in single precision."""
MEETING: Final = 1e-7
"""Distance, relative to the size, within which corners are one, and lie on a face."""
Points = tuple[tuple[float, ...], ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A face: its outward unit normal and offset, and its corners' numbers, counterclockwise from outside."""

    normal: Array
    offset: float
    corners: tuple[int, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Hull:
    """A convex polyhedron.

    Parameters
    ----------
    corners
        (n, 3) in m.
    faces, edges
        Faces, and pairs of corners.
    centre, radius
        Of the largest sphere inside, m.
    """

    corners: Array
    faces: tuple[Face, ...]
    edges: tuple[tuple[int, int], ...]
    centre: Array
    radius: float


def hull_of(points: Sequence[Sequence[float]]) -> Hull:
    """The convex hull of points in m, which has a volume."""
    return _made(tuple(tuple(point) for point in points), 0.0)


def inside_of(points: Sequence[Sequence[float]], share: float) -> tuple[Hull, float]:
    """A convex hull without a layer of some depth below its faces, and this depth in m.

    Parameters
    ----------
    share
        The distance, by the radius of the largest sphere inside.
    """
    given = tuple(tuple(point) for point in points)
    return _made(given, share), share * hull_of(given).radius


@cache
def _made(points: Points, share: float) -> Hull:
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    hull = ConvexHull(np.array(points))
    size = float(np.ptp(hull.points, axis=0).max())
    planes = _planes(hull.equations, size)
    centre, radius = _largest_sphere(planes)
    corners = hull.points[hull.vertices]
    if share > 0.0:
        planes = planes + np.array([0.0, 0.0, 0.0, share * radius])
        corners = _apart(HalfspaceIntersection(planes, centre).intersections, MEETING * size)
    found = [_face(plane, corners, MEETING * size if share else FLAT * size) for plane in planes]
    faces = tuple(face for face in found if face is not None)
    edges = {(min(i, j), max(i, j)) for face in faces for i, j in around(face.corners)}
    return Hull(corners, faces, tuple(sorted(edges)), centre, (1.0 - share) * radius)


def _planes(equations: Array, size: float) -> Array:
    """(m, 4) planes of faces, each once: the outermost of those that triangles of one face have."""
    found: list[Array] = []
    for plane in equations:
        for i, other in enumerate(found):
            if np.abs(plane[:3] - other[:3]).max() <= FLAT and abs(plane[3] - other[3]) <= FLAT * size:
                found[i] = plane if plane[3] < other[3] else other
                break
        else:
            found.append(plane)
    return np.array(found)


def _largest_sphere(planes: Array) -> tuple[Array, float]:
    """Centre (3,) and radius of the largest sphere within planes (Chebyshev's centre)."""
    from scipy.optimize import linprog

    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog([0.0, 0.0, 0.0, -1.0], rows, -planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)]).x
    return found[:3], float(found[3])


def _apart(points: Array, tolerance: float) -> Array:
    """(n, 3) points, each once."""
    found: list[Array] = []
    for point in points:
        if all(np.linalg.norm(point - other) > tolerance for other in found):
            found.append(point)
    return np.array(found)


def _face(plane: Array, corners: Array, tolerance: float) -> Face | None:
    """The face in a plane; None of a plane that touches in a corner or an edge alone."""
    normal, offset = plane[:3], -float(plane[3])
    on = np.flatnonzero(np.abs(corners @ normal - offset) <= tolerance)
    if on.size < 3:
        return None
    across = svd(normal[None])[2][1:]
    if np.linalg.det([*across, normal]) < 0.0:
        across = across[::-1]
    flat = (corners[on] - corners[on].mean(axis=0)) @ across.T
    order = on[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]
    return Face(normal, offset, tuple(int(i) for i in order))


def around(corners: Sequence[int]) -> list[tuple[int, int]]:
    """Edges of a face with these corners."""
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))
