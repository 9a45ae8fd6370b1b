"""Placed picture of a pattern for the three writers, and its plane geometry.

Lengths are in points (1/72 inch), x to the right, y **down**.
"""

import itertools
import math
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

POINT = 1e-9
"""Distance in points below which two positions are equal."""
UPRIGHT = 1e-12
"""Length along an axis below which a segment is perpendicular to it."""
MARGIN = 10.0
"""Room about the outer rectangle."""
BETTER = 1e-6
"""Least decrease of a drawing's cost above rounding."""

Point = tuple[float, float]
Points = NDArray[np.float64]

KINDS = ("storage", "environment", "reversible", "irreversible", "composite", "unknown")


@final
@dataclass(frozen=True, slots=True)
class Lettering:
    """A short name at a place: `base` with `sub` set as a subscript.

    `at` is the centre of the lettering, `size` the height of its type, `width` what it is reckoned to take.
    """

    base: str
    sub: str
    at: Point
    size: float
    width: float

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of the lettering's extent."""
        x, y = self.at
        return (x - self.width / 2, y - 0.55 * self.size, x + self.width / 2, y + 0.55 * self.size)


@final
@dataclass(frozen=True, slots=True)
class PlacedBox:
    """An inner box: a disc with its name; `hatching` are chords across it (environments only)."""

    path: str
    kind: str
    at: Point
    radius: float
    lines: tuple[Lettering, ...]
    hatching: tuple[tuple[Point, Point], ...]


@final
@dataclass(frozen=True, slots=True)
class PlacedJunction:
    """A junction: a dot, with its name beside it."""

    path: str
    at: Point
    radius: float
    label: Lettering


@final
@dataclass(frozen=True, slots=True)
class PlacedRegion:
    """An opened composite: a disc round its nodes, `members`, with its name inside at the top."""

    path: str
    at: Point
    radius: float
    label: Lettering
    members: frozenset[str]


@final
@dataclass(frozen=True, slots=True)
class Wire:
    """A line of the picture, from one node to another or to the outer rectangle.

    Attributes
    ----------
    title : str
        What the line stands for, in words.
    ends : tuple of str
        Paths of the nodes that it is attached to (one path for an outer port).
    role : str
        ``"port"``, ``"outer"`` (a port of the pattern itself) or ``"link"`` (two junctions that share their state).
    power : bool
        False: only information; drawn dashed.
    points : tuple of Point
        The line, as a polyline; the label, if any, is the port's name where the junction does not say it.
    """

    title: str
    ends: tuple[str, ...]
    role: str
    power: bool
    points: tuple[Point, ...]
    label: Lettering | None


@final
@dataclass(frozen=True, slots=True)
class Placement:
    """A pattern, placed in the plane.

    `rectangle` is left, top, width, height of the outer box; `legend` has a disc and a word for each kind, below it.
    """

    boxes: tuple[PlacedBox, ...]
    junctions: tuple[PlacedJunction, ...]
    wires: tuple[Wire, ...]
    rectangle: tuple[float, float, float, float]
    corner: float
    regions: tuple[PlacedRegion, ...] = ()
    legend: tuple[tuple[PlacedBox, Lettering], ...] = ()

    @property
    def origin(self) -> Point:
        """Left and top of the whole picture, margins included."""
        return self.rectangle[0] - MARGIN, self.rectangle[1] - MARGIN

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the whole picture, margins and legend included."""
        left, top, width, height = self.rectangle
        right = max([left + width, *(word.bounds[2] for _, word in self.legend)])
        bottom = max([top + height, *(box.at[1] + box.radius for box, _ in self.legend)])
        return right - left + 2 * MARGIN, bottom - top + 2 * MARGIN

    def nodes(self) -> dict[str, tuple[Point, float]]:
        """Centre and radius of every box and junction, by path."""
        boxes = {box.path: (box.at, box.radius) for box in self.boxes}
        return boxes | {junction.path: (junction.at, junction.radius) for junction in self.junctions}


def distances(point: Points, starts: Points, ends: Points) -> Points:
    """Distance of one point (2,), or of points (n, 2), to segments from `starts` to `ends`, (n, 2) each."""
    along = ends - starts
    length2 = np.maximum((along * along).sum(axis=-1), POINT**2)
    part = np.clip((((point - starts) * along).sum(axis=-1)) / length2, 0.0, 1.0)
    return np.linalg.norm(point - starts - part[..., None] * along, axis=-1)


def _gaps(points: Points, line: tuple[Point, ...]) -> Points:
    """(n,) distances of points (n, 2) to a polyline."""
    vertices = np.asarray(line, dtype=float)
    return distances(points[:, None], vertices[:-1], vertices[1:]).min(axis=1)


def trespasses(placement: Placement) -> list[tuple[str, str]]:
    """Every (wire, node) such that the wire runs through a box or junction that it is not attached to."""
    nodes = [(path, frozenset((path,)), at, radius) for path, (at, radius) in placement.nodes().items()]
    regions = [(region.path, region.members, region.at, region.radius) for region in placement.regions]
    return [
        (wire.title, path) for discs in (nodes, regions) for wire in placement.wires for path in _through(wire, discs)
    ]


def _through(wire: Wire, discs: list[tuple[str, frozenset[str], Point, float]]) -> list[str]:
    """Paths of discs, (path, members, centre, radius), that a wire runs through without an end among their members."""
    if not discs:
        return []
    near = _gaps(np.array([at for _, _, at, _ in discs]), wire.points) < [radius for *_, radius in discs]
    return [discs[i][0] for i in np.flatnonzero(near) if discs[i][1].isdisjoint(wire.ends)]


def overlaps(placement: Placement) -> list[tuple[str, str]]:
    """Every two boxes or junctions that overlap, and every node in an opened composite that it does not belong to."""
    nodes = placement.nodes()
    found = [
        (first, second)
        for (first, (at, r)), (second, (there, s)) in itertools.combinations(nodes.items(), 2)
        if math.dist(at, there) < r + s
    ]
    for one, two in itertools.combinations(placement.regions, 2):
        if math.dist(one.at, two.at) < one.radius + two.radius:
            found.append((one.path, two.path))
    return found + [
        (path, region.path)
        for region in placement.regions
        for path, (at, r) in nodes.items()
        if path not in region.members and math.dist(at, region.at) < r + region.radius
    ]


def inside(bounds: tuple[float, float, float, float], starts: Points, ends: Points) -> Points:
    """Length of each segment, from `starts` to `ends`, (n, 2) each, within a rectangle."""
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    near = ((np.minimum(starts, ends) <= high) & (np.maximum(starts, ends) >= low)).all(axis=1)
    lengths = np.zeros(len(starts))
    if not near.any():
        return lengths
    start = starts[near]
    along = ends[near] - start
    still = np.abs(along) < UPRIGHT
    step = np.where(still, 1.0, along)
    first, last = (low - start) / step, (high - start) / step
    enter = np.where(still, -np.inf, np.minimum(first, last)).max(axis=1).clip(0.0, 1.0)
    leave = np.where(still, np.inf, np.maximum(first, last)).min(axis=1).clip(0.0, 1.0)
    lengths[near] = np.clip(leave - enter, 0.0, None) * np.linalg.norm(along, axis=1)
    return lengths


def blots(placement: Placement) -> list[str]:
    """Every name beside a junction or wire that lies on a wire, a box, a junction or another such name."""
    texts = [region.label for region in placement.regions] + [junction.label for junction in placement.junctions]
    texts += [wire.label for wire in placement.wires if wire.label is not None]
    pieces = [piece for wire in placement.wires for piece in itertools.pairwise(wire.points)]
    lines = np.array(pieces, dtype=float).reshape(-1, 2, 2)
    found: list[str] = []
    for index, text in enumerate(texts):
        left, top, right, bottom = text.bounds
        on_wire = bool((inside(text.bounds, lines[:, 0], lines[:, 1]) > 0).any())
        on_node = any(
            math.dist(centre, (min(max(centre[0], left), right), min(max(centre[1], top), bottom))) < radius
            for centre, radius in placement.nodes().values()
        )
        on_text = any(
            min(right, other[2]) > max(left, other[0]) and min(bottom, other[3]) > max(top, other[1])
            for other in (each.bounds for each in texts[:index])
        )
        if on_wire or on_node or on_text:
            found.append(text.base + text.sub)
    return found


def faults(placement: Placement) -> list[str]:
    """Faults of the picture, in words: wires through foreign nodes, names on something."""
    through = [f"{wire} runs through {node}" for wire, node in trespasses(placement)]
    through += [f"{one} overlaps {other}" for one, other in overlaps(placement)]
    return through + [f"the name {name} lies on a wire, a node or another name" for name in blots(placement)]


def crossings(placement: Placement) -> int:
    """Number of pairs of wires that cross each other away from a common end."""
    count = 0
    for index, first in enumerate(placement.wires):
        for second in placement.wires[index + 1 :]:
            if not set(first.ends) & set(second.ends):
                count += _cross(first.points, second.points)
    return count


def _cross(first: tuple[Point, ...], second: tuple[Point, ...]) -> bool:
    def side(a: Point, b: Point, c: Point) -> float:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    return any(
        side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0
        for a, b in itertools.pairwise(first)
        for c, d in itertools.pairwise(second)
    )


def hatching(centre: Point, radius: float, step: float = 5.0) -> tuple[tuple[Point, Point], ...]:
    """Chords at 45 degrees across a disc, `step` apart."""
    count = int(radius // step)
    chords: list[tuple[Point, Point]] = []
    for index in range(-count, count + 1):
        offset = index * step
        half = math.sqrt(max(radius**2 - offset**2, 0.0))
        if half > 1.0:
            middle = (centre[0] + offset * math.sqrt(0.5), centre[1] + offset * math.sqrt(0.5))
            reach = half * math.sqrt(0.5)
            chords.append(((middle[0] - reach, middle[1] + reach), (middle[0] + reach, middle[1] - reach)))
    return tuple(chords)
