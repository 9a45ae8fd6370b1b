"""The attached network about a point: flows and their derivatives."""

from typing import final

import numpy as np

from ephs.mechanics.tree.engine.attachment import attachment_of
from ephs.mechanics.tree.equations.laws import Laws
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.sweeps.balances import network_program
from ephs.semantics.bundle import Array

__all__ = ["Attached"]


@final
class Attached:
    """The network of one mechanism.

    Attributes
    ----------
    there
        Whether there is one.
    tie, tied
        As `ephs.mechanics.tree.sweeps.residuals` reads them: rates, temperatures, prescribed efforts and states, then
        increments of joints.
    """

    def __init__(self, reduced: Reduced, scal: Array, supply: Array) -> None:
        there, nodes = reduced.attaching, len(reduced.entropies) - len(reduced.attaching.network.states)
        net = there.network
        places = [
            *((0, place) for place in there.ports.tolist()),
            *((1, place) for place in net.nodes),
            *((2, 0) for _ in net.inputs),
            *((3, nodes + k) for k in range(len(net.states))),
            *((4, freedom) for freedom in there.bent.tolist()),
        ]
        self.there = bool(net.skew.size)
        self.tie = np.array(places, dtype=np.int64).ravel()
        self.tied = np.zeros((len(places), 2 + len(places)))
        self._count, self._net, self._theta = (
            (net.known, len(there.bent)),
            attachment_of(reduced, reduced.tables.address),
            float(scal[1]),
        )
        self._ports, self._nodes, self._states = there.ports, list(net.nodes), nodes
        self._slopes = np.zeros((net.known, len(places)))
        self._first = net.state_at
        self._q, self._s = np.zeros(reduced.coordinates), np.zeros(len(reduced.entropies))
        self._warmth, self._made = np.zeros(len(reduced.entropies)), np.zeros(len(reduced.made))
        place = self._net.integers, self._net.reals, reduced.tables.parameters, scal, supply
        calls = network_program().compiled()
        self._solve = calls["solve"].bind(*place, self._q, self._s, self._warmth, self._made)
        self._derive = calls["slopes"].bind(*place, self._slopes)

    @property
    def power(self) -> float:
        """Power in W of what is given, where `about` has been."""
        return float(self._net.part("power")[0])

    def states(self) -> tuple[Array, Array]:
        """((states,), (states, states)) rates of the states, and their derivatives by the states."""
        mine = slice(self._first, self._count[0])
        return -self.tied[mine, 0], -self._slopes[mine, mine]

    def about(self, q: Array, rates: Array, s: Array, warmth: Array, laws: Laws) -> tuple[int, int]:
        """Evaluate all of it; what it makes goes to the laws; (status, component)."""
        known, bent = self._count
        effort, flow = self._net.part("effort"), self._net.part("flow")
        effort[: self._ports.size] = rates[self._ports]
        self._q[:], self._s[:], self._warmth[:], self._made[:] = q, s, warmth, 0.0
        status = int(self._solve()) or int(self._derive())
        if status:
            return status, int(self._net.whole("fault")[0])
        laws.made[:] += self._made
        self.tied[:known, 0], self.tied[:known, 2:] = flow[:known], self._slopes
        point = [rates[self._ports], warmth[self._nodes], np.zeros(known), s[self._states :], np.zeros(bent)]
        point[2] = point[2][: known - sum(part.size for part in point[:2]) - point[3].size]
        self.tied[:, 1] = np.concatenate(point)
        first = self._ports.size
        taken = flow[first : first + len(self._nodes)]
        laws.warm(-float(taken @ (self._theta + warmth[self._nodes])))
        return 0, 0
