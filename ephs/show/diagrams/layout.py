"""From a pattern to its placed picture.

Boxes and junctions get places, wires are led round what they are not attached to, outer ports run to the
outer rectangle, and names are set where nothing else is. All of it is deterministic: the same pattern gives the same
picture.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Nesting, Pattern
from ephs.show.diagrams import opening
from ephs.show.diagrams import positions as places
from ephs.show.diagrams.geometry import (
    BETTER,
    MARGIN,
    Lettering,
    PlacedBox,
    PlacedJunction,
    PlacedRegion,
    Placement,
    Point,
    Points,
    Wire,
    crossings,
    faults,
    hatching,
)
from ephs.show.diagrams.graph import DOT, TYPE, Disc, Graph, UnplacedWire, places_of, read, width_of
from ephs.show.diagrams.legend import legend
from ephs.show.diagrams.lettering import Sheet, around, beside
from ephs.show.diagrams.routing import bulged, route, straight, trimmed

if TYPE_CHECKING:
    from ephs.semantics import System

PORT_TYPE = 8.0
ROOMY = 60
"""Nodes up to which a picture is drawn larger if names lack room."""
Rectangle = tuple[float, float, float, float]


def place(
    source: "Pattern | Nesting | System",
    *,
    kinds: Mapping[str, str] | None = None,
    positions: Mapping[str, tuple[float, float]] | None = None,
    opened: bool = False,
) -> Placement:
    """Place a pattern or system in the plane.

    Parameters
    ----------
    source : Pattern or System
        What to draw. A system knows the kinds of its boxes.
    kinds : mapping of str to str, optional
        Kind of each box, by path: storage, environment, reversible, irreversible, composite or unknown.
    positions : mapping of str to (float, float), optional
        Points for the boxes, and for junctions if wanted, in steps of a grid, y upwards. By default they are found.
    opened : bool
        Whether composites show what is inside; points are then those of the inner boxes.

    Raises
    ------
    ShowError
        For an unknown kind, or positions that do not fit the pattern.
    """
    if opened and isinstance(source, Nesting) and source.pattern.is_identity:
        source = source.flatten()
    parts = opening.opened(source, kinds) if opened and not isinstance(source, Pattern) else None
    graph = read(source, kinds) if parts is None else parts.graph
    page = _DrawnGraph(graph, {} if parts is None else parts.members)
    if positions is not None:
        return _roomy(page, places.given(graph, positions))
    best: tuple[float, Points, Placement] | None = None
    for points in places.proposals(graph) if parts is None else parts.proposals():
        now = _picture(page, points)
        width, height = now.size
        bends = sum(len(wire.points) > 2 for wire in now.wires)
        cost = 300.0 * len(faults(now)) + 12.0 * crossings(now) + 4.0 * bends + (width + height) / 60.0
        if best is None or cost < best[0] - BETTER:
            best = cost, points, now
    if best is None:
        return _picture(page, np.zeros((0, 2)))
    return _roomy(page, best[1], best[2])


@final
@dataclass(frozen=True, slots=True)
class _DrawnGraph:
    """Graph to be drawn, and the opened composite of each node."""

    graph: Graph
    members: Mapping[str, frozenset[str]]


def _roomy(page: _DrawnGraph, points: Points, first: Placement | None = None) -> Placement:
    """The picture, expanded until every name and wire has room; the best one if none has."""
    best = _picture(page, points) if first is None else first
    count = len(faults(best))
    for factor in (1.2, 1.5, 1.9, 2.4, 3.0, 4.0):
        if count == 0 or len(points) > ROOMY:
            break
        now = _picture(page, factor * points, factor)
        if len(faults(now)) < count:
            best, count = now, len(faults(now))
    return best


def _picture(page: _DrawnGraph, points: Points, room: float = 1.0) -> Placement:
    graph, radii = page.graph, page.graph.radii()
    at = places_of(radii, points)
    regions = opening.regions(page.members, at, radii)
    field = _PlacedNodes(at, radii, regions)
    wires = [_wire(edge, line, None) for edge, line in _inner_lines(graph, field, 16.0 * room)]
    # Once without the outer ports, to learn how large the rectangle must be, and once with them.
    sheet = _sheet(field, wires, None)
    labels = [_label(path, name, at, sheet).bounds for path, name in graph.dots]
    rectangle = _bounds(field, wires, labels)
    wires += _outer_wires(graph, field, wires, rectangle)
    sheet = _sheet(field, wires, rectangle)
    named = [(path, _label(path, name, at, sheet)) for path, name in graph.dots]
    ports = {edge.title: edge.port for edge in graph.edges}
    wires = [_with_label(wire, ports[wire.title], sheet) for wire in wires]
    left, top, right, bottom = rectangle
    kinds = {disc.kind for disc in graph.discs} | {"composite" for _ in regions}
    return Placement(
        tuple(_box(disc, at[disc.path]) for disc in graph.discs),
        tuple(PlacedJunction(path, at[path], DOT, text) for path, text in named),
        tuple(wires),
        (left, top, right - left, bottom - top),
        14.0,
        regions,
        legend(kinds, (left, bottom + MARGIN - 4.0), right - left),
    )


@final
@dataclass(frozen=True, slots=True)
class _PlacedNodes:
    """Positions of nodes and opened composites, before the outer rectangle."""

    at: Mapping[str, Point]
    radii: Mapping[str, float]
    regions: tuple[PlacedRegion, ...]

    def obstacles(self, ends: tuple[str, ...]) -> Points:
        """Rows (x, y, radius) of the obstacles of a wire with these ends."""
        rows = [(*point, self.radii[path]) for path, point in self.at.items() if path not in ends]
        rows += [(*region.at, region.radius) for region in self.regions if region.members.isdisjoint(ends)]
        return np.array(rows, dtype=float).reshape(-1, 3)


def _inner_lines(graph: Graph, field: _PlacedNodes, apart: float) -> list[tuple[UnplacedWire, tuple[Point, ...]]]:
    groups: dict[tuple[str, ...], list[UnplacedWire]] = {}
    for edge in graph.edges:
        if edge.role != "outer":
            groups.setdefault(edge.ends, []).append(edge)
    lines: list[tuple[UnplacedWire, tuple[Point, ...]]] = []
    for ends, edges in groups.items():
        start, end = field.at[ends[0]], field.at[ends[1]]
        obstacles = field.obstacles(ends)
        for index, edge in enumerate(edges):
            amount = apart * (index - (len(edges) - 1) / 2)
            line = bulged(start, end, amount) if amount else (start, end)
            clear = all(straight(a, b, obstacles) for a, b in itertools.pairwise(line))
            line = line if clear else route(start, end, obstacles)
            lines.append((edge, trimmed(line, field.radii[ends[0]])))
    return lines


def _outer_wires(graph: Graph, field: _PlacedNodes, wires: list[Wire], rectangle: Rectangle) -> list[Wire]:
    found: list[Wire] = []
    left, top, right, bottom = rectangle
    taken: list[Point] = []
    for edge in graph.edges:
        if edge.role != "outer":
            continue
        (path,) = edge.ends
        x, y = field.at[path]
        obstacles = field.obstacles(edge.ends)
        inset = 16.0
        ends = [(left, y), (right, y), (x, top), (x, bottom)]
        ends += [(side, v) for side in (left, right) for v in np.linspace(top + inset, bottom - inset, 9).tolist()]
        ends += [(v, side) for side in (top, bottom) for v in np.linspace(left + inset, right - inset, 9).tolist()]
        best: Wire | None = None
        least = math.inf
        for rank, end in enumerate(ends):
            crowd = sum(max(0.0, 18.0 - math.dist(end, other)) for other in taken)
            if straight((x, y), end, obstacles):
                line: tuple[Point, ...] = ((x, y), end)
                bent = 0.0
            elif rank < 4:
                line, bent = route((x, y), end, obstacles), 60.0
            else:
                continue
            wire = _wire(edge, line, None)
            over = sum(_meet(wire, other) for other in (*wires, *found))
            length = sum(math.dist(a, b) for a, b in itertools.pairwise(line))
            cost = length + bent + 80.0 * over + 10.0 * crowd + (25.0 if rank >= 4 else 0.0)
            if cost < least - BETTER:
                best, least = wire, cost
        if best is not None:
            taken.append(best.points[-1])
            found.append(best)
    return found


def _meet(first: Wire, second: Wire) -> int:
    return crossings(Placement((), (), (first, second), (0.0, 0.0, 0.0, 0.0), 0.0))


def _sheet(field: _PlacedNodes, wires: list[Wire], bounds: Rectangle | None) -> Sheet:
    pieces = [piece for wire in wires for piece in zip(wire.points, wire.points[1:], strict=False)]
    nodes = np.array([(*field.at[path], field.radii[path]) for path in field.at], dtype=float).reshape(-1, 3)
    titles = [region.label.bounds for region in field.regions]
    return Sheet(nodes, np.array(pieces, dtype=float).reshape(-1, 2, 2), bounds, titles)


def _label(path: str, name: tuple[str, str], at: Mapping[str, Point], sheet: Sheet) -> Lettering:
    size = TYPE if "." not in name[0] else 0.86 * TYPE
    return sheet.write(name, size, around(at[path], DOT, name, size))


def _bounds(field: _PlacedNodes, wires: list[Wire], labels: list[Rectangle]) -> Rectangle:
    air = 18.0
    discs = [(point, field.radii[path]) for path, point in field.at.items()]
    discs += [(region.at, region.radius) for region in field.regions]
    lefts = [(x - radius, y - radius, x + radius, y + radius) for (x, y), radius in discs]
    dots = [(x, y, x, y) for wire in wires for x, y in wire.points]
    every = np.array([*lefts, *dots, *labels, *([] if lefts else [(0.0, 0.0, 60.0, 30.0)])])
    return (
        float(every[:, 0].min()) - air,
        float(every[:, 1].min()) - air,
        float(every[:, 2].max()) + air,
        float(every[:, 3].max()) + air,
    )


def _wire(edge: UnplacedWire, line: tuple[Point, ...], label: Lettering | None) -> Wire:
    return Wire(edge.title, edge.ends, edge.role, edge.power, line, label)


def _with_label(wire: Wire, port: str, sheet: Sheet) -> Wire:
    if not port:
        return wire
    text = sheet.write((port, ""), PORT_TYPE, beside(wire.points, (port, ""), PORT_TYPE))
    return replace(wire, label=text)


def _box(disc: Disc, centre: Point) -> PlacedBox:
    pitch = 1.15 * disc.type_size
    first = centre[1] - pitch * (len(disc.lines) - 1) / 2
    lines = tuple(
        Lettering(base, sub, (centre[0], first + pitch * row), disc.type_size, width_of(base, sub, disc.type_size))
        for row, (base, sub) in enumerate(disc.lines)
    )
    marks = hatching(centre, disc.radius) if disc.kind == "environment" else ()
    return PlacedBox(disc.path, disc.kind, centre, disc.radius, lines, marks)
