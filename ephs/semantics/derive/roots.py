"""Roots of increasing functions between two numbers, in the numbers of any evaluator."""

from collections.abc import Callable
from typing import Final

from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real, Truth

MOST: Final = 80
"""Steps at most: halvings alone end sooner."""
ENDED: Final = 2.0**-52
"""Size of the last step, by that of the ends."""


def root(on: Evaluator, function: Callable[[Real], tuple[Real, Real]], low: Real, high: Real) -> Real:
    """Return where an increasing function is zero: Newton's steps where they halve, else halvings of what is left.

    Parameters
    ----------
    function
        A number -> value and derivative.
    low, high
        Ends between which the root is.
    """
    below, above, at = on.variable(low), on.variable(high), on.variable(0.5 * (low + high))
    last, count = on.variable(high - low), on.variable(0.0)
    small = ENDED * (on.absolute(low) + on.absolute(high))

    def body() -> Truth:
        here = at.value
        value, slope = function(here)
        positive = value > 0.0
        left, right = on.select(positive, below.value, here), on.select(positive, here, above.value)
        below.value, above.value = left, right
        newton = -(value / slope)
        ended = on.absolute(newton) <= small
        inside = on.both(here + newton > left, here + newton < right)
        quick = on.both(inside, on.absolute(newton) <= 0.5 * last.value)
        step = on.select(on.either(ended, quick), newton, 0.5 * (left + right) - here)
        last.value, at.value = on.absolute(step), here + step
        count.value = count.value + 1.0
        return on.either(on.absolute(step) <= small, count.value >= float(MOST))

    on.repeat(body)
    return at.value
