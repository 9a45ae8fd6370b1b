"""Kernels of quaternions and SO(3). Nothing is allocated; outputs may alias inputs.

Functions of plain numbers return tuples and are meant to be called by other kernels; the others take arrays,
the last of which is written. Quaternions are [w, x, y, z] and leave every product with unit length.
"""

from typing import TypeAlias

import numpy as np

from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.series_kernels import alpha, beta, cot, gamma

Three: TypeAlias = tuple[float, float, float]
Four: TypeAlias = tuple[float, float, float, float]


@kernel
def product(aw: float, ax: float, ay: float, az: float, bw: float, bx: float, by: float, bz: float) -> Four:
    """Quaternion product a·b, normalised."""
    w = aw * bw - ax * bx - ay * by - az * bz
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    scale = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


@kernel
def rotate(w: float, x: float, y: float, z: float, a: float, b: float, c: float) -> Three:
    """The vector (a, b, c) turned by a unit quaternion; with −x, −y, −z turned back."""
    s, t, u = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s


@kernel
def exp_quaternion(a: float, b: float, c: float) -> Four:
    """Unit quaternion of a rotation vector."""
    quarter = 0.25 * (a * a + b * b + c * c)
    scale = 0.5 * alpha(quarter)
    return np.cos(np.sqrt(quarter)), scale * a, scale * b, scale * c


@kernel
def log_quaternion(w: float, x: float, y: float, z: float) -> Three:
    """Principal rotation vector of a unit quaternion, of length ≤ π."""
    length = np.sqrt(x * x + y * y + z * z)
    if length < 1e-4:
        ratio = length / w
        square = ratio * ratio
        scale = (2.0 / w) * (1.0 - square / 3.0 + square * square / 5.0)
    elif w < 0.0:
        scale = -2.0 * np.arctan2(length, -w) / length
    else:
        scale = 2.0 * np.arctan2(length, w) / length
    return scale * x, scale * y, scale * z


@kernel
def polynomial(a: float, b: float, c: float, first: float, second: float, u: float, v: float, w: float) -> Three:
    """(1 + first ω̂ + second ω̂²) (u, v, w) with ω = (a, b, c): V and its inverse applied to a vector."""
    d, e, f = b * w - c * v, c * u - a * w, a * v - b * u
    g, h, k = b * f - c * e, c * d - a * f, a * e - b * d
    return u + first * d + second * g, v + first * e + second * h, w + first * f + second * k


@kernel
def quat_multiply(a: Array, b: Array, out: Array) -> None:
    """Product of quaternions, shapes (4,)."""
    w, x, y, z = product(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
    out[0], out[1], out[2], out[3] = w, x, y, z


@kernel
def quat_rotate(q: Array, v: Array, out: Array) -> None:
    """Vector v turned from body to world, shapes (4,), (3,), (3,)."""
    a, b, c = rotate(q[0], q[1], q[2], q[3], v[0], v[1], v[2])
    out[0], out[1], out[2] = a, b, c


@kernel
def quat_rotate_back(q: Array, v: Array, out: Array) -> None:
    """Vector v turned from world to body, shapes (4,), (3,), (3,)."""
    a, b, c = rotate(q[0], -q[1], -q[2], -q[3], v[0], v[1], v[2])
    out[0], out[1], out[2] = a, b, c


@kernel
def quat_to_matrix(q: Array, out: Array) -> None:
    """Rotation matrix, shape (3, 3), of a unit quaternion; q may be longer than four."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 1] = 2.0 * (y * z + w * x)


@kernel
def so3_exp_quat(w: Array, out: Array) -> None:
    """Unit quaternion, shape (4,), of a rotation vector, shape (3,)."""
    a, b, c, d = exp_quaternion(w[0], w[1], w[2])
    out[0], out[1], out[2], out[3] = a, b, c, d


@kernel
def so3_log_quat(q: Array, out: Array) -> None:
    """Principal rotation vector, shape (3,), of a unit quaternion, shape (4,)."""
    a, b, c = log_quaternion(q[0], q[1], q[2], q[3])
    out[0], out[1], out[2] = a, b, c


@kernel
def write_block(out: Array, row: int, column: int, diagonal: float, skew: Three, outer: float, a: Three) -> None:
    """Write diagonal·1 + hat(skew) + outer·a aᵀ into the 3×3 block that starts at (row, column)."""
    for i in range(3):
        for j in range(3):
            out[row + i, column + j] = outer * a[i] * a[j]
        out[row + i, column + i] += diagonal
    out[row, column + 1] -= skew[2]
    out[row + 1, column] += skew[2]
    out[row, column + 2] += skew[1]
    out[row + 2, column] -= skew[1]
    out[row + 1, column + 2] -= skew[0]
    out[row + 2, column + 1] += skew[0]


@kernel
def so3_left_jacobian(w: Array, out: Array) -> None:
    """V = dexp of SO(3), right-trivialised, 1 + β ŵ + γ ŵ², shape (3, 3)."""
    a, b, c = w[0], w[1], w[2]
    x = a * a + b * b + c * c
    f, g = beta(x), gamma(x)
    write_block(out, 0, 0, 1.0 - g * x, (f * a, f * b, f * c), g, (a, b, c))


@kernel
def so3_left_jacobian_inv(w: Array, out: Array) -> None:
    """V⁻¹ = 1 − ½ ŵ + c ŵ², shape (3, 3); singular where |w| = 2π."""
    a, b, c = w[0], w[1], w[2]
    x = a * a + b * b + c * c
    g = cot(x)
    write_block(out, 0, 0, 1.0 - g * x, (-0.5 * a, -0.5 * b, -0.5 * c), g, (a, b, c))
