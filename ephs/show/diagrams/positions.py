"""Positions of boxes and junctions: given points, else Graphviz' neato, else networkx; then small repairs."""

import ctypes
import math
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ephs.show.diagrams.geometry import BETTER, POINT, Points, distances
from ephs.show.diagrams.graph import Graph
from ephs.show.shared.errors import ShowError

GAP = 26.0
CLEARANCE = 9.0
GRID = 80.0
ITERATIONS = 20000
"""Time limit of Graphviz, which reports when the layout of a large pattern exceeds it."""
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
    starts = range(1, 9) if count <= 40 else range(1, 4) if count <= 120 else range(1, 2)
    for start in starts:
        points = _neato(graph, start) if find_spec("pygraphviz") else _networkx(graph, start)
        yield _spread(graph, _upright(points), wires=count <= 120)


def _edges(graph: Graph) -> list[tuple[str, str]]:
    return [(e.ends[0], e.ends[1] if e.role != "outer" else _OUTER + e.ends[0]) for e in graph.edges]


def _neato(graph: Graph, start: int) -> Points:
    import pygraphviz

    radii = graph.radii()
    names = {path: f"n{index}" for index, path in enumerate(radii)}
    names |= {end: f"o{index}" for index, (_, end) in enumerate(_edges(graph)) if end.startswith(_OUTER)}
    net = pygraphviz.AGraph(
        strict=True,
        directed=False,
        mode="KK",
        overlap="false",
        start=str(start),
        sep="+8",
        epsilon="0.02",
        maxiter=str(ITERATIONS),
    )
    for path, name in names.items():
        side = 2 * radii.get(path, 2.0) / 72
        net.add_node(name, shape="circle", fixedsize="true", label="", width=side, height=side)
    for first, second in _edges(graph):
        length = (radii.get(first, 2.0) + radii.get(second, 2.0) + GAP) / 72
        net.add_edge(names[first], names[second], len=length)
    with _errors_only():
        net.layout(prog="neato")
    found: Any = net
    places = [str(found.get_node(names[path]).attr["pos"]).split(",") for path in radii]
    return np.array([(float(x), -float(y)) for x, y in places]).reshape(-1, 2)


@contextmanager
def _errors_only() -> Generator[None, None, None]:
    """Graphviz without its warnings on stderr, such as for layouts that reach the limit of iterations."""
    from pygraphviz import graphviz

    try:
        least_told = ctypes.CDLL(graphviz._graphviz.__file__).agseterr  # pygraphviz has no option for it
    except (AttributeError, OSError):
        yield
        return
    before = least_told(1)
    try:
        yield
    finally:
        least_told(before)


def _networkx(graph: Graph, start: int) -> Points:
    import networkx

    radii = graph.radii()
    net = networkx.Graph()
    net.add_nodes_from(radii)
    for first, second in _edges(graph):
        net.add_edge(first, second, length=radii.get(first, 2.0) + radii.get(second, 2.0) + GAP)
    # Separate parts are laid out one by one, side by side: there is no distance between them.
    places: dict[str, Points] = {}
    offset = 0.0
    for part in sorted(networkx.connected_components(net), key=lambda nodes: sorted(nodes)[0]):
        piece = net.subgraph(sorted(part))
        turn = {
            node: (
                math.cos(start + 2 * math.pi * i / len(piece)),
                math.sin(start + 2 * math.pi * i / len(piece)),
            )
            for i, node in enumerate(sorted(piece))
        }
        scale = max((data["length"] for *_, data in piece.edges(data=True)), default=1.0)
        span = scale * 0.55 * max(1.0, networkx.diameter(piece))
        found = networkx.kamada_kawai_layout(piece, weight="length", pos=turn, scale=span)
        lowest = min(point[0] for point in found.values())
        shift = np.array([offset - lowest + 40.0, 0.0])
        places |= {node: np.asarray(point, dtype=float) + shift for node, point in found.items()}
        offset = max(float(places[node][0]) for node in piece) + 40.0
    return np.array([places[path] for path in radii], dtype=float).reshape(-1, 2)


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
