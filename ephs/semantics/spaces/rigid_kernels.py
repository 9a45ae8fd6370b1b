"""Kernels of SE(3): poses, adjoints, exponential map and its differential.

Poses are [w, x, y, z, rx, ry, rz], twists (ω, υ). Nothing is allocated; vector outputs may alias inputs.
"""

import numpy as np

from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.rotation_kernels import (
    exp_quaternion,
    log_quaternion,
    polynomial,
    product,
    rotate,
    write_block,
)
from ephs.semantics.spaces.series_kernels import beta, beta1, cot, cot1, gamma, gamma1


@kernel
def pose_compose(a: Array, b: Array, out: Array) -> None:
    """Product of poses a·b."""
    w, x, y, z = product(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
    p, q, r = rotate(a[0], a[1], a[2], a[3], b[4], b[5], b[6])
    p, q, r = a[4] + p, a[5] + q, a[6] + r
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = w, x, y, z, p, q, r


@kernel
def pose_inverse(a: Array, out: Array) -> None:
    """Inverse of a pose."""
    w, x, y, z = a[0], -a[1], -a[2], -a[3]
    p, q, r = rotate(w, x, y, z, a[4], a[5], a[6])
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = w, x, y, z, -p, -q, -r


@kernel
def pose_between(a: Array, b: Array, out: Array) -> None:
    """The pose a⁻¹·b of b in the frame of a."""
    w, x, y, z = product(a[0], -a[1], -a[2], -a[3], b[0], b[1], b[2], b[3])
    p, q, r = rotate(a[0], -a[1], -a[2], -a[3], b[4] - a[4], b[5] - a[5], b[6] - a[6])
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = w, x, y, z, p, q, r


@kernel
def pose_exp(v: Array, out: Array) -> None:
    """Exponential map, shape (6,) to (7,)."""
    w, x, y, z = exp_quaternion(v[0], v[1], v[2])
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    p, q, r = polynomial(v[0], v[1], v[2], beta(square), gamma(square), v[3], v[4], v[5])
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = w, x, y, z, p, q, r


@kernel
def pose_log(a: Array, out: Array) -> None:
    """Principal logarithm, shape (7,) to (6,); rotation vectors of length ≤ π."""
    x, y, z = log_quaternion(a[0], a[1], a[2], a[3])
    p, q, r = polynomial(x, y, z, -0.5, cot(x * x + y * y + z * z), a[4], a[5], a[6])
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, p, q, r


@kernel
def pose_retract(a: Array, v: Array, out: Array) -> None:
    """The pose a·exp(v)."""
    s, t, m, n = exp_quaternion(v[0], v[1], v[2])
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    p, q, r = polynomial(v[0], v[1], v[2], beta(square), gamma(square), v[3], v[4], v[5])
    p, q, r = rotate(a[0], a[1], a[2], a[3], p, q, r)
    p, q, r = a[4] + p, a[5] + q, a[6] + r
    w, x, y, z = product(a[0], a[1], a[2], a[3], s, t, m, n)
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = w, x, y, z, p, q, r


@kernel
def pose_increment(a: Array, b: Array, out: Array) -> None:
    """log(a⁻¹·b), shape (6,)."""
    w, x, y, z = product(a[0], -a[1], -a[2], -a[3], b[0], b[1], b[2], b[3])
    p, q, r = rotate(a[0], -a[1], -a[2], -a[3], b[4] - a[4], b[5] - a[5], b[6] - a[6])
    x, y, z = log_quaternion(w, x, y, z)
    p, q, r = polynomial(x, y, z, -0.5, cot(x * x + y * y + z * z), p, q, r)
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, p, q, r


@kernel
def _write_adjoint(w: float, x: float, y: float, z: float, p: float, q: float, r: float, out: Array) -> None:
    for j in range(3):
        a, b, c = rotate(w, x, y, z, 1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        out[0, j], out[1, j], out[2, j] = a, b, c
        out[3, 3 + j], out[4, 3 + j], out[5, 3 + j] = a, b, c
        out[3, j], out[4, j], out[5, j] = q * c - r * b, r * a - p * c, p * b - q * a
        out[0, 3 + j] = out[1, 3 + j] = out[2, 3 + j] = 0.0


@kernel
def adjoint(a: Array, out: Array) -> None:
    """Ad of a pose, [[R, 0], [r̂ R, R]], shape (6, 6)."""
    _write_adjoint(a[0], a[1], a[2], a[3], a[4], a[5], a[6], out)


@kernel
def adjoint_inverse(a: Array, out: Array) -> None:
    """Ad of a pose's inverse, shape (6, 6)."""
    p, q, r = rotate(a[0], -a[1], -a[2], -a[3], a[4], a[5], a[6])
    _write_adjoint(a[0], -a[1], -a[2], -a[3], -p, -q, -r, out)


@kernel
def adjoint_apply(a: Array, u: Array, out: Array) -> None:
    """Ad_a u = (R ω, R υ + r × R ω) of a twist."""
    x, y, z = rotate(a[0], a[1], a[2], a[3], u[0], u[1], u[2])
    p, q, r = rotate(a[0], a[1], a[2], a[3], u[3], u[4], u[5])
    p, q, r = p + a[5] * z - a[6] * y, q + a[6] * x - a[4] * z, r + a[4] * y - a[5] * x
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, p, q, r


@kernel
def coadjoint_apply(a: Array, f: Array, out: Array) -> None:
    """Ad*_a f = (Rᵀ(f_ω − r × f_υ), Rᵀ f_υ) of a wrench: the transpose of Ad_a."""
    x, y, z = (
        f[0] - a[5] * f[5] + a[6] * f[4],
        f[1] - a[6] * f[3] + a[4] * f[5],
        f[2] - a[4] * f[4] + a[5] * f[3],
    )
    x, y, z = rotate(a[0], -a[1], -a[2], -a[3], x, y, z)
    p, q, r = rotate(a[0], -a[1], -a[2], -a[3], f[3], f[4], f[5])
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, p, q, r


@kernel
def ad(u: Array, out: Array) -> None:
    """ad of a twist, [[ω̂, 0], [υ̂, ω̂]], shape (6, 6)."""
    none = (0.0, 0.0, 0.0)
    write_block(out, 0, 0, 0.0, (u[0], u[1], u[2]), 0.0, none)
    write_block(out, 0, 3, 0.0, none, 0.0, none)
    write_block(out, 3, 0, 0.0, (u[3], u[4], u[5]), 0.0, none)
    write_block(out, 3, 3, 0.0, (u[0], u[1], u[2]), 0.0, none)


@kernel
def _write_dual(v: Array, sign: float, f: float, f1: float, g: float, g1: float, out: Array) -> None:
    # 1 + f ω̂ + g ω̂² over the dual numbers at ω = sign (ω + ε υ), the ε part in the lower left block.
    a, b, c = sign * v[0], sign * v[1], sign * v[2]
    p, q, r = sign * v[3], sign * v[4], sign * v[5]
    x, d = a * a + b * b + c * c, a * p + b * q + c * r
    none = (0.0, 0.0, 0.0)
    write_block(out, 0, 3, 0.0, none, 0.0, none)
    write_block(out, 0, 0, 1.0 - g * x, (f * a, f * b, f * c), g, (a, b, c))
    write_block(out, 3, 3, 1.0 - g * x, (f * a, f * b, f * c), g, (a, b, c))
    h = d * f1
    skew = (f * p + h * a, f * q + h * b, f * r + h * c)
    write_block(out, 3, 0, -d * (2.0 * g + g1 * x), skew, d * g1, (a, b, c))
    for i in range(3):
        for j in range(3):
            out[3 + i, j] += g * (v[i] * v[3 + j] + v[3 + i] * v[j])


@kernel
def _square(v: Array) -> float:
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


@kernel
def dexp(v: Array, out: Array) -> None:
    """Right-trivialised differential of exp, shape (6, 6): (d exp v) exp(v)⁻¹ = dexp_v dv."""
    x = _square(v)
    _write_dual(v, 1.0, beta(x), beta1(x), gamma(x), gamma1(x), out)


@kernel
def dexp_inv(v: Array, out: Array) -> None:
    """Inverse of `dexp`; singular where the rotation reaches 2π."""
    x = _square(v)
    _write_dual(v, 1.0, -0.5, 0.0, cot(x), cot1(x), out)


@kernel
def pose_dexp_left(v: Array, out: Array) -> None:
    """Left-trivialised differential of exp, `dexp` of −v."""
    x = _square(v)
    _write_dual(v, -1.0, beta(x), beta1(x), gamma(x), gamma1(x), out)


@kernel
def pose_dexp_left_inv(v: Array, out: Array) -> None:
    """Inverse of `pose_dexp_left`."""
    x = _square(v)
    _write_dual(v, -1.0, -0.5, 0.0, cot(x), cot1(x), out)


@kernel
def pose_normalise(a: Array) -> None:
    """Give the quaternion of a pose unit length, in place."""
    scale = 1.0 / np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + a[3] * a[3])
    for i in range(4):
        a[i] *= scale
