"""Prescribed motions of joints in joint coordinates: rates, displacements and accelerations at a time."""

from dataclasses import replace
from typing import final

import numpy as np

from ephs.mechanics.tree.equations.state import ReducedState
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.semantics.bundles.bundle import Array


@final
class Prescribed:
    """The motion laws of one mechanism's joints.

    Attributes
    ----------
    freedoms
        (k,) their places among the tree's rates.
    changing
        Whether one of the rates changes with time.
    lead
        (tree's degrees of freedom,) accelerations, zeros for other joints, at the time that was placed last.
    """

    def __init__(self, reduced: Reduced) -> None:
        t = reduced.tables
        led = [(i, edge.motion) for i, edge in enumerate(reduced.edges[: reduced.links]) if edge.motion is not None]
        self._laws = [law for _, law in led]
        self._elements = np.array([int(t.q_at[i]) for i, _ in led], dtype=int)
        self.freedoms = np.array([int(t.r_at[i]) for i, _ in led], dtype=int)
        self.changing = not all(law.constant for law in self._laws)
        self.lead = np.zeros(reduced.freedoms)

    def place(self, t: float) -> None:
        """Put the accelerations at t s into ``lead``."""
        if self.changing:
            self.lead[self.freedoms] = [law.acceleration(t) for law in self._laws]

    def rates(self, t: float) -> Array:
        """(k,) at t s."""
        return np.array([law.rate(t) for law in self._laws])

    def displaced(self, start: float, end: float) -> Array:
        """(k,) changes of the coordinates between two times in s."""
        return np.array([law.displacement(end) - law.displacement(start) for law in self._laws])

    def followed(self, base: ReducedState, end: ReducedState) -> ReducedState:
        """The end of a step from ``base`` with coordinates and rates of these joints as the laws say."""
        if not self.changing:
            return end
        q, r = end.q.copy(), end.r.copy()
        q[self._elements] = base.q[self._elements] + self.displaced(base.t, end.t)
        r[self.freedoms] = self.rates(end.t)
        return replace(end, q=q, r=r)
