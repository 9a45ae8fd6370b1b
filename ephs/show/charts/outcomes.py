"""Outcome of a run, decided by thresholds against a reference motion."""

from enum import StrEnum

import numpy as np

from ephs.show.charts.reference import Motion
from ephs.show.charts.runs import Array

__all__ = ["ACCURATE", "BOUND", "ENERGY", "KEPT", "SILENT", "Outcome", "horizon", "judge"]

ACCURATE = 1e-2
"""Largest error of an accurate run, relative to the size of mechanism and motion, or of a rotation matrix's entry."""
ENERGY = 1e-2
"""Largest defect of the energy balance that is no drift, relative to what was turned over."""
KEPT = 0.5
"""Least part of the true motion's extent that an undamped motion has in the second half of the time."""
BOUND = 10.0
"""A body this many sizes of mechanism and motion away from their centre is lost."""
BLOWN = 100.0
"""A turnover of energy this many times the true one is not bounded."""
_NO_ENERGY = 1e-9


class Outcome(StrEnum):
    """Outcome of a run.

    ``ACCURATE``: the error at the end is at most `ACCURATE`.
    ``WRONG_BUT_BOUNDED``: the error is larger, and nothing of what follows shows.
    ``ENERGY_DRIFT``: besides, the energy balance was off by more than `ENERGY`.
    ``DAMPED``: besides, energy was lost that no ledger has, or the extent of the motion is less than `KEPT`.
    ``REFUSED``: the method stopped and said why, or took too long.
    ``DIVERGED``: the method said nothing, and the result is not finite, beyond `BOUND`, or its energy beyond `BLOWN`.
    ``FLAGGED``: the result is not accurate, or not known to be, and the run's audit has a finding.
    ``UNKNOWN``: a result that is finite, with nothing to compare it with.
    """

    ACCURATE = "accurate"
    WRONG_BUT_BOUNDED = "wrong but bounded"
    ENERGY_DRIFT = "energy drift"
    DAMPED = "damped"
    REFUSED = "refused"
    DIVERGED = "diverged"
    FLAGGED = "flagged"
    UNKNOWN = "not known"


SILENT = frozenset({Outcome.WRONG_BUT_BOUNDED, Outcome.ENERGY_DRIFT, Outcome.DAMPED, Outcome.DIVERGED})
"""Silent failures: the run succeeded, its audit found nothing, and the result is wrong."""


def judge(found: Motion, true: Motion) -> tuple[Outcome, float]:
    """The outcome of a motion that was computed to the end, and its error there; both motions at the same times."""
    error = float(found.off(true, true.length)[-1])
    if _lost(found, true):
        return Outcome.DIVERGED, error
    if error <= ACCURATE:
        return Outcome.ACCURATE, error
    drift = found.balance / max(true.turnover, found.turnover, _NO_ENERGY)
    if drift[-1] < -ENERGY:
        return Outcome.DAMPED, error
    if np.abs(drift).max() > ENERGY:
        return Outcome.ENERGY_DRIFT, error
    if _extent(found) < KEPT * _extent(true):
        return Outcome.DAMPED, error
    return Outcome.WRONG_BUT_BOUNDED, error


def horizon(found: Motion, true: Motion) -> float:
    """The last time in s up to which the error stayed below `ACCURATE`."""
    wrong = np.flatnonzero(~(found.off(true, true.length) <= ACCURATE))
    if not wrong.size:
        return float(found.t[-1])
    return float(found.t[wrong[0] - 1]) if wrong[0] else 0.0


def _lost(found: Motion, true: Motion) -> bool:
    finite = np.isfinite(found.position).all() and np.isfinite(found.rotation).all() and np.isfinite(found.turnover)
    if not finite:
        return True
    away = float(np.linalg.norm(found.position - true.centre, axis=-1).max())
    return away > BOUND * true.length or found.turnover > BLOWN * max(true.turnover, _NO_ENERGY)


def _extent(motion: Motion) -> float:
    """Extent of positions and rotations in the second half of the time."""
    half = slice(len(motion.t) // 2, None)
    spread: Array = np.ptp(motion.position[half], axis=0) / motion.length
    turned: Array = np.ptp(motion.rotation[half], axis=0)
    return float(max(spread.max(initial=0.0), turned.max(initial=0.0)))
