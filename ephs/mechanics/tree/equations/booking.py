"""Totals of a step on the reduced form, which components passed on and made, and its work; and records of states."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.heats import ROUNDING
from ephs.mechanics.tree.engine.states import STATES, StorageRow
from ephs.mechanics.tree.engine.tables import table_of
from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.linear.sums import grown
from ephs.semantics.stage import Table
from ephs.semantics.stage.calling import Bound
from ephs.semantics.systems.kept import once
from ephs.solve.equations.heats import held_between
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.records import STORING
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.result.record import RunRecord

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState


@final
class Booking:
    """Totals that a mechanism's steps sum up."""

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

    def step(
        self,
        start: "ReducedState",
        end: "ReducedState",
        flows: Array,
        work: float,
        passed: float = 0.0,
        *,
        missed: Array | None = None,
        stages: tuple[Array, Array, Array] | None = None,
        between: tuple["ReducedState", "ReducedState"] | None = None,
        refused: bool = True,
    ) -> "ReducedState":
        """The end of a step with heats and totals, see `Heats`, by sums that lose nothing to rounding.

        Parameters
        ----------
        end
            Its loops are closed.
        flows, missed
            (makers,) in J over the step, and by how much their quadrature may be off; None where it finds no more heat
            than is lost.
        work, passed
            By what drives, and heat to entropies that are not booked, in J over the step.
        stages
            As of `Heats.taken`.
        between
            Ends of a shorter step from the same start and of a longer one, between which components make their entropy.
        refused
            Whether a step is refused in which a component loses entropy.

        Raises
        ------
        SolveError
            The step is refused, or more heat was carried away than there is.
        """
        eq, heats = self._equations, self._equations.heats
        start = eq.accounts.opened(start)
        flows = heats.booked(flows, missed, self._lost(start, end, flows, work))
        change, made = heats.taken(start.heats, flows, stages)
        if between is not None:
            made = held_between(made, *(each.totals[TOTALS:] - start.totals[TOTALS:] for each in between))
        if refused:
            self._refuse(made, flows, start, end)
        heat = float(flows[heats.frictions].sum() + flows @ heats.carried)
        change = np.where(heats.plain, end.heats - start.heats, change)
        sums, at = np.concatenate([start.heats, start.totals]), start.heats.size
        added = np.concatenate([change, [heat, work, passed], made])
        sums, carry = grown(sums, start.account[eq.accounts.own :], added)
        account = np.concatenate([start.account[: eq.accounts.own], carry])
        return replace(end, heats=sums[:at], totals=sums[at:], account=account)

    def _lost(self, start: "ReducedState", end: "ReducedState", flows: Array, work: float) -> float | None:
        """Energy in J that is neither stored at the end, nor passed on by others than friction."""
        eq = self._equations
        if not eq.heats.frictions.size or np.isnan(start.account[0]):
            return None
        held = float(eq.engine.energy(end.q, end.r, end.heats)[:2].sum())
        before = float(start.account[0] + start.totals[1] - start.totals[0])
        return before + work - held - float(flows @ eq.heats.carried)

    def _refuse(self, made: Array, flows: Array, start: "ReducedState", end: "ReducedState") -> None:
        """Refuse a step in which a component lost entropy beyond rounding, in the direction of time."""
        eq = self._equations
        rounding = ROUNDING * eq.heats.most(start.heats, flows)
        lost = np.flatnonzero(np.sign(end.t - start.t) * made < -rounding)
        if lost.size:
            raise SolveError(Outcome.LAWLESS, str(eq.reduced.made[int(lost[0])]), "")

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
