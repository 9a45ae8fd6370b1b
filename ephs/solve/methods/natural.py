"""The natural method: every component discretised on its own, order 2, energy and holonomic relations exact.

The state of the method is a value; advancing it is compiled, and gives one row of results a step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.kernel_table import RAISED
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.analysis import AS_BEFORE, AT_START, WITHIN, Analysis, Decided, analyse
from ephs.solve.methods.blame import Blame
from ephs.solve.methods.newton import BEFORE, natural_program
from ephs.solve.methods.records import COMPONENT, DIVERGED, DONE, INCONSISTENT, PIVOT, Memory, Order, parts_of
from ephs.solve.methods.stored import Stored
from ephs.solve.model import Model
from ephs.solve.snapshot import Snapshot, parts
from ephs.solve.sparse import Index

SETTLING = 16
"""Steps after a change of order until the next: the values at the change itself may be exceptional."""
_OUTCOMES = {DIVERGED: Outcome.DIVERGED, PIVOT: Outcome.SINGULAR, INCONSISTENT: Outcome.CONTRADICTION}


@final
@dataclass(frozen=True, slots=True, eq=False)
class NaturalState:
    """Present state of the method.

    Parameters
    ----------
    x
        (point_size,) the states.
    z
        (unknowns,) the unknowns of the last step; of `Natural4` (stages, unknowns).
    previous
        (`BEFORE`, unknowns) those of the steps before, latest first, from which the next are guessed; of `Natural4`
        (`BEFORE` · stages, unknowns), stage after stage.
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
    x
        (steps, point_size).
    energies
        (steps, components): energy of each storage in J, entropy made so far by each irreversible component in J/K.
    ledgers
        (steps, 5): heat, energy supplied, exergy supplied, entropy made, least entropy production in the step.
    cut
        How many of the steps were taken in parts.
    """

    x: Array
    energies: Array
    ledgers: Array
    iterations: int
    failure: SolveError | None
    cut: int = 0

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return int(self.x.shape[0])


@final
class Loop:
    """The compiled loop over steps, bound to arrays of its own.

    Parameters
    ----------
    bind
        Called with the memory of a state (x, z, previous, sums), of (h, θ₀, π₀), of inputs, and of results.
    stages
        Shape of what there is for each stage of a step: none at order 2.

    Attributes
    ----------
    order, room
        The order of elimination, and how many steps there is room for.
    rows
        States, energies and ledgers, a row for each step that was taken last.
    """

    def __init__(
        self, model: Model, order: Order, room: int, bind: Callable[..., Any], stages: tuple[int, ...] = ()
    ) -> None:
        components, n = model.tables.kind.size, model.unknowns
        self.order, self.room, self._scal = order, room, model.scal(0.0)
        self._inputs = np.tile(model.input_values(), (*stages, 1))
        size, before = model.descriptor.point_size, BEFORE * max((1, *stages))
        self._state = [np.zeros(shape) for shape in (size, (*stages, n), (before, n), 4 + components)]
        self.rows = [np.zeros((room, width)) for width in (size, components, 5)]
        self._outcome = np.zeros(4, dtype=np.int64)
        self._call = bind(self._state, self._scal, self._inputs, (*self.rows, self._outcome, 0))

    def run(self, state: Sequence[Array], h: float, inputs: Array, steps: int) -> tuple[int, int, int, int]:
        """Take steps in place of a state (x, z, previous, sums): status, component, steps done, iterations."""
        self._scal[0], self._inputs[..., : inputs.shape[-1]] = h, inputs
        for own, given in zip(self._state, state, strict=True):
            own[:] = given
        self._call(steps)
        for own, given in zip(self._state, state, strict=True):
            given[:] = own
        status, component, done, iterations = self._outcome.tolist()
        return status, component, done, iterations


@final
class Natural:
    """The natural method for one model.

    Parameters
    ----------
    model
        The compiled model. The method keeps scratch memory: use one for each thread.

    Attributes
    ----------
    analysis
        The present order of elimination, None before the first step.
    changes
        How often the order was decided anew.
    nodes
        Where in a step inputs are wanted.
    """

    name = "natural"
    order = 2
    nodes = (0.5,)

    def __init__(self, model: Model) -> None:
        self.model = model
        self.analysis: Analysis | None = None
        self.changes = 0
        self._memory: Memory = model.memory()
        self._unsettled = 0
        self._dropped: Index | None = None
        self._decided: Decided | None = None
        self._bound: Loop | None = None
        self._stored = Stored(model)

    def init(self, x: Array) -> NaturalState:
        """The state of the method at the states x; unknowns are guessed from the efforts there."""
        z = self._stored.efforts(x)
        return NaturalState(x.copy(), z, np.tile(z, (BEFORE, 1)), np.zeros(4 + len(self.model.descriptor.components)))

    def energies(self, x: Array) -> Array:
        """(components,): energy of each storage at the states x, zero elsewhere."""
        return self._stored.energies(x)

    def prepare(self, state: NaturalState, h: float) -> None:
        """Decide the order of elimination and compile programs that are not in the cache, before timing starts."""
        self._loop(self._order(state.x, state.z, h).order, 1)

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
            (1, …) values at the outer ports during these steps, the model's own where None.
        """
        model = self.model
        given = model.input_values() if inputs is None else inputs[0]
        x, z, previous, sums = (a.copy() for a in (state.x, state.z, state.previous, state.sums))
        rows = np.empty((steps, x.size))
        energies, ledgers = np.empty((steps, model.tables.kind.size)), np.empty((steps, 5))
        done = iterations = 0
        failure: SolveError | None = None
        tried = AS_BEFORE
        while done < steps and failure is None:
            try:
                analysis = self._order(x, z, h, max(tried, AT_START))
            except SolveError as error:
                failure = error
                break
            order = analysis.order
            wanted = steps - done
            if tried:  # no better pivots exist: take this one step with the present ones
                order, wanted = replace(order, floor=np.zeros_like(order.floor)), 1
            elif self._unsettled:
                wanted = min(wanted, self._unsettled)
            loop = self._loop(order, wanted)
            status, component, taken, spent = loop.run((x, z, previous, sums), h, given, wanted)
            for out, found in zip((rows, energies, ledgers), loop.rows, strict=True):
                out[done : done + taken] = found[:taken]
            done, iterations = done + taken, iterations + spent
            if status == DONE:
                tried = AS_BEFORE
                self._settle(taken)
            elif status >= COMPONENT and (tried == WITHIN or not has_choice(order.dropped, status)):
                failure = SolveError.of_component(status, model, component)
            elif tried == WITHIN:
                blame = Blame(model, order.dropped)
                failure = blame.contradicted(x, z, h) if status == INCONSISTENT else of_status(status)
                if status == DIVERGED:
                    failure = blame.diverged(self._memory.residual, self._memory.scale)
            else:
                self.analysis, tried, self._unsettled = None, tried + 1, SETTLING
        after = NaturalState(x, z, previous, sums)
        return after, Chunk(rows[:done], energies[:done], ledgers[:done], int(iterations), failure)

    @property
    def redundant(self) -> tuple[str, ...]:
        """The omitted equations, in words."""
        return self.analysis.redundant if self.analysis is not None else ()

    def snapshot(self) -> Snapshot:
        """Origin of the present order of elimination, and the equations left out before."""
        return {
            "decided": parts(self._decided) if self.analysis is not None else None,
            "dropped": self._dropped,
            "unsettled": self._unsettled,
            "changes": self.changes,
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Decide the order as it was decided."""
        self.analysis, found = None, snapshot["decided"]
        if found is not None:
            self._dropped = found["before"]
            self._order(found["x"], found["z"], found["h"], found["tried"])
        self._dropped, self._unsettled = snapshot["dropped"], snapshot["unsettled"]
        self.changes = snapshot["changes"]

    def points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The state in the middle of a step from x, by the rates that ``state`` holds."""
        return self.stage_points(state, h, x)

    def stage_points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The state in the middle of the step from x that led to ``state``."""
        d = self.model.descriptor
        return [d.advance(x, 0.5 * h * state.z[: d.rate_size])]

    def _order(self, x: Array, z: Array, h: float, tried: int = AT_START) -> Analysis:
        if self.analysis is None:
            self._decided = Decided(x.copy(), z.copy(), float(h), self._dropped, tried)
            self.analysis = analyse(self.model, x, z, h, self._dropped, tried)
            self._dropped = self.analysis.dropped
            self.changes += 1
            self._memory = replace(self._memory, factors=np.zeros(self.analysis.fill))
        return self.analysis

    def _loop(self, order: Order, steps: int) -> Loop:
        """The compiled loop in an order, with room for so many steps."""
        if self._bound is None or self._bound.order is not order or self._bound.room < steps:
            parts = parts_of(self.model.tables), parts_of(order), parts_of(self._memory)

            def bind(state: Sequence[Array], scal: Array, inputs: Array, results: Sequence[Any]) -> Any:
                x, z, previous, sums = state
                advance = natural_program().compiled()["advance"]
                return advance.bind(*parts, x, z, previous, scal, inputs, sums, *results)

            self._bound = Loop(self.model, order, steps, bind)
        return self._bound

    def _settle(self, taken: int) -> None:
        if self._unsettled:
            self._unsettled = max(0, self._unsettled - taken)
            if not self._unsettled:
                self.analysis = None


def has_choice(dropped: Index, status: int) -> bool:
    """Whether leaving out other equations may keep a step within the domain of the component that gave this status."""
    return bool(dropped.any()) and status != COMPONENT + RAISED


def of_status(status: int) -> SolveError:
    """Outcome of a step as a whole by the compiled loop's status."""
    return SolveError(_OUTCOMES[status], "", "")
