"""Outcome of a run, decided by thresholds against a reference motion."""

from enum import StrEnum

import numpy as np

from ephs.show.charts.reference import PosesInTime
from ephs.show.charts.runs import Array, RunSetting
from ephs.solve.auditing.audit import MANY_TIMES, MOTION

ACCURATE = 1e-2
"""Error at which digits of a motion end."""
RIGHT = MOTION
"""Largest error of a right run at constant steps, what their audit allows: a part of the size of mechanism and motion,
an entry of a rotation matrix, a part of the energies turned over."""
AMPLIFIED = 10.0
"""Allowed error of a right run, as a multiple of the effect of changing the data by the tolerance."""
TIMES = MANY_TIMES * AMPLIFIED
"""Largest error of a right run at chosen steps, in tolerances, where the motion amplifies nothing and steps are few:
what the audit allows to the defect of energy, times a growth of errors that it does not see. Where there are more
steps, one tolerance a step; where the motion amplifies, so much more; at most `RIGHT`."""
CONDITION = RIGHT / 1e-3
"""A motion is judged up to the last time to which it changes by less than this many times a relative change of its
data: to there, data of three digits make it right."""
ENERGY = 1e-2
"""Largest defect of the energy balance without drift, relative to the turnover."""
KEPT = 0.5
"""Least part of the true motion's extent that an undamped motion has in the second half of the time."""
BOUND = 10.0
"""A body this many sizes of mechanism and motion away from their centre is lost."""
BLOWN = 100.0
"""Energy turnover, relative to the true one, above which a motion counts as unbounded."""
_NO_ENERGY = 1e-9


class ChartOutcome(StrEnum):
    """Outcome of a run.

    ``RIGHT``: the error where the motion is judged is at most what `right` says.
    ``WRONG_BUT_BOUNDED``: the error is larger, and nothing of what follows shows.
    ``ENERGY_DRIFT``: besides, the energy balance was off by more than `ENERGY`.
    ``DAMPED``: besides, energy was lost that no ledger has, or the extent of the motion is less than `KEPT`.
    ``REFUSED``: the method stopped and said why.
    ``SLOW``: the chart stopped it, because it took too long.
    ``DIVERGED``: the method said nothing, and the result is not finite, beyond `BOUND`, or its energy beyond `BLOWN`.
    ``FLAGGED``: the result is not right, or not known to be, and the run's audit has a finding.
    ``UNKNOWN``: a result that is finite, with nothing to compare it with.
    """

    RIGHT = "right"
    WRONG_BUT_BOUNDED = "wrong but bounded"
    ENERGY_DRIFT = "energy drift"
    DAMPED = "damped"
    REFUSED = "refused"
    SLOW = "took too long"
    DIVERGED = "diverged"
    FLAGGED = "flagged"
    UNKNOWN = "not known"


SILENT = frozenset(
    {ChartOutcome.WRONG_BUT_BOUNDED, ChartOutcome.ENERGY_DRIFT, ChartOutcome.DAMPED, ChartOutcome.DIVERGED}
)
"""Silent failures: the run succeeded, its audit found nothing, and the result is wrong."""


def right(setting: RunSetting, condition: float, steps: int) -> float:
    """The largest error of a right run of so many steps at a setting, where the motion has this condition."""
    if setting.kind == "step":
        return RIGHT
    return min(RIGHT, setting.value * max(TIMES, steps, AMPLIFIED * condition))


def judge(found: PosesInTime, true: PosesInTime, allowed: float = RIGHT) -> tuple[ChartOutcome, float]:
    """The outcome of a complete motion, and its error at the end; both motions at the same times.

    The error is that of positions and rotations, or of heat and work, whichever is larger.
    """
    error = float(np.maximum(found.off(true, true.length), found.misbooked(true))[-1])
    if _lost(found, true):
        return ChartOutcome.DIVERGED, error
    if error <= allowed:
        return ChartOutcome.RIGHT, error
    drift = found.balance / max(true.turnover, found.turnover, _NO_ENERGY)
    if drift[-1] < -ENERGY:
        return ChartOutcome.DAMPED, error
    if np.abs(drift).max() > ENERGY:
        return ChartOutcome.ENERGY_DRIFT, error
    if _extent(found) < KEPT * _extent(true):
        return ChartOutcome.DAMPED, error
    return ChartOutcome.WRONG_BUT_BOUNDED, error


def horizon(found: PosesInTime, true: PosesInTime) -> float:
    """The last time in s up to which the error stayed below `ACCURATE`."""
    wrong = np.flatnonzero(~(found.off(true, true.length) <= ACCURATE))
    if not wrong.size:
        return float(found.t[-1])
    return float(found.t[wrong[0] - 1]) if wrong[0] else 0.0


def _lost(found: PosesInTime, true: PosesInTime) -> bool:
    finite = np.isfinite(found.position).all() and np.isfinite(found.rotation).all() and np.isfinite(found.turnover)
    if not finite:
        return True
    away = float(np.linalg.norm(found.position - true.centre, axis=-1).max())
    return away > BOUND * true.length or found.turnover > BLOWN * max(true.turnover, _NO_ENERGY)


def _extent(motion: PosesInTime) -> float:
    """Extent of positions and rotations in the second half of the time."""
    half = slice(len(motion.t) // 2, None)
    spread: Array = np.ptp(motion.position[half], axis=0) / motion.length
    turned: Array = np.ptp(motion.rotation[half], axis=0)
    return float(max(spread.max(initial=0.0), turned.max(initial=0.0)))
