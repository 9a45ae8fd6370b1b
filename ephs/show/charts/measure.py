"""Work and precision of methods."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.mechanics.methods.registry import AUTO, METHODS
from ephs.mechanics.scene.model import Scene
from ephs.show.charts.peers import PEERS, PeerError, PeerRun
from ephs.show.charts.reference import PosesInTime, Reference, tight_reference
from ephs.show.charts.runs import Array, RunEnding, RunSetting, attempt

TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEPS = tuple(20 * 2**k for k in range(11))
"""Into how many steps the time is divided."""
FLOOR = 100.0
"""Errors below this many cross-checks of the reference are not resolved."""


@final
@dataclass(frozen=True, slots=True)
class Point:
    """One method at one setting.

    Parameters
    ----------
    method
        Its name; a peer's starts with that of its program.
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
    reference: Reference | None = None,
    repeats: int = 3,
    limit: float = 20.0,
    tolerances: Sequence[float] = TOLERANCES,
    steps: Sequence[int] = STEPS,
    peers: bool = True,
    note: Callable[[str], None] | None = None,
    enough: Callable[[Point], bool] | None = None,
) -> list[Point]:
    """Measure error, time and evaluations of every method over its settings.

    Parameters
    ----------
    methods
        Names of `METHODS` or of `PEERS`, or ``"auto"``; all but that unless given. Methods that can do both run over
        tolerances and over steps.
    reference
        What is true at ``until``; a tight run unless given.
    repeats
        Runs of which the median time is taken.
    limit
        Wall time in s for a method: one whose run took a quarter of it is not refined further.
    peers
        Whether other programs that are installed are measured too, where they can do the scene.
    note
        Called with the name of each method before it is measured.
    enough
        Called with each point: whether the method need not be refined further.
    """
    truth = tight_reference(scene, until) if reference is None else reference
    everything = [*(name for name, method in METHODS.items() if method.scenes), *(PEERS if peers else ())]
    points: list[Point] = []
    for name in everything if methods is None else methods:
        if note is not None:
            note(name)
        for settings in _settings(name, until, tolerances, steps):
            if name in PEERS:
                found = _foreign(scene, until, name, settings, truth, repeats, limit, told=methods is not None)
            else:
                found = _own(scene, until, name, settings, truth, repeats, limit)
            for point in found:
                points.append(point)
                if enough is not None and enough(point):
                    break
    return points


def _settings(name: str, until: float, tolerances: Sequence[float], steps: Sequence[int]) -> list[list[RunSetting]]:
    method = AUTO if name == "auto" else METHODS.get(name) or PEERS[name]
    found: list[list[RunSetting]] = []
    if method.adaptive:
        found.append([RunSetting("tolerance", value) for value in tolerances])
    if method.fixed:
        found.append([RunSetting("step", until / count) for count in steps])
    return found


def _own(
    scene: Scene, until: float, name: str, settings: list[RunSetting], truth: Reference, repeats: int, limit: float
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
            for _ in range(_more(repeats, first.wall, limit))
        ]
        runs = [run.solution.stats["integrate_s"] for run in [*rest, first] if run.solution is not None]
        stats, error = first.solution.stats, float(PosesInTime.of(first.solution).off(truth.motion)[-1])
        count = int(stats.get("evaluations", stats.get("iterations", 0)))
        defect = float(first.solution.energy_error[-1])
        point = _point(name, setting, error, float(np.median(runs)), count, int(stats["steps"]), defect, truth)
        audit = first.solution.audit
        yield point if audit.passed else replace(point, flagged=str(audit))
        if first.wall > limit / 4.0:
            return


def _foreign(
    scene: Scene,
    until: float,
    name: str,
    settings: list[RunSetting],
    truth: Reference,
    repeats: int,
    limit: float,
    *,
    told: bool,
) -> Iterator[Point]:
    try:
        run = PEERS[name].prepare(scene, until)
    except PeerError as error:  # of all programs those that can are shown; of the one that was asked for, why not
        if told:
            yield Point(name, settings[0], np.nan, np.nan, 0, 0, RunEnding.REFUSED, str(error))
        return
    for setting in settings:
        try:
            first: PeerRun = run(setting, limit)
            rest = [run(setting, limit) for _ in range(_more(repeats, first.seconds, limit))]
        except PeerError as error:
            yield Point(name, setting, np.nan, np.nan, 0, 0, error.ending, str(error))
            if error.ending is not RunEnding.FAILED:
                return
            continue
        seconds = float(np.median([each.seconds for each in [*rest, first]]))
        still: Array = np.zeros(1)
        end = PosesInTime(truth.motion.t[-1:], first.position[None], first.rotation[None], still, np.zeros((1, 2)), 0.0)
        error = float(end.off(_end(truth.motion))[0])
        yield _point(name, setting, error, seconds, first.evaluations, first.steps, first.defect, truth)
        if first.seconds > limit / 4.0:
            return


def _end(motion: PosesInTime) -> PosesInTime:
    last = slice(-1, None)
    t, position, rotation, balance, totals = (
        each[last] for each in (motion.t, motion.position, motion.rotation, motion.balance, motion.totals)
    )
    return PosesInTime(t, position, rotation, balance, totals, motion.turnover, motion.size)


def _more(repeats: int, wall: float, limit: float) -> int:
    """Number of further runs: none if the first took most of the available time."""
    return 0 if wall > limit / 4.0 else repeats - 1


def _point(
    name: str,
    setting: RunSetting,
    error: float,
    seconds: float,
    evaluations: int,
    steps: int,
    defect: float,
    truth: Reference,
) -> Point:
    floor = error < FLOOR * truth.cross_check
    if not np.isfinite(error):
        return Point(name, setting, np.nan, seconds, evaluations, steps, RunEnding.FAILED, "the result is not finite")
    return Point(name, setting, error, seconds, evaluations, steps, RunEnding.DONE, defect=defect, floor=floor)
