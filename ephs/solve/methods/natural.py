"""The natural method: every component discretised on its own; energy and holonomic relations exact, friction included.

It has Gauss stages. With one, of order 2, a component's relation over a step is all there is; with several, what the
stages miss of it is put in as one term a component (see `stages`), so that discretising commutes with composing for any
number. A composition of steps of order 2 would have to step backwards through dissipation.

The state of the method is a value; advancing it is compiled, and gives one row of results a step.
"""

from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.kernel_table import RAISED
from ephs.semantics.linear.sparse import sparse_lu
from ephs.semantics.spaces.rank import TINY
from ephs.solve.equations.model import Model
from ephs.solve.equations.sparse import Index, order
from ephs.solve.methods.analysis import (
    AS_BEFORE,
    AT_START,
    DEFECT,
    SHRUNK,
    WITHIN,
    Decided,
    dependent_rows,
    entries_at,
    null_unknown,
)
from ephs.solve.methods.blame import contradicted, diverged
from ephs.solve.methods.collocation import moments
from ephs.solve.methods.guesses import BEFORE
from ephs.solve.methods.newton import natural_program
from ephs.solve.methods.records import COMPONENT, DIVERGED, DONE, INCONSISTENT, Memory, Order, OrderOf
from ephs.solve.methods.residuals import FAULTS
from ephs.solve.methods.scheme import gauss
from ephs.solve.methods.spread import closing_of, groups_of, memory_of
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.result.record import RunRecord
from ephs.solve.running.snapshot import Snapshot, parts

SETTLING = 16
"""Steps after a change of order until the next: the values at the change itself may be exceptional."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class NaturalState:
    """Present state of the method.

    Parameters
    ----------
    x
        (point_size,) the states.
    z
        (stages, unknowns) the unknowns of the last step.
    previous
        (`BEFORE` · stages, unknowns) those of the steps before, latest first, stage after stage, from which the next
        are guessed.
    sums
        (4 + components,): heat, energy supplied, exergy supplied, entropy made; entropy made by each component.
    """

    x: Array
    z: Array
    previous: Array
    sums: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """Results of some steps, one row each, and the cause of an early stop.

    Parameters
    ----------
    rows
        Times count from the start of the first step.
    cut
        How many of the steps were taken in parts.
    """

    rows: RunRecord
    iterations: int
    failure: SolveError | None
    cut: int = 0

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return int(self.rows.t.size)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Loop:
    """The compiled loop over steps, bound to arrays of its own: a state, (h, θ₀, π₀), inputs, and rows of results."""

    order: Order
    state: tuple[Array, ...]
    scal: Array
    inputs: Array
    rows: tuple[Array, Array, Array]
    outcome: Index
    call: Any

    def run(self, state: tuple[Array, ...], h: float, inputs: Array, steps: int) -> list[int]:
        """Take steps in place of a state (x, z, previous, sums): status, component, steps done, iterations."""
        self.scal[0], self.inputs[:, : inputs.shape[1]] = h, inputs
        for own, given in zip(self.state, state, strict=True):
            own[:] = given
        self.call(steps)
        for own, given in zip(self.state, state, strict=True):
            given[:] = own
        return self.outcome.tolist()


@final
class Natural:
    """The natural method for one model.

    Parameters
    ----------
    model
        The compiled model. The method keeps scratch memory: use one for each thread.
    stages
        Number of Gauss stages.

    Attributes
    ----------
    order
        In the length of a step: of momenta across constraints, which is the least. Without constraints it is twice the
        number of stages.
    elimination
        The present order of elimination, None before the first step.
    changes
        Number of times that it was decided anew.
    redundant
        The equations that it leaves out, in words.
    nodes
        Where in a step inputs are wanted.
    """

    def __init__(self, model: Model, stages: int = 1) -> None:
        self.model, self.stages, self._scheme = model, stages, gauss(stages)
        self.order, self.nodes = stages + stages % 2, self._scheme.nodes
        self.name = "natural" if stages == 1 else f"natural{self.order}"
        self.elimination: Order | None = None
        self.changes = 0
        self.redundant: tuple[str, ...] = ()
        self._memory: Memory = model.memory()
        self._groups = groups_of(model, stages)
        self._scratch = memory_of(model, self._groups, stages)
        self._closing = None if stages == 1 else closing_of(model, self._groups)
        self._unsettled = 0
        self._dropped: Index | None = None
        self._decided: Decided | None = None
        self._inputs = self._given(None)
        self._bound: _Loop | None = None
        self._stored = StoredEnergies(model)

    def init(self, x: Array) -> NaturalState:
        """The state of the method at the states x; unknowns are guessed from the efforts there."""
        z = np.tile(self._stored.efforts(x), (self.stages, 1))
        return NaturalState(x.copy(), z, np.tile(z, (BEFORE, 1)), np.zeros(4 + len(self.model.descriptor.components)))

    def energies(self, x: Array) -> Array:
        """(components,): energy of each storage at the states x, zero elsewhere."""
        return self._stored.energies(x)

    def prepare(self, state: NaturalState, h: float) -> None:
        """Decide the order of elimination and compile programs that are not in the cache, before timing starts."""
        self._loop(self._order(state.x, state.z, h, self._given(None), AT_START), 1)

    def step(self, state: NaturalState, h: float, inputs: Array | None = None) -> NaturalState:
        """One step of h seconds.

        Raises
        ------
        SolveError
            The step has no solution, or lies outside the method's domain.
        """
        after, chunk = self.advance(state, h, 1, inputs)
        if chunk.failure is not None:
            raise chunk.failure
        return after

    def advance(
        self, state: NaturalState, h: float, steps: int, inputs: Array | None = None
    ) -> tuple[NaturalState, Chunk]:
        """Up to ``steps`` steps of h seconds; the chunk names the cause of an early stop.

        Parameters
        ----------
        inputs
            (stages, …) values at the outer ports at the nodes of these steps, the model's own where None.
        """
        model, given = self.model, self._given(inputs)
        x, z, previous, sums = (array.copy() for array in (state.x, state.z, state.previous, state.sums))
        rows = [np.empty((steps, width)) for width in (state.x.size, model.tables.kind.size, 5)]
        done = iterations = 0
        failure: SolveError | None = None
        tried = AS_BEFORE
        while done < steps and failure is None:
            try:
                o = self._order(x, z, h, given, max(tried, AT_START))
            except SolveError as error:
                failure = error
                break
            wanted = steps - done
            if tried:  # no better pivots exist: take this one step with the present ones
                o, wanted = replace(o, floor=np.zeros_like(o.floor)), 1
            elif self._unsettled:
                wanted = min(wanted, self._unsettled)
            loop = self._loop(o, wanted)
            status, component, taken, spent = loop.run((x, z, previous, sums), h, given, wanted)
            for out, found in zip(rows, loop.rows, strict=True):
                out[done : done + taken] = found[:taken]
            done, iterations = done + taken, iterations + spent
            if status == DONE:
                tried = AS_BEFORE
                self._settle(taken)
            # other equations that are left out may keep a step within a component's domain
            elif status >= COMPONENT and (tried == WITHIN or not o.dropped.any() or status == COMPONENT + RAISED):
                failure = SolveError.of_component(status, model, component)
            elif tried == WITHIN:
                failure = self._failure(status, o, x, z, h)
            else:  # another order, at these values
                self.elimination, tried, self._unsettled = None, tried + 1, SETTLING
        record = RunRecord(h * np.arange(1.0, done + 1.0), *(found[:done] for found in rows))
        return NaturalState(x, z, previous, sums), Chunk(record, int(iterations), failure)

    def snapshot(self) -> Snapshot:
        """Origin of the present order of elimination, and the equations left out before."""
        return {
            "decided": parts(self._decided) if self.elimination is not None else None,
            "inputs": self._inputs,
            "dropped": self._dropped,
            "unsettled": self._unsettled,
            "changes": self.changes,
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Decide the order as it was decided."""
        self.elimination, found = None, snapshot["decided"]
        if found is not None:
            self._dropped = found["before"]
            self._order(found["x"], found["z"], found["h"], snapshot["inputs"], found["tried"])
        self._dropped, self._unsettled = snapshot["dropped"], snapshot["unsettled"]
        self.changes = snapshot["changes"]

    def points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The states at the nodes of a step from x, by the rates that ``state`` holds, continued."""
        d, nodes = self.model.descriptor, np.array(self.nodes)
        ahead = moments(nodes, 1.0 + nodes) - self._scheme.b
        return [d.advance(x, h * (weights @ state.z[:, : d.rate_size])) for weights in ahead]

    def stage_points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The states at the nodes of the step from x that led to ``state``, which was solved last."""
        return self.points(state, h, x) if self.stages == 1 else list(self._scratch.x.copy())

    def _given(self, inputs: Array | None) -> Array:
        return np.tile(self.model.input_values(), (self.stages, 1)) if inputs is None else np.ascontiguousarray(inputs)

    def _loop(self, o: Order, steps: int) -> _Loop:
        """The compiled loop in an order, with room for so many steps."""
        if self._bound is None or self._bound.order is not o or len(self._bound.rows[0]) < steps:
            model = self.model
            size, components, stages, n = (
                model.descriptor.point_size,
                model.tables.kind.size,
                self.stages,
                model.unknowns,
            )
            shapes = (size,), (stages, n), (BEFORE * stages, n), (4 + components,)
            x, z, previous, sums = state = tuple(np.zeros(shape) for shape in shapes)
            scal, inputs, outcome = model.scal(0.0), self._given(None), np.zeros(4, dtype=np.int64)
            rows = np.zeros((steps, size)), np.zeros((steps, components)), np.zeros((steps, 5))
            call = natural_program(self.stages).compiled()["advance"].bind(
                parts(model.tables), parts(self._groups), parts(o), parts(self._memory),
                parts(self._scratch), x, z, previous, scal, model.scal(0.0), inputs, sums, *rows, outcome, 0,
            )  # fmt: skip
            self._bound = _Loop(o, state, scal, inputs, rows, outcome, call)
        return self._bound

    def _settle(self, taken: int) -> None:
        if self._unsettled:
            self._unsettled = max(0, self._unsettled - taken)
            if not self._unsettled:
                self.elimination = None

    def _failure(self, status: int, o: Order, x: Array, z: Array, h: float) -> SolveError:
        """Why a step has no solution, by the compiled loop's status."""
        given = self.model, o.dropped[: self.model.unknowns]
        if status == INCONSISTENT:
            return contradicted(*given, x, z[-1], h)
        if status == DIVERGED:
            held = self._memory if self.stages == 1 else self._scratch
            return diverged(*given, held.residual, held.scale)
        return SolveError(Outcome.SINGULAR, "", "")

    def _order(self, x: Array, z: Array, h: float, inputs: Array, tried: int) -> Order:
        """Rank of the constraints, and an order of elimination for all stages, at these values unless there is one."""
        if self.elimination is not None:
            return self.elimination
        model, t, stages, size = self.model, self.model.tables, self.stages, self.stages * self.model.unknowns
        self._decided, self._inputs = Decided(x.copy(), z.copy(), float(h), self._dropped, tried), inputs.copy()
        values, ranked = entries_at(model, x, z[0], h, tried)
        dropped = self._dropped = dependent_rows(model, x, ranked, self._dropped, self._closing)
        s, scheme = self._scratch, self._scheme
        if stages == 1:
            s.data[0] = values
        else:
            fault = natural_program(stages).compiled()["linearise"](
                parts(t), parts(self._groups), dropped, x, z, model.scal(h), model.scal(0.0), inputs,
                parts(self._memory), parts(s), 1,
            )  # fmt: skip
            if fault:
                raise SolveError.of_component(fault % FAULTS, model, fault // FAULTS)
        i, j, source = self._groups.where.T
        inside = source >= 0
        row, column = (np.where(inside, of[source], -source - 1) for of in (t.row, t.column))
        data = np.where(inside & (i == j), s.data[i, source], 0.0)
        data += np.where(inside & (column < t.counts[0]), h * np.array(scheme.a)[i, j] * s.slope[i, source], 0.0)
        data[~inside] = 1.0
        active = inside != (dropped[row] == 1)
        chosen = np.flatnonzero(active)
        entries = np.where(data[chosen] == 0.0, TINY, data[chosen])  # a place that is zero now may fill later
        n = model.unknowns
        try:
            found = order(size, (row + i * n)[chosen], (column + j * n)[chosen], entries)
        except RuntimeError as error:
            raise self._singular(self._decided, row[chosen], column[chosen], data[chosen]) from error
        place = np.full(active.size, -1, dtype=np.int64)
        place[chosen] = found.place
        made = OrderOf(
            found.rows, found.columns, found.start, found.column, found.diagonal, place, np.tile(dropped, stages),
            np.zeros(size), np.array([DEFECT]),
        )  # fmt: skip
        self._memory, ratio = replace(self._memory, factors=np.zeros(found.fill)), np.zeros(size)
        if not sparse_lu().compiled()["factorise"](
            place, made.start, made.entry, made.diagonal, np.where(active, data, 0.0), self._memory.factors, s.dense,
            made.floor, ratio,
        ):  # fmt: skip
            raise self._singular(self._decided, row[chosen], column[chosen], data[chosen])
        self.elimination = replace(made, floor=SHRUNK * ratio)
        self.redundant = tuple(model.row_name(int(number)) for number in np.flatnonzero(dropped))
        self.changes += 1
        return self.elimination

    def _singular(self, decided: Decided, row: Index, column: Index, values: Array) -> SolveError:
        """Why there is no order of elimination: an unknown without equation, or only the values of several stages."""
        if self.stages == 1:
            return SolveError.undetermined(self.model, null_unknown(self.model.unknowns, row, column, values))
        single = Natural(self.model)
        single._dropped = decided.before
        try:
            single._order(decided.x, decided.z[:1], decided.h, single._given(None), decided.tried)
        except SolveError as error:
            return error
        return SolveError(Outcome.SINGULAR, "", "")
