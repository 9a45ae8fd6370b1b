"""One run under limits: its solution, or its outcome and message."""

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.registry import MethodEntry
from ephs.mechanics.runs.simulate import simulate
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System
from ephs.solve.auditing.findings import CostWarning
from ephs.solve.methods.own import Method
from ephs.solve.posing.errors import Interrupted, SimulationError
from ephs.solve.posing.errors import Outcome as Failure
from ephs.solve.result.solution import Solution

MOST_STEPS = 500_000
"""Default limit of one run."""


_REFUSALS = (Failure.INCONSISTENT, Failure.UNDETERMINED, Failure.PYTHON)


class RunEnding(StrEnum):
    """End of a run."""

    DONE = "done"
    REFUSED = "refused"  # at every setting
    FAILED = "failed"  # at this setting
    SLOW = "took too long"
    LEAKED = "unexpected exception"


@final
@dataclass(frozen=True, slots=True)
class RunSetting:
    """Setting of a run: a tolerance, rtol = atol, or a constant step in s."""

    kind: str
    value: float

    def __str__(self) -> str:
        return f"tol {self.value:.0e}" if self.kind == "tolerance" else f"h = {self.value:.3g} s"

    def options(self) -> dict[str, Any]:
        """Options of `ephs.simulate`."""
        return {"rtol": self.value, "atol": self.value} if self.kind == "tolerance" else {"step": self.value}


@final
@dataclass(frozen=True, slots=True, eq=False)
class ChartRun:
    """A solution, or None; how the run ended, its message, and the wall time in s of everything."""

    solution: Solution | None
    ending: RunEnding
    message: str
    wall: float


class _TooLong(Exception):
    """Raised from inside a run to stop it."""


class _TimeLimit:
    """Stops a run at its limit of processor time, which other programs do not shorten. It starts with the first
    progress report: kernels are compiled before that."""

    def __init__(self, limit: float) -> None:
        self.begin, self.limit, self.fired = time.perf_counter(), limit, False
        self.alive: float | None = None

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.begin

    def __call__(self, t: float, until: float, stats: Mapping[str, Any]) -> None:
        now = time.process_time()
        if self.alive is None:
            self.alive = now
        elif now - self.alive > self.limit:
            self.fired = True
            when = f"{self.limit:g} s of processor time were over at t = {t:.3g} of {until:g} s"
            raise _TooLong(f"{RunEnding.SLOW}: {when}")


def attempt(
    model: Scene | System,
    until: float,
    method: str | Method | MethodEntry,
    setting: RunSetting,
    *,
    limit: float,
    save_at: Array | None = None,
    max_steps: int = MOST_STEPS,
    options: Mapping[str, Any] | None = None,
) -> ChartRun:
    """Run a model once; failures are returned as values.

    Parameters
    ----------
    limit
        Processor time in s after which the run is stopped.
    save_at
        Times that are kept; the end alone unless given.
    options
        Further options of `ephs.simulate`.
    """
    watch, told = _TimeLimit(limit), list[warnings.WarningMessage]()
    times = np.array([until]) if save_at is None else save_at
    try:
        with warnings.catch_warnings(record=True) as told, np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # overflow before a failure is part of the failure
            warnings.simplefilter("always", CostWarning)
            solution = simulate(
                model,
                until,
                method=method,
                save_at=times,
                max_steps=max_steps,
                progress=watch,
                audit="off",  # errors are measured against a reference
                **setting.options(),
                **(options or {}),
            )
        return ChartRun(solution, RunEnding.DONE, "", watch.spent)
    except Interrupted as error:
        if not watch.fired:
            raise KeyboardInterrupt from error
        ending, message = RunEnding.FAILED, str(error)
    except SimulationError as error:
        if isinstance(error.__cause__, _TooLong):
            ending, message = RunEnding.SLOW, str(error.__cause__)
        else:
            ending, message = (RunEnding.REFUSED if error.outcome in _REFUSALS else RunEnding.FAILED), str(error)
    except Exception as error:  # a chart of failures survives all exceptions, internal ones included
        spoken = type(error).__module__.startswith("ephs.")
        ending = RunEnding.REFUSED if spoken else RunEnding.LEAKED
        message = str(error) if spoken else f"{type(error).__name__}: {error}"
    if watch.fired and ending is not RunEnding.SLOW:  # a method that converted it to a failure of its own
        ending, message = RunEnding.SLOW, f"{RunEnding.SLOW}: {message}"
    if ending is RunEnding.SLOW:
        message = "; ".join([message, *(str(each.message) for each in told)])
    return ChartRun(None, ending, message, watch.spent)
