"""Global error of constant steps: the run against one of fewer, longer steps.

A method of order p errs at a time t by C(t) hᵖ, where C holds how errors of steps have grown and cancelled until then.
So runs with steps h and k h are (kᵖ − 1) C hᵖ apart. What they are apart bounds the error of the shorter steps, so a
few long steps are enough where these are good: the first k is the largest for which they should be, by the errors of
single steps. Where runs are far apart C hᵖ is not all of the error, and k is made smaller; where they are at k = 2, a
run with h / 2 decides if the run could be right by its order, or longer steps fail; otherwise it counts as not
resolved. Long runs are held against one by an explicit method of high order first, which takes few steps: if it agrees,
nothing more is run.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import TINY
from ephs.solve.auditing.rounding import rounded
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import Interrupted, worst_entry
from ephs.solve.running.control import SLIVER

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

LEAST = 4
"""Least number of longer steps in a run."""
MARGIN = 3.0
"""Runs are expected to be this many times nearer than they may be: the errors of single steps may have grown."""
SHORTER = 3
"""Factor for shortening failed steps, down to two of the run's."""
FEW = 300
"""Number of steps below which a run by another method costs more to set up than it saves."""
INSTANTS = 16
"""Number of times for comparison with a run by another method."""
SHARE = 2
"""Largest number of the run's steps per step of the other method."""


@final
@dataclass(frozen=True, slots=True)
class Again:
    """Further runs of the same problem.

    Parameters
    ----------
    coarser
        With constant steps of so many s, up to a time in s.
    independent
        By an explicit method of high order with steps of its own, so many at most, kept at some times in s; None where
        that is not cheaper.
    """

    coarser: Callable[[float, float], "Solution"]
    independent: Callable[[Array, int], "Solution"] | None


@final
@dataclass(frozen=True, slots=True)
class GlobalError:
    """The estimated error of a run.

    Parameters
    ----------
    size
        In lengths of the mechanism or rad, of energies, heat and work in parts of the gross energies.
    instant
        Index of the time where it is largest.
    path
        The body or the storage that is off most; None of heat and work.
    resolved
        Whether it is of the method's order, so that shorter steps are known to help.
    """

    size: float
    instant: int
    path: Path | None
    resolved: bool

    def shorter(self, h: float, order: int, allowed: float) -> str:
        """End of the advice to take shorter steps than h s by a method of an order; empty of an allowed error."""
        if self.size <= allowed:
            return ""
        if not self.resolved:
            return f" of {0.25 * h:.2g} s or less: a step twice as long gives another motion"
        return f" of {0.9 * h * (allowed / self.size) ** (1.0 / order):.2g} s"


def global_error(
    solution: "Solution", order: int, h: float, summed: Callable[[], float], allowed: float, again: Again
) -> GlobalError | None:
    """The error of a run with constant steps of h s, by one with longer steps or another method; None where these fail.

    Parameters
    ----------
    summed, allowed
        Gives the sum of the errors of single steps, where it is asked for; the largest error that is allowed.
    """
    steps, times = int(solution.stats["steps"]), 2.0**order
    independent = again.independent
    if independent is not None and steps > FEW:
        kept = solution.t[np.unique(np.linspace(0, len(solution) - 1, INSTANTS).astype(int))]
        found = _distance(solution, lambda: independent(kept, steps // SHARE))
        if found is not None and found[0] <= allowed:
            return GlobalError(*found, resolved=True)
    wanted = (allowed / (MARGIN * max(summed(), TINY))) ** (1.0 / order)
    k = max(2, int(min(wanted, steps // LEAST)))
    end = float(solution.t[-1])
    while True:
        found = _distance(solution, lambda h=k * h: again.coarser(h, end))
        size, instant, path = found or (np.inf, 0, None)
        if size <= allowed:
            return GlobalError(size / (float(k) ** order - 1.0), instant, path, resolved=True)
        if k == 2:
            break
        k = max(2, k // SHORTER)
    finer = None
    if found is None or size <= allowed * (times - 1.0):  # the run could still be right, by its order
        finer = _distance(solution, lambda: again.coarser(0.5 * h, end))
    if finer is not None and finer[0] <= allowed:
        return GlobalError(finer[0] * times / (times - 1.0), *finer[1:], resolved=True)
    found = found or finer
    return GlobalError(*found, resolved=False) if found is not None else None


def energy_error(solution: "Solution", order: int, h: float, again: Again) -> GlobalError | None:
    """Largest error of a stored energy, relative to the gross energies, of a run with constant steps of h s.

    By a run with half the step; None where that fails.
    """
    met = _met(solution, lambda: again.coarser(0.5 * h, float(solution.t[-1])))
    if met is None:
        return None
    (other, mine, its), times, found = met, 2.0**order, list[GlobalError]()
    for path, a in solution.ledgers.storages.items():
        b = other.ledgers.storages[path]
        off = np.nan_to_num(np.abs((a[mine] - a[0]) - (b[its] - b[0])), nan=np.inf) / solution.ledgers.scale
        worst = int(np.argmax(off))
        found.append(GlobalError(float(off[worst]) * times / (times - 1.0), int(mine[worst]), path, resolved=True))
    return max(found, key=lambda each: each.size, default=None)


def _met(one: "Solution", run: Callable[[], "Solution"]) -> "tuple[Solution, Index, Index] | None":
    """The solution of a run, and the indices of the common times in a solution and in that one.

    None where the run fails, or there are none.
    """
    try:
        other = run()
    except Interrupted:
        raise
    except Exception:  # no solution with these steps, or an input that fails between the former ones
        return None
    near = SLIVER * abs(one.t[-1] - one.t[0])
    at = np.clip(np.searchsorted(one.t, other.t - near), 0, len(one) - 1)
    common = np.abs(one.t[at] - other.t) <= near
    return (other, at[common], np.flatnonzero(common)) if common.any() else None


def _distance(one: "Solution", run: Callable[[], "Solution"]) -> tuple[float, int, Path | None] | None:
    """Distance of a solution from that of a run at their common times: size, time, body.

    None where the run fails.
    """
    problem, met = one.problem, _met(one, run)
    if problem is None or met is None:
        return None
    other, mine, its = met
    found: list[tuple[float, int, Path | None]] = []
    bodies = [slot.path for slot in problem.descriptor.states if slot.quantity.kind == "pose"]
    shifts: list[tuple[Array, Path | None]] = [
        (apart(one.states[path][mine], other.states[path][its], problem.length), path) for path in bodies
    ]
    for name in ("heat", "work"):
        a, b = getattr(one.ledgers, name), getattr(other.ledgers, name)
        off = np.abs((a[mine] - a[0]) - (b[its] - b[0]))
        rounding = rounded(one) if off.any() else 0.0  # which is all that there is of bodies at rest
        shifts.append((np.where(off <= rounding, 0.0, off / one.ledgers.scale), None))
    for shift, path in shifts:
        worst = worst_entry(shift)
        found.append((float(np.nan_to_num(shift[worst], nan=np.inf)), int(mine[worst]), path))
    return max(found, key=lambda each: each[0])


def apart(one: Array, other: Array, length: float) -> Array:
    """(n,) distances of (n, 7) poses: in parts of a length, or the angles in rad between them."""
    moved = np.linalg.norm(one[..., 4:] - other[..., 4:], axis=-1) / length
    chord = np.minimum(
        np.linalg.norm(one[..., :4] - other[..., :4], axis=-1), np.linalg.norm(one[..., :4] + other[..., :4], axis=-1)
    )
    return np.maximum(moved, 4.0 * np.arcsin(np.minimum(1.0, 0.5 * chord)))
