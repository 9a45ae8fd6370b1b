"""The components of one mechanism about a point: tables and memory of the staged program of laws."""

from typing import final

import numpy as np

from ephs.mechanics.tree.engine.laws import BUFFERS, laws_call
from ephs.mechanics.tree.engine.tables import Forces
from ephs.mechanics.tree.sweeps.edges import Law
from ephs.semantics.bundle import Array

__all__ = ["Laws"]


@final
class Laws:
    """Laws of the edges, storages of heat and conductions of one mechanism.

    Parameters
    ----------
    forces
        Tables of the components.
    makers
        How many components make entropy.
    scal
        (h, θ₀, π₀), as the components' kernels take it.

    Attributes
    ----------
    law
        (edges · width,): records of `Law`.
    warming, flow
        As the equations read them: (entropies, 3) and (conductions, 8).
    made
        (makers,) entropy a second, in W/K: that components make, of conductions what leaves their first store.
    """

    def __init__(self, forces: Forces, makers: int, scal: Array) -> None:
        entropies, conductions = forces.node.size, len(forces.conduction)
        self.law, self._s = np.zeros(len(forces.edge) * Law.real_width), np.zeros(entropies)
        self.warming, self.flow = np.zeros((entropies, 3)), np.zeros((conductions, 8))
        self.made, self._heat = np.zeros(makers), np.zeros(1)
        of, buffers = forces.tables(), [np.zeros(size) for size in BUFFERS.values()]
        self._call = laws_call().bind(
            of["acting"], self.law, of["node"], of["conduction"], forces.component, of["parameters"], scal,
            self._s, self.warming, self.flow, self.made, self._heat, *buffers,
        )  # fmt: skip

    @property
    def heat(self) -> float:
        """Power of all friction in W."""
        return float(self._heat[0])

    def warm(self, power: float) -> None:
        """Add the dissipation of attachments to the power of friction."""
        self._heat[0] += power

    def about(self, s: Array) -> tuple[int, int]:
        """Evaluate all components at entropies s, and where laws have their points; (status, component)."""
        self._s[:] = s
        fault = int(self._call())
        return fault % 64, fault // 64
