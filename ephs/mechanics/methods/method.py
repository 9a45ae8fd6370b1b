"""Base of the methods on the reduced form: a step, and the interface to the time loop."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any

import numpy as np

from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import SolveError
from ephs.solve.result.record import RunRecord
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Instants, Leg, Row, Span, Taken, too_fast

HALVINGS = 4
"""Number of halvings of a failing part of a step whose whole succeeded."""


class ReducedMethod(ABC):
    """A method on a mechanism in joint coordinates; a custom one defines `step`.

    Parameters
    ----------
    equations
        The mechanism.
    control
        Tolerances and limits.

    Attributes
    ----------
    name
        What the registry calls it.
    exponent
        The power of the step with which its estimate of the error falls.
    share
        Exponent of a step's share of the tolerance by its length, see `Steered`.
    atol, rtol
        (counted,) of what counts in an error.
    hold
        Factor up to which steps that may grow stay as they are, since their matrices are factorised.
    stiffness
        h·|λ| of the fastest mode, as the last step showed it; 0 of methods that do not look.
    rough
        Elements of the last step's start and end, each where constraints nearly repeat each other: rates there carry
        rounding over the least singular value, so that drift says nothing.
    counts
        Its own counts, for the solution's statistics.
    """

    name: str
    exponent: float
    share: float = 0.0
    hold: float = 1.0
    stiffness: float = 0.0
    rough: tuple[Array, ...] = ()
    _low: Attempt[ReducedState] | None = None  # the last part of a step

    def __init__(self, equations: ReducedEquations, control: Control) -> None:
        self.equations, self.control = equations, control
        self.rtol, self.atol = equations.allowed(control.rtol, control.atol)
        self.counts: dict[str, Any] = {}
        self._known: tuple[Array, Array] | None = None

    def first(self, state: ReducedState, y: Array) -> Array:
        """The rates at a state with the vector y, evaluated once where steps from there are tried again."""
        if self._known is None or self._known[0] is not state.q:
            self._known = state.q, self.equations.rates(state.t, state.q, y)
        return self._known[1]

    @abstractmethod
    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds, which may be negative.

        Raises
        ------
        SolveError
            The step has no solution.
        """

    def start(self, t: float, h: float) -> ReducedState:
        """The initial state with its loops closed."""
        return self.equations.start(t)

    def prepare(self, state: ReducedState, h: float) -> None:
        """Compile programs that are not in the cache, before timing starts."""
        self.equations.prepare(state)

    def many(self, span: Span[ReducedState]) -> Leg[ReducedState] | None:
        """None: one step a call."""
        return None

    def tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        """One step of h seconds, whose detail are its sums, those of `ephs.solve.march.memory.Totals`.

        ``part``: whether it is a part of one, whose sums lie between those of a shorter part and of the whole.
        """
        return self.step(state, h)

    def inside(self, attempt: Attempt[ReducedState], t: float) -> ReducedState:
        """A shorter step from the same start, or several where that fails or errs: dense output of full order.

        With `tried`, heat and entropy production of components lie between their values at the previous instant and
        at the end of the step.
        """
        start, h, low = attempt.start, t - attempt.start.t, self._low
        if attempt.detail is None:
            return self._part(start, h, HALVINGS)
        if low is None or low.start is not start or abs(low.h) > abs(h):
            low = Attempt(start, start, 0.0, 0.0, 0.0, 0.0 * attempt.detail)
        totals = self.equations.engine.totals
        totals["whole"][:], totals["low"][:] = attempt.detail, low.detail
        try:
            found = self.tried(start, h, part=True)
        except SolveError:
            return self._part(start, h, HALVINGS)
        if found.error > 1.0 and self.control.step is None:
            return self._part(start, h, HALVINGS)
        self._low = found
        return found.end

    def _part(self, state: ReducedState, h: float, halvings: int) -> ReducedState:
        found = None
        try:
            found = self.step(state, h)
        except SolveError:
            if not halvings:
                raise
        coarse = found is not None and found.error > 1.0 and self.control.step is None
        if found is not None and not (coarse and (halvings or found.h != h)):
            return found.end
        if found is not None and not halvings:  # left unfinished
            raise too_fast(self.name, found.worst, h)
        middle = self._part(state, 0.5 * h, halvings - 1)
        return self._part(middle, 0.5 * h, halvings - 1)

    def missed(self, attempt: Attempt[ReducedState]) -> float | None:
        """None: the balance of energy shows it."""
        return None

    def anew(self, state: ReducedState) -> ReducedState:
        """The same state as a start: a new object without memory."""
        return replace(state, q=state.q.copy(), memory=())

    def row(self, state: ReducedState) -> Row:
        """Record of a state."""
        return self.equations.row(state)

    def record(self, taken: Instants[ReducedState]) -> RunRecord:
        """Records of many instants."""
        if isinstance(taken, Taken):
            q, rest, put = taken.data
            return self.equations.booking.record(taken.times, q, rest, put, taken.least)
        times, states, least = zip(*taken, strict=True)
        return self.equations.booking.record_of(states, np.array(times), np.array(least))

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return self.equations.stats() | self.counts

    def snapshot(self, state: ReducedState) -> Snapshot | None:
        """Memory from step to step besides the state, with its counts; None where it is unknown."""
        own = self.taken(state)
        if own is None:
            return None
        equations = {"evaluations": self.equations.evaluations, "accounts": self.equations.accounts.snapshot()}
        return {"own": own, "counts": self.counts, **equations}

    def restore(self, snapshot: Snapshot, state: ReducedState) -> None:
        """Go on from a snapshot."""
        self.take(snapshot["own"], state)
        self.counts.update(snapshot["counts"])
        self.equations.evaluations = snapshot["evaluations"]
        self.equations.accounts.restore(snapshot["accounts"])

    def taken(self, state: ReducedState) -> Snapshot | None:
        """None: a resumable custom method returns its memory, which may be an empty mapping."""
        return None

    def take(self, own: Snapshot, state: ReducedState) -> None:  # noqa: B027 - of a method that takes nothing along
        """Restore from a value of `taken`."""
