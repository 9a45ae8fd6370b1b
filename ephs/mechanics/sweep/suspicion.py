"""Members of an ensemble that may violate a law of their audit: they are run again individually, with the whole audit.

What is looked at is cheap beside a member's run, and stricter than the audit: the balance of energy at a few of its
instants, the entropy made in its steps, and at constant steps the distance from a run with longer ones.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.bundle import Array
from ephs.solve.auditing.audit import MOTION, Bounds
from ephs.solve.auditing.growth import apart

__all__ = ["LONGER", "Suspicion"]

LONGER = 4
"""Length of comparison steps in constant steps."""
INSTANTS = 5
"""Number of instants at which a member's energies are checked, with the first and the last."""
ROUNDING = 1e-12
"""Rounding of an energy balance, relative to the energies."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """Reference values of the audit of an ensemble's members.

    Parameters
    ----------
    equations
        Filled with the numbers of the member that is looked at.
    bounds
        What its audit allows.
    """

    equations: Equations
    bounds: Bounds

    def of(
        self,
        start: ReducedState,
        put: Array,
        q: Array,
        y: Array,
        end: ReducedState,
        least: float,
        longer: Callable[[], ReducedState],
    ) -> bool:
        """Whether a member has to be run on its own.

        Parameters
        ----------
        put
            (n,) energies in J that corrections put in.
        q, y
            (n, …) joints' elements and rates, entropies and ledgers that were kept.
        least
            The least entropy in J/K that a component made in a step.
        longer
            The end of a run with constant steps that are `LONGER` times as long.
        """
        n, ns = self.equations.n, self.equations.ns
        chosen = np.unique(np.linspace(0, len(q) - 1, INSTANTS).astype(int)).tolist() if len(q) else []
        kept = [ReducedState(start.t, q[i], y[i, :n], y[i, n : n + ns], y[i, n + ns :]) for i in chosen]
        x, energies = self.equations.booking.energies([start, *kept, end])
        totals = np.array([state.totals for state in (start, *kept, end)])
        held = energies * self.equations.led.mechanical
        changes = held - held[0]
        heat, work = totals[:, 0], totals[:, 1]
        gross = float(np.max(np.abs(changes).sum(axis=1) + np.abs(heat) + np.abs(work)))
        defect = float(np.max(np.abs(changes.sum(axis=1) + heat - work)))
        if not defect <= self.bounds.energy * gross + ROUNDING * float(np.abs(held).sum(axis=1).max()):
            return True
        plain = float(np.max(np.abs([*put, *end.account[2:3]]), initial=0.0))
        if least < 0.0 or not plain <= self.bounds.accuracy * gross:
            return True
        if self.bounds.step is None:
            return False
        other, _ = self.equations.booking.energies([longer()])
        descriptor, length = self.equations.problem.descriptor, self.equations.problem.length
        poses = [slot.point for slot in descriptor.states if slot.quantity.kind == "pose"]
        return not all(float(apart(x[-1, at], other[0, at], length)) <= MOTION for at in poses)
