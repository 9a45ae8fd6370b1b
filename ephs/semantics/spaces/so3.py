"""Rotations as formulas over numbers of any kind: unit quaternions [w, x, y, z], exp, log and their differentials.

Quaternions leave every product with unit length. Functions that take no quaternion work on rotation vectors.
"""

from ephs.semantics.spaces.series import alpha, beta, cosine, cot, gamma
from ephs.semantics.spaces.vectors import Columns, Entries, Rows, Vector3, add, cross, dot, hat, plus, scale
from ephs.semantics.stage import Evaluator, Real

SMALL = 1e-8
"""Square of an angle below which the series is taken: its next term is below rounding."""


def conjugate(q: Entries) -> list[Real]:
    """The inverse of a unit quaternion."""
    return [q[0], -q[1], -q[2], -q[3]]


def normalised(on: Evaluator, q: Entries) -> list[Real]:
    """A quaternion of unit length."""
    return scale(1.0 / on.sqrt(dot(q, q)), q)


def multiply(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """Product a·b of unit quaternions, normalised."""
    v = add(add(scale(a[0], b[1:]), scale(b[0], a[1:])), cross(a[1:], b[1:]))
    return normalised(on, [a[0] * b[0] - dot(a[1:], b[1:]), *v])


def rotate(q: Entries, v: Entries) -> Vector3:
    """R(q) v; with the conjugate quaternion, turned back."""
    twice = scale(2.0, cross(q[1:], v))
    return add(add(v, scale(q[0], twice)), cross(q[1:], twice))


def matrix(q: Entries) -> Rows:
    """R(q), by rows."""
    w, x, y, z = q
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]


def quaternion(on: Evaluator, m: Columns) -> list[Real]:
    """The unit quaternion of a rotation matrix, its largest entry positive and found without cancellation."""
    (a, xy, zx), (yx, b, yz), (xz, zy, c) = m
    x, y, z = zy - yz, zx - xz, yx - xy
    xy, yz, zx = xy + yx, yz + zy, zx + xz
    # Row k is 4 q_k q.
    lines = [
        [1.0 + (a + b + c), x, y, z],
        [x, 1.0 + (a - b - c), xy, zx],
        [y, xy, 1.0 + (b - a - c), yz],
        [z, zx, yz, 1.0 + (c - a - b)],
    ]
    best, size = lines[0], lines[0][0]
    for k in range(1, 4):
        larger = lines[k][k] > size
        best, size = on.select(larger, lines[k], best), on.select(larger, lines[k][k], size)
    return scale(0.5 / on.sqrt(size), best)


def exp(on: Evaluator, v: Entries) -> list[Real]:
    """Unit quaternion of a rotation vector."""
    quarter = 0.25 * dot(v, v)
    return [cosine(on, quarter), *scale(0.5 * alpha(on, quarter), v)]


def log(on: Evaluator, q: Entries) -> Vector3:
    """Principal rotation vector, of length ≤ π, of a unit quaternion."""
    w, square = q[0], dot(q[1:], q[1:])
    small = square < SMALL
    length = on.sqrt(on.select(small, 1.0, square))
    ratio = square / on.select(small, w * w, 1.0)
    near = (2.0 / on.select(small, w, 1.0)) * (1.0 - ratio / 3.0 + ratio * ratio / 5.0)
    far = on.copysign(2.0, w) * on.atan2(length, on.absolute(w)) / length
    return scale(on.select(small, near, far), q[1:])


def polynomial(v: Entries, first: Real, second: Real, x: Entries) -> Vector3:
    """(1 + first v̂ + second v̂²) x."""
    once = cross(v, x)
    return add(add(x, scale(first, once)), scale(second, cross(v, once)))


def block(diagonal: Real, skew: Entries, outer: Real, v: Entries) -> Rows:
    """The matrix diagonal·1 + ŝ + outer·v vᵀ."""
    square = [[outer * v[i] * v[j] + (diagonal if i == j else 0.0) for j in range(3)] for i in range(3)]
    return plus(square, hat(skew))


def dexp(on: Evaluator, v: Entries) -> Rows:
    """V = dexp, right-trivialised, 1 + β v̂ + γ v̂²; the left-trivialised one is that of −v."""
    x = dot(v, v)
    second = gamma(on, x)
    return block(1.0 - second * x, scale(beta(on, x), v), second, v)


def dexp_inv(on: Evaluator, v: Entries) -> Rows:
    """V⁻¹ = 1 − ½ v̂ + c v̂²; singular where |v| = 2π."""
    x = dot(v, v)
    second = cot(on, x)
    return block(1.0 - second * x, scale(-0.5, v), second, v)


def difference(on: Evaluator, a: Entries, b: Entries) -> Vector3:
    """log(a⁻¹ b) of unit quaternions."""
    return log(on, multiply(on, conjugate(a), b))
