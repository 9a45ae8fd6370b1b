"""Rates at the stages of a step, the states at which they are evaluated, and what errors there may be."""

from dataclasses import dataclass
from typing import final

from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector, staged
from ephs.solve.march.memory import Errors
from ephs.solve.march.records import MarchControl, Motion, TableauRecord


@final
@dataclass(frozen=True, slots=True)
class MarchStep:
    """A step of a motion from a state.

    Attributes
    ----------
    base, start
        Elements and y that it starts from.
    h
        Its length in s, negative backward.
    k
        (stages + 1, size): rates at its stages; the first is the start.
    y, q
        y and elements at its end, in memory for those at its stages.
    """

    motion: Motion
    tableau: TableauRecord
    control: MarchControl
    base: Vector
    start: Vector
    h: Real
    k: Matrix
    y: Vector
    q: Vector


def place(on: Evaluator, motion: Motion, j: Integer) -> Integer:
    """Return the index in y of the j-th counted number."""
    return on.select(j < motion.freedoms, j, j + (motion.increments - motion.freedoms))


@staged
def evaluate(on: Evaluator, step: MarchStep, y: Vector, q: Vector, out: Vector) -> Integer:
    """Evaluate the rates at base·exp(v), of v in y, and count it; return a status."""
    control = step.control
    control.evaluations = control.evaluations + 1
    status, component = step.motion.rates(on, step.base, y, q, out)
    control.component = component
    return status


def combine(on: Evaluator, step: MarchStep, stage: Integer) -> None:
    """Write y at a stage, start + h Σ a·k, by the rates of those before."""
    y = step.y
    copy(on, step.start, y)

    def add(s: Integer) -> None:
        weight = step.h * step.tableau.a[stage, s]

        def entry(j: Integer) -> None:
            y[j] = y[j] + weight * step.k[s, j]

        on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(y.size, entry))

    on.loop(stage, add)


def allow(on: Evaluator, motion: Motion, errors: Errors, start: Vector, end: Vector) -> None:
    """Write what errors of a step from ``start`` to ``end`` may be, atol + rtol · size, to ``allowed``."""
    motion.sizes(on, start, end, errors.allowed)

    def each_entry(j: Integer) -> None:
        errors.allowed[j] = errors.atol[j] + errors.rtol[j] * errors.allowed[j]

    on.loop(motion.counted, each_entry)
