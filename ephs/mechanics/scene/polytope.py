"""Convex meshes: vertices of STL files, after a check of convexity, and of the convex hulls of points."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ephs.mechanics.shapes.hull import hull_of
from ephs.semantics.bundles.bundle import Array

MOST_BYTES = 20_000_000
MOST_VERTICES = 256
"""Vertices that a surface may have: each is a point of contact."""
MOST_FACES = 128
"""Faces and edges that a mesh may have to meet others than planes: all of them are in one compiled function."""
FLAT = 1e-5
"""Relative tolerance of convexity: depth of vertices inside the hull, and difference of volumes. Bodies that are
thinner count as flat."""
BLOCK = 2**22
"""Numbers that are in memory at a time for the depth of vertices."""
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
HEAD = 84
"""Bytes before the triangles of a binary file: 80 of text, and their number."""


def vertices_of(file: Path) -> Array:
    """(n, 3) vertices of the convex body in an STL file, text or binary, each once.

    Raises
    ------
    ValueError
        Fault of the file: it cannot be read, bounds no body, is not convex, or has too many vertices.
    """
    triangles = triangles_of(file)
    if not len(triangles):
        raise ValueError("a file without triangles")
    if not np.all(np.isfinite(triangles)):
        raise ValueError("a mesh with numbers that are not finite")
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    hull = _hull(triangles.reshape(-1, 3))
    if hull is None:
        raise ValueError("a mesh without volume")
    corners, faces, volume = hull
    inside = _inside(faces, triangles.reshape(-1, 3))
    if inside > FLAT * size:
        raise ValueError(f"a mesh that is not convex: a vertex lies {inside:.3g} m inside its convex hull")
    centre = corners.mean(axis=0)
    own = float(np.abs(np.einsum("ni,ni->n", *_spans(triangles - centre))).sum()) / 6.0
    if abs(own - volume) > FLAT * size**3:
        raise ValueError(f"a mesh that is not convex: of volume {own:.4g} m³, its convex hull {volume:.4g} m³")
    if len(corners) > MOST_VERTICES:
        raise ValueError(f"a mesh of {len(corners)} vertices, more than {MOST_VERTICES}")
    return corners


def corners_of(points: Array) -> Array:
    """(n, 3) vertices of the convex hull of points (m, 3).

    Raises
    ------
    ValueError
        Points in a plane, or nearly.
    """
    hull = _hull(points)
    if hull is None:
        raise ValueError("points in a plane, or nearly")
    return hull[0]


def faces_and_edges(corners: Sequence[Sequence[float]]) -> int:
    """Number of faces and edges of the convex hull of its corners (n, 3); of many corners a lower bound."""
    least = 2 * len(corners) + 2  # each corner has three edges or more
    if least > MOST_FACES:
        return least
    hull = hull_of(corners)
    return len(hull.faces) + len(hull.edges)


def depth_inside(points: Array) -> float:
    """Greatest depth in m of points (m, 3) inside their convex hull; 0 for corners of a convex body, or a flat one."""
    hull = _hull(points)
    found = 0.0 if hull is None else _inside(hull[1], points)
    return found if found > FLAT * float(np.ptp(points, axis=0).max()) else 0.0


def _inside(faces: Array, points: Array) -> float:
    """Greatest depth of points (n, 3) below the nearest of faces (m, 4), in blocks of moderate memory."""
    each = np.unique(points, axis=0)
    blocks = np.array_split(each, 1 + len(each) * len(faces) // BLOCK)
    return max(-float((faces[:, :3] @ block.T + faces[:, 3:]).max(axis=0).min()) for block in blocks)


def largest_hull(points: Array, least: int = MOST_VERTICES, share: float = 0.0) -> tuple[Array, float]:
    """Some vertices (n, 3) of the convex hull of points (m, 3), and the distance in m of the farthest point outside of
    their hull. Those farthest outside are taken first.

    Parameters
    ----------
    least, share
        All vertices of hulls that have no more than ``least``; of others at least these, and at most `MOST_VERTICES`,
        until all points are no farther outside than this share of the largest extent.

    Raises
    ------
    ValueError
        Points in a plane.
    """
    from scipy.spatial import ConvexHull

    corners = corners_of(points)
    if len(corners) <= least:
        return corners, 0.0
    taken = ConvexHull(corners, qhull_options="Qt TA4").vertices
    enough = share * float(np.ptp(corners, axis=0).max())
    while True:
        faces = ConvexHull(corners[taken]).equations
        heights = faces[:, :3] @ corners.T + faces[:, 3:]
        outside = heights.max(axis=1)
        depth = float(outside.max())
        new = np.setdiff1d(heights[outside > 0.5 * depth].argmax(axis=1), taken)
        if not new.size or len(taken) == MOST_VERTICES or (len(taken) >= least and depth <= enough):
            return corners[taken], depth
        order = np.argsort(-heights.max(axis=0)[new], kind="stable")
        taken = np.append(taken, new[order][: (least if len(taken) < least else MOST_VERTICES) - len(taken)])


def _spans(triangles: Array) -> tuple[Array, Array]:
    return triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])


def _hull(points: Array) -> tuple[Array, Array, float] | None:
    """Corners (n, 3) of the convex hull, its faces (m, 4) as normal and offset, and its volume; None of flat ones."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(np.unique(points, axis=0))
    except (QhullError, ValueError):
        return None
    if hull.volume <= FLAT * hull.area * float(np.ptp(points, axis=0).max()):
        return None
    return hull.points[hull.vertices], hull.equations, float(hull.volume)


def triangles_of(file: Path) -> Array:
    """(n, 3, 3) corners of the triangles of an STL file, text or binary.

    Raises
    ------
    ValueError
        A file that cannot be read.
    """
    if not file.is_file():
        raise ValueError("no file")
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"a file of more than {MOST_BYTES // 1_000_000} MB")
    data = file.read_bytes()
    count = int.from_bytes(data[80:HEAD], "little")
    if len(data) == HEAD + count * RECORD.itemsize:
        found = np.frombuffer(data, RECORD, count, HEAD)["corners"]
        return np.asarray(found, dtype=float)
    words = data.decode("utf-8", errors="replace").split()
    at = [i for i, word in enumerate(words) if word == "vertex"]
    try:
        numbers = np.array([[float(word) for word in words[i + 1 : i + 4]] for i in at], dtype=float)
        return numbers.reshape(-1, 3, 3)
    except ValueError:
        raise ValueError("a file that is no STL") from None
