"""Work and precision of methods."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, final

import numpy as np

from ephs.mechanics.methods.registry import AUTO, METHODS
from ephs.mechanics.scene.model import Scene
from ephs.show.charts.reference import PosesInTime, ReferenceMotion, tight_reference
from ephs.show.charts.runs import RunEnding, RunSetting, attempt

TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEPS = tuple(20 * 2**k for k in range(11))
"""Into how many steps the time is divided."""
FLOOR = 100.0
"""Errors below this many cross-checks of the reference are not resolved."""


class Measurable(Protocol):
    """A method of this package or of another program: whether it chooses its steps, and takes constant ones."""

    @property
    def adaptive(self) -> bool: ...
    @property
    def fixed(self) -> bool: ...


@final
@dataclass(frozen=True, slots=True)
class Point:
    """One method at one setting.

    Parameters
    ----------
    method
        Its name; that of another program's method starts with the program's.
    setting
        Tolerance or step.
    error
        Largest deviation of a component of a position, in m, or of a rotation matrix at the end; NaN without a result.
    seconds
        Median over the repeats of the time of integration.
    evaluations
        Of the accelerations, or iterations where the method solves equations; 0 where it does not tell.
    outcome, message
        How the run ended, and what it told its user.
    defect
        Of the balance of energy at the end, relative to what was turned over; NaN where it is not known.
    floor
        Whether the error is too near that of the reference to be known.
    flagged
        Findings of the run's audit, which refuses the result unless told otherwise; empty where there are none.
    """

    method: str
    setting: RunSetting
    error: float
    seconds: float
    evaluations: int
    steps: int
    outcome: RunEnding
    message: str = ""
    defect: float = np.nan
    floor: bool = False
    flagged: str = ""

    @property
    def tolerance(self) -> float:
        """The requested tolerance; 0 with constant steps."""
        return self.setting.value if self.setting.kind == "tolerance" else 0.0


def work_precision(
    scene: Scene,
    until: float,
    methods: Sequence[str] | None = None,
    *,
    reference: ReferenceMotion | None = None,
    repeats: int = 3,
    limit: float = 20.0,
    tolerances: Sequence[float] = TOLERANCES,
    steps: Sequence[int] = STEPS,
    note: Callable[[str], None] | None = None,
    enough: Callable[[Point], bool] | None = None,
) -> list[Point]:
    """Measure error, time and evaluations of every method over its settings.

    Parameters
    ----------
    methods
        Names of `METHODS`, or ``"auto"``; all but that unless given. Methods that can do both run over tolerances and
        over steps.
    reference
        What is true at ``until``; a tight run unless given.
    repeats
        Runs of which the median time is taken.
    limit
        Wall time in s for a method: one whose run took a quarter of it is not refined further.
    note
        Called with the name of each method before it is measured.
    enough
        Called with each point: whether the method need not be refined further.
    """
    truth = tight_reference(scene, until) if reference is None else reference
    everything = [name for name, method in METHODS.items() if method.scenes]
    points: list[Point] = []
    for name in everything if methods is None else methods:
        if note is not None:
            note(name)
        method = AUTO if name == "auto" else METHODS[name]
        for settings in settings_over(method, until, tolerances, steps):
            for point in _refined(scene, until, name, settings, truth, repeats, limit):
                points.append(point)
                if enough is not None and enough(point):
                    break
    return points


def settings_over(
    method: Measurable, until: float, tolerances: Sequence[float], steps: Sequence[int]
) -> list[list[RunSetting]]:
    """Settings of a method from coarse to fine: a list over tolerances, a list over steps, as far as it has them."""
    found: list[list[RunSetting]] = []
    if method.adaptive:
        found.append([RunSetting("tolerance", value) for value in tolerances])
    if method.fixed:
        found.append([RunSetting("step", until / count) for count in steps])
    return found


def _refined(
    scene: Scene,
    until: float,
    name: str,
    settings: list[RunSetting],
    truth: ReferenceMotion,
    repeats: int,
    limit: float,
) -> Iterator[Point]:
    both = np.array([0.0, until])
    for setting in settings:
        first = attempt(scene, until, name, setting, limit=limit, save_at=both)
        if first.solution is None:
            yield Point(name, setting, np.nan, np.nan, 0, 0, first.ending, first.message)
            if first.ending is not RunEnding.FAILED:  # a finer setting changes nothing, or takes even longer
                return
            continue
        if setting is settings[0] and first.wall > limit / 4.0:  # kernels may have been compiled
            first = attempt(scene, until, name, setting, limit=limit, save_at=both)
            if first.solution is None:
                return
        rest = [
            attempt(scene, until, name, setting, limit=limit, save_at=both)
            for _ in range(repeats_after(repeats, first.wall, limit))
        ]
        runs = [run.solution.stats["integrate_s"] for run in [*rest, first] if run.solution is not None]
        stats, error = first.solution.stats, float(PosesInTime.of_solution(first.solution).off(truth.motion)[-1])
        count = int(stats.get("evaluations", stats.get("iterations", 0)))
        defect = float(first.solution.energy_error[-1])
        point = measured_point(name, setting, error, float(np.median(runs)), count, int(stats["steps"]), defect, truth)
        audit = first.solution.audit
        yield point if audit.passed else replace(point, flagged=str(audit))
        if first.wall > limit / 4.0:
            return


def repeats_after(repeats: int, wall: float, limit: float) -> int:
    """Number of further runs: none if the first took a quarter of the time of its method."""
    return 0 if wall > limit / 4.0 else repeats - 1


def measured_point(
    name: str,
    setting: RunSetting,
    error: float,
    seconds: float,
    evaluations: int,
    steps: int,
    defect: float,
    truth: ReferenceMotion,
) -> Point:
    """The point of a finished run; a failure if its error is not finite."""
    floor = error < FLOOR * truth.cross_check
    if not np.isfinite(error):
        return Point(name, setting, np.nan, seconds, evaluations, steps, RunEnding.FAILED, "the result is not finite")
    return Point(name, setting, error, seconds, evaluations, steps, RunEnding.DONE, defect=defect, floor=floor)
