"""The natural methods as steppers: constant or variable steps, error estimates, events and variable inputs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.auditing.retaken import PARTS, share_missed
from ephs.solve.equations.instant import rates_read
from ephs.solve.equations.model import Model, model_of
from ephs.solve.equations.starting import check_start
from ephs.solve.methods.continuous import Continuous
from ephs.solve.methods.driven import advance_driven, advance_whole
from ephs.solve.methods.guesses import BEFORE
from ephs.solve.methods.natural import Chunk, Natural, NaturalState
from ephs.solve.methods.records import IRREVERSIBLE
from ephs.solve.methods.starts import unknowns_away
from ephs.solve.posing.breakpoints import NEAR
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord, record_of
from ephs.solve.running.control import Control, Grid
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Instant, Instants, Row, Span, Taken

FIRST = 16
"""Steps in the first compiled call, by which the time of a step becomes known."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class PacedState:
    """Present state of the method: its own state, the time, and the record there."""

    t: float
    inner: NaturalState
    kept: Row


@final
class Paced:
    """A natural method on one problem.

    Where no constant step is given, a step is two of half the length, whose difference to one of the whole length
    estimates the error.

    Parameters
    ----------
    make
        Makes the method for a compiled model.
    """

    def __init__(self, problem: Problem, t0: float, control: Control, make: Callable[[Model], Natural]) -> None:
        d = problem.descriptor
        self._make, self._model = make, model_of(problem, t0)
        self.problem, self.method = problem, make(self._model)
        self.name, self._step = self.method.name, control.step
        self._within: Natural | None = None
        self._start: PacedState | None = None
        self._away: PacedState | None = None
        self._iterations = self._cut = 0
        self._rtol, self._atol = control.rtol.rates(d), control.atol.rates(d)
        self._counted = _counted(problem)

    def start(self, t: float, h: float) -> PacedState:
        """The initial state.

        Raises
        ------
        SolveError
            The states contradict the constraints.
        """
        check_start(self.problem, self.method.model, h)
        x = self.problem.point
        energies = self.method.energies(x)
        self._start = PacedState(t, self.method.init(x), Row(x, energies, np.zeros(4)))
        return self._start

    def prepare(self, state: PacedState, h: float) -> None:
        """Compile programs that are not in the cache, before timing starts."""
        self.method.prepare(state.inner, h)

    def many(self, span: Span[PacedState]) -> "_FixedSteps | None":
        """Constant steps with constant inputs."""
        return _FixedSteps(self, span, self._step) if self._step is not None and self.problem.constant else None

    def chunk(self, state: PacedState, h: float, steps: int) -> tuple[NaturalState, Chunk]:
        """Up to so many steps of h seconds from a state, in compiled calls where inputs are constant."""
        inner, chunk = self._advanced(state, h, steps)
        if state is self._start and chunk.failure is not None and not chunk.steps:
            self._away = self._away or self._elsewhere(state)
            if self._away is not state:
                inner, chunk = self._advanced(self._away, h, steps)
        self._iterations += chunk.iterations
        self._cut += chunk.cut
        return inner, chunk

    def step(self, state: PacedState, h: float) -> Attempt[PacedState]:
        """One step of h seconds."""
        if self._step is not None:
            end, least = self._single(state, h)
            return Attempt(state, end, h, 0.0, least)
        cut = self._cut
        coarse, _ = self._single(state, h)
        if self._cut > cut:  # it is its halves, and would be compared with itself
            raise SolveError(Outcome.DIVERGED, "", f"{h:.3g} s")
        middle, first = self._single(state, 0.5 * h)
        end, second = self._single(middle, 0.5 * h)
        off, worst = self._off(state, coarse, end)
        return Attempt(state, end, h, off / (2.0**self.method.order - 1.0), min(first, second), middle, worst)

    def _advanced(self, state: PacedState, h: float, steps: int) -> tuple[NaturalState, Chunk]:
        if self.problem.constant:
            return advance_whole(self.method, state.inner, h, steps)
        return advance_driven(self.problem, self.method, state.inner, state.t, h)

    def _elsewhere(self, state: PacedState) -> PacedState:
        """The same start with unknowns that solve the equations there, where these are found."""
        model, problem = self._model, self.problem
        given = model.input_values(None if problem.constant else problem.inputs(state.t, problem.initial))
        z = unknowns_away(model, Continuous(model), state.inner.x, given)
        if z is None:
            return state
        whole = np.tile(z, (len(state.inner.z), 1))
        return replace(state, inner=replace(state.inner, z=whole, previous=np.tile(whole, (BEFORE, 1))))

    def inside(self, attempt: Attempt[PacedState], t: float) -> PacedState:
        """A shorter step from the same start, or from the middle of two, so that instants lead to the end."""
        start, middle = attempt.start, attempt.detail or attempt.start
        return self.shorter(middle if abs(t - start.t) >= abs(middle.t - start.t) else start, t)

    def shorter(self, state: PacedState, t: float) -> PacedState:
        """The state at a time by one step, which leaves no trace in those of the run: its method is another."""
        if abs(t - state.t) <= NEAR * float(np.spacing(abs(t))):
            return replace(state, t=t)
        if self._within is None:
            self._within = self._make(self._model)
        start = replace(self._within.init(state.kept.x), sums=self._sums(state.kept))
        inner, chunk = advance_driven(self.problem, self._within, start, state.t, t - state.t)
        return _end(chunk, inner, t)

    def missed(self, attempt: Attempt[PacedState]) -> float:
        """Error of a step in tolerances, by steps of a third of its length."""
        end = attempt.start
        for _ in range(PARTS):
            end, _ = self._single(end, attempt.h / PARTS)
        return self._off(attempt.start, attempt.end, end)[0] / share_missed(self.method.order)

    def anew(self, state: PacedState) -> PacedState:
        """The same state as one to start from: unknowns are guessed afresh."""
        return replace(state, inner=replace(self.method.init(state.kept.x), sums=self._sums(state.kept)))

    def record(self, taken: Instants[PacedState]) -> RunRecord:
        """Records of many instants."""
        if isinstance(taken, Taken):
            return RunRecord(taken.times, *taken.data)
        return record_of(taken, [state.kept for _, state, _ in taken])

    def row(self, state: PacedState) -> Row:
        """Record of a state."""
        return state.kept

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return {
            **self.problem.remarks,
            "iterations": self._iterations,
            "cut_steps": self._cut,
            "orders": self.method.changes,
            "dependent_equations": len(self.method.redundant),
            "unknowns": self.method.model.unknowns,
        }

    def snapshot(self, state: PacedState) -> Snapshot:
        """Memory from step to step besides the state."""
        within = self._within.snapshot() if self._within is not None else None
        return {"method": self.method.snapshot(), "within": within, "counts": [self._iterations, self._cut]}

    def restore(self, snapshot: Snapshot, state: PacedState) -> None:
        """Go on from a snapshot."""
        self.method.restore(snapshot["method"])
        self._iterations, self._cut = snapshot["counts"]
        if snapshot["within"] is not None:
            self._within = self._make(self._model)
            self._within.restore(snapshot["within"])

    def _single(self, state: PacedState, h: float) -> tuple[PacedState, float]:
        inner, chunk = self.chunk(state, h, 1)
        return _end(chunk, inner, state.t + h), float(chunk.rows.ledgers[-1, 4])

    def _sums(self, row: Row) -> Array:
        """(4 + components,) counts of a method's state at a row."""
        return np.concatenate([row.sums, np.where(self._model.tables.kind == IRREVERSIBLE, row.energies, 0.0)])

    def _off(self, state: PacedState, coarse: PacedState, fine: PacedState) -> tuple[float, str]:
        """Distance between two ends of a step in tolerances, and the state where it occurs."""
        worst, where = 0.0, ""
        for slot in self.problem.descriptor.states:
            space = manifold(slot.quantity.space)
            if not self._counted[slot.rates].all() or not space.dim:
                continue
            a, b = coarse.inner.x[slot.point], fine.inner.x[slot.point]
            size = 1.0
            if space.code == VECTOR:
                size = max(float(np.abs(b).max()), float(np.abs(state.inner.x[slot.point]).max()))
            allowed = self._atol[slot.rates] + self._rtol[slot.rates] * size
            error = float(np.max(np.abs(space.increment(a, b)) / allowed))
            if not error <= worst:
                worst, where = error, str(slot.path)
        return worst, where


def _end(chunk: Chunk, inner: NaturalState, t: float) -> PacedState:
    """State after a chunk that ends at t.

    Raises
    ------
    SolveError
        The chunk has no such step.
    """
    if chunk.failure is not None:
        raise chunk.failure
    return PacedState(t, inner, chunk.rows.row(-1))


def _taken(rows: RunRecord, last: NaturalState) -> Taken[PacedState]:
    """Instants at the ends of steps, from whose states steps may start anew."""

    def state(k: int) -> PacedState:
        return PacedState(float(rows.t[k]), replace(last, x=rows.x[k]), rows.row(k))

    return Taken(rows.t, rows.ledgers[:, 4], (rows.x, rows.energies, rows.ledgers), state)


@final
class _FixedSteps:
    """Many constant steps a compiled call, those of full length on the grid of the run."""

    left = False

    def __init__(self, method: Paced, span: Span[PacedState], step: float) -> None:
        self.state, self.counts = span.state, replace(span.counts, h=step)
        self._method, self._span = method, span
        self._grid, self._sign = Grid(abs(span.until - span.t0), step), 1.0 if span.until > span.t0 else -1.0
        self._saved, self._most = span.saved, FIRST
        self._rows: Instants[PacedState] = []

    def advance(self, steps: int) -> bool:
        """Up to so many steps; whether the end is reached.

        Raises
        ------
        SolveError
            A step has no solution.
        """
        grid, done, span = self._grid, self.counts.steps, self._span
        count, h = min(steps, self._most, grid.whole - done), grid.h
        if not count:
            count, h = 1, grid.last
        inner, chunk = self._method.chunk(self.state, self._sign * h, count)
        times = span.t0 + self._sign * grid.h * np.arange(done + 1, done + chunk.steps + 1).astype(np.float64)
        ended = done + count == grid.count
        if ended and chunk.steps == count:
            times[-1] = span.until
        taken = _taken(replace(chunk.rows, t=times), inner)
        if chunk.steps:
            self._rows = taken if span.save_at is None else self._between(taken, span.save_at)
            self.state = replace(taken.state(chunk.steps - 1), inner=inner)
            self.counts = self.counts.after(h, float(taken.least.min()), chunk.steps)
        if chunk.failure is not None:
            raise chunk.failure
        self._most = steps
        return ended

    def _between(self, taken: Taken[PacedState], save_at: Array) -> list[Instant[PacedState]]:
        """The instants to keep among those of some steps from the present state."""
        first, self._saved = (
            self._saved,
            int(np.searchsorted(self._sign * save_at, self._sign * taken.times[-1], side="right")),
        )
        found: list[Instant[PacedState]] = []
        for when in save_at[first : self._saved].tolist():
            k = int(np.searchsorted(self._sign * taken.times, self._sign * when))
            t, after, least = taken[k]
            if t != when:
                after = self._method.shorter(taken.state(k - 1) if k else self.state, when)
            found.append((when, after, least))
        return found

    def rows(self) -> Instants[PacedState]:
        """Instants to keep since the last call."""
        rows, self._rows = self._rows, []
        return rows

    @property
    def time(self) -> float:
        """The time reached."""
        return self.state.t

    def snapshot(self) -> Snapshot:
        """Nothing: the run's state and counts are all there is."""
        return {}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from where the run is."""


def _counted(problem: Problem) -> Array:
    """(rate_size,) which states count in an error: not momenta whose junctions have constraints.

    Those satisfy the constraints to the method's order only, alternating; what they do shows in positions.
    """
    d = problem.descriptor
    bound = np.zeros(d.effort_size, dtype=bool)
    for slot in d.components:
        if slot.multipliers:
            bound[list(slot.efforts)] = True
    out = np.ones(d.rate_size, dtype=bool)
    for slot, _ in d.storages:
        for rate, effort in zip(rates_read(slot), slot.efforts, strict=True):
            out[rate] = not bound[effort]
    odd = {i for s in d.states if s.quantity.parity < 0 for i in range(s.rates.start, s.rates.stop)}
    out[[i for i in range(d.rate_size) if i not in odd]] = True
    return out
