"""Motion as plain arrays: poses of bodies at the frames of a film, extents, a place for the camera."""

import math
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.motion.batch import compose, exponentials, inverse
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd, symmetric_eigen
from ephs.semantics.spaces.rank import DIRECTION, TINY
from ephs.semantics.spaces.rotations import matrix_to_quaternion, rotation_log

OPPOSITE = 1e-9
"""Distance of a cosine from −1 within which a rotation's axis is arbitrary."""
MISSED = 0.25
"""Part of the velocities by which their mean may miss the way between two instants, for these to bend it."""
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
    return Film(times, float(playing / max(1, count - 1)), poses_at(sol, names, times))


def between_instants(t: Array, times: Array, values: Array) -> Array:
    """Values (n,) at the times t, which rise or fall, at other times: by straight lines."""
    return np.interp(times, t, values) if t[-1] >= t[0] else np.interp(times, t[::-1], values[::-1])


def nearest(t: Array, times: Array) -> NDArray[np.int64]:
    """Index of the instant in t, which rises or falls, that is nearest to each of some times."""
    order = np.argsort(t)
    after = np.clip(np.searchsorted(t[order], times), 0, len(t) - 1)
    before = np.maximum(after - 1, 0)
    return order[np.where(times - t[order[before]] <= t[order[after]] - times, before, after)]


def poses_at(sol: Any, names: list[str], times: Array) -> dict[str, Array]:
    """Poses (n, 7) of bodies at times: between instants cubic in time, by the poses and velocities there.

    Straight lines join instants whose velocities contradict the displacement between them, at impacts and in modes.
    """
    t, moving = np.asarray(sol.t, dtype=float), sol.stats.get("method") != "mode"
    return {name: _sampled(t, sol.body(name), times, float(moving)) for name in names}


def _sampled(t: Array, body: Any, times: Array, moving: float) -> Array:
    poses = np.hstack([body.quaternion, body.position])
    if len(t) < 2:
        return np.repeat(poses, len(times), axis=0)
    forward = 1.0 if t[-1] > t[0] else -1.0
    k = np.clip(np.searchsorted(forward * t, forward * times, side="right") - 1, 0, len(t) - 2)
    h = (t[k + 1] - t[k])[:, None]
    share, before, after = (times - t[k])[:, None] / h, poses[k], poses[k + 1]
    turn = rotation_log(compose(inverse(before), after)[:, :4])
    (v, v_end), (w, w_end) = ([moving * h * x[i] for i in (k, k + 1)] for x in (body.velocity, body.angular_velocity))
    mean, size = 0.5 * (w + w_end), np.linalg.norm(turn, axis=1, keepdims=True)
    axis = np.where(size > DIRECTION, turn, mean)
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), TINY)
    whole = np.round(np.sum((mean - turn) * axis, axis=1, keepdims=True) / (2.0 * math.pi))
    half = 0.5 * np.maximum(size, DIRECTION)  # of the angle; the twist's last end as a rate of the rotation vector
    bent = np.cross(turn, np.cross(turn, w_end)) * (1.0 - half / np.tan(half)) / (2.0 * half) ** 2
    ends = np.where(whole == 0.0, w_end + 0.5 * np.cross(turn, w_end) + bent, w_end)
    turned = exponentials(_cubic(turn + 2.0 * math.pi * whole * axis, w, ends, share))
    out = compose(before, np.hstack([turned, np.zeros_like(mean)]))
    out[:, 4:] = before[:, 4:] + _cubic(after[:, 4:] - before[:, 4:], v, v_end, share)
    return out


def _cubic(way: Array, first: Array, last: Array, share: Array) -> Array:
    """(n, d) parts of ways: cubic ones with slopes at both ends, straight ones where their mean is another way."""
    miss, size = (
        np.linalg.norm(x, axis=1, keepdims=True) for x in (way - 0.5 * (first + last), np.hstack([first, last]))
    )
    bow = share * (1.0 - share) * ((1.0 - share) * (first - way) - share * (last - way))
    return share * way + np.where(miss <= MISSED * size, bow, 0.0)


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
