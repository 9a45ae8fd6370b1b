"""Arrays of poses: quaternion and position of all instants, for reading motions."""

import numpy as np

from ephs.mechanics.scene.geometry import JointCoupling
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import codes
from ephs.semantics.spaces.rotations import quaternion_to_matrix

SERIES = 0.01
"""Angle θ in rad below which (θ − sin θ)/θ³ is its series up to θ⁴: the next term, θ⁶/362880, is below rounding."""


def rotations(q: Array) -> Array:
    """(n, 3, 3) of unit quaternions (n, 4)."""
    return quaternion_to_matrix(q.T).transpose(2, 0, 1)


def compose(a: Array, b: Array) -> Array:
    """(n, 7) products of poses; either may be of one row."""
    return product(a.T, b.T).T


def product(a: Array, b: Array) -> Array:
    """(7, ...) products of poses (7, ...), an axis of b.ndim - a.ndim more where b has one."""
    aw, ax, ay, az = a[:4]
    bw, bx, by, bz = b[:4]
    first = aw * bw - ax * bx - ay * by - az * bz
    out = np.empty((7, *first.shape))
    out[0] = first
    out[1] = aw * bx + bw * ax + ay * bz - az * by
    out[2] = aw * by + bw * ay + az * bx - ax * bz
    out[3] = aw * bz + bw * az + ax * by - ay * bx
    np.add(a[4:], _turned(a, b[4:]), out=out[4:])
    return out


def gap(a: Array, b: Array) -> tuple[Array, Array]:
    """Angle in rad, of small ones, and distance in m between poses (7, ...)."""
    sign = np.where(np.sum(a[:4] * b[:4], axis=0) < 0.0, -1.0, 1.0)
    turn, way = a[:4] - sign * b[:4], a[4:] - b[4:]
    return 2.0 * np.sqrt(np.sum(turn * turn, axis=0)), np.sqrt(np.sum(way * way, axis=0))


def included(coupling: JointCoupling, coordinates: Array) -> Array:
    """(n, 7) poses of C2 in C1 at a joint's coordinates (n, d)."""
    pair = coupling.pair
    if coupling.middle is not None:
        first, second = (_displaced(pair.basis, x[:, None]) for x in coordinates.T)
        return compose(compose(first, coupling.middle[None]), second)
    if pair.code in (codes.SO3, codes.SE3, codes.SE2):
        angular, linear = np.zeros((2, coordinates.shape[0], 3))
        spatial = pair.code != codes.SE2
        angular[:, 0 if spatial else 2 :] = coordinates[:, : 3 if spatial else 1]
        rest = coordinates[:, 3 if spatial else 1 :]
        linear[:, : rest.shape[1]] = rest
        return np.concatenate([exponentials(angular), linear], axis=1)
    return _displaced(pair.basis, coordinates)


def _displaced(basis: Array, x: Array) -> Array:
    """(n, 7) exponentials of the twists ``basis @ x`` of coordinates (n, d)."""
    if not basis[[0, 1, 3, 4]].any():  # along and about the third axis
        out = np.zeros((x.shape[0], 7))
        half = 0.5 * (x @ basis[2])
        out[:, 0], out[:, 3], out[:, 6] = np.cos(half), np.sin(half), x @ basis[5]
        return out
    angular, linear = x @ basis[:3].T, x @ basis[3:].T
    angle = np.sqrt(np.einsum("ni,ni->n", angular, angular))[:, None]
    small = angle < SERIES
    safe = np.where(small, 1.0, angle)
    square = angle * angle
    third = np.where(small, (1.0 - square * (0.05 - square / 840.0)) / 6.0, (safe - np.sin(safe)) / safe**3)
    across = _cross(angular.T, linear.T).T
    moved = linear + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * across + third * _cross(angular.T, across.T).T
    return np.concatenate([exponentials(angular), moved], axis=1)


def exponentials(angular: Array) -> Array:
    """(n, 4) quaternions of rotation vectors (n, 3)."""
    half = 0.5 * np.sqrt(np.einsum("ni,ni->n", angular, angular))
    return np.concatenate([np.cos(half)[:, None], 0.5 * np.sinc(half / np.pi)[:, None] * angular], axis=1)


def inverse(a: Array) -> Array:
    """(n, 7) inverse poses."""
    turned_back = a * np.array([1.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0])
    turned_back[:, 4:] = -turned(turned_back, a[:, 4:])
    return turned_back


def turned(a: Array, v: Array) -> Array:
    """(n, 3) vectors turned by poses."""
    return _turned(a.T, v.T).T


def _turned(a: Array, v: Array) -> Array:
    """(3, ...) vectors turned by poses (7, ...)."""
    twice = 2.0 * _cross(a[1:4], v)
    return v + a[0] * twice + _cross(a[1:4], twice)


def adjoint_inverse(a: Array) -> Array:
    """(n, 6, 6) Ad of the inverse poses."""
    back = inverse(a)
    r = rotations(back[:, :4])
    out = np.zeros((a.shape[0], 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = r
    x, y, z = back[:, 4:].T
    o = np.zeros_like(x)
    out[:, 3:, :3] = np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1) @ r
    return out


def _cross(a: Array, b: Array) -> Array:
    """(3, ...) products; NumPy's own costs several times as much."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
