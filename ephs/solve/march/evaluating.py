"""Rates at the stages of a step, the states at which they are evaluated, and what errors there may be."""

from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector, staged
from ephs.solve.march.memory import Errors
from ephs.solve.march.records import MarchControl, Motion


def place(on: Evaluator, motion: Motion, j: Integer) -> Integer:
    """Return the index in y of the j-th counted number."""
    return on.select(j < motion.freedoms, j, j + (motion.increments - motion.freedoms))


@staged
def evaluate(
    on: Evaluator, motion: Motion, control: MarchControl, base: Vector, y: Vector, q: Vector, out: Vector
) -> Integer:
    """Evaluate the rates at base·exp(v) and count it; return a status."""
    control.evaluations = control.evaluations + 1
    status, component = motion.rates(on, base, y, q, out)
    control.component = component
    return status


def combine(on: Evaluator, weights: Vector, count: Integer, h: Real, k: Matrix, start: Vector, y: Vector) -> None:
    """Write start + h Σ weights·k of the first ``count`` rates to y."""
    copy(on, start, y)

    def add(s: Integer) -> None:
        weight = h * weights[s]

        def entry(j: Integer) -> None:
            y[j] = y[j] + weight * k[s, j]

        on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(y.size, entry))

    on.loop(count, add)


def allow(on: Evaluator, motion: Motion, errors: Errors, start: Vector, end: Vector) -> None:
    """Write what errors of a step from ``start`` to ``end`` may be, atol + rtol · size, to ``allowed``."""
    motion.sizes(on, start, end, errors.allowed)

    def each_entry(j: Integer) -> None:
        errors.allowed[j] = errors.atol[j] + errors.rtol[j] * errors.allowed[j]

    on.loop(motion.counted, each_entry)
