"""Work and precision of other programs, beside those of the methods of this package."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.peers.programs import PEERS
from benchmarks.peers.scene import PeerError, PeerRun
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.show.charts.measure import STEPS, TOLERANCES, Point, measured_point, repeats_after, settings_over
from ephs.show.charts.measure import work_precision as own_work_precision
from ephs.show.charts.reference import PosesInTime, ReferenceMotion, tight_reference
from ephs.show.charts.runs import RunEnding, RunSetting

__all__ = ["work_precision"]


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
    enough: Callable[[Point], bool] | None = None,
) -> list[Point]:
    """Error, time and evaluations of methods and of other programs, as `ephs.show.charts.work_precision` measures.

    Parameters
    ----------
    methods
        Names of `METHODS` or of `PEERS`; all unless given, but of the programs those that can do the scene.
    """
    truth = tight_reference(scene, until) if reference is None else reference
    everything = [*(name for name, method in METHODS.items() if method.scenes), *PEERS]
    points: list[Point] = []
    for name in everything if methods is None else methods:
        if name not in PEERS:
            points += own_work_precision(
                scene, until, [name], reference=truth, repeats=repeats, limit=limit, tolerances=tolerances, steps=steps,
                enough=enough,
            )  # fmt: skip
            continue
        for settings in settings_over(PEERS[name], until, tolerances, steps):
            for point in _refined(scene, until, name, settings, truth, repeats, limit, told=methods is not None):
                points.append(point)
                if enough is not None and enough(point):
                    break
    return points


def _refined(
    scene: Scene,
    until: float,
    name: str,
    settings: list[RunSetting],
    truth: ReferenceMotion,
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
            rest = [run(setting, limit) for _ in range(repeats_after(repeats, first.seconds, limit))]
        except PeerError as error:
            yield Point(name, setting, np.nan, np.nan, 0, 0, error.ending, str(error))
            if error.ending is not RunEnding.FAILED:
                return
            continue
        seconds = float(np.median([each.seconds for each in [*rest, first]]))
        still: Array = np.zeros(1)
        end = PosesInTime(truth.motion.t[-1:], first.position[None], first.rotation[None], still, np.zeros((1, 2)), 0.0)
        error = float(end.off(_last(truth.motion))[0])
        yield measured_point(name, setting, error, seconds, first.evaluations, first.steps, first.defect, truth)
        if first.seconds > limit / 4.0:
            return


def _last(motion: PosesInTime) -> PosesInTime:
    """A motion at its last instant alone."""
    each = (motion.t, motion.position, motion.rotation, motion.balance, motion.totals)
    t, position, rotation, balance, totals = (values[-1:] for values in each)
    return PosesInTime(t, position, rotation, balance, totals, motion.turnover, motion.size)
