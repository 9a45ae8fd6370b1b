"""Time loop of all methods: control, events, records, progress and interruption."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, Generic, TypeVar

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.audit import Tests
from ephs.solve.auditing.forecast import Forecast
from ephs.solve.auditing.production import Production
from ephs.solve.auditing.resolution import Samples, trials_of
from ephs.solve.march.control import Policy
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.errors import OptionError, Outcome, SolveError, serves_not, solve_error_of
from ephs.solve.posing.events import Watch
from ephs.solve.posing.problem import Problem, States
from ephs.solve.result.record import RowBlocks, RunRecord, record_of
from ephs.solve.result.solution import Solution
from ephs.solve.running.control import SLIVER, Advance, Control, Grid, first_step
from ephs.solve.running.ending import audited, failures_of, repeatable
from ephs.solve.running.request import RunRequest
from ephs.solve.running.snapshot import Snapshot, like, parts
from ephs.solve.running.stepping import Attempt, Counts, Instant, Instants, Leg, Row, Span, Stepper, at_time, too_fast
from ephs.solve.running.watching import Balance

S = TypeVar("S")
RESPONSE = 0.1
BURST = 1000
"""Steps in one compiled call at most, for progress and interruption."""
BLOCK = 1024
"""Rows buffered before conversion into records."""
FINAL = (Outcome.PYTHON, Outcome.INPUT, Outcome.EVENT, Outcome.INCONSISTENT, Outcome.INTERRUPTED)
"""Failures that shorter steps cannot avoid."""


def integrate(
    problem: Problem,
    t0: float,
    until: float,
    make: Callable[[], tuple[Stepper[S], Policy | None]],
    control: Control,
    breakpoints: Breakpoints,
    request: RunRequest,
) -> Solution:
    """Solve an initial value problem, forward or backward in time.

    Parameters
    ----------
    make
        Makes the method, and what chooses its steps; None: they are constant.
    breakpoints
        Where inputs jump, and steps end.

    Raises
    ------
    SimulationError
        The run failed part-way; ``.partial`` holds the solution up to there. `Interrupted` where the user stopped it.
    """
    begin = time.perf_counter()
    if not (np.isfinite(until) and until != t0):
        raise OptionError("until", until, f"a time other than t0 = {t0!r} s")
    run = RunLoop(problem, t0, until, *make(), control, breakpoints, request, begin)
    with failures_of(run):
        run.start()
        for _ in run.advance(run.restore()):
            pass
        run.write(end=True)
    return run.solution()


class RunLoop(Generic[S]):
    """One run in progress; parameters as of `integrate`, and when it began by the clock, in s."""

    state: S

    def __init__(
        self,
        problem: Problem,
        t0: float,
        until: float,
        stepper: Stepper[S],
        policy: Policy | None,
        control: Control,
        breakpoints: Breakpoints,
        request: RunRequest,
        begin: float,
    ) -> None:
        self.breakpoints, self.request, self.journal = breakpoints, request, request.journal
        self.problem, self.until, self.stepper, self.control = problem, until, stepper, control
        self.policy, self.begin, self.bounds, self.save_at = policy, begin, request.bounds, request.save_at
        self.t = self.t0 = t0
        self.grid = None if policy else Grid(abs(until - t0), float(control.step or 0.0))
        self.sign = 1.0 if until > t0 else -1.0
        self.setup, self.looked, self.ended = 0.0, begin, False
        self.saved, self.counts = 0, Counts()
        self.way = Advance(t0, abs(until - t0) if policy else 0.0)
        self.blocks: list[Instants[S]] = []
        self.pending: list[Instant[S]] = []
        self.kept = RowBlocks()
        self.samples: Samples[S] = Samples(
            wanted=policy is None, retaken=self.bounds is not None and self.bounds.retaken
        )
        self.watch = Watch((), t0, {})
        order, serves = (self.bounds.order, self.bounds.serves) if self.bounds else (1, serves_not)
        self.forecast = Forecast(stepper.name, order, until, serves)
        self.leg: Leg[S] | None = None
        self.first: Row | None = None
        self.cause: SolveError | None = None  # reason of rejecting the longer step

    def start(self) -> None:
        """The initial state, and the first row."""
        self.h = first_step(self.control, abs(self.until - self.t0))
        if self.grid and self.control.max_steps is not None and self.grid.count > self.control.max_steps:
            raise OptionError("max_steps", self.control.max_steps, f"at least the grid's {self.grid.count} steps")
        self.state = self.stepper.start(self.t0, self.sign * self.h)
        row = self.first = self.stepper.row(self.state)
        self.balance = Balance(self.problem, row)
        self.production = Production(self.problem, self.sign)
        self.production.start(row)
        if self.save_at is None or (self.save_at.size and self.save_at[0] == self.t0):
            self.kept.add(record_of([(self.t0, None, 0.0)], [row]))
            self.saved = 1
        self.samples.add([(self.t0, self.state, 0.0)])
        self.stepper.prepare(self.state, self.sign * self.h)
        events = self.request.events
        self.watch = Watch(events, self.t0, self._here() if events else {})
        self.setup = time.perf_counter() - self.begin

    def advance(self, stood: Snapshot | None) -> Iterator[None]:
        """Run to the end or to a terminal event: in compiled code while possible, then step by step.

        Others may go on after each of what it yields: many compiled steps, or one.

        ``stood`` is where the compiled part of an earlier run did, None where it was left.
        """
        stepwise = self.watch.events or self.production.active or self.breakpoints.active
        compiled = not stepwise and (self.journal is None or self.journal.snapshot is None or stood is not None)
        while compiled and not self.ended and self.t != self.until:  # leg after leg, while the method has one
            here = self.state, self.t0, self.until, self.h, self.control, self.policy, self.save_at, self.saved
            self.leg = self.stepper.many(Span(*here, replace(self.counts, h=self.h)))
            if self.leg is None:
                break
            if stood is not None:
                self.leg.restore(stood)
            stood = None
            yield from self._follow(self.leg)
            self.leg = None
        yield from self._advance_stepwise()

    def _follow(self, leg: Leg[S]) -> Iterator[None]:
        """Compiled steps until the end, or until the compiled code stops."""
        done, most = False, BURST
        while not (done or leg.left):
            self._require_steps_left()
            burst = most if self.control.max_steps is None else min(most, self.control.max_steps - self.counts.steps)
            begin, before = time.perf_counter(), self.counts.steps
            try:
                done = leg.advance(burst)
            finally:
                fresh, self.counts = leg.rows(), leg.counts
                self.blocks.append(fresh)
                self.samples.add(fresh)
                self.saved += len(fresh)
                self.t, self.h, self.state = leg.time, self.counts.h, leg.state
            each = (time.perf_counter() - begin) / max(1, self.counts.steps - before)
            most = int(np.clip(RESPONSE / each, 1, BURST))
            if not leg.left:  # else a journal would lead from one method into the other
                self._look()
            yield

    def _require_steps_left(self) -> None:
        """Refuse more steps than are allowed."""
        if self.control.max_steps is not None and self.counts.steps >= self.control.max_steps:
            raise SolveError(Outcome.MANY, "", f"{self.control.max_steps}")

    @property
    def _next_on_grid(self) -> int:
        """Number of the next step on the grid of constant ones."""
        return self.counts.steps - self.breakpoints.split + 1

    def _advance_stepwise(self) -> Iterator[None]:
        control, grid = self.control, self.grid
        while self.t != self.until and not self.ended:
            self._require_steps_left()
            if grid:
                self.h = self._next_on_grid * grid.h - abs(self.t - self.t0)
            end = self.breakpoints.end(self.t, self.h, self._here)
            rest = abs(end - self.t)
            if grid and rest - self.h <= SLIVER * grid.h:
                self.h, whole = rest, rest - self.h >= -SLIVER * grid.h
            else:
                whole = True
            # No tiny remainder for a last step.
            h = self.h if rest > 1.01 * self.h else rest if rest <= 1.0000001 * self.h or grid else 0.5 * rest
            cut = end != self.until and h < self.h
            if self.policy and (followed := max(self.breakpoints.followed(self.t, h), control.least)) < h:
                h, cut = followed, True
            exact = grid.h if grid and abs(h - grid.h) <= self.breakpoints.near else h
            try:
                attempt = self.stepper.step(self.state, self.sign * exact)
            except (SolveError, ArithmeticError, np.linalg.LinAlgError) as error:
                failure = self.cause = solve_error_of(error)
                if grid or failure.outcome in FINAL:
                    raise failure from error
                self._shrink(0.25 * h, failure)
                continue
            if self.policy:
                accepted, wanted = self.policy.judge(h, attempt.error, abs(self.until - self.t0))
                if not accepted and not (cut and wanted > h):
                    asked = self.policy.wanted(h, attempt.error, abs(self.until - self.t0))
                    cause = too_fast(self.stepper.name, attempt.worst, asked * self.problem.seconds)
                    self._shrink(min(wanted, control.most), cause)
                    continue
                # a step shortened to an end is no evidence about longer ones
                if h == self.h or wanted < (min(self.h, 2.0 * h) if cut else self.h):
                    self.h = max(min(wanted, control.most), min(control.least, h))
            there = h == rest and abs(abs(attempt.h) - h) <= self.breakpoints.near
            self.ended = self._accept(attempt, end if there else None)
            if self.t == end != self.until and not self.ended:
                self.state = self.stepper.anew(self.state)
                self.breakpoints.enter(end, self._here, split=not whole)
            self._look()
            yield

    def _shrink(self, h: float, cause: SolveError | None) -> None:
        self.counts = replace(self.counts, rejected=self.counts.rejected + 1)
        finest = self.policy.finest if self.policy else 0.0
        self.h = self.control.allowed(h, max(abs(self.t), abs(self.until)), cause, finest * abs(self.until - self.t0))

    def _accept(self, attempt: Attempt[S], end: float | None) -> bool:
        """Keep a step; whether an event ends the run with it."""
        t = self.t + attempt.h if end is None else end
        if end is None and self.policy is None:
            t = self.t0 + self.sign * self._next_on_grid * float(self.control.step or 0.0)
        after = at_time(attempt.end, t)
        stopped = None
        if self.watch.events:
            stopped = self.watch.step(self.t, t, self._at(after), lambda s: self._at(self.stepper.inside(attempt, s)))
            if stopped is not None and stopped != t:
                t, after = stopped, at_time(self.stepper.inside(attempt, stopped), stopped)
        self.watch.add((h for h in attempt.happened if self.sign * (t - h[0]) >= 0.0), self._at)
        if self.production.active:
            self.production.step(t, self.stepper.row(after))
        self.counts = self.counts.after(abs(attempt.h), attempt.least)
        if self.save_at is None:
            self.pending.append((t, after, attempt.least))
        else:
            last = int(np.searchsorted(self.sign * self.save_at, self.sign * t, side="right"))
            for when in self.save_at[self.saved : last]:
                found = after if when == t else self.stepper.inside(attempt, float(when))
                self.pending.append((float(when), found, attempt.least))
            self.saved = last
        self.samples.add([(t, after, attempt.least)])
        self.samples.retaken.add(self.t, attempt)
        self.state, self.t, self.cause = after, t, None
        if self.policy is not None:
            self.forecast.look(self.counts.steps, t, self.stepper.stats)
        return stopped is not None

    def _look(self) -> None:
        """Report progress and write the journal at intervals; a run that does not come forward ends."""
        self.way.require(self.counts.steps, self.t)
        if self.journal is not None and self.journal.due:
            self.write()
        elif len(self.pending) + sum(map(len, self.blocks)) >= BLOCK:
            self._settle()
        now, progress = time.perf_counter(), self.request.progress
        if progress is not None and (self.t == self.until or now - self.looked > 0.5 * RESPONSE):
            self.looked = now
            progress(self.t, self.until, {**self.stats(), "energy_error": self.energy_error()})

    def energy_error(self) -> float:
        """The defect of the energy balance now, relative to the largest energies so far."""
        return self.balance.error(self.stepper.row(self.state))

    def _at(self, state: S) -> Mapping[Path, Array]:
        return States(self.problem.descriptor.unpack(self.stepper.row(state).x))

    def _here(self) -> Mapping[Path, Array]:
        return self._at(self.state)

    def stats(self) -> dict[str, Any]:
        """Statistics of the run so far."""
        counts = self.counts
        return {
            "method": self.stepper.name,
            "steps": counts.steps,
            "rejected": counts.rejected,
            "shortest_step": float(counts.shortest) if counts.steps else 0.0,
            "longest_step": counts.longest,
            "dependent_equations": 0,
            **({"step": self.control.step} if self.policy is None else {}),
            **self.stepper.stats(),
            **self.request.remarks,
            **self.breakpoints.stats(),
            **self.forecast.stats(),
            "setup_s": self.setup,
            "integrate_s": time.perf_counter() - self.begin - self.setup,
            "least_production": float(counts.least) if np.isfinite(counts.least) else 0.0,
            **self.watch.stats(),
        }

    def solution(self) -> Solution:
        """The solution so far."""
        stats, kept = self.stats(), self.kept_rows()
        ends = self.ends()
        stats |= {**self.stepper.stats(), **self.request.remarks}  # also known from rows
        return audited(self.problem, kept, stats, self.bounds, ends, self._trials)

    def kept_rows(self) -> RunRecord:
        """All kept rows so far."""
        self._settle()
        return self.kept.whole(self.problem.descriptor)

    def _trials(self, solution: Solution) -> Tests | None:
        step = self.control.step
        if self.bounds is None or step is None:
            return self.samples.retaken.missed(self.stepper, self.breakpoints, self.problem.seconds)
        trials = trials_of(
            solution, self.bounds.undamped, self.problem, self.stepper, self.bounds.order, self.samples.states,
            self.sign * step, self.t, self.breakpoints,
        )  # fmt: skip
        return repeatable(trials, self.bounds, ended=self.ended or self.t == self.until)

    def ends(self) -> list[RunRecord]:
        """The first and the last row, recorded or not; none for a run that did not start or is not finite."""
        with suppress(SolveError):  # a failed run may end where evaluation is impossible
            if self.first:
                last = self.kept.ending_at(self.t) or record_of([(self.t, None, 0.0)], [self.stepper.row(self.state)])
                return [record_of([(self.t0, None, 0.0)], [self.first]), last]
        return []

    def _settle(self) -> None:
        """Pending part, as it is kept."""
        for block in (*self.blocks, self.pending):
            if len(block):
                self.kept.add(self.stepper.record(block))
        self.blocks, self.pending = [], []

    @property
    def _resumable(self) -> dict[str, Any]:
        """What has snapshots of its own, by name."""
        own = {"watch": self.watch, "breakpoints": self.breakpoints, "forecast": self.forecast}
        return own if self.policy is None else {**own, "policy": self.policy}

    def write(self, *, end: bool = False) -> None:
        """An entry in the journal, if there is one."""
        if self.journal is not None:
            self._settle()
            self.ended = self.ended or end
            self.journal.write(self.kept.fresh(), self.snapshot(), self.stats())

    def snapshot(self) -> Snapshot | None:
        """Present state of the run; None if its method provides none."""
        method = self.stepper.snapshot(self.state)
        if method is None:
            return None
        return {
            "t": self.t,
            "counts": parts(replace(self.counts, h=self.h)),
            "saved": self.saved,
            "elapsed": time.perf_counter() - self.begin - self.setup,
            "ended": self.ended,
            "state": parts(self.state),
            "method": method,
            **{name: part.snapshot() for name, part in self._resumable.items()},
            "samples": self.samples.snapshot(),
            "leg": self.leg.snapshot() if self.leg is not None else None,
        }

    def restore(self) -> Snapshot | None:
        """Resume from the state in the journal, and that of the compiled part."""
        found = self.journal.snapshot if self.journal is not None else None
        if self.journal is None or found is None:
            return None
        self.t, self.saved, self.counts = found["t"], found["saved"], like(self.counts, found["counts"])
        self.h = self.counts.h
        self.begin = time.perf_counter() - self.setup - found["elapsed"]
        self.ended = found["ended"]
        self.state = like(self.state, found["state"])
        for name, part in self._resumable.items():
            part.restore(found[name])
        self.stepper.restore(found["method"], self.state)
        self.production.start(self.stepper.row(self.state))
        self.kept = RowBlocks()
        self.samples.restore(found["samples"], self.state)
        if self.journal.rows is not None:
            self.kept.add(self.journal.rows, written=True)
        return found["leg"]
