"""Positions of boxes and junctions: given points, else a balance of their distances; then small repairs."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.spaces.decompositions import symmetric_eigen
from ephs.show.diagrams.geometry import BETTER, POINT, Points, distances
from ephs.show.diagrams.graph import Graph
from ephs.show.shared.errors import ShowError

GAP = 26.0
CLEARANCE = 9.0
GRID = 80.0
ROUNDS = 500
"""Largest number of rounds of the balance."""
_AXES = ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3), (0, 4), (1, 4))
"""Principal coordinates from which layouts begin."""
SETTLED = 1e-5
"""Least relative decrease of its cost in a round."""
_OUTER = "\0"
FARTHEST = 1e6
"""Largest coordinate of a point: far beyond it, nodes beside each other are at one point by rounding."""


def given(graph: Graph, positions: Mapping[str, tuple[float, float]]) -> Points:
    """Points from the author's own grid: unit steps, x to the right, y upwards.

    A junction without a point goes to the middle of its boxes.

    Raises
    ------
    ShowError
        If a name is unknown, a box has no point, a point is far away, or two nodes share one.
    """
    known = {str(name): (float(x), float(y)) for name, (x, y) in positions.items()}
    placed = set(known)
    paths = list(graph.radii())
    for name in known:
        if name not in paths:
            raise ShowError("stranger", found=name, expected=", ".join(sorted(paths)))
        if not all(abs(x) <= FARTHEST for x in known[name]):
            raise ShowError("far", path=name, found=str(known[name]), expected=f"{FARTHEST:g}")
    for disc in graph.discs:
        if disc.path not in known:
            raise ShowError("unplaced", path=disc.path)
    for path, _ in graph.dots:
        if path not in known:
            around = [known[e.ends[0]] for e in graph.edges if e.role == "port" and e.ends[1] == path]
            around = around or [known[disc.path] for disc in graph.discs]
            known[path] = (sum(x for x, _ in around) / len(around), sum(y for _, y in around) / len(around))
            # A junction of one box would sit on it, and one of several could sit on another node.
            while any(math.dist(known[path], point) < 0.3 for other, point in known.items() if other != path):
                known[path] = (known[path][0] + 0.8, known[path][1] + 0.1)
    for index, first in enumerate(paths):
        for second in paths[index + 1 :]:
            if math.dist(known[first], known[second]) < POINT:
                raise ShowError("coincide", path=first, found=second)
    points = np.array([(GRID * known[p][0], -GRID * known[p][1]) for p in paths], dtype=float).reshape(-1, 2)
    free = np.array([path not in placed for path in paths], dtype=bool)
    return _spread(graph, points, wires=True, free=free) if free.any() else points


def proposals(graph: Graph) -> Iterator[Points]:
    """Layouts to choose from, (nodes, 2) each, boxes before junctions; the same ones at every call."""
    count = len(graph.discs) + len(graph.dots)
    if count == 0:
        yield np.zeros((0, 2))
        return
    starts = range(1, 9) if count <= 40 else range(1, 6) if count <= 120 else range(1, 2)
    for start in starts:
        yield _spread(graph, _upright(_balanced(graph, start)), wires=count <= 120)


def _balanced(graph: Graph, start: int) -> Points:
    """Points whose distances are nearest to the lengths of the shortest ways between them, weighed by their squares.

    Gansner, Koren and North, *Graph Drawing by Stress Majorization*, LNCS 3383 (2005) 239-250. ``start`` counts places
    to begin from. Ports of the pattern itself are nodes of their own, which keeps room for wires to the outside.
    """
    from scipy.linalg import cho_factor, cho_solve
    from scipy.sparse.csgraph import shortest_path

    radii = graph.radii()
    ends = [(e.ends[0], e.ends[1] if e.role != "outer" else _OUTER + e.ends[0]) for e in graph.edges]
    index = {path: i for i, path in enumerate(dict.fromkeys([*radii, *(second for _, second in ends)]))}
    size = len(index)
    lengths = np.zeros((size, size))
    for first, second in ends:
        lengths[index[first], index[second]] = radii[first] + radii.get(second, 2.0) + GAP
    wanted = shortest_path(lengths, directed=False)
    reached = np.isfinite(wanted)
    wanted = np.where(reached, wanted, wanted[reached].max() + 2.0 * GAP)  # parts that no wire joins
    np.fill_diagonal(wanted, np.inf)
    weights = wanted**-2.0
    np.fill_diagonal(wanted, 0.0)
    turns, reach = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(size), GAP * np.sqrt(np.arange(size) + 0.5)
    points = np.column_stack([reach * np.cos(turns), reach * np.sin(turns)])
    if size < 2:
        return points
    points = 0.1 * points + _scaled(wanted, *_AXES[start - 1])
    metric = cho_factor(_laplacian(weights)[1:, 1:])
    least = np.inf
    for _ in range(ROUNDS):
        distance = np.linalg.norm(points[:, None] - points[None], axis=2)
        stress = float((weights * (distance - wanted) ** 2).sum())
        if not stress < (1.0 - SETTLED) * least:
            break
        least = stress
        pull = _laplacian(weights * wanted / np.maximum(distance, POINT))
        points = np.vstack([np.zeros((1, 2)), cho_solve(metric, (pull @ points)[1:])])
    return points[: len(radii)]


def _scaled(wanted: Points, *axes: int) -> Points:
    """Classical scaling: two of the principal coordinates that distances (n, n) have."""
    centred = np.eye(len(wanted)) - 1.0 / len(wanted)
    sizes, ways = symmetric_eigen(-0.5 * centred @ wanted**2 @ centred)
    chosen = [max(-1 - axis, -len(sizes)) for axis in axes]
    return ways[:, chosen] * np.sqrt(np.maximum(sizes[chosen], 0.0))


def _laplacian(weights: Points) -> Points:
    return np.diag(weights.sum(axis=1)) - weights


def _upright(points: Points) -> Points:
    """Rotate the long side to the horizontal, and the first node to the upper left."""
    if len(points) < 2:
        return points
    centred = points - points.mean(axis=0)
    moment = centred.T @ centred
    angle = 0.5 * math.atan2(2 * float(moment[0, 1]), float(moment[0, 0] - moment[1, 1]))
    cosine, sine = math.cos(angle), math.sin(angle)
    turned = centred @ np.array([[cosine, -sine], [sine, cosine]])
    return turned * np.where(turned[0] > BETTER, -1.0, 1.0)


def _spread(graph: Graph, points: Points, *, wires: bool, free: NDArray[np.bool_] | None = None) -> Points:
    """Push apart overlapping nodes and, if `wires`, nodes on a foreign wire; all, or the free ones."""
    paths = list(graph.radii())
    radii = np.array([graph.radii()[path] for path in paths])
    index = {path: i for i, path in enumerate(paths)}
    pairs = [(index[e.ends[0]], index[e.ends[1]]) for e in graph.edges if e.role != "outer"]
    ends = np.array(pairs, dtype=int).reshape(-1, 2)
    wanted = radii[:, None] + radii[None, :] + CLEARANCE
    np.fill_diagonal(wanted, 0.0)
    places = points.copy()
    for _ in range(300):
        apart = places[:, None, :] - places[None, :, :]
        distance = np.linalg.norm(apart, axis=-1)
        lacking = np.clip(wanted - distance, 0.0, None)
        push = (0.5 * lacking / np.maximum(distance, POINT))[..., None] * apart
        moved = push.sum(axis=1)
        if wires and len(ends):
            moved += _off_wires(places, radii, ends)
        if free is not None:
            moved[~free] = 0.0
        if np.abs(moved).max(initial=0.0) < 0.05:
            break
        places += 0.7 * moved
    return places


def _off_wires(places: Points, radii: Points, ends: Points) -> Points:
    moved = np.zeros_like(places)
    for node in range(len(places)):
        foreign = (ends != node).all(axis=1)
        starts, stops = places[ends[foreign, 0]], places[ends[foreign, 1]]
        lacking = np.clip(radii[node] + CLEARANCE - distances(places[node], starts, stops), 0.0, None)
        for which in np.flatnonzero(lacking):
            along = stops[which] - starts[which]
            normal = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), POINT)
            if (places[node] - starts[which]) @ normal < 0:
                normal = -normal
            step = 0.4 * min(float(lacking[which]), 8.0)
            moved[node] += step * normal
            moved[ends[foreign][which]] -= 0.5 * step * normal
    return moved
