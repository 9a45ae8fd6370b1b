"""Data of a march: equations of motion, a tableau, its control, its memory."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, final

from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Vector,
    integer,
    real,
)
from ephs.solve.march.account import RunAccount
from ephs.solve.march.memory import Totals


class Ending(IntEnum):
    """Outcome of a march.

    Beyond REFUSED: by the status of an evaluation, REFUSED + status.
    """

    DONE = 0
    """At the end."""
    PAUSED = 1
    """After as many steps as asked."""
    CAREFUL = 2
    """Constraints nearly repeat each other: the next step needs a careful elimination."""
    SHORT = 3
    """The step gets too short."""
    FULL = 4
    """No more rows fit."""
    STIFF = 5
    """Stability, or failed evaluations, hold the steps back."""
    STALE = 6
    """Implicit steps need the matrix of the state."""
    REFUSED = 7


class Status(IntEnum):
    """Outcome of an evaluation of a motion; other numbers are those of its components."""

    SOUND = 0
    STILL = 20
    """A degree of freedom moves no mass."""
    DEPENDENT = 21
    """Constraints nearly repeat each other."""
    OPEN = 22
    """Loops do not close."""
    LAWLESS = 23
    """A component lost entropy in the step."""
    UNSETTLED = 24
    """Implicit stages do not converge."""


class Motion(ABC):
    """Equations of motion: elements q on a manifold, and y = (v, r, rest) with increments v of q from a base.

    From `summed` on, the rest is summed over the run without loss: heats and totals, of which `book` makes what a step
    leaves. Subclasses are frozen dataclasses whose fields are memory and known values, so that staged functions take
    them. An error counts the tree's increments, the first `freedoms` of v, its rates r, and what follows r in y.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def increments(self) -> Integer:
        """Size of v."""

    @property
    @abstractmethod
    def freedoms(self) -> Integer:
        """Size of r."""

    @property
    @abstractmethod
    def summed(self) -> Integer:
        """Start of the sums over the run in y; its size where there are none."""

    @property
    @abstractmethod
    def counted(self) -> Integer:
        """Number of coordinates that an error counts."""

    @property
    @abstractmethod
    def closes(self) -> bool:
        """Whether steps are closed: projected onto constraints."""

    @abstractmethod
    def rates(self, on: Evaluator, base: Vector, y: Vector, q: Vector, out: Vector) -> tuple[Integer, Integer]:
        """Write ẏ at q = base·exp(v) into ``out``, and leave q; return a status and the component that it is of."""

    @abstractmethod
    def settle(self, on: Evaluator, base: Vector, y: Vector, q: Vector) -> Integer:
        """Take the end y of a step to a state: base·exp(v) to q, closed, rates in y; return a status."""

    @abstractmethod
    def rounding(self, on: Evaluator, anchor: Real, y: Vector) -> Real:
        """Return the rounding in J of the energy at y, where the anchor is that of an account."""

    @abstractmethod
    def book(self, on: Evaluator, tableau: "TableauRecord", k: Matrix, h: Real, totals: Totals) -> Integer:
        """Make of a step's sums of rates, with sums of sizes, what changes from its start on; return a status.

        Sums of rates are h Σ b k of what is summed, of the rates k at its stages.
        """

    @abstractmethod
    def absorb(self, on: Evaluator, anchor: Real, y0: Vector, q: Vector, y1: Vector, change: Vector) -> None:
        """Book as heat the energy missing from a step's sums with a damping method.

        The step leads from y0 to (q, y1); the anchor is that of an account.
        """

    @abstractmethod
    def warm(self, on: Evaluator, y0: Vector, y: Vector) -> None:
        """Lift what an iterate y of a step from y0 may not be below."""

    @abstractmethod
    def hold(self, on: Evaluator, change: Vector, low: Vector, high: Vector, *, made: bool) -> None:
        """Put a part's sums between those of a shorter part of the step and those of the whole; with ``made`` what
        `book` made of them."""

    @abstractmethod
    def open(self, on: Evaluator, account: RunAccount, q: Vector, y: Vector) -> Integer:
        """Make the account's anchor that of a state; return a status."""

    @abstractmethod
    def correct(
        self, on: Evaluator, account: RunAccount, h: Real, start: Vector, y: Vector, q: Vector, allowed: Vector
    ) -> Integer:
        """Move the end (q, y) of a step of h seconds to its remaining energy; return a status."""

    @abstractmethod
    def sizes(self, on: Evaluator, y0: Vector, y1: Vector, out: Vector) -> None:
        """Write the sizes of counted numbers over a step to ``out``: relative tolerances are parts of them."""

    @abstractmethod
    def project(self, on: Evaluator, q: Vector, change: Vector) -> None:
        """Take the part across the constraints, at q, out of a change (degrees of freedom,) of the rates."""

    @abstractmethod
    def least(self, on: Evaluator, change: Vector) -> Real:
        """Return the least entropy production of a component in a step, after `book`."""


@final
@dataclass(frozen=True, slots=True)
class TableauRecord:
    """Coefficients of a Runge-Kutta method whose first stage is the step's start.

    Attributes
    ----------
    a
        (stages + 1, stages): its last row leads to the step's end.
    error, coarse
        (stages + 1,): weights of the estimates; `coarse` is taken where eighth[0] is not 0.
    eighth
        (1,): 1 for estimates of orders 5 and 3 that are combined, else 0.
    """

    a: Matrix
    error: Vector
    coarse: Vector
    eighth: Annotated[Integers, 1]


class MarchControl(Record):
    """Present state of a march, and the choice of its steps. Times are counted from the start and grow.

    Attributes
    ----------
    time, end
        Time reached; where it ends, negative for a run backward.
    origin, span
        Time at the start; length of the run.
    step, tried, grid
        Next step; the one that was tried last; step of a fixed grid, 0 for none.
    least_step, most_step
        Bounds of steps.
    exponent, share, damping, strict
        As of `ephs.solve.march.control.Steered`; `DAMPING` and `STRICT` there.
    before
        Error of the step before.
    stiff, limit
        h·|λ| of the last step; the limit from which stability holds steps back, 0 to leave it.
    shortest, longest, least
        Of steps taken: lengths, and least entropy made.
    failed
        1 after a step that was rejected.
    fresh
        1 where the first rates are known.
    rough
        1 where constraints nearly repeated each other at the start: drift says nothing there.
    saved
        Number of the next instant to keep, −1 to keep every step.
    rows
        Rows kept since they were handed over.
    held, free
        Steps that stability held back, and steps since that it did not.
    refusals
        Steps without solution, one after the other.
    component
        Number of the component that refused an evaluation.
    steps, rejected, evaluations
        Counts.
    """

    time = real()
    end = real()
    origin = real()
    span = real()
    step = real()
    tried = real()
    grid = real()
    least_step = real()
    most_step = real()
    exponent = real()
    share = real()
    damping = real()
    strict = real()
    before = real()
    stiff = real()
    limit = real()
    shortest = real()
    longest = real()
    least = real()
    failed = integer()
    fresh = integer()
    rough = integer()
    saved = integer()
    rows = integer()
    held = integer()
    free = integer()
    refusals = integer()
    component = integer()
    steps = integer()
    rejected = integer()
    evaluations = integer()
