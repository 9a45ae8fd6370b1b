"""End of a run, whatever it was: its failures with what was computed before, its solution, and the audit of it."""

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any, Protocol

import numpy as np

from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.systems.kept import once
from ephs.solve.auditing.audit import Bounds, Tests, audit
from ephs.solve.auditing.findings import Audit
from ephs.solve.auditing.passing import TURNED
from ephs.solve.auditing.resolution import Trials
from ephs.solve.equations.oscillations import fastest_of
from ephs.solve.posing.errors import Interrupted, Outcome, SimulationError, SolveError, serves_not, solve_error_of
from ephs.solve.posing.problem import Problem
from ephs.solve.result.labels import labels_of
from ephs.solve.result.ledger import ledgers
from ephs.solve.result.record import RunRecord, joined
from ephs.solve.result.solution import Solution
from ephs.solve.result.states import RecordedStates


class Run(Protocol):
    """A run in progress: its state and its results so far."""

    t: float
    t0: float
    until: float
    h: float
    problem: Problem
    bounds: Bounds | None

    def solution(self) -> Solution:
        """The solution so far."""
        ...


_AT_CONSTRAINTS = (Outcome.SINGULAR, Outcome.CONTRADICTION, Outcome.DIVERGED, Outcome.UNDETERMINED)
_AT_SPEED = (Outcome.TINY, Outcome.MANY)
_AT_LENGTH = (Outcome.DIVERGED, Outcome.TURN, Outcome.DOMAIN, Outcome.RANGE, Outcome.SINGULAR)
MANY_RADIANS = 1e3
"""Angle of the fastest oscillation in a run above which it is why steps are many."""
HALF_TURN = np.pi - 0.02
"""Angle in rad of a strained relative pose beyond which steps are held up by the end of its logarithm."""
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
        if error.outcome in _AT_CONSTRAINTS and run.problem.dependences:
            told.append(run.problem.dependences())
        if error.outcome in (*_AT_CONSTRAINTS, Outcome.INCONSISTENT) and run.t == run.t0:
            told.append(_no_motion(run.problem))
        equation = "; ".join(filter(None, told))
        serves = run.bounds.serves if run.bounds is not None else serves_not
        partial = run.solution()
        fact, hint = _half_turned(outcome, partial) or _fast(run, outcome, partial)
        told = "; ".join(filter(None, (equation, fact)))
        raise failed(outcome, run.t * run.problem.seconds, error.path, told, partial, serves, hint) from error.cause
    except KeyboardInterrupt as error:
        raise Interrupted(Outcome.INTERRUPTED, run.t * run.problem.seconds, "", "", run.solution()) from error
    except MemoryError as error:
        raise SimulationError(Outcome.MEMORY, run.t * run.problem.seconds, "", str(error), run.solution()) from error


def _no_motion(problem: Problem) -> str:
    """The equations that contradict each other at the start, if no motion exists there."""
    try:
        found = problem.descriptor.system.relation(problem.reference).at(problem.initial)
    except SemanticsError:
        return ""
    return f"at the start {found.doubt}" if found.empty else ""


def _half_turned(outcome: Outcome, partial: Solution) -> tuple[str, str] | None:
    """The strained relative pose that has turned by half a turn, where its logarithm ends; what to do then."""
    if not (len(partial) and partial.problem is not None and outcome in (*_AT_SPEED, *_AT_LENGTH)):
        return None
    state = partial.state_at(len(partial) - 1)
    for slot, storage in partial.problem.descriptor.storages:
        point = {port: state[slot.path / port] for port in storage.bundle.ports}
        relative = [(port, of.space.size) for port, _, of in storage.bundle.items() if of.kind == "relative_pose"]
        turns = [point[port][0] for port, size in relative if size in (4, 7)]  # quaternions come first
        turned = max((2.0 * np.arccos(min(abs(float(w)), 1.0)) for w in turns), default=0.0)
        if turned > HALF_TURN and storage.energy(point) != 0.0:
            told = f"{slot.path} has turned by half a turn, where its strain ends"
            return told, f", or take more elements in place of {slot.path}"
    return None


def _fast(run: Run, outcome: Outcome, partial: Solution) -> tuple[str, str]:
    """The fastest oscillation where steps that follow it are many, or were much too long for it; what to do then."""
    if not (len(partial) and partial.problem is not None and outcome in (*_AT_SPEED, *_AT_LENGTH)):
        return "", ""
    problem, unit = partial.problem, run.problem.seconds
    found = fastest_of(problem, problem.descriptor.pack(partial.state_at(len(partial) - 1)))
    if found is None:
        return "", ""
    rate, path = found
    radians = rate * abs(run.until - run.t0) * unit
    if not (radians > MANY_RADIANS if outcome in _AT_SPEED else rate * run.h * unit > TURNED):
        return "", ""
    told = f"the fastest oscillation, of {path}, has {rate:.3g} rad/s ({rate / (2.0 * np.pi):.3g} Hz)"
    return f"{told}, {radians:.1g} rad in the run", f", or make {path} softer, or rigid: a joint in its place"


def audited(
    problem: Problem,
    record: RunRecord,
    stats: Mapping[str, Any],
    bounds: Bounds | None,
    ends: list[RunRecord],
    trials: Callable[[Solution], Tests | None],
) -> Solution:
    """Kept part of a run, with the audit from its start to the present time, which is made when it is asked for.

    Parameters
    ----------
    trials
        Makes those of the audit.
    ends
        The first and the last row, kept or not; nothing where there is none.
    """
    if bounds is None or not ends:
        return solution_of(problem, record, stats)
    first, last = ends

    @cache
    def found() -> Audit:
        kept = len(solution) and record.t[0] == first.t[0] and record.t[-1] == last.t[0]
        whole = solution if kept else solution_of(problem, joined([first, record, last]) or record, stats)
        return audit(whole, bounds, trials(whole))

    solution = solution_of(problem, record, stats, found)
    return solution


def repeatable(trials: Trials | None, bounds: Bounds, *, ended: bool) -> Trials | None:
    """Trials with further runs of the problem, where its run has ended."""
    return replace(trials, again=bounds.again) if trials is not None and ended else trials


def solution_of(
    problem: Problem, record: RunRecord, stats: Mapping[str, Any], audited: Callable[[], Audit] | None = None
) -> Solution:
    """Kept part of a run, as a solution, with what makes its audit."""
    while problem.shown is not None:
        problem, record, stats = problem.shown(record, stats)
    d = problem.descriptor
    labels = once(d, "labels", lambda: {slot.path: labels_of(slot.quantity) for slot in d.states})
    return Solution(
        problem.name, record.t, RecordedStates(d, record.x), lambda: ledgers(problem, record), dict(stats), problem,
        labels, audited=audited,
    )  # fmt: skip
