"""Progress of a run: the defect of its energy balance, and the callback for it."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any, final

from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.ledger import ledgers
from ephs.solve.result.record import record_of
from ephs.solve.running.stepping import Row

Progress = Callable[[float, float, Mapping[str, Any]], None]
"""Called with the time, the end, and statistics so far."""


@final
class Balance:
    """The energy balance since a first row."""

    def __init__(self, problem: Problem, first: Row) -> None:
        self._problem, self._first, self._scale = problem, deepcopy(first), 0.0

    def error(self, row: Row) -> float:
        """The defect now, relative to the largest K + |V − V₀| + |heat| + |work| so far."""
        totals = ledgers(self._problem, record_of([(0.0, None, 0.0)] * 2, [self._first, row]))
        self._scale = max(self._scale, totals.scale)
        return float(totals.defect(mechanical=self._problem.mechanical)[-1]) * totals.scale / self._scale


def guarded(progress: Progress | None) -> Progress | None:
    """A progress function, whose exceptions end the run with a named error and a partial solution."""
    if progress is None:
        return None
    if not callable(progress):
        raise OptionError("progress", progress, "a function progress(t, until, stats)")
    asked = progress

    def tell(t: float, until: float, stats: Mapping[str, Any]) -> None:
        try:
            asked(t, until, stats)
        except Exception as error:
            raise SolveError(Outcome.PROGRESS, "", f"{type(error).__name__}: {error}", error) from error

    return tell
