"""Books of a step on the reduced form: what its components passed on and made, and the work that it took."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.states import STATES, Stored
from ephs.mechanics.tree.engine.tables import table_of
from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.semantics.bundle import Array
from ephs.solve.model import STORING

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.equations import Equations, ReducedState

__all__ = ["Booking"]


@final
class Booking:
    """The books of one mechanism's steps."""

    def __init__(self, equations: "Equations", paper: PaperStates) -> None:
        self._equations, self.paper = equations, paper
        t, m = equations.model.tables, equations.model.memory()
        kept = np.flatnonzero(t.kind == STORING)
        places = np.stack([kept, t.parameter_at[kept], t.read_x_at[kept]], axis=1)
        self.storages = table_of(Stored, np.hstack([t.address[kept, None], t.dims[kept], places]))
        self._memory = m.x, m.v, m.e, m.lam, m.f, m.c, m.jac, m.work
        self._last = np.zeros(0), np.zeros(0)
        self._outer = equations.reduced.attaching.outer

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
            outside = self._outer @ (end.heats - start.heats)[heats.plain]
            lost = work - float((after - before) @ led.mechanical + outside + flows @ heats.carried)
            self._last = end.q, after
        flows = heats.booked(flows, missed, lost)
        taken, made = heats.taken(start.heats, flows)
        heat = float(flows[heats.frictions].sum() + flows @ heats.carried)
        return replace(
            end, heats=np.where(heats.plain, end.heats, taken), books=start.books + np.concatenate([[heat, work], made])
        )

    def arrays(self) -> list[Any]:
        """All arrays of the tables that states are made from."""
        return self.paper.arrays()

    def energies(self, states: Sequence["ReducedState"]) -> tuple[Array, Array]:
        """(rows, point_size) all states of the scene's system, and (rows, components) the energies that they hold."""
        eq = self._equations
        q, r, heats = zip(*((state.q, state.r, state.heats) for state in states), strict=True)
        x = self.paper.rows(np.array(q), np.array(r), eq.heats.entropies(np.array(heats)))
        energies = np.zeros((len(states), len(eq.problem.descriptor.components)))
        t, fault = eq.model.tables, np.zeros(1, dtype=np.int64)
        status = STATES.compiled()["energies"](
            self.storages, t.read_x, t.parameters, eq.scal, x, *self._memory, energies, fault
        )
        eq.refuse(status, int(fault[0]))
        return x, energies

    def _energies(self, state: "ReducedState") -> Array:
        """(components,) stored energies in J."""
        return self._last[1] if self._last[0] is state.q else self.energies([state])[1][0]
