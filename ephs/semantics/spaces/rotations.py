"""Rotations in space: hat and vee, quaternions, exponential map and its coefficients, as matrices.

Quaternions are stored [w, x, y, z], rotate body coordinates to world coordinates, and have unit length.
"""

from collections.abc import Callable
from math import atan2, cos, factorial, sin, sqrt, tan

import numpy as np

from ephs.semantics.spaces import so3, vectors
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.series import DENOMINATORS, NUMERATORS

# Below this angle the closed forms lose digits by cancellation and power series take over.
SMALL_ANGLE = 0.5
_TERMS = 12


def hat(v: Array) -> Array:
    """The skew matrix with hat(v) w = v × w."""
    return np.array(vectors.hat(list(v)))


def vee(m: Array) -> Array:
    """The vector of a skew matrix, read from the entries (3, 2), (1, 3), (2, 1)."""
    return np.array([m[2, 1], m[0, 2], m[1, 0]])


def terms(coefficient: Callable[[int], float]) -> tuple[float, ...]:
    """As many coefficients of a power series as double precision needs for |x| ≤ ¼."""
    return tuple(coefficient(k) for k in range(_TERMS))


def series(coefficients: tuple[float, ...], x: float) -> float:
    """The power series Σ coefficients[k] xᵏ."""
    found = 0.0
    for coefficient in reversed(coefficients):
        found = found * x + coefficient
    return found


_GAMMA = terms(lambda k: (-1) ** k / factorial(2 * k + 3))


def alpha(angle: float) -> float:
    """sin θ / θ."""
    return sin(angle) / angle if angle else 1.0


def beta(angle: float) -> float:
    """(1 − cos θ) / θ²."""
    return 0.5 * alpha(0.5 * angle) ** 2


def gamma(angle: float) -> float:
    """(θ − sin θ) / θ³."""
    if abs(angle) < SMALL_ANGLE:
        return series(_GAMMA, angle**2)
    return (angle - sin(angle)) / angle**3


def bernoulli_ratio(k: int) -> float:
    """B₂ₖ / (2k)! with the Bernoulli numbers, for k = 1 … 13."""
    return (-1) ** (k + 1) * NUMERATORS[k - 1] / (DENOMINATORS[k - 1] * factorial(2 * k))


_COTANGENT = terms(lambda k: (-1) ** k * bernoulli_ratio(k + 1))


def cotangent(angle: float) -> float:
    """(1 − (θ/2) cot(θ/2)) / θ²."""
    if abs(angle) < SMALL_ANGLE:
        return series(_COTANGENT, angle**2)
    return (1.0 - 0.5 * angle / tan(0.5 * angle)) / angle**2


def rotation_exp(w: Array) -> Array:
    """Unit quaternion with w ≥ 0 of a rotation vector: cos ½θ, ½ α(½θ) w."""
    x, y, z = w.tolist()
    half = 0.5 * sqrt(x * x + y * y + z * z)
    real = cos(half)
    scale = 0.5 * alpha(half) * (1.0 if real >= 0.0 else -1.0)
    return np.array([abs(real), scale * x, scale * y, scale * z])


def turn_of(q: Array) -> float:
    """Angle of a unit quaternion's rotation, in [0, π]."""
    w, x, y, z = q.tolist()
    return 2.0 * atan2(sqrt(x * x + y * y + z * z), abs(w))


def sheared(w: Array, v: Array, first: float, second: float) -> list[float]:
    """(1 + a ŵ + b ŵ²) v with a and b the ``first`` and ``second`` coefficient."""
    x, y, z = w.tolist()
    e, f, g = v.tolist()
    i, j, k = y * g - z * f, z * e - x * g, x * f - y * e
    return [
        e + first * i + second * (y * k - z * j),
        f + first * j + second * (z * i - x * k),
        g + first * k + second * (x * j - y * i),
    ]


def rotation_dexp(w: Array) -> Array:
    """Right-trivialised differential of `rotation_exp`, 1 + β ŵ + γ ŵ²: the V of exp on SE(3)."""
    angle, skew = float(np.linalg.norm(w)), hat(w)
    return np.eye(3) + beta(angle) * skew + gamma(angle) * skew @ skew


def rotation_dexp_inv(w: Array) -> Array:
    """Inverse of `rotation_dexp`, 1 − ½ ŵ + c ŵ² with c the `cotangent` coefficient."""
    angle, skew = float(np.linalg.norm(w)), hat(w)
    return np.eye(3) - 0.5 * skew + cotangent(angle) * skew @ skew


def quaternion_to_matrix(q: Array) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion, or (3, 3, n) of many (4, n): 1 + 2 w v̂ + 2 v̂²."""
    w, x, y, z = q.tolist() if q.ndim == 1 else q
    return np.array(so3.matrix([w, x, y, z]))


def matrix_to_quaternion(m: Array) -> Array:
    """Unit quaternion of a rotation matrix with w ≥ 0, from the largest pivot (Shepperd)."""
    pivots = np.array([np.trace(m), m[0, 0], m[1, 1], m[2, 2]])
    i = int(np.argmax(pivots))
    q = np.empty(4)
    if i == 0:
        q[0] = 1.0 + pivots[0]
        q[1:] = vee(m - m.T)
    else:
        a, b, c = i - 1, i % 3, (i + 1) % 3
        q[0] = m[c, b] - m[b, c]
        q[1 + a] = 1.0 + m[a, a] - m[b, b] - m[c, c]
        q[1 + b] = m[b, a] + m[a, b]
        q[1 + c] = m[c, a] + m[a, c]
    return normalised(q if q[0] >= 0.0 else -q)


def normalised(q: Array) -> Array:
    """The quaternion, or each of many (4, n), divided by its length."""
    return q / np.sqrt(q @ q if q.ndim == 1 else (q * q).sum(axis=0))


def rotation_log(q: Array) -> Array:
    """Principal rotation vectors (..., 3) of unit quaternions (..., 4), of length ≤ π; well conditioned everywhere.

    At exactly π the sign of the axis is arbitrary.
    """
    q = np.where(q[..., :1] >= 0.0, q, -q)
    w, v = q[..., :1], q[..., 1:]
    length = np.sqrt((v * v).sum(axis=-1, keepdims=True))
    near = length < 1e-4
    upper = np.where(near, w, 1.0)  # only a half turn has w = 0, and that is not near
    x = (length / upper) ** 2
    series = 2.0 / upper * (1.0 - x / 3.0 + x * x / 5.0)
    return v * np.where(near, series, 2.0 * np.arctan2(length, w) / np.where(near, 1.0, length))


def random_quaternion(rng: np.random.Generator) -> Array:
    """A uniformly distributed rotation."""
    return normalised(rng.standard_normal(4))
