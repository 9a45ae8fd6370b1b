"""Poses by the thousand: quaternion and position of all instants in one array, for reading motions."""

import numpy as np

from ephs.semantics.bundle import Array

__all__ = ["adjoint_inverse", "compose", "inverse", "rotations", "turned"]


def rotations(q: Array) -> Array:
    """(n, 3, 3) of unit quaternions (n, 4)."""
    w, x, y, z = q.T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def compose(a: Array, b: Array) -> Array:
    """(n, 7) products of poses."""
    aw, av, bw, bv = a[:, :1], a[:, 1:4], b[:, :1], b[:, 1:4]
    w = aw * bw - np.sum(av * bv, axis=1, keepdims=True)
    v = aw * bv + bw * av + _cross(av, bv)
    return np.concatenate([w, v, a[:, 4:] + turned(a, b[:, 4:])], axis=1)


def inverse(a: Array) -> Array:
    """(n, 7) inverse poses."""
    turned_back = a * np.array([1.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0])
    turned_back[:, 4:] = -turned(turned_back, a[:, 4:])
    return turned_back


def turned(a: Array, v: Array) -> Array:
    """(n, 3) vectors turned by poses."""
    twice = 2.0 * _cross(a[:, 1:4], v)
    return v + a[:, :1] * twice + _cross(a[:, 1:4], twice)


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
    """(n, 3) row by row; NumPy's own costs several times as much."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
