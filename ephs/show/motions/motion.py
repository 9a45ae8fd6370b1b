"""Motion as plain arrays: poses of bodies at the frames of a film, extents, a place for the camera."""

import math
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd, symmetric_eigen
from ephs.semantics.spaces.rank import DIRECTION, TINY
from ephs.semantics.spaces.rotations import matrix_to_quaternion

OPPOSITE = 1e-9
"""Distance of a cosine from −1 within which a rotation's axis is arbitrary."""
PLANAR = 1e-12
"""Relative squared distance of collinear points from a line."""


@final
@dataclass(frozen=True, slots=True)
class Film:
    """Frames of a motion.

    Attributes
    ----------
    times : (n,)
        Model time of each frame, s.
    pause : float
        Time from frame to frame when played, s.
    poses : dict of str to (n, 7)
        Pose of each body at each frame: unit quaternion, then position of the centre of mass, m.
    """

    times: Array
    pause: float
    poses: dict[str, Array]


@final
@dataclass(frozen=True, slots=True)
class View:
    """A camera: position and target in m, vertical field of view in rad."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field: float


def film(sol: Any, names: list[str], fps: float, duration: float | None, most: int = 3000) -> Film:
    """Sample a solution at even times.

    Parameters
    ----------
    sol : Solution
        Of a scene.
    names : list of str
        The bodies to follow.
    fps : float
        Frames a second when played; fewer where the film would have more than `most` frames.
    duration : float, optional
        Playing time, s; by default that of the model, so that it is seen in real time.
    """
    t = np.asarray(sol.t, dtype=float)
    span = abs(float(t[-1] - t[0]))
    playing = span if duration is None else float(duration)
    count = max(2, min(most, round(playing * fps) + 1))
    times = np.linspace(t[0], t[-1], count) if span > 0 else t[:1]
    poses = {name: _sampled(t, sol.body(name), times) for name in names}
    return Film(times, float(playing / max(1, count - 1)), poses)


def between_instants(t: Array, times: Array, values: Array) -> Array:
    """Values (n,) at the times t, which rise or fall, at other times: by straight lines."""
    return np.interp(times, t, values) if t[-1] >= t[0] else np.interp(times, t[::-1], values[::-1])


def nearest(t: Array, times: Array) -> NDArray[np.int64]:
    """Index of the instant in t, which rises or falls, that is nearest to each of some times."""
    order = np.argsort(t)
    after = np.clip(np.searchsorted(t[order], times), 0, len(t) - 1)
    before = np.maximum(after - 1, 0)
    return order[np.where(times - t[order[before]] <= t[order[after]] - times, before, after)]


def _sampled(t: Array, body: Any, times: Array) -> Array:
    turns = np.asarray(body.quaternion, dtype=float).copy()
    # q and -q are one rotation: continuous signs, so that blending takes the shorter arc.
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips)[:, None]
    places = np.asarray(body.position, dtype=float)
    columns = [between_instants(t, times, column) for column in (*turns.T, *places.T)]
    poses = np.stack(columns, axis=1)
    poses[:, :4] /= np.linalg.norm(poses[:, :4], axis=1, keepdims=True)
    return poses


def rotate(quaternion: Array, vector: Array) -> Array:
    """Turn vectors (..., 3) by unit quaternions (..., 4)."""
    axis = quaternion[..., 1:]
    across = 2.0 * np.cross(axis, vector)
    return vector + quaternion[..., :1] * across + np.cross(axis, across)


def point_of(pose: Array, local: Array) -> Array:
    """World place (..., 3) of a body's point under poses (..., 7)."""
    return pose[..., 4:] + rotate(pose[..., :4], np.broadcast_to(local, (*pose.shape[:-1], 3)))


def between(first: Array, second: Array) -> tuple[Array, float]:
    """Unit quaternion that turns z to the direction from one point to another, and their distance."""
    way = second - first
    length = float(np.linalg.norm(way))
    if length < DIRECTION:
        return np.array([1.0, 0.0, 0.0, 0.0]), 0.0
    z = way / length
    if z[2] < -1.0 + OPPOSITE:
        return np.array([0.0, 1.0, 0.0, 0.0]), length
    turn = np.array([1.0 + z[2], -z[1], z[0], 0.0])
    return turn / np.linalg.norm(turn), length


def equivalent_box(mass: float, inertia: Array) -> tuple[Array, Array]:
    """Sides (3,) m and orientation (4,) of the solid box with this mass, kg, and inertia (3, 3), kg m²."""
    moments, axes = symmetric_eigen(np.asarray(inertia, dtype=float))
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1.0
    squares = 6.0 / mass * (moments.sum() - 2.0 * moments) if mass > 0 else np.zeros(3)
    sides = np.sqrt(np.clip(squares, 0.0, None))
    longest = float(sides.max())
    # A rod's box would be too thin to be seen.
    return np.maximum(sides, 0.06 * longest if longest > 0 else 0.0), matrix_to_quaternion(axes)


def best_side(points: Array) -> Array:
    """(3,) the way from points (n, 3) to where their motion is seen best: flat motions from the front."""
    scatter = points - points.mean(axis=0)
    _, spread, axes = svd(scatter.T @ scatter)
    if spread[1] > PLANAR * max(spread[0], TINY) and spread[2] < 0.05 * spread[0]:
        front = np.array([0.0, 0.0, 1.0]) if abs(axes[2, 2]) > 0.3 else np.array([1.0, -1.2, 0.8])
        normal = axes[2] * (1.0 if axes[2] @ front >= 0 else -1.0)
        side = np.cross(normal, np.array([0.0, 0.0, 1.0]))
        length = float(np.linalg.norm(side))
        # Flat motions are seen from the front, a little from above and from the side.
        across = side / length if length > 0.1 else np.array([0.0, 1.0, 0.0])
        # a little from above and from the side
        way = normal + 0.3 * np.array([0.0, 0.0, 1.0]) - 0.35 * across
    else:
        way = np.array([1.0, -1.2, 0.7])
    return way / np.linalg.norm(way)


def frame_all(
    points: Array, reach: "float | Array", way: Array | None = None, field: float = math.radians(40.0)
) -> View:
    """A camera that sees all points (n, 3) with the balls of `reach` m (a number, or (n,)) about them.

    It stands on the side `way`, (3,) of length 1; by default where the points are seen best.
    """
    way = best_side(points) if way is None else way
    ball = np.broadcast_to(np.asarray(reach, dtype=float), (len(points),))
    target = 0.5 * ((points - ball[:, None]).min(axis=0) + (points + ball[:, None]).max(axis=0))
    nearer = (points - target) @ way
    aside = np.linalg.norm(points - target - nearer[:, None] * way, axis=1)
    # a ball touches the cone of sight where its centre is its radius / cos within it
    distance = float((nearer + (aside + ball / math.cos(field / 2)) / math.tan(field / 2)).max())
    place = target + way * max(distance, 1e-3)
    return View(
        (float(place[0]), float(place[1]), float(place[2])),
        (float(target[0]), float(target[1]), float(target[2])),
        field,
    )
