"""Functions beyond the elementary ones, for numbers and symbols alike."""

import math
from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np

from ephs.semantics.derive.functions import FUNCTIONS
from ephs.semantics.derive.recording import Recorded
from ephs.semantics.stage.plain import PLAIN

SHORT = 1e-2
"""Below this a series serves, whose first term left out is below rounding: z⁸/9!."""
HALVINGS = 54
"""Of an interval, until it is one of neighbouring numbers."""


@singledispatch
def sinhc(z: Any) -> Any:
    """sinh(z)/z, smooth and positive: 1 at z = 0, infinite where it overflows."""
    x = float(z)
    if abs(x) < SHORT:
        return 1.0 + x * x / 6.0 * (1.0 + x * x / 20.0 * (1.0 + x * x / 42.0))
    return math.sinh(x) / x if abs(x) < 709.0 else math.inf


@sinhc.register
def _(z: Recorded) -> Recorded:
    return z.sinhc()


def log_mean(log_a: Any, log_b: Any) -> Any:
    """The logarithmic mean (a − b)/(ln a − ln b) of two positive numbers, from their logarithms; a where a = b.

    It lies between the geometric and the arithmetic mean: √(ab) sinh(z)/z with z = (ln a − ln b)/2. With it a net rate
    a − b is a non-negative factor times the difference of the logarithms, which is a difference of potentials.
    """
    return np.exp((log_a + log_b) / 2) * sinhc((log_a - log_b) / 2)


def choose(number: Any, one: Any, other: Any) -> Any:
    """One of two values: the first where the number is positive. Both have been evaluated."""
    if isinstance(number, Recorded):
        return number.choose(one, other)
    if np.ndim(number):
        return np.where(number > 0.0, one, other)  # pyright: ignore[reportUnknownVariableType]
    return one if number > 0.0 else other


def root(function: Callable[..., Any], low: Any, high: Any, *given: Any) -> Any:
    """The number x between two ends at which an increasing function f(x, *given) is zero.

    Its derivatives and slopes are those of an implicit function, so f needs to say by itself all that it depends on.
    """
    recorded = next((each for each in (low, high, *given) if isinstance(each, Recorded)), None)
    if recorded is not None:
        return recorded.root(function, low, high, given)
    middle = 0.5 * (low + high)
    for _ in range(HALVINGS):
        above = function(middle, *given) > 0.0
        low, high = choose(above, low, middle), choose(above, middle, high)
        middle = 0.5 * (low + high)
    return middle


def squared_turn(q: Any) -> Any:
    """θ² of a unit quaternion, or of four arrays, with the angle 0 ≤ θ ≤ π of rotation; smooth but at half a turn."""
    w, x, y, z = q
    if isinstance(w, Recorded):
        return w.squared_turn(x, y, z)
    if np.ndim(w):
        return (2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), np.abs(w))) ** 2
    angle = 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w))
    return angle * angle


def turn_ratio(square: Any) -> Any:
    """(θ/2)/sin(θ/2) of θ² ≤ π²: a rotation vector is 2 (θ/2)/sin(θ/2) times the vector of its quaternion."""
    return square.turn_ratio() if isinstance(square, Recorded) else FUNCTIONS["turn_ratio"].value(PLAIN, square)


def turn_curve(square: Any) -> Any:
    """c = (1 − (θ/2) cot(θ/2))/θ² of θ² ≤ π²: what the inverse derivatives of exponentials are made of."""
    return square.turn_curve() if isinstance(square, Recorded) else FUNCTIONS["turn_curve"].value(PLAIN, square)


def turn_curve_slope(square: Any) -> Any:
    """Derivative of `turn_curve` by θ²."""
    if isinstance(square, Recorded):
        return square.turn_curve_slope()
    return FUNCTIONS["turn_curve_slope"].value(PLAIN, square)
