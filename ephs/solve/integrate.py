"""Time loop of compiled steps in chunks; progress, interruption and records between chunks."""

import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol, final

import numpy as np

from ephs.operad import Quantity
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import Pair
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.auditing.audit import Bounds, Tests, audit
from ephs.solve.auditing.production import Production
from ephs.solve.auditing.resolution import Trials, natural_trials
from ephs.solve.breakpoints import Breakpoints
from ephs.solve.control import SLIVER
from ephs.solve.errors import Interrupted, OptionError, Outcome, SimulationError, SolveError, solve_error_of
from ephs.solve.journal import Written
from ephs.solve.methods.driven import ComponentMethod, advance_driven, advance_whole, started
from ephs.solve.methods.natural import Chunk, Natural, NaturalState
from ephs.solve.methods.records import IRREVERSIBLE
from ephs.solve.model import Model, compile_model
from ephs.solve.problem import Problem, States
from ephs.solve.result.labels import labels_of
from ephs.solve.result.ledger import ledgers
from ephs.solve.result.record import Record, Recorder, joined
from ephs.solve.result.solution import Solution
from ephs.solve.snapshot import Snapshot, like, parts
from ephs.solve.starting import check_start
from ephs.solve.watching import Balance

__all__ = ["Grid", "Progress", "audited", "failures_of", "integrate", "repeatable", "solution_of"]

RESPONSE = 0.1
"""Seconds between updates of progress and checks of Ctrl-C."""
LARGEST_CHUNK = 1000

Progress = Callable[[float, float, Mapping[str, Any]], None]


@final
@dataclass(frozen=True, slots=True)
class Grid:
    """The times t₀ + k·h, the last step shortened to end on ``until``."""

    t0: float
    until: float
    h: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.h) and self.h > 0.0):
            raise OptionError("step", self.h, "a number of seconds > 0")
        if not (np.isfinite(self.until) and self.until > self.t0):
            raise OptionError("until", self.until, f"a time after t0 = {self.t0!r} s")

    @property
    def whole(self) -> int:
        """Number of steps of full length."""
        count = (self.until - self.t0) / self.h
        nearest = round(count)  # no additional tiny step where h divides the time up to rounding
        return int(nearest) if abs(count - nearest) <= SLIVER * max(1.0, count) else int(count)

    @property
    def last(self) -> float:
        """Length of the shortened last step, 0 where there is none."""
        rest = self.until - self.time(self.whole)
        return rest if rest > SLIVER * self.h else 0.0

    def time(self, k: int) -> float:
        """The time after k full steps."""
        return self.t0 + k * self.h


def integrate(
    problem: Problem,
    grid: Grid,
    *,
    make: Callable[[Model], ComponentMethod] = Natural,
    save_at: Array | None = None,
    max_steps: int | None = None,
    progress: Progress | None = None,
    journal: Written | None = None,
    bounds: Bounds | None = None,
    breakpoints: Breakpoints | None = None,
) -> Solution:
    """Solve an initial value problem on a grid, forward in time, by a method that discretises component by component.

    Parameters
    ----------
    journal
        Where the run is written down, and what an earlier part of it left there.
    bounds
        What the audit of the run allows; None: there is none.
    breakpoints
        Where inputs jump, and steps end; None: nowhere.

    Raises
    ------
    SimulationError
        The run failed part-way; ``.partial`` holds the solution up to there. `Interrupted` where the user stopped it.
    """
    begin = time.perf_counter()
    d = problem.descriptor
    x0 = d.pack(problem.initial)
    model = compile_model(d, problem.reference, problem.inputs(grid.t0, problem.initial))
    stepper = make(model)
    inside = _Inside(problem, make, model)
    run = _Run(
        problem, grid, stepper, Recorder(d, grid.t0, x0, save_at, inside), begin, progress, journal, bounds,
        breakpoints or Breakpoints(grid.t0, grid.until),
    )  # fmt: skip
    with failures_of(run):
        run.recorder.start(stepper.energies(x0))
        run.balance = Balance(problem, *run.recorder.latest)
        run.production.start(*run.recorder.latest[:2])
        check_start(problem, model, grid.h)
        run.state = stepper.init(x0)
        stepper.prepare(run.state, grid.h)
        run.setup = time.perf_counter() - begin
        run.restore()
        run.full_steps(max_steps)
        if grid.last and run.t != grid.until:
            run.to(grid.until, grid.last)
            run.look()
    return run.solution()


@final
class _Inside:
    """Dense output: a shorter step from the start of a step, by a method of its own."""

    def __init__(self, problem: Problem, make: Callable[[Model], ComponentMethod], model: Model) -> None:
        self._problem, self._make, self._model = problem, make, model
        self._method: ComponentMethod | None = None

    def __call__(self, start: tuple[float, Array, Array, Array], when: float) -> tuple[Array, Array, Array]:
        if self._method is None:
            self._method = self._make(self._model)
        t, x, energies, ledgers = start
        made = np.where(self._model.tables.kind == IRREVERSIBLE, energies, 0.0)
        state = started(self._method, x, np.concatenate([ledgers[:4], made]))
        _, chunk = advance_driven(self._problem, self._method, state, t, when - t)
        if chunk.failure is not None:
            raise chunk.failure
        return chunk.x[-1], chunk.energies[-1], chunk.ledgers[-1]

    def snapshot(self) -> Snapshot | None:
        """Memory from one time to the next."""
        return None if self._method is None else self._method.snapshot()

    def restore(self, snapshot: Snapshot | None) -> None:
        """Go on from a snapshot."""
        if snapshot is not None:
            self._method = self._make(self._model)
            self._method.restore(snapshot)


class Run(Protocol):
    """A run in progress: its state and its results so far."""

    t: float
    problem: Problem

    def solution(self) -> Solution:
        """The solution so far."""
        ...


_AT_LOOPS = (Outcome.OPEN, Outcome.CONTRADICTION, Outcome.DIVERGED, Outcome.SINGULAR, Outcome.TINY)


@contextmanager
def failures_of(run: Run) -> Generator[None, None, None]:
    """Failures and interruptions inside become those of the run, with its time and partial solution."""
    try:
        with np.errstate(all="ignore"):  # overflow is an outcome, not a warning
            yield
    except (SolveError, ArithmeticError, np.linalg.LinAlgError) as raised:
        error = solve_error_of(raised)
        outcome = error.outcome
        if outcome in _AT_LOOPS and run.problem.shaky is not None and run.problem.shaky():
            outcome = Outcome.SHAKY
        failed = Interrupted if isinstance(error.cause, KeyboardInterrupt) else SimulationError
        told = [error.equation]
        if error.outcome in (Outcome.SINGULAR, Outcome.CONTRADICTION, Outcome.DIVERGED) and run.problem.dependences:
            told.append(run.problem.dependences())
        equation = "; ".join(filter(None, told))
        raise failed(outcome, run.t * run.problem.seconds, error.path, equation, run.solution()) from error.cause
    except KeyboardInterrupt as error:
        raise Interrupted(Outcome.INTERRUPTED, run.t * run.problem.seconds, "", "", run.solution()) from error
    except MemoryError as error:
        raise SimulationError(Outcome.MEMORY, run.t * run.problem.seconds, "", str(error), run.solution()) from error


def audited(
    problem: Problem,
    record: Record,
    stats: Mapping[str, Any],
    bounds: Bounds | None,
    ends: list[Record],
    trials: Callable[[Solution], Tests | None],
) -> Solution:
    """Kept part of a run, with the audit from its start to the present time.

    Parameters
    ----------
    trials
        Makes those of the audit.
    ends
        The first and the last row, kept or not; nothing where there is none.
    """
    solution = whole = solution_of(problem, record, stats)
    if bounds is None or not ends:
        return solution
    first, last = ends
    if not (len(solution) and record.t[0] == first.t[0] and record.t[-1] == last.t[0]):
        whole = solution_of(problem, joined([first, record, last]) or record, stats)
    solution.stats = {**solution.stats, "audit": audit(whole, bounds, trials(whole)).record()}
    return solution


def repeatable(trials: Trials | None, bounds: Bounds, *, ended: bool) -> Trials | None:
    """Trials with further runs of the problem, where its run has ended."""
    return replace(trials, again=bounds.again) if trials is not None and ended else trials


def solution_of(problem: Problem, record: Record, stats: Mapping[str, Any]) -> Solution:
    """Kept part of a run, as a solution."""
    while problem.shown is not None:
        problem, record, stats = problem.shown(record, stats)
    states = {slot.path: coordinates(slot.quantity, record.x[:, slot.point]) for slot in problem.descriptor.states}
    labels = {slot.path: labels_of(slot.quantity) for slot in problem.descriptor.states}
    return Solution(problem.name, record.t, states, ledgers(problem, record), dict(stats), problem, labels)


class _Run:
    """A run in progress: its state and its records."""

    state: NaturalState
    balance: Balance

    def __init__(
        self,
        problem: Problem,
        grid: Grid,
        stepper: ComponentMethod,
        recorder: Recorder,
        begin: float,
        progress: Progress | None,
        journal: Written | None,
        bounds: Bounds | None,
        breakpoints: Breakpoints,
    ) -> None:
        self.breakpoints, self.production, self.looked = breakpoints, Production(problem), begin
        self.problem, self.grid, self.stepper, self.recorder = problem, grid, stepper, recorder
        self.begin, self.progress, self.journal, self.bounds = begin, progress, journal, bounds
        self.t, self.setup, self.steps, self.iterations, self.cut = grid.t0, 0.0, 0, 0, 0

    def full_steps(self, max_steps: int | None) -> None:
        """All steps of full length, in chunks that adapt to the time that they take."""
        whole = self.grid.whole
        if max_steps is not None and whole + bool(self.grid.last) > max_steps:
            raise OptionError("max_steps", max_steps, f"at least the grid's {whole + bool(self.grid.last)} steps")
        alone = self.problem.constant and not self.breakpoints.active
        size = 16 if alone else 1
        while self.done < whole:
            count = min(size, whole - self.done)
            before, done = time.perf_counter(), self.done + count
            end = self.grid.until if done == whole and not self.grid.last else None
            if alone:
                self.take(self.grid.h, count, end)
            else:
                self.to(self.grid.time(done) if end is None else end, self.grid.h)
            self.look()
            if alone:
                slow = (time.perf_counter() - before) / RESPONSE
                size = int(np.clip(size / np.clip(slow, 0.25, 2.0), 1, LARGEST_CHUNK))

    @property
    def done(self) -> int:
        """Steps of the grid that are taken, in parts or not."""
        return self.steps - self.breakpoints.split

    def to(self, target: float, h: float) -> None:
        """One step of the grid of h seconds, in parts where inputs jump within it."""
        grid, first = self.grid, self.done
        while self.done == first:
            end = self.breakpoints.end(self.t, target - self.t, self._states)
            whole = end - target >= -SLIVER * grid.h  # a jump at the grid's time, to rounding, divides no step
            jump = end != grid.until and end - target <= SLIVER * grid.h
            regular = abs(target - self.t - h) <= SLIVER * grid.h and whole
            self.take(h if regular else min(end, target) - self.t, 1, end if jump else target)
            if jump:
                self.state = started(self.stepper, self.state.x, self.state.sums)
                self.breakpoints.enter(end, self._states, split=not whole)

    def _states(self) -> States:
        return States(self.problem.descriptor.unpack(self.state.x))

    def take(self, h: float, count: int, end: float | None) -> None:
        """Some steps of one length; ``end`` is their exact end where the grid would round it."""
        if self.problem.constant:
            self.state, chunk = advance_whole(self.stepper, self.state, h, count)
        else:
            self.state, chunk = advance_driven(self.problem, self.stepper, self.state, self.t, h)
        self.iterations += chunk.iterations
        self.cut += chunk.cut
        times = np.array([self.grid.time(self.done + k + 1) for k in range(chunk.steps)])
        if end is not None and chunk.steps == count:
            times[-1] = end
        chunk = self.production.cut(times, chunk)
        self._record(times[: chunk.steps], chunk)
        if chunk.failure is not None:
            raise chunk.failure

    def look(self) -> None:
        """Report progress and write the journal at intervals."""
        at_end, now = self.t == self.grid.until, time.perf_counter()
        if self.progress is not None and (at_end or now - self.looked > 0.5 * RESPONSE):
            self.looked, error = now, self.balance.error(*self.recorder.latest)
            self.progress(self.t, self.grid.until, {**self.stats(), "energy_error": error})
        if self.journal is not None and (at_end or self.journal.due):
            self.journal.write(self.recorder.rows.fresh(), self.snapshot(), self.stats())

    def snapshot(self) -> Snapshot:
        """Present state of the run."""
        return {
            "t": self.t,
            "counts": [self.steps, self.iterations, self.cut],
            "elapsed": time.perf_counter() - self.begin - self.setup,
            "state": parts(self.state),
            "method": self.stepper.snapshot(),
            "recorder": self.recorder.snapshot(),
            "breakpoints": self.breakpoints.snapshot(),
        }

    def restore(self) -> None:
        """Resume from the state in the journal."""
        found = self.journal.snapshot if self.journal is not None else None
        if found is not None:
            self.t, (self.steps, self.iterations, self.cut) = found["t"], found["counts"]
            self.begin = time.perf_counter() - self.setup - found["elapsed"]
            self.state = like(self.state, found["state"])
            self.breakpoints.restore(found["breakpoints"])
            self.stepper.restore(found["method"])
            self.recorder.restore(found["recorder"], self.journal.rows if self.journal is not None else None)
            self.production.start(*self.recorder.latest[:2])

    def _record(self, times: Array, chunk: Chunk) -> None:
        if chunk.steps:
            self.recorder.add(times, chunk)
            self.steps += chunk.steps
            self.t = float(times[-1])

    def stats(self) -> dict[str, Any]:
        """Statistics of the run so far."""
        return {
            "method": self.stepper.name,
            **self.problem.remarks,
            "steps": self.steps,
            "rejected": 0,
            "iterations": self.iterations,
            "cut_steps": self.cut,
            "orders": self.stepper.changes,
            "dependent_equations": len(self.stepper.redundant),
            "unknowns": self.stepper.model.unknowns,
            **self.breakpoints.stats(),
            "setup_s": self.setup,
            "integrate_s": time.perf_counter() - self.begin - self.setup,
            "step": self.grid.h,
            "least_production": self.recorder.least,
        }

    def solution(self) -> Solution:
        """The solution so far."""
        recorder = self.recorder
        return audited(
            self.problem, recorder.result(), self.stats(), self.bounds, recorder.ends(), self._trials
        )  # fmt: skip

    def _trials(self, solution: Solution) -> Trials | None:
        bounds = self.bounds
        if bounds is None or bounds.undamped is None or bounds.step is None:
            return None
        jumps = [self.problem.seconds * t for t in self.breakpoints.times]
        trials = natural_trials(solution, bounds.undamped, bounds.step, self.stepper, jumps)
        return repeatable(trials, bounds, ended=self.t == self.grid.until)


def coordinates(quantity: Quantity, x: Array) -> Array:
    """States (n, size) as users read them: scalars (n,), relative poses as the pair's coordinates (n, d)."""
    if quantity.kind == "relative_pose":
        pair = Pair.from_space(quantity.space)
        return x if pair.manifold.code == VECTOR else pair.coordinates(x)
    return x[:, 0] if x.shape[1] == 1 else x
