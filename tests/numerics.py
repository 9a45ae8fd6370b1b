"""The numbers that laws are stated in: rounding, the size of an array, seeds that are drawn."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import strategies as st

__all__ = ["EPS", "generators", "jacobian", "largest", "seeds", "slope"]

EPS = float(np.finfo(float).eps)
"""Distance of 1 from the next number."""

seeds = st.integers(0, 2**32 - 1)
"""For generators of random numbers."""

generators = seeds.map(np.random.default_rng)
"""Such generators."""


def largest(values: Any, **options: float) -> Any:
    """The largest absolute value.

    An empty array has none, and is an error, but with ``initial``: a law about nothing is not shown.
    """
    return np.abs(values).max(**options)


def slope(function: Callable[[float], Any], h: float, times: int = 0) -> Any:
    """The derivative at 0 by a central difference over ``h``, extrapolated so many times by halves of it.

    Its error is of the order 2 (1 + times) in h, and rounding of the function over h.
    """
    table = [(function(d) - function(-d)) / (2.0 * d) for d in (h / 2.0**k for k in range(times + 1))]
    for power in (4.0**k for k in range(1, times + 1)):
        table = [(power * b - a) / (power - 1.0) for a, b in pairwise(table)]
    return table[0]


def jacobian(function: Callable[[Any], Any], size: int, h: float, times: int = 0) -> Any:
    """(…, size) derivatives at 0 in that many dimensions, each as `slope` has it."""
    return np.array([slope(lambda d, unit=unit: function(d * unit), h, times) for unit in np.eye(size)]).T
