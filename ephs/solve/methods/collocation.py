"""Polynomials through the stages of a collocation method."""

import numpy as np

from ephs.semantics.bundle import Array


def moments(nodes: Array, theta: float) -> Array:
    """(stages,) weights of the stages' values for the integral from 0 to theta of the polynomial through them."""
    powers = np.array([theta ** (k + 1) / (k + 1) for k in range(nodes.size)])
    return np.asarray(np.linalg.solve(np.vander(nodes, increasing=True).T, powers), dtype=float)


def values(nodes: Array, theta: float) -> Array:
    """(stages,) weights of the stages' values for that at theta of the polynomial through them."""
    powers = theta ** np.arange(nodes.size)
    return np.asarray(np.linalg.solve(np.vander(nodes, increasing=True).T, powers), dtype=float)
