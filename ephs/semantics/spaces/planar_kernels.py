"""Kernels of the cover of SE(2), stored as (φ, x, y) with the angle not wrapped. Outputs may alias vector
inputs.
"""

import numpy as np

from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.series_kernels import alpha, beta, cot, gamma


@kernel
def se2_compose(a: Array, b: Array, out: Array) -> None:
    """Product of planar motions."""
    c, s = np.cos(a[0]), np.sin(a[0])
    angle, x, y = a[0] + b[0], a[1] + c * b[1] - s * b[2], a[2] + s * b[1] + c * b[2]
    out[0], out[1], out[2] = angle, x, y


@kernel
def se2_inverse(a: Array, out: Array) -> None:
    """Inverse of a planar motion."""
    c, s = np.cos(a[0]), np.sin(a[0])
    angle, x, y = -a[0], -c * a[1] - s * a[2], s * a[1] - c * a[2]
    out[0], out[1], out[2] = angle, x, y


@kernel
def se2_exp(v: Array, out: Array) -> None:
    """Exponential map."""
    angle, square = v[0], v[0] * v[0]
    p, q = alpha(square), angle * beta(square)
    x, y = p * v[1] - q * v[2], q * v[1] + p * v[2]
    out[0], out[1], out[2] = angle, x, y


@kernel
def se2_log(a: Array, out: Array) -> None:
    """Logarithm on the cover; singular where the angle is a non-zero multiple of 2π."""
    angle = a[0]
    p, q = 1.0 - angle * angle * cot(angle * angle), -0.5 * angle
    x, y = p * a[1] - q * a[2], q * a[1] + p * a[2]
    out[0], out[1], out[2] = angle, x, y


@kernel
def se2_retract(a: Array, v: Array, out: Array) -> None:
    """The planar motion a·exp(v)."""
    c, s, square = np.cos(a[0]), np.sin(a[0]), v[0] * v[0]
    p, q = alpha(square), v[0] * beta(square)
    x, y = p * v[1] - q * v[2], q * v[1] + p * v[2]
    angle, x, y = a[0] + v[0], a[1] + c * x - s * y, a[2] + s * x + c * y
    out[0], out[1], out[2] = angle, x, y


@kernel
def se2_increment(a: Array, b: Array, out: Array) -> None:
    """log(a⁻¹·b) on the cover."""
    c, s, angle = np.cos(a[0]), np.sin(a[0]), b[0] - a[0]
    x, y = c * (b[1] - a[1]) + s * (b[2] - a[2]), c * (b[2] - a[2]) - s * (b[1] - a[1])
    p, q = 1.0 - angle * angle * cot(angle * angle), -0.5 * angle
    x, y = p * x - q * y, q * x + p * y
    out[0], out[1], out[2] = angle, x, y


@kernel
def _write(out: Array, x: float, y: float, p: float, q: float) -> None:
    out[0, 0], out[0, 1], out[0, 2] = 1.0, 0.0, 0.0
    out[1, 0], out[1, 1], out[1, 2] = x, p, -q
    out[2, 0], out[2, 1], out[2, 2] = y, q, p


@kernel
def _write_dexp(angle: float, x: float, y: float, out: Array) -> None:
    square = angle * angle
    b, g = beta(square), angle * gamma(square)
    # −(b + g J) J (x, y) with J the quarter turn.
    _write(out, b * y + g * x, g * y - b * x, alpha(square), angle * b)


@kernel
def _write_dexp_inv(angle: float, x: float, y: float, out: Array) -> None:
    square = angle * angle
    k = cot(square)
    _write(out, -0.5 * y + angle * k * x, 0.5 * x + angle * k * y, 1.0 - square * k, -0.5 * angle)


@kernel
def se2_dexp(v: Array, out: Array) -> None:
    """Right-trivialised differential of the exponential map, shape (3, 3)."""
    _write_dexp(v[0], v[1], v[2], out)


@kernel
def se2_dexp_inv(v: Array, out: Array) -> None:
    """Inverse of `se2_dexp`."""
    _write_dexp_inv(v[0], v[1], v[2], out)


@kernel
def se2_dexp_left(v: Array, out: Array) -> None:
    """Left-trivialised differential, `se2_dexp` of −v."""
    _write_dexp(-v[0], -v[1], -v[2], out)


@kernel
def se2_dexp_left_inv(v: Array, out: Array) -> None:
    """Inverse of `se2_dexp_left`."""
    _write_dexp_inv(-v[0], -v[1], -v[2], out)
