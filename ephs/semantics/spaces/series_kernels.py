"""Coefficient functions of exponential maps, as kernels of x = θ².

With α = sin θ/θ, the coefficients β, γ of the differential and c of its inverse multiply ω̂ and ω̂². A twist
is a rotation vector over the dual numbers, ω + ε υ, so the coefficients of the (ω, υ) blocks are derivatives:
f1 stands for (1/θ) df/dθ = 2 df/dx. Below θ = 1 power series replace the closed forms, which cancel there.
"""

from math import factorial
from typing import Final

import numpy as np

from ephs.semantics.spaces.jit import kernel

# B₂ₖ / (2k)! of the Bernoulli numbers with all signs positive, k = 1 … 12.
_NUMERATORS: Final = (1, 1, 1, 1, 5, 691, 7, 3617, 43867, 174611, 854513, 236364091)
_DENOMINATORS: Final = (6, 30, 42, 30, 66, 2730, 6, 510, 798, 330, 138, 2730)

_SMALL: Final = 1.0
# Highest power first, as Horner's rule reads them.
_ALPHA: Final = tuple((-1) ** k / factorial(2 * k + 1) for k in range(9, -1, -1))
_BETA: Final = tuple((-1) ** k / factorial(2 * k + 2) for k in range(9, -1, -1))
_GAMMA: Final = tuple((-1) ** k / factorial(2 * k + 3) for k in range(9, -1, -1))
_BETA1: Final = tuple(2 * k * (-1) ** k / factorial(2 * k + 2) for k in range(10, 0, -1))
_GAMMA1: Final = tuple(2 * k * (-1) ** k / factorial(2 * k + 3) for k in range(10, 0, -1))
_COT: Final = tuple(_NUMERATORS[k] / (_DENOMINATORS[k] * factorial(2 * k + 2)) for k in range(11, -1, -1))
_COT1: Final = tuple(2 * k * _NUMERATORS[k] / (_DENOMINATORS[k] * factorial(2 * k + 2)) for k in range(11, 0, -1))


@kernel
def horner(coefficients: tuple[float, ...], x: float) -> float:
    """A polynomial, highest coefficient first."""
    value = 0.0
    for c in coefficients:
        value = value * x + c
    return value


@kernel
def alpha(x: float) -> float:
    """sin θ / θ."""
    if x < _SMALL:
        return horner(_ALPHA, x)
    angle = np.sqrt(x)
    return np.sin(angle) / angle


@kernel
def beta(x: float) -> float:
    """(1 − cos θ) / θ², without cancellation."""
    if x < _SMALL:
        return horner(_BETA, x)
    half = np.sin(0.5 * np.sqrt(x))
    return 2.0 * half * half / x


@kernel
def gamma(x: float) -> float:
    """(θ − sin θ) / θ³."""
    if x < _SMALL:
        return horner(_GAMMA, x)
    angle = np.sqrt(x)
    return (angle - np.sin(angle)) / (angle * x)


@kernel
def cot(x: float) -> float:
    """c = (1 − (θ/2) cot(θ/2)) / θ²; singular at θ = 2π."""
    if x < _SMALL:
        return horner(_COT, x)
    half = 0.5 * np.sqrt(x)
    return (1.0 - half / np.tan(half)) / x


@kernel
def beta1(x: float) -> float:
    """(1/θ) dβ/dθ = (α − 2β) / θ²."""
    if x < _SMALL:
        return horner(_BETA1, x)
    return (alpha(x) - 2.0 * beta(x)) / x


@kernel
def gamma1(x: float) -> float:
    """(1/θ) dγ/dθ = (β − 3γ) / θ²."""
    if x < _SMALL:
        return horner(_GAMMA1, x)
    return (beta(x) - 3.0 * gamma(x)) / x


@kernel
def cot1(x: float) -> float:
    """(1/θ) dc/dθ."""
    if x < _SMALL:
        return horner(_COT1, x)
    half = 0.5 * np.sqrt(x)
    sine = np.sin(half)
    return (half / np.tan(half) + 0.25 * x / (sine * sine) - 2.0) / (x * x)
