"""Composites opened by one level: a disc with their boxes inside replaces the named disc."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Nesting, Pattern
from ephs.show.diagrams import positions as places
from ephs.show.diagrams.geometry import BETTER, Lettering, PlacedRegion, Point, Points
from ephs.show.diagrams.graph import TYPE, Graph, places_of, read, width_of

if TYPE_CHECKING:
    from ephs.semantics import System

_PAD = 12.0
_TITLE = 1.5 * TYPE


@final
@dataclass(frozen=True, slots=True)
class Opened:
    """A system with its composites opened: the whole graph, which nodes are in which, and the graphs to place."""

    graph: Graph
    outer: Graph
    inner: Mapping[str, Graph]

    @property
    def members(self) -> dict[str, frozenset[str]]:
        """Nodes of the whole graph in each composite, by its path."""
        paths = list(self.graph.radii())
        return {box: frozenset(path for path in paths if path.startswith(f"{box}.")) for box in self.inner}

    def proposals(self) -> Iterator[Points]:
        """Layouts of the whole graph, (nodes, 2) each: inner layouts inserted into an outer one and rotated to fit."""
        insides = {box: self._inside(box) for box in self.inner}
        sizes = {box: _circle(nodes, self.graph.radii(), box)[1] for box, nodes in insides.items()}
        discs = tuple(replace(d, radius=sizes.get(d.path, d.radius)) for d in self.outer.discs)
        outer = replace(self.outer, discs=discs)
        for points in places.proposals(outer):
            at = places_of(outer.radii(), points)
            for box, nodes in insides.items():
                centre, _ = _circle(nodes, self.graph.radii(), box)
                relative = {path: (x - centre[0], y - centre[1]) for path, (x, y) in nodes.items()}
                at |= self._turned(relative, at[box], at)
            yield np.array([at[path] for path in self.graph.radii()], dtype=float).reshape(-1, 2)

    def _inside(self, box: str) -> dict[str, Point]:
        """Positions of a composite's own nodes; shared junctions lie outside."""
        graph = self.inner[box]
        points = next(iter(places.proposals(graph)))
        kept = self.members[box]
        placed = places_of((f"{box}.{path}" for path in graph.radii()), points)
        return {path: point for path, point in placed.items() if path in kept}

    def _turned(self, nodes: Mapping[str, Point], centre: Point, at: Mapping[str, Point]) -> dict[str, Point]:
        """The turn, of sixteen, with the shortest wires to the outside."""
        wires = [
            (here, at[there])
            for edge in self.graph.edges
            if len(edge.ends) == 2
            for here, there in (edge.ends, edge.ends[::-1])
            if here in nodes and there not in nodes and there in at
        ]
        best, least = dict(nodes), math.inf
        for step in range(16):
            c, s = math.cos(step * math.pi / 8), math.sin(step * math.pi / 8)
            now = {p: (centre[0] + c * x - s * y, centre[1] + s * x + c * y) for p, (x, y) in nodes.items()}
            length = sum(math.dist(now[here], there) for here, there in wires)
            if length < least - BETTER:
                best, least = now, length
        return best


def opened(source: "System | Nesting", kinds: Mapping[str, str] | None = None) -> Opened:
    """Open every composite of the outermost level."""
    if isinstance(source, Nesting):
        inside: dict[str, Pattern | System] = {str(box): child.pattern for box, child in source.children.items()}
        whole: Pattern | System = Nesting(
            source.pattern, {b: child.pattern for b, child in source.children.items()}
        ).flatten()
        top: Pattern | System = source.pattern
    else:
        fillings = source.fillings.items()
        composites = {box: f for box, f in fillings if f.kind == "composite" and not f.pattern.is_identity}
        inside = {str(box): composite for box, composite in composites.items()}
        whole = source.flatten_once()
        top = source
    known = {str(path): str(kind) for path, kind in (kinds or {}).items()}

    def graph(part: "Pattern | System", prefix: str = "") -> Graph:
        names = part if isinstance(part, Pattern) else part.pattern
        here = {str(b): known[prefix + str(b)] for b in names.boxes if prefix + str(b) in known}
        return read(part, here, inside=() if part is not whole else inside)

    return Opened(graph(whole), graph(top), {box: graph(part, f"{box}.") for box, part in inside.items()})


def regions(
    members: Mapping[str, frozenset[str]], at: Mapping[str, Point], radii: Mapping[str, float]
) -> tuple[PlacedRegion, ...]:
    """The discs about the nodes of each composite, with their names at the top."""
    found: list[PlacedRegion] = []
    for box, paths in members.items():
        if not paths:
            continue
        (x, y), radius = _circle({path: at[path] for path in sorted(paths)}, radii, box)
        label = Lettering(box, "", (x, y - radius + 0.85 * _TITLE), TYPE, width_of(box, "", TYPE))
        found.append(PlacedRegion(box, (x, y), radius, label, paths))
    return tuple(found)


def _circle(nodes: Mapping[str, Point], radii: Mapping[str, float], box: str) -> tuple[Point, float]:
    """A disc round all nodes with room for a name above them."""
    if not nodes:
        return (0.0, 0.0), 2 * TYPE
    points = np.array(list(nodes.values()))
    sizes = np.array([radii[path] for path in nodes])
    # Towards the farthest node, by ever smaller steps: the least disc, however the nodes are turned (Bădoiu, Clarkson).
    centre = points.mean(axis=0)
    for step in range(2, 300):
        away = np.linalg.norm(points - centre, axis=1) + sizes
        centre = centre + (points[away.argmax()] - centre) / step
    reach = float((np.linalg.norm(points - centre, axis=1) + sizes).max())
    return (float(centre[0]), float(centre[1])), max(reach, width_of(box, "", TYPE) / 2) + _PAD + _TITLE
