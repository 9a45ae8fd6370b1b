"""Coefficient functions of exponential maps, as functions of x = θ².

With α = sin θ/θ, the coefficients β, γ of the differential and c of its inverse multiply ω̂ and ω̂². A twist is a
rotation vector over the dual numbers, ω + ε υ, so the coefficients of the (ω, υ) blocks are derivatives: f1 stands for
(1/θ) df/dθ = 2 df/dx. Below θ = 1 power series replace the closed forms, which cancel there. Both are evaluated, the
closed forms at x = 1 where the series are taken.
"""

from collections.abc import Sequence
from math import factorial
from typing import Final

from ephs.semantics.stage import Evaluator, Real, Truth

NUMERATORS: Final = (1, 1, 1, 1, 5, 691, 7, 3617, 43867, 174611, 854513, 236364091, 8553103)
DENOMINATORS: Final = (6, 30, 42, 30, 66, 2730, 6, 510, 798, 330, 138, 2730, 6)
"""Of the Bernoulli numbers B₂ₖ without their signs, k = 1 … 13."""

# Highest power first, as Horner's rule reads them.
_COSINE: Final = tuple((-1) ** k / factorial(2 * k) for k in range(10, -1, -1))
_ALPHA: Final = tuple((-1) ** k / factorial(2 * k + 1) for k in range(9, -1, -1))
_BETA: Final = tuple((-1) ** k / factorial(2 * k + 2) for k in range(9, -1, -1))
_GAMMA: Final = tuple((-1) ** k / factorial(2 * k + 3) for k in range(9, -1, -1))
_BETA1: Final = tuple(2 * k * (-1) ** k / factorial(2 * k + 2) for k in range(10, 0, -1))
_GAMMA1: Final = tuple(2 * k * (-1) ** k / factorial(2 * k + 3) for k in range(10, 0, -1))
_COT: Final = tuple(NUMERATORS[k] / (DENOMINATORS[k] * factorial(2 * k + 2)) for k in range(11, -1, -1))
_COT1: Final = tuple(2 * k * NUMERATORS[k] / (DENOMINATORS[k] * factorial(2 * k + 2)) for k in range(11, 0, -1))


def horner(coefficients: Sequence[float], x: Real) -> Real:
    """A polynomial, highest coefficient first."""
    value: Real = coefficients[0]
    for c in coefficients[1:]:
        value = value * x + c
    return value


def _far(on: Evaluator, x: Real) -> tuple[Truth, Real, Real]:
    """Whether the series serves, and x and θ for the closed form."""
    small = x < 1.0
    square = on.select(small, 1.0, x)
    return small, square, on.sqrt(square)


def cosine(on: Evaluator, x: Real) -> Real:
    """cos θ."""
    small, _, angle = _far(on, x)
    return on.select(small, horner(_COSINE, x), on.cos(angle))


def alpha(on: Evaluator, x: Real) -> Real:
    """sin θ / θ."""
    small, _, angle = _far(on, x)
    return on.select(small, horner(_ALPHA, x), on.sin(angle) / angle)


def beta(on: Evaluator, x: Real) -> Real:
    """(1 − cos θ) / θ², without cancellation."""
    small, square, angle = _far(on, x)
    half = on.sin(0.5 * angle)
    return on.select(small, horner(_BETA, x), 2.0 * half * half / square)


def gamma(on: Evaluator, x: Real) -> Real:
    """(θ − sin θ) / θ³."""
    small, square, angle = _far(on, x)
    return on.select(small, horner(_GAMMA, x), (angle - on.sin(angle)) / (angle * square))


def cot(on: Evaluator, x: Real) -> Real:
    """c = (1 − (θ/2) cot(θ/2)) / θ²; singular at θ = 2π."""
    small, square, angle = _far(on, x)
    half = 0.5 * angle
    return on.select(small, horner(_COT, x), (1.0 - half * on.cos(half) / on.sin(half)) / square)


def beta1(on: Evaluator, x: Real) -> Real:
    """(1/θ) dβ/dθ = (α − 2β) / θ²."""
    small, square, _ = _far(on, x)
    return on.select(small, horner(_BETA1, x), (alpha(on, square) - 2.0 * beta(on, square)) / square)


def gamma1(on: Evaluator, x: Real) -> Real:
    """(1/θ) dγ/dθ = (β − 3γ) / θ²."""
    small, square, _ = _far(on, x)
    return on.select(small, horner(_GAMMA1, x), (beta(on, square) - 3.0 * gamma(on, square)) / square)


def cot1(on: Evaluator, x: Real) -> Real:
    """(1/θ) dc/dθ."""
    small, square, angle = _far(on, x)
    half = 0.5 * angle
    sine = on.sin(half)
    closed = (half * on.cos(half) / sine + 0.25 * square / (sine * sine) - 2.0) / (square * square)
    return on.select(small, horner(_COT1, x), closed)
