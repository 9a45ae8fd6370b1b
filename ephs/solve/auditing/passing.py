"""Oscillations so fast that steps pass over them: kept with their energy, at instants that say nothing of the motion.

An undamped method maps a rate to its opposite, or itself, where a step is many times longer than the oscillation, and
so do its halves and thirds: their differences show nothing, and energy is kept. Its energy in the result does show.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.curvature import curvature
from ephs.solve.auditing.resolution import STILL
from ephs.solve.auditing.rounding import trembling
from ephs.solve.equations.instant import instant, rates_read
from ephs.solve.equations.oscillations import oscillations
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import Problem

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

TURNED = 10.0
"""Angle in rad by which an oscillation may go on in a step at most: no method resolves one and a half turns."""
PLACES = 3
"""Number of pairs of instants that are looked at, of those that are farthest apart: steps are longest there."""


@final
@dataclass(frozen=True, slots=True)
class Passed:
    """Oscillations that steps pass over.

    Parameters
    ----------
    size
        Their energy as a part of the gross energies.
    instant
        Where it is largest.
    path, rate
        Storage of the one with the most energy, its angular frequency in rad/s.
    """

    size: float
    instant: int
    path: Path
    rate: float

    def hint(self, step: float | None) -> str:
        """End of an advice on constant steps, or on chosen ones (None)."""
        told = f"{1.0 / self.rate:.1g} s: steps pass over an oscillation of {self.rate:.3g} rad/s"
        return f" of {told}" if step else f", or max_step = {told}"


def passed_over(solution: "Solution", h: float, allowed: float) -> Passed | None:
    """Oscillations that steps of h s pass over, with energy before and after them; None where there are none.

    Energies above the allowed part of the gross energies are checked by the rates of all states: neither does a spring
    oscillate that is stretched without a force that moves it back, nor a mass that stretches none.
    """
    problem = solution.problem
    if problem is None or len(solution) < 2 or not _may_be(solution, h):
        return None
    worst: Passed | None = None
    scale = max(solution.ledgers.scale, trembling(solution) / STILL)  # what is less counts as at rest
    gaps = np.abs(np.diff(solution.t))
    wide = np.flatnonzero(gaps >= 0.5 * gaps.max())
    for i in wide[np.linspace(0, wide.size - 1, min(PLACES, wide.size)).astype(int)].tolist():
        for pulls in (lambda _: None, lambda k: _pull(solution, problem, k)):
            both = [oscillations(problem, problem.descriptor.pack(solution.state_at(k)), pulls(k)) for k in (i, i + 1)]
            held = [(of, np.where(of.rates * h > TURNED, of.energies, 0.0)) for of in both if of is not None]
            if len(held) < len(both):
                return None
            of, energies = min(held, key=lambda each: float(each[1].sum()))
            size, most = float(energies.sum()) / scale, int(np.argmax(energies))
            if not size > allowed:
                break
        if size > (worst.size if worst is not None else 0.0):
            worst = Passed(size, i + 1, of.springs[most], float(of.rates[most]))
    return worst


def _pull(solution: "Solution", problem: Problem, i: int) -> Array | None:
    """(effort_size,) rates of momenta at the i-th instant, in N or N m; of other states, too. None if not known."""
    d, state = problem.descriptor, solution.state_at(i)
    x = d.pack(state)
    try:
        found = instant(d, problem.reference, x, problem.inputs(float(solution.t[i]), state)).rates
    except (SolveError, np.linalg.LinAlgError):  # no finite numbers, or no balance: the finding stays
        return None
    rates, out = np.concatenate([found[slot.path] for slot in d.states]), np.zeros(d.effort_size)
    for slot, _ in d.storages:
        out[list(slot.efforts)] = rates[rates_read(slot)]
    return out


def _may_be(solution: "Solution", h: float) -> bool:
    """Whether the stiffest storage of the start would turn the lightest by so much in h s."""
    problem = solution.problem
    if problem is None:
        return False
    d = problem.descriptor
    x = d.pack(solution.state_at(0))
    parity = {i: slot.quantity.parity for slot in d.junctions for i in range(slot.efforts.start, slot.efforts.stop)}
    stiff = light = 0.0
    for slot, storage in d.storages:
        if not storage.environment and slot.efforts:
            size = float(np.abs(curvature(storage, d.point(slot, x), problem.reference)).sum(axis=1).max())
            if all(parity[i] < 0 for i in slot.efforts):
                light = max(light, size)
            else:
                stiff = max(stiff, size)
    return stiff * light * h**2 > TURNED**2
