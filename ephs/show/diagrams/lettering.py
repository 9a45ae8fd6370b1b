"""Placement of names beside dots and wires, without overlaps."""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import final

import numpy as np

from ephs.show.diagrams.geometry import POINT, Lettering, Point, Points, inside
from ephs.show.diagrams.graph import width_of

LESS = 1e-9
"""Least decrease of a name's cost for a move."""
OVERLAP = 1e6
"""Cost of lying on something: more than that of any place along a wire, 0.05 a pixel."""
_AIR = 1.5
Place = tuple[Point, float]


@final
@dataclass(frozen=True, slots=True)
class Sheet:
    """Obstacles of lettering: discs, rows (x, y, radius), line pieces, and the lettering set before.

    `bounds` is the outer rectangle as left, top, right, bottom, if there is one already.
    """

    discs: Points
    pieces: Points
    bounds: tuple[float, float, float, float] | None = None
    written: list[tuple[float, float, float, float]] = field(default_factory=list)

    def write(self, name: tuple[str, str], size: float, places: Iterable[Place]) -> Lettering:
        """Set a name at the best of some places, (centre, cost), and record it."""
        width = width_of(*name, size)
        best, cost = Lettering(*name, (0.0, 0.0), size, width), math.inf
        for centre, dislike in places:
            if dislike >= cost:
                continue
            text = Lettering(*name, centre, size, width)
            now = dislike + self._trouble(text)
            if now < cost - LESS:
                best, cost = text, now
        self.written.append(best.bounds)
        return best

    def _trouble(self, text: Lettering) -> float:
        left, top, right, bottom = text.bounds
        left, top, right, bottom = left - _AIR, top - _AIR, right + _AIR, bottom + _AIR
        trouble = 0.0
        if len(self.pieces):
            under = inside((left, top, right, bottom), self.pieces[:, 0], self.pieces[:, 1])
            trouble += OVERLAP * float(np.count_nonzero(under)) + float(under.sum())
        if len(self.discs):
            nearest = np.clip(self.discs[:, :2], (left, top), (right, bottom))
            depth = self.discs[:, 2] - np.hypot(*(nearest - self.discs[:, :2]).T)
            trouble += OVERLAP * float(np.count_nonzero(depth > 0)) + 3.0 * float(np.clip(depth, 0.0, None).sum())
        for other in self.written:
            across = min(right, other[2]) - max(left, other[0])
            down = min(bottom, other[3]) - max(top, other[1])
            if across > 0 and down > 0:
                trouble += OVERLAP + 2.0 * across * down
        if self.bounds is not None:
            limits = (self.bounds[0] - left, self.bounds[1] - top, right - self.bounds[2], bottom - self.bounds[3])
            trouble += 20.0 * sum(max(0.0, limit + 3.0) for limit in limits)
        return trouble


def around(centre: Point, radius: float, name: tuple[str, str], size: float) -> list[Place]:
    """Places round a dot: right above first, then the others, near before far."""
    half = width_of(*name, size) / 2
    places: list[Place] = []
    for far in range(6):
        for step in range(16):
            angle = -math.pi / 4 + step * math.pi / 8
            cosine, sine = math.cos(angle), math.sin(angle)
            reach = radius + 2.5 + 2.5 * far
            # The lettering's nearest edge, not its centre, is at the reach.
            x = centre[0] + cosine * (reach + half)
            y = centre[1] + sine * (reach + 0.45 * size)
            places.append(((x, y), 0.12 * min(step, 16 - step) + 1.2 * far))
    return sorted(places, key=lambda place: place[1])


def beside(line: tuple[Point, ...], name: tuple[str, str], size: float) -> list[Place]:
    """Places at either side of a wire, near its first end before farther on."""
    half = width_of(*name, size) / 2
    places: list[Place] = []
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(line))
    for along in (5.0, 7.0, 9.0, 11.5, 14.0, 17.0, 20.0, 24.0, *(part * length for part in (0.4, 0.5, 0.6, 0.7, 0.8))):
        (x, y), (dx, dy) = _point_along(line, along)
        for side in (1.0, -1.0):
            nx, ny = -dy * side, dx * side
            # The rectangle's corner nearest to the wire keeps a distance from it.
            off = _AIR + 1.0 + abs(nx) * half + abs(ny) * 0.55 * size
            places.append(((x + off * nx, y + off * ny), 0.05 * along))
    return places


def _point_along(line: tuple[Point, ...], along: float) -> tuple[Point, Point]:
    """Point and unit direction at an arc length."""
    for a, b in itertools.pairwise(line):
        length = math.dist(a, b)
        if along <= length and length > 0:
            direction = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
            return (a[0] + along * direction[0], a[1] + along * direction[1]), direction
        along -= length
    a, b = line[-2], line[-1]
    length = max(math.dist(a, b), POINT)
    return b, ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
