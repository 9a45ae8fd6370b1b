"""The cover of SE(2) as formulas over numbers of any kind: motions (φ, x, y), the angle not wrapped."""

from ephs.semantics.spaces.series import alpha, beta, cot, gamma
from ephs.semantics.spaces.vectors import Entries, Rows, add, sub
from ephs.semantics.stage import Evaluator, Real


def _times(p: Real, q: Real, v: Entries) -> list[Real]:
    """(p + q J) v in the plane, J the quarter turn."""
    return [p * v[0] - q * v[1], q * v[0] + p * v[1]]


def compose(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """Product of planar motions."""
    return [a[0] + b[0], *add(a[1:], _times(on.cos(a[0]), on.sin(a[0]), b[1:]))]


def exp(on: Evaluator, v: Entries) -> list[Real]:
    """Exponential map."""
    square = v[0] * v[0]
    return [v[0], *_times(alpha(on, square), v[0] * beta(on, square), v[1:])]


def log(on: Evaluator, a: Entries) -> list[Real]:
    """Logarithm on the cover; singular where the angle is a non-zero multiple of 2π."""
    square = a[0] * a[0]
    return [a[0], *_times(1.0 - square * cot(on, square), -0.5 * a[0], a[1:])]


def retract(on: Evaluator, a: Entries, v: Entries) -> list[Real]:
    """The planar motion a·exp(v)."""
    return compose(on, a, exp(on, v))


def increment(on: Evaluator, a: Entries, b: Entries) -> list[Real]:
    """log(a⁻¹·b) on the cover."""
    return log(on, [b[0] - a[0], *_times(on.cos(a[0]), -on.sin(a[0]), sub(b[1:], a[1:]))])


def _matrix(column: Entries, p: Real, q: Real) -> Rows:
    return [[1.0, 0.0, 0.0], [column[0], p, -q], [column[1], q, p]]


def dexp(on: Evaluator, v: Entries) -> Rows:
    """Right-trivialised differential of the exponential map; the left-trivialised one is that of −v."""
    square = v[0] * v[0]
    b, g = beta(on, square), v[0] * gamma(on, square)
    return _matrix(_times(g, -b, v[1:]), alpha(on, square), v[0] * b)


def dexp_inv(on: Evaluator, v: Entries) -> Rows:
    """Inverse of `dexp`."""
    square = v[0] * v[0]
    c = cot(on, square)
    return _matrix(_times(v[0] * c, 0.5, v[1:]), 1.0 - square * c, -0.5 * v[0])
