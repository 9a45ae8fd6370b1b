"""Memory of a march: state, next step, accumulated sums, records."""

from dataclasses import dataclass
from typing import Annotated, final

from ephs.semantics.stage import Matrix, Vector


@final
@dataclass(frozen=True, slots=True)
class Errors:
    """Tolerances of the components of the error, and their allowances in a step: (counted,) each."""

    atol: Vector
    rtol: Vector
    allowed: Vector


@final
@dataclass(frozen=True, slots=True)
class Totals:
    """Memory of a step's sums, see `Memory`.

    Attributes
    ----------
    start, end
        y at the start of the step and at its end, of which the sums are written.
    before, after
        (summed,): what rounding left of the sums there.
    """

    start: Vector
    end: Vector
    before: Vector
    after: Vector
    change: Vector
    size: Vector
    whole: Vector
    low: Vector


@final
@dataclass(frozen=True, slots=True)
class Memory:
    """The state of a march, and memory for its next step.

    Attributes
    ----------
    q, y, k
        Elements, (v = 0, rates, rest), and rates at the stages (stages + 1, size).
    q1, y1, q2, y2, k2
        The same at a step's end, and of a part of a step.
    last
        y at the last stage.
    open
        (degrees of freedom,): rates before they are put on the constraints.
    atol, rtol, allowed, fine, coarse
        (counted,): tolerances, what they allow, estimates.
    carry, carry1, carry2
        (summed,): what rounding left of the sums.
    change, size
        (summed,): what a step adds to the sums, and the sizes of what that adds up.
    whole, low
        (2 · summed,): such changes before and after `Motion.book`, of the whole step and of its part that was kept
        last.
    times
        (instants,): to keep.
    rows_t, rows_q, rows_y
        Rows that were kept: (rows, 4) time, least entropy made, energies put in and their sizes, (rows, ·) elements,
        (rows, ·) y without v.
    """

    q: Vector
    y: Vector
    k: Matrix
    q1: Vector
    y1: Vector
    q2: Vector
    y2: Vector
    k2: Matrix
    last: Vector
    atol: Vector
    rtol: Vector
    allowed: Vector
    open: Vector
    fine: Vector
    coarse: Vector
    carry: Vector
    carry1: Vector
    carry2: Vector
    change: Vector
    size: Vector
    whole: Vector
    low: Vector
    times: Vector
    rows_t: Annotated[Matrix, 4]
    rows_q: Matrix
    rows_y: Matrix

    @property
    def errors(self) -> Errors:
        return Errors(self.atol, self.rtol, self.allowed)
