"""Newton's method with a matrix that is kept: when stages are solved, when they are not, when the matrix is stale.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8. One function for the stages of compiled steps and
for those that are iterated in floats.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.semantics.stage import Evaluator, Integer, Real, Truth

ITERATIONS = 10
"""Iterations after which a step is given up."""
FAST = 0.3
"""A rate of convergence from which on a new matrix is made, where one costs as much as a dozen iterations."""
BEYOND = 1e300
"""Bound of numbers: nan is not below it."""


@final
@dataclass(frozen=True, slots=True)
class Iterated:
    """The end of an iteration: how many corrections it took, whether they solve, and whether the matrix served well."""

    tries: Integer
    solved: Truth
    fast: Truth


def iterate(on: Evaluator, correct: Callable[[Integer], Real], enough: Real, rough: Real, fast: float) -> Iterated:
    """Correct until the stages are solved, or will not be.

    Parameters
    ----------
    correct
        Called with the number of the correction, from 1: makes it, and returns its size relative to what is allowed;
        what is not below `BEYOND` ends the iteration.
    enough, rough
        Size of what may be left; that is good enough where the iteration gets no further.
    fast
        Rate of convergence from which on the matrix is stale.
    """
    tries, solved, served = on.counter(0), on.counter(0), on.counter(0)
    lost = on.counter(0)
    before = on.variable(BEYOND)

    def once() -> Truth:
        tries.value = tries.value + 1
        moved = correct(tries.value)
        later, long = tries.value > 1, tries.value > 2
        rate = on.select(later, moved / before.value, BEYOND)
        slow = on.minimum(rate, 0.9)
        close = on.either(moved <= enough, on.both(later, moved * rate <= enough * (1.0 - slow)))
        # Rounding, or a poor matrix near a change of rank, ends convergence.
        last = tries.value >= ITERATIONS
        stuck = on.both(moved <= rough, on.either(last, on.both(long, rate > 0.5)))
        away = on.both(on.both(long, rate >= 1.0), moved > on.maximum(10.0 * enough, rough))
        ends = on.either(on.negate(moved < BEYOND), on.either(away, last))
        solved.value = on.select(on.either(close, stuck), 1, 0)
        served.value = on.select(on.both(close, on.either(on.negate(long), rate < fast)), 1, 0)
        lost.value = on.select(ends, 1, 0)
        before.value = moved
        return on.either(on.same(solved.value, 1), on.same(lost.value, 1))

    on.repeat(once)
    return Iterated(tries.value, on.same(solved.value, 1), on.same(served.value, 1))
