"""Meshes of quadrilaterals for shells: checks, normals, section frames, grids; arrays of all elements at once."""

from collections.abc import Callable, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.elements.shell.stiffness import EDGES
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError

Indices: TypeAlias = NDArray[np.int64]
Truths: TypeAlias = NDArray[np.bool_]
FLAT: Final = 1e-6
"""Area of a corner's triangle, in parts of the element's area, below which it counts as degenerate."""
WARPED: Final = 0.2
"""Height of corners over the mean plane, in parts of the root of the area, beyond which an element is refused."""
STEEP: Final = 0.5
"""Least cosine between a corner's normal and the element's own."""


def grid(surface: Callable[[Any, Any], Any], elements: tuple[int, int]) -> tuple[Array, Array, Indices]:
    """Points (m, 3) of a surface, their parameters (m, 2), and elements (n, 4) of a grid.

    Parameters
    ----------
    surface
        Function of two parameters between 0 and 1, called with arrays (m,), that gives three coordinates in m; its
        normal is that of ∂u × ∂v.
    elements
        Number of elements along each parameter; consecutive nodes lie along the second parameter.
    """
    across, along = elements
    if min(elements) < 1:
        _refuse("elements", elements, "two numbers ≥ 1")
    u, v = (x.ravel() for x in np.meshgrid(*(np.linspace(0.0, 1.0, k + 1) for k in elements), indexing="ij"))
    points: Array = np.stack([np.broadcast_to(np.asarray(x, dtype=float), u.shape) for x in surface(u, v)], axis=1)
    number = np.arange(len(points)).reshape(across + 1, along + 1)
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    return points, np.stack([u, v], axis=1), np.stack([corner.ravel() for corner in corners], axis=1)


def quadrilaterals(points: Array, cells: Sequence[Sequence[int]]) -> tuple[Array, Indices, Indices]:
    """Points, elements of four nodes, and the ends of new nodes, of a mesh with triangles, too.

    If there is a triangle, each one becomes three quadrilaterals, and each quadrilateral four, with new nodes in the
    middle of edges and elements. Points and elements are those given where there is none.

    Parameters
    ----------
    points
        (m, 3); they stay the first ones.
    cells
        Three or four nodes of each element.

    Returns
    -------
    points, cells
        (k, 3), (n, 4).
    ends
        (e, 2) points between which the nodes m … m + e − 1 are.
    """
    if all(len(cell) == 4 for cell in cells):
        return points, np.array(cells, dtype=np.int64).reshape(-1, 4), np.zeros((0, 2), dtype=np.int64)
    middles: dict[tuple[int, int], int] = {}

    def middle(a: int, b: int) -> int:
        return middles.setdefault((min(a, b), max(a, b)), len(points) + len(middles))

    around = [[(cell[i - 1], a, cell[(i + 1) % len(cell)]) for i, a in enumerate(cell)] for cell in cells]
    corners = [[(middle(before, a), a, middle(a, after)) for before, a, after in cell] for cell in around]
    first = len(points) + len(middles)
    found = [[a, after, first + k, before] for k, cell in enumerate(corners) for before, a, after in cell]
    ends = np.array([*middles], dtype=np.int64)
    centres = np.array([points[list(cell)].mean(axis=0) for cell in cells])
    return np.concatenate([points, points[ends].mean(axis=1), centres]), np.array(found, dtype=np.int64), ends


def checked(points: Array, cells: Indices) -> None:
    """Raise a StructureError that names the first element by which points (m, 3) and cells (n, 4) are no shell."""
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        _refuse("points", f"an array of shape {points.shape}", "finite numbers (m, 3)")
    if cells.ndim != 2 or cells.shape[1] != 4 or not len(cells) or cells.dtype.kind not in "iu":
        _refuse("elements", f"an array of {cells.dtype} of shape {cells.shape}", "integers (n, 4)")
    beyond = ((cells < 0) | (cells >= len(points))).sum(axis=1) > 0
    _each(beyond, cells, lambda i: f"a node of 0 … {len(points) - 1} at each corner")
    alone = np.setdiff1d(np.arange(len(points)), cells)
    if alone.size:
        _refuse(f"points[{alone[0]}]", "a corner of no element", "elements that match the points")
    corner = points[cells]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    twice = np.linalg.norm(normal, axis=1)
    largest = np.square(corner - corner.mean(axis=1, keepdims=True)).sum(axis=(1, 2))
    _each(twice <= FLAT * largest, cells, lambda i: f"an area; it has {0.5 * twice[i]:.3g} m²")
    unit = normal / twice[:, None]
    ahead, behind = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    turned = np.einsum("nki,ni->nk", np.cross(ahead, behind), unit) / twice[:, None]
    worst = turned.argmin(axis=1)
    _each(turned.min(axis=1) <= FLAT, cells, lambda i: f"convex corners; that at node {cells[i, worst[i]]} is not")
    height = np.abs(np.einsum("nki,ni->nk", corner - corner.mean(axis=1, keepdims=True), unit)).max(axis=1)
    high = height / np.sqrt(0.5 * twice)
    _each(high > WARPED, cells, lambda i: f"corners within {WARPED:g} √area of a plane; they are {high[i]:.2g} off")
    _match(cells)


def _match(cells: Indices) -> None:
    """Refuse edges of three elements, and neighbours of opposite orientation."""
    ways = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    for sides, at_most, what in (
        (np.sort(ways, axis=1), 2, "at most two elements at the edge {edge}"),
        (ways, 1, "the orientation of its neighbour at the edge {edge}"),
    ):
        _, where, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        many = count[where.ravel()] > at_most
        last = np.flatnonzero(many)[-1] if many.any() else 0
        edge = "–".join(map(str, sorted(ways[last].tolist())))
        bad = np.zeros(len(cells), dtype=bool)
        bad[last // 4] = many.any()
        text = what.format(edge=edge)
        _each(bad, cells, lambda _, text=text: text)


def corner_normals(points: Array, cells: Indices, crease: float) -> Array:
    """(n, 4, 3) unit normals at corners: means over the neighbours; the element's own beyond the angle of a crease."""
    corner = points[cells]
    own = np.cross(np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner)
    total = np.zeros_like(points)
    np.add.at(total, cells, own)
    mean, own = (unit(x) for x in (total[cells], own))
    return np.where(dot(mean, own) < np.cos(crease), own, mean)


def section_axes(points: Array, cells: Indices, normals: Array, along: Array | None) -> Array:
    """(n, 4, 3, 3) frames of elements at their corners, in columns, the third along normals (n, 4, 3).

    The frame of the element's centre turns the shortest way. Its first axis is that along a direction (3,), or where
    there is none, its first two axes are as near to the element's two directions as can be.
    """
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    one, two = unit(b + c - a - d), unit(c + d - a - b)
    middle = unit(np.cross(one, two))
    if along is None:
        first = unit(one + np.cross(two, middle))
    else:
        flat = along - dot(middle, np.broadcast_to(along, middle.shape)) * middle
        upright = np.linalg.norm(flat, axis=1) <= FLAT * np.linalg.norm(along)
        _each(upright, cells, lambda i: f"a direction along it; {along.tolist()} is its normal")
        first = unit(flat)
    centre = np.stack([first, np.cross(middle, first), middle], axis=2)
    up = np.broadcast_to(middle[:, None], normals.shape)
    cosine = dot(up, normals)
    steep = cosine.min(axis=(1, 2)) < STEEP
    _each(steep, cells, lambda i: f"normals within {np.degrees(np.arccos(STEEP)):.0f}° of its own at its corners")
    axis = np.cross(up, normals)
    skew = np.cross(np.eye(3), axis[..., None, :])
    turn = np.eye(3) + skew + skew @ skew / (1.0 + cosine[..., None])
    return turn @ centre[:, None]


def edge_ends(corners: Array) -> tuple[Array, Array]:
    """Arrays (4n, …) at the starts and the ends of edges, of arrays (n, 4, …) at corners."""
    shape = (-1, *corners.shape[2:])
    return tuple(corners[:, [edge[k] for edge in EDGES]].reshape(shape) for k in (0, 1))  # pyright: ignore


def unit(x: Array) -> Array:
    """Vectors of length 1."""
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def dot(a: Array, b: Array) -> Array:
    """Products along the last axis, which is kept."""
    return np.sum(a * b, axis=-1, keepdims=True)


def _each(bad: Truths, cells: Indices, expected: Callable[[int], str]) -> None:
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        _refuse(f"elements[{i}]", f"the nodes {cells[i].tolist()}", expected(i))


def _refuse(key: str, found: object, expected: str) -> None:
    raise StructureError("parameter", "shell", key=key, found=found, expected=expected)
