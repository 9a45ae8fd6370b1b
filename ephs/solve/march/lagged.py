"""Semi-implicit stages: losses act on the rates at a stage's end, with resistances of an explicit stage beside it.

ẏ = H(y, y) is taken as H(Y, Z) with two stage values: Y is explicit and says what acts, Z is implicit and is what the
resistances act on. H is linear in Z, so that a stage needs one linear system, and no derivatives. Boscarino, Filbet and
Russo, J. Sci. Comput. 68 (2016) 975-1001.
"""

from abc import ABC, abstractmethod
from typing import Final

from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth, Vector, staged
from ephs.solve.march.evaluating import MarchStep, combine
from ephs.solve.march.records import Motion


class Lagged(ABC):
    """What semi-implicit stages of a motion need besides it. Subclasses are frozen dataclasses.

    Attributes
    ----------
    scheme
        (stages, stages): coefficients of Z, lower triangular.
    again
        (stages,): 1 where Y is that of the stage before, and of the first stage, whose Y is the step's start.
    seen
        Memory of what `observe` writes.
    reached
        (degrees of freedom,): the known part of Z.
    """

    __slots__ = ()
    scheme: Matrix
    again: Integers
    seen: Vector
    reached: Vector

    @abstractmethod
    def observe(self, on: Evaluator, motion: Motion, base: Vector, y: Vector, q: Vector) -> tuple[Integer, Integer]:
        """Evaluate Y without losses, whose resistances are kept; return a status and the component that it is of."""

    @abstractmethod
    def resist(self, on: Evaluator, motion: Motion, y: Vector, weight: Real, fresh: Truth, out: Vector) -> Integer:
        """Complete ẏ, where rates are those reached and ``weight`` times their own; return a status.

        ``fresh``: whether the resistances are those of the stage before.
        """

    @abstractmethod
    def advance(self, on: Evaluator, motion: Motion, base: Vector, y: Vector, q: Vector) -> None:
        """Write base·exp(v), of v in y, to q."""


AHEAD: Final = 3
"""The stage that says what acts at a step's end, by rates without losses. Row 0 of k keeps these, the last row those at
the end itself."""


@staged
def begin(on: Evaluator, step: MarchStep, lagged: Lagged) -> Integer:
    """Evaluate the start of a step without losses, for its first stage; return a status."""
    step.control.evaluations = step.control.evaluations + 1
    status, step.control.component = lagged.observe(on, step.motion, step.base, step.start, step.q)
    return status


@staged
def stage(on: Evaluator, step: MarchStep, lagged: Lagged, i: Integer) -> Integer:
    """Evaluate a stage into its row of k; return a status."""
    motion, control, h, k, y = step.motion, step.control, step.h, step.k, step.y
    nv, n, status, known = motion.increments, motion.freedoms, on.counter(0), on.same(lagged.again[i], 1)

    def observe() -> None:
        control.evaluations = control.evaluations + 1
        status.value, control.component = lagged.observe(on, motion, step.base, y, step.q)
        on.when(on.same(i, AHEAD), lambda: copy(on, lagged.seen, k.row(0)))

    def resist() -> None:
        copy(on, lagged.seen, k.row(i))
        copy(on, step.start.part(nv, n), lagged.reached)

        def add(j: Integer) -> None:
            weight = h * lagged.scheme[i, j]

            def entry(m: Integer) -> None:
                lagged.reached[m] = lagged.reached[m] + weight * k[j, nv + m]

            on.loop(n, entry)

        on.loop(i, add, start=1)
        status.value = lagged.resist(on, motion, y, h * lagged.scheme[i, i], on.both(known, i > 1), k.row(i))

    combine(on, step, i)
    on.when(known, lambda: None, observe)
    on.when(on.same(status.value, 0), resist)
    return status.value


@staged
def lag(on: Evaluator, step: MarchStep, lagged: Lagged) -> Integer:
    """Evaluate the stages after the first, where `begin` has been, and finish the step; return a status."""
    at, status = on.counter(1), on.counter(0)

    def once() -> Truth:
        status.value = stage(on, step, lagged, at.value)
        at.value = at.value + 1
        return on.either(on.negate(on.same(status.value, 0)), at.value >= step.tableau.a.columns)

    on.repeat(once)
    on.when(on.same(status.value, 0), lambda: finish(on, step, lagged))
    return status.value


@staged
def finish(on: Evaluator, step: MarchStep, lagged: Lagged) -> None:
    """Write the step's end to y and q; until that is evaluated, the stage ahead says what acts there."""
    last = step.tableau.a.columns
    combine(on, step, last)
    lagged.advance(on, step.motion, step.base, step.y, step.q)
    copy(on, step.k.row(0), step.k.row(last))
