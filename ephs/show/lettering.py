"""Where names go: beside their dot or wire, on nothing else."""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import final

import numpy as np

from ephs.show.geometry import Point, Points, Text, distances
from ephs.show.graph import width_of

_AIR = 2.0


@final
@dataclass(frozen=True, slots=True)
class Sheet:
    """What lettering has to keep off: discs, rows (x, y, radius), line pieces, and the lettering set before.

    `bounds` is the outer rectangle as left, top, right, bottom, if there is one already.
    """

    discs: Points
    pieces: Points
    bounds: tuple[float, float, float, float] | None = None
    written: list[tuple[float, float, float, float]] = field(default_factory=list)

    def write(self, name: tuple[str, str], size: float, places: Iterable[tuple[Point, float]]) -> Text:
        """Set a name at the best of some places, (centre, how little it is liked), and remember it."""
        width = width_of(*name, size)
        best, cost = (0.0, 0.0), math.inf
        for place, dislike in places:
            now = dislike + self._trouble(place, width, size)
            if now < cost - 1e-9:
                best, cost = place, now
        text = Text(name[0], name[1], best, size, width)
        self.written.append(text.bounds)
        return text

    def _trouble(self, centre: Point, width: float, size: float) -> float:
        x, y = centre
        across = x + width * np.linspace(-0.5, 0.5, max(3, int(width / 4)))
        down = y + size * np.linspace(-0.5, 0.5, 4)
        marks = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        trouble = 0.0
        if len(self.pieces):
            away = distances(marks[:, None, :], self.pieces[None, :, 0], self.pieces[None, :, 1]).min(axis=0)
            trouble += float(np.clip(_AIR - away, 0.0, None).sum()) * 4.0
        if len(self.discs):
            away = np.linalg.norm(marks[:, None, :] - self.discs[None, :, :2], axis=-1) - self.discs[None, :, 2]
            trouble += float(np.clip(_AIR - away, 0.0, None).sum()) * 2.0
        left, top, right, bottom = x - width / 2 - 1, y - size / 2 - 1, x + width / 2 + 1, y + size / 2 + 1
        for other in self.written:
            over = min(right, other[2]) - max(left, other[0])
            under = min(bottom, other[3]) - max(top, other[1])
            if over > 0 and under > 0:
                trouble += 10.0 + 2.0 * over * under
        if self.bounds is not None:
            limits = (
                self.bounds[0] - left,
                self.bounds[1] - top,
                right - self.bounds[2],
                bottom - self.bounds[3],
            )
            trouble += 20.0 * sum(max(0.0, limit + 3.0) for limit in limits)
        return trouble


def around(centre: Point, radius: float, name: tuple[str, str], size: float) -> list[tuple[Point, float]]:
    """Places round a dot: right above first, then the others, near before far."""
    half = width_of(*name, size) / 2
    places: list[tuple[Point, float]] = []
    for far in range(3):
        for step in range(16):
            angle = -math.pi / 4 + step * math.pi / 8
            cosine, sine = math.cos(angle), math.sin(angle)
            reach = radius + 3.0 + 6.0 * far
            # The lettering's nearest edge, not its centre, is at the reach.
            x = centre[0] + cosine * (reach + half)
            y = centre[1] + sine * (reach + 0.5 * size)
            places.append(((x, y), 0.12 * min(step, 16 - step) + 3.0 * far))
    return places


def beside(line: tuple[Point, ...], name: tuple[str, str], size: float) -> list[tuple[Point, float]]:
    """Places at either side of a wire, near its first end."""
    half = width_of(*name, size) / 2
    places: list[tuple[Point, float]] = []
    for along in (5.0, 9.0, 14.0, 20.0):
        (x, y), (dx, dy) = _at(line, along)
        for side in (1.0, -1.0):
            nx, ny = -dy * side, dx * side
            off = 2.5 + abs(nx) * half + abs(ny) * 0.5 * size
            places.append(((x + off * nx, y + off * ny), 0.05 * along))
    return places


def _at(line: tuple[Point, ...], along: float) -> tuple[Point, Point]:
    """Point and unit direction at an arc length."""
    for a, b in itertools.pairwise(line):
        length = math.dist(a, b)
        if along <= length and length > 0:
            direction = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
            return (a[0] + along * direction[0], a[1] + along * direction[1]), direction
        along -= length
    a, b = line[-2], line[-1]
    length = max(math.dist(a, b), 1e-9)
    return b, ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
