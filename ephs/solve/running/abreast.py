"""Runs of the independent parts of a problem, abreast: each takes steps of its own, and the results are of the whole.

The solution of the whole has the states of all parts and the sums of their ledgers.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any, Final, final

import numpy as np

from ephs.semantics.descriptor.product import Factor
from ephs.solve.auditing.retaken import Missed
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord
from ephs.solve.result.solution import Solution
from ephs.solve.running.ending import audited, failures_of
from ephs.solve.running.loop import RESPONSE, RunLoop
from ephs.solve.running.request import RunRequest

Part = tuple[Factor, RunLoop[Any]]
"""An independent part of a problem and its run, which keeps the same times as the others."""


def integrate_abreast(problem: Problem, parts: Sequence[Part], request: RunRequest) -> Solution:
    """Solve the initial value problems of the independent parts of a problem, as `integrate` does the whole.

    Raises
    ------
    SimulationError
        The run of a part failed; ``.partial`` holds the solution up to the last of the times that all have reached.
        `Interrupted` where the user stopped it.
    """
    runs = _Abreast(problem, parts, request)
    with failures_of(runs):
        runs.start()
        runs.advance()
    return runs.solution()


@final
class _Abreast:
    """Runs of parts, of which the one that is behind goes on first, so that all are near each other when they end."""

    def __init__(self, problem: Problem, parts: Sequence[Part], request: RunRequest) -> None:
        self.problem, self.request, self.bounds = problem, request, request.bounds
        self.factors, self.runs = zip(*parts, strict=True)
        first = self.runs[0]
        self.t0, self.until, self.t, self.h = first.t0, first.until, first.t0, 0.0
        self.begin = self.looked = first.begin
        self.setup = 0.0
        shared = np.bincount(np.concatenate([factor.states for factor in self.factors])) > 1
        self.shared = [shared[factor.states] for factor in self.factors]

    def start(self) -> None:
        """The first row of each."""
        for run in self.runs:
            run.start()
        self.setup = time.perf_counter() - self.begin

    def advance(self) -> None:
        """Run all to the end.

        Raises
        ------
        SolveError, ArithmeticError, LinAlgError
            That of the run that fails first; the others have come to its time, too.
        """
        going, failed = {run: run.advance(None) for run in self.runs}, list[tuple[RunLoop[Any], Exception]]()
        while going:
            run = min(going, key=lambda one: abs(one.t - one.t0))
            self.t, self.h = run.t, run.h
            if failed and abs(run.t - run.t0) >= min(abs(one.t - one.t0) for one, _ in failed):
                break
            try:
                next(going[run])
            except StopIteration:
                del going[run]
            except (SolveError, ArithmeticError, np.linalg.LinAlgError) as error:
                failed.append((run, error))
                del going[run]
            self._tell()
        if failed:
            run, error = min(failed, key=lambda one: abs(one[0].t - one[0].t0))
            self.t, self.h = run.t, run.h
            raise error
        self.t = self.until

    def _tell(self) -> None:
        """Report progress at intervals: the time to which all have come."""
        now, progress = time.perf_counter(), self.request.progress
        if progress is not None and (self.t == self.until or now - self.looked > 0.5 * RESPONSE):
            self.looked = now
            error = max(run.energy_error() for run in self.runs)
            progress(self.t, self.until, {**self.stats(), "energy_error": error})

    def stats(self) -> dict[str, Any]:
        """Statistics of the whole: sums of those of the parts, or what they have in common."""
        each = [run.stats() for run in self.runs]
        keys = dict.fromkeys(key for one in each for key in one)
        combined = {key: _COMBINED.get(key, _together)([one[key] for one in each if key in one]) for key in keys}
        if "work_apart" in combined:
            apart = [(one["work_apart"], one["work_apart_at"]) for one in each if "work_apart" in one]
            combined["work_apart_at"] = max(apart)[1]
        times = {"setup_s": self.setup, "integrate_s": time.perf_counter() - self.begin - self.setup}
        return {**combined, **self.request.remarks, **times, "independent_parts": len(self.runs)}

    def solution(self) -> Solution:
        """The solution of the whole, as far as all have come."""
        kept, ends = self._whole([run.kept_rows() for run in self.runs]), [run.ends() for run in self.runs]
        found: list[RunRecord] = []
        if all(ends):
            arrived = all(run.t == self.until for run in self.runs)
            last = self._whole([last for _, last in ends]) if arrived else kept[-1:]
            found = [self._whole([first for first, _ in ends]), last] if last.t.size else []
        return audited(self.problem, kept, self.stats(), self.bounds, found, lambda _: self._missed())

    def _missed(self) -> Missed | None:
        """The error of chosen steps in that part where it is largest."""
        seconds = self.problem.seconds
        found = [run.samples.retaken.missed(run.stepper, run.breakpoints, seconds) for run in self.runs]
        return max((one for one in found if one is not None), key=lambda one: one.size, default=None)

    def _whole(self, records: Sequence[RunRecord]) -> RunRecord:
        """Rows of the whole at those times to which all have come.

        A state that several parts have, as the environment's entropy, is its start plus its changes in all of them.
        """
        count = min(len(record.t) for record in records)
        records = [record[:count] for record in records]
        start = self.problem.point
        x, energies = np.tile(start, (count, 1)), np.zeros((count, len(self.problem.descriptor.components)))
        for factor, shared, record in zip(self.factors, self.shared, records, strict=True):
            own, several = factor.states[~shared], factor.states[shared]
            x[:, own] = record.x[:, ~shared]
            x[:, several] += record.x[:, shared] - start[several]
            energies[:, factor.components] = record.energies  # the environment's is read off its states
        sums = sum(record.ledgers[:, :4] for record in records)
        least = np.min([record.ledgers[:, 4:] for record in records], axis=0)
        return RunRecord(records[0].t, x, energies, np.hstack([sums, least]))


def _together(values: Sequence[Any]) -> Any:
    """Sum of numbers; lists one after the other; of others what they have in common, or the first."""
    first = values[0]
    if isinstance(first, list):
        return [one for value in values for one in value]
    return sum(values) if isinstance(first, int | float) and not isinstance(first, bool) else first


def _names(values: Sequence[str]) -> str:
    return ", ".join(dict.fromkeys(name for value in values for name in value.split(", ")))


def _defects(values: Sequence[dict[str, float]]) -> dict[str, float]:
    """By how much balances would be missed: sums of all, and the largest with its time."""
    sums = {key: sum(one[key] for one in values) for key in ("sum", "left")}
    return {**max(values, key=lambda one: one["largest"]), **sums}


_COMBINED: Final[dict[str, Callable[[Sequence[Any]], Any]]] = {
    "method": _names,
    "chosen": _names,
    "shortest_step": min,
    "longest_step": max,
    "least_production": min,
    "plain_defect": _defects,
}
"""Functions that combine statistics of the parts; all others are summed or alike."""
