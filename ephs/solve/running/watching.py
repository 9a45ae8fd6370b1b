"""Progress of a run: the defect of its energy balance, and the callback for it."""

from collections.abc import Callable, Mapping
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.ledger import ledgers
from ephs.solve.result.record import RunRecord

Progress = Callable[[float, float, Mapping[str, Any]], None]
"""Called with the time, the end, and statistics so far."""


@final
class Balance:
    """The energy balance since a first row (states, energies, and the first four sums of a `RunRecord`)."""

    def __init__(self, problem: Problem, x: Array, energies: Array, sums: Array) -> None:
        self._problem = problem
        self._first = (x.copy(), energies.copy(), sums[:4].copy())
        self._scale = 0.0

    def error(self, x: Array, energies: Array, sums: Array) -> float:
        """The defect now, relative to the largest K + |V − V₀| + |heat| + |work| so far."""
        rows = [np.array(pair) for pair in zip(self._first, (x, energies, sums[:4]), strict=True)]
        totals = ledgers(self._problem, RunRecord(np.zeros(2), rows[0], rows[1], np.pad(rows[2], ((0, 0), (0, 1)))))
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
