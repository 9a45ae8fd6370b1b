"""Entropy production of irreversible components, checked in every step if their structure is not proved."""

from typing import final

import numpy as np

from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.primitives.primitives import Irreversible, Point, Storage
from ephs.semantics.systems.kept import once
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.running.stepping import Row

SHARE = 1e-12
"""Fraction of the entropies exchanged and produced in a step: smaller negative productions are rounding."""
ROUNDING = 8.0 * float(np.finfo(float).eps)
"""Fraction of the entropy produced so far, of which a step's production is a difference; and of the heat capacities:
a change of temperatures by rounding."""
DECADES = range(-12, 13)
"""Entropies in J/K for the search of a heat capacity."""


@final
class Production:
    """Watches the components whose verdict is only ``"searched"``.

    Parameters
    ----------
    sign
        −1 of a run backward in time.
    """

    def __init__(self, problem: Problem, sign: float = 1.0) -> None:
        d = problem.descriptor
        self._sign = sign
        self._makers, self._watched, self._entropies = once(d, "production", lambda: _watched(d))
        self._paths = [d.components[i].path for i in self._watched.tolist()]
        self.active = bool(self._paths)
        self._still = ROUNDING * _capacity(problem) if self.active else 0.0

    def start(self, row: Row) -> None:
        """The start of the next step."""
        self._last = row

    def step(self, t: float, row: Row) -> None:
        """Check a step that ended at t in s.

        Raises
        ------
        SolveError
            A component destroyed entropy in it.
        """
        last, energies = self._last, row.energies
        made = self._sign * (energies[self._watched] - last.energies[self._watched])
        exchanged = float(np.abs(row.x[self._entropies] - last.x[self._entropies]).sum())
        exchanged += float(np.abs(energies[self._makers] - last.energies[self._makers]).sum())
        allowed = SHARE * exchanged + ROUNDING * np.abs(energies[self._watched]) + self._still
        excess = made + allowed
        worst = int(np.argmin(excess))
        if excess[worst] < 0.0:
            size = f"{made[worst]:.3g} J/K in the step to t = {t:.9g} s"
            raise SolveError(Outcome.ENTROPY, str(self._paths[worst]), size)
        self._last = row


def _watched(d: Descriptor) -> tuple[Index, Index, Index]:
    """Numbers of the irreversible components, of those that are searched, and places of the entropies."""
    makes = [isinstance(one, Irreversible) for one in d.numbering.primitives]
    searched = [isinstance(one, Irreversible) and one.verdict != "proved" for one in d.numbering.primitives]
    makers, watched = (np.flatnonzero(np.array(each)[d.numbering.primitive]) for each in (makes, searched))
    hot = [slot.point.start for slot in d.states if slot.quantity.kind == "entropy"]
    return makers, watched, np.array(hot, dtype=np.int64)


def _capacity(problem: Problem) -> float:
    """Sum of the heat capacities ds/d(log θ) of what stores entropy, at the initial states, in J/K."""
    d = problem.descriptor
    x, total = problem.point, 0.0
    for slot, storage in d.storages:
        point = d.point(slot, x)
        for _, where, quantity in storage.bundle.items():
            if quantity.kind == "entropy" and not storage.environment:
                total += next(filter(None, (_share(storage, point, where, 10.0**k) for k in DECADES)), 0.0)
    return total


def _share(storage: Storage, point: Point, where: slice, step: float) -> float:
    """The capacity by a difference over an entropy in J/K; 0 where that changes the temperature too little, or ends."""
    v = np.zeros(storage.bundle.size)
    v[where] = step
    before, after = (float(storage.energy_gradient(x)[where][0]) for x in (point, storage.retract(point, v)))
    ratio = abs(np.log(after / before)) if before > 0.0 and np.isfinite(after) and after > 0.0 else 0.0
    return step / ratio if ratio > 1e-3 else 0.0
