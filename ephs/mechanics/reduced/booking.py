"""Books of a step on the reduced form: what its components passed on and made, and the work that it took."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.reduced.paper import PaperStates
from ephs.mechanics.reduced.table_kernels import stored_energies
from ephs.semantics.bundle import Array

if TYPE_CHECKING:
    from ephs.mechanics.reduced.equations import Equations, ReducedState

__all__ = ["Booking"]


@final
class Booking:
    """The books of one mechanism's steps."""

    def __init__(self, equations: "Equations", paper: PaperStates) -> None:
        self._equations, self._paper, self._memory = equations, paper, equations.model.memory()
        self._last = np.zeros(0), np.zeros(0)

    def step(
        self, start: "ReducedState", end: "ReducedState", flows: Array, missed: Array, work: float
    ) -> "ReducedState":
        """The end of a step with heats and books, see `Heats`.

        Parameters
        ----------
        flows, missed
            (makers,) in J over the step, and by how much their quadrature may be off.
        work
            By what drives, in J over the step.
        """
        eq = self._equations
        heats, led, lost = eq.heats, eq.led, None
        if heats.frictions.size and not led.counting:
            before, after = self._energies(start), self._energies(end)
            lost = work - float((after - before) @ led.mechanical)
            self._last = end.q, after
        flows = heats.booked(flows, missed, lost)
        taken, made = heats.taken(start.heats, flows)
        heat = float(flows[heats.frictions].sum())
        return replace(end, heats=taken, books=start.books + np.concatenate([[heat, work], made]))

    def energies(self, states: Sequence["ReducedState"]) -> tuple[Array, Array]:
        """(rows, point_size) all states of the scene's system, and (rows, components) the energies that they hold."""
        eq = self._equations
        q, r, heats = zip(*((state.q, state.r, state.heats) for state in states), strict=True)
        x = self._paper.rows(np.array(q), np.array(r), eq.heats.entropies(np.array(heats)))
        energies = np.zeros((len(states), len(eq.problem.descriptor.components)))
        eq.refuse(*stored_energies(eq.model.tables, eq.scal, self._memory, x, energies))
        return x, energies

    def _energies(self, state: "ReducedState") -> Array:
        """(components,) stored energies in J."""
        return self._last[1] if self._last[0] is state.q else self.energies([state])[1][0]
