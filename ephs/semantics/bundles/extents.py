"""Domains of quantities: membership, random states, and step limits."""

import math

import numpy as np

from ephs.operad import Quantity
from ephs.semantics.bundles.bundle import Array


def inside(quantity: Quantity, x: Array) -> bool:
    """Whether all numbers of a state lie in the quantity's domain."""
    low, high = quantity.domain
    return all(low < number < high for number in x.ravel().tolist())


def into(quantity: Quantity, x: Array) -> Array:
    """Random numbers of size one, moved into the domain: positive ones spread about 1, others about the middle."""
    return between(*quantity.domain, x)


def between(low: float, high: float, x: Array) -> Array:
    """Random numbers of size one, moved between two ends."""
    if math.isinf(low) and math.isinf(high):
        return x
    if math.isinf(high):
        return low + np.exp(0.3 * x)
    if math.isinf(low):
        return high - np.exp(0.3 * x)
    return low + (high - low) * (0.5 + 0.5 * np.tanh(0.3 * x))


def room(quantity: Quantity, x: Array) -> float:
    """Length scale for steps from the state: distance to the ends of the domain, 1 if unbounded."""
    ends = np.concatenate([np.abs(x - end) for end in quantity.domain if math.isfinite(end)] or [np.ones(1)])
    return float(ends.min())


def expected(quantity: Quantity) -> str:
    """The domain in words, for messages."""
    low, high = quantity.domain
    if math.isinf(high):
        return f"a number > {low:g}"
    return f"a number < {high:g}" if math.isinf(low) else f"a number between {low:g} and {high:g}"
