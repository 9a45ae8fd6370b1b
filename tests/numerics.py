"""The numbers that laws are stated in: rounding, the size of an array, seeds that are drawn."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

__all__ = ["EPS", "generators", "largest", "seeds"]

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
