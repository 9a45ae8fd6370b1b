"""Records of states on the reduced form: the energies that they hold, and what was summed up to them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.states import STATES, StorageRow
from ephs.mechanics.tree.engine.tables import table_of
from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Table
from ephs.semantics.stage.calling import Bound
from ephs.semantics.systems.kept import once
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.records import STORING
from ephs.solve.result.record import RunRecord

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState


@final
class Booking:
    """Records of one mechanism."""

    def __init__(self, equations: "ReducedEquations", paper: PaperStates) -> None:
        self._equations, self.paper = equations, paper
        m = equations.model.memory()
        self._memory = m.x, m.v, m.e, m.lam, m.f, m.c, m.jac, m.work
        self.storages, self._makers = once(equations.reduced, "booked", self._booked)

    def _booked(self) -> tuple[Table[StorageRow], Index]:
        """The storages, and the numbers of the components that make entropy."""
        model, components = self._equations.model, self._equations.problem.descriptor.components
        t = model.tables
        kept = np.flatnonzero(t.kind == STORING)
        places = np.stack([kept, t.parameter_at[kept], t.read_x_at[kept]], axis=1)
        rows = np.hstack([model.resting(kept)[kept][:, None], t.dims[kept], places])
        number = {slot.path: i for i, slot in enumerate(components)}
        return table_of(StorageRow, rows), np.array([number[path] for path in self._equations.reduced.made], dtype=int)

    def arrays(self) -> list[Any]:
        """All arrays of the tables that states are made from."""
        return self.paper.arrays()

    def record_of(self, states: Sequence["ReducedState"], times: Array, least: Array) -> RunRecord:
        """`record` of states one by one."""
        eq = self._equations
        q = np.array([state.q for state in states]).reshape(len(states), eq.reduced.coordinates)
        rest = [np.concatenate([state.r, state.heats, state.totals]) for state in states]
        put = np.array([state.account[2:4] for state in states if state.account.size]).reshape(-1, 2)
        return self.record(times, q, np.array(rest).reshape(len(states), eq.size - eq.nv), put, least)

    def record(self, times: Array, q: Array, rest: Array, put: Array, least: Array) -> RunRecord:
        """Records of many states.

        Parameters
        ----------
        times, q, rest
            (rows,) in s, (rows, ·) elements, (rows, ·) rates, heats and totals.
        put
            (rows, 2) what corrections put in and the sum of its sizes, in J; of the last states, those with an account.
        least
            (rows,) least entropy production in the step before, in J/K.
        """
        eq = self._equations
        r, heats, totals = np.split(rest, [eq.n, eq.n + eq.ns], axis=1)
        x, energies = self.energies(q, r, heats)
        heat, work = totals[:, 0] + totals[:, 2], eq.led.work(times, energies, totals)
        eq.accounts.noted.note(times[times.size - len(put) :], put)
        energies[:, self._makers] = 0.0
        np.add.at(energies.T, self._makers, totals[:, TOTALS:].T)
        ledgers = np.stack([heat, work, work, totals[:, TOTALS:].sum(axis=1), least], axis=1)
        return RunRecord(times, x, energies, ledgers)

    def energies(self, q: Array, r: Array, heats: Array) -> tuple[Array, Array]:
        """(rows, point_size) all states of the scene's system, and (rows, components) the energies that they hold.

        Of rows of elements, rates and heats.
        """
        eq = self._equations
        x = self.paper.rows(q, np.ascontiguousarray(r), eq.heats.entropies(heats))
        energies, fault = np.zeros((len(x), len(eq.problem.descriptor.components))), np.zeros(1, dtype=np.int64)
        eq.refuse(self.weighed(x, energies, fault)(), int(fault[0]))
        return x, energies

    def weighed(self, x: Array, energies: Array, fault: Index) -> Bound:
        """A call that writes the energies at rows of all states, or the number of a storage that has none there."""
        t, scal = self._equations.model.tables, self._equations.scal
        return STATES.compiled()["energies"].bind(
            self.storages, t.read_x, t.parameters, scal, x, *self._memory, energies, fault
        )
