"""Wires as polylines that avoid all boxes and junctions except their ends."""

import heapq
import itertools
import math

import numpy as np
from numpy.typing import NDArray

from ephs.show.diagrams.geometry import POINT, Point, Points, distances

CLEAR = 3.5
NEAR = 150.0
"""Distance from the straight line of the obstacles that are looked at first."""


def straight(start: Point, end: Point, obstacles: Points) -> bool:
    """Whether the segment keeps clear of all obstacles, rows (x, y, radius)."""
    return bool(visible(start, np.array([end], dtype=float), obstacles)[0])


def visible(start: Point, ends: Points, obstacles: Points) -> NDArray[np.bool_]:
    """Points of `ends` (n, 2) that can be reached straight, clear of all obstacles, rows (x, y, radius)."""
    if not len(obstacles):
        return np.ones(len(ends), dtype=bool)
    between = distances(obstacles[None, :, :2], np.array(start, dtype=float), ends[:, None, :])
    return np.all(between >= obstacles[:, 2] + CLEAR, axis=1)


def route(start: Point, end: Point, obstacles: Points) -> tuple[Point, ...]:
    """The shortest line of straight pieces from `start` to `end` round all obstacles.

    The line bends at corners of octagons about the obstacles (a visibility graph, searched best first). Where there is
    no way through, which takes touching obstacles all round, it is the straight line.
    """
    if straight(start, end, obstacles):
        return (start, end)
    away = distances(obstacles[:, :2], np.array([start], dtype=float), np.array([end], dtype=float))
    if len(near := obstacles[away < obstacles[:, 2] + NEAR]) < len(obstacles):
        line = route(start, end, near)
        if all(straight(a, b, obstacles) for a, b in itertools.pairwise(line)):
            return line
    turns = np.arange(8) * math.pi / 4
    reach = (obstacles[:, 2] + CLEAR + 1.5) / math.cos(math.pi / 8)
    rings = obstacles[:, None, :2] + reach[:, None, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    around = rings.reshape(-1, 2)
    away = np.linalg.norm(around[:, None, :] - obstacles[None, :, :2], axis=-1)
    free = around[(away >= obstacles[:, 2] + CLEAR).all(axis=1)]
    corners = np.concatenate([np.array([start, end], dtype=float), free])
    ahead = np.linalg.norm(corners - corners[1], axis=1)
    best = np.full(len(corners), math.inf)
    best[0] = 0.0
    before = np.zeros(len(corners), dtype=int)
    done = np.zeros(len(corners), dtype=bool)
    queue: list[tuple[float, int]] = [(float(ahead[0]), 0)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == 1:
            return _smooth(_corner_path(corners, before), obstacles)
        if done[here]:
            continue
        done[here] = True
        # Each bend has a small cost, so that lines with fewer bends are preferred.
        length = best[here] + np.linalg.norm(corners - corners[here], axis=1) + 6.0
        nearer = np.flatnonzero(~done & (length < best))
        centre = (float(corners[here, 0]), float(corners[here, 1]))
        for there in nearer[visible(centre, corners[nearer], obstacles)]:
            best[there], before[there] = length[there], here
            heapq.heappush(queue, (float(length[there] + ahead[there]), int(there)))
    return (start, end)


def _corner_path(corners: Points, before: NDArray[np.int_]) -> tuple[Point, ...]:
    way = [1]
    while way[-1] != 0:
        way.append(int(before[way[-1]]))
    return tuple((float(corners[index, 0]), float(corners[index, 1])) for index in reversed(way))


def _smooth(line: tuple[Point, ...], obstacles: Points) -> tuple[Point, ...]:
    """Cut the corners thrice, as long as the line stays clear."""
    for _ in range(3):
        cut = [line[0]]
        for a, b in itertools.pairwise(line):
            cut.append((0.75 * a[0] + 0.25 * b[0], 0.75 * a[1] + 0.25 * b[1]))
            cut.append((0.25 * a[0] + 0.75 * b[0], 0.25 * a[1] + 0.75 * b[1]))
        cut.append(line[-1])
        if not all(straight(a, b, obstacles) for a, b in itertools.pairwise(cut)):
            return line
        line = tuple(cut)
    return line


def bulged(start: Point, end: Point, amount: float) -> tuple[Point, ...]:
    """A bow from `start` to `end`, `amount` off the straight line at its middle: for parallel wires."""
    along = (end[0] - start[0], end[1] - start[1])
    length = max(math.hypot(*along), POINT)
    normal = (-along[1] / length, along[0] / length)
    steps = [k / 12 for k in range(13)]
    return tuple(
        (
            start[0] + t * along[0] + 4 * t * (1 - t) * amount * normal[0],
            start[1] + t * along[1] + 4 * t * (1 - t) * amount * normal[1],
        )
        for t in steps
    )


def trimmed(line: tuple[Point, ...], radius: float) -> tuple[Point, ...]:
    """The line outside the disc of this radius about its first point."""
    centre = line[0]
    for index in range(1, len(line)):
        a, b = line[index - 1], line[index]
        if math.dist(b, centre) <= radius:
            continue
        low, high = 0.0, 1.0
        for _ in range(40):
            part = 0.5 * (low + high)
            inside = math.dist((a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])), centre) <= radius
            low, high = (part, high) if inside else (low, part)
        return ((a[0] + high * (b[0] - a[0]), a[1] + high * (b[1] - a[1])), *line[index:])
    return line
