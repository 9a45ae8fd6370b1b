"""The natural method of order 4: three Gauss stages, energy and holonomic relations exact, friction included.

The corrections that make it so are one term a component (see `stages`), so that discretising commutes with
composing as it does at order 2. A composition of steps of order 2 would have to step backwards through dissipation.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.holonomic import Holonomic
from ephs.semantics.linear.sparse import sparse_lu
from ephs.semantics.primitives.primitives import Kernel
from ephs.semantics.primitives.pullback import pulled_ports
from ephs.semantics.spaces.codes import SE3
from ephs.semantics.spaces.rank import TINY
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.analysis import (
    AS_BEFORE,
    AT_START,
    DEFECT,
    SHRUNK,
    WITHIN,
    Decided,
    analyse,
    dependent_rows,
    entries_at,
)
from ephs.solve.methods.blame import Blame
from ephs.solve.methods.collocation import moments
from ephs.solve.methods.gauss import gauss_program
from ephs.solve.methods.natural import (
    Chunk,
    Loop,
    NaturalState,
    has_choice,
    of_status,
)
from ephs.solve.methods.newton import BEFORE
from ephs.solve.methods.records import (
    COMPONENT,
    DIVERGED,
    DONE,
    INCONSISTENT,
    STORING,
    Memory,
    Order,
    OrderOf,
    parts_of,
)
from ephs.solve.methods.residuals import FAULTS
from ephs.solve.methods.scheme import (
    NODES,
    SCHEME,
    STAGES,
    WEIGHTS,
    Groups,
    GroupsOf,
    StagesOf,
)
from ephs.solve.methods.stored import Stored
from ephs.solve.model import Model
from ephs.solve.snapshot import Snapshot, parts
from ephs.solve.sparse import Index, order


@final
class Natural4:
    """The method for one model. It keeps scratch memory: use one for each thread.

    Attributes
    ----------
    nodes
        Where in a step inputs are wanted.
    changes
        How often the order of elimination was decided anew.
    redundant
        The equations that it leaves out, in words.
    """

    name = "natural4"
    order = 4
    nodes = tuple(NODES.tolist())

    def __init__(self, model: Model) -> None:
        self.model = model
        self.changes = 0
        self.redundant: tuple[str, ...] = ()
        t, n = model.tables, model.unknowns
        self._memory: Memory = model.memory()
        self._groups = _groups(model, _entries(model))
        self._closing = _closing(model, self._groups)
        size, entries, rates = int(model.descriptor.point_size), int(t.row.size), int(t.counts[0])
        k, nodes = STAGES, len(self._groups.node)
        self._scratch = StagesOf(
            x=np.zeros((k, size)), v=np.zeros((k, rates)), turn=np.zeros((k, 8)), outer=np.zeros((k, 8)),
            whole=np.zeros(rates), mean=np.zeros(n), gradient=np.zeros(rates),
            share=np.zeros((nodes, k)), factor=np.zeros(nodes), end=np.zeros(nodes), gap=np.zeros(n),
            energy=np.zeros(t.kind.size), residual=np.zeros((k, n)), scale=np.zeros((k, n)),
            data=np.zeros((k, entries)), slope=np.zeros((k, entries)), matrix=np.zeros(len(self._groups.where)),
            change=np.zeros(k * n), dense=np.zeros(k * n), pivot=np.zeros(k * n), one=np.zeros(8),
        )  # fmt: skip
        self._order: Order | None = None
        self._bound: Loop | None = None
        self._dropped: Index | None = None
        self._decided: Decided | None = None
        self._inputs = np.zeros(0)
        self._stored = Stored(model)

    def init(self, x: Array) -> NaturalState:
        """The state of the method at the states x; unknowns are guessed from the efforts there."""
        z = np.tile(self._stored.efforts(x), (STAGES, 1))
        return NaturalState(x.copy(), z, np.tile(z, (BEFORE, 1)), np.zeros(4 + len(self.model.descriptor.components)))

    def energies(self, x: Array) -> Array:
        """(components,): energy of each storage at the states x, zero elsewhere."""
        return self._stored.energies(x)

    def prepare(self, state: NaturalState, h: float) -> None:
        """Decide the order of elimination and compile programs that are not in the cache, before timing starts."""
        self.advance(state, h, 0)

    def points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The states at the nodes of a step from x, by the rates that ``state`` holds, continued."""
        d, rates = self.model.descriptor, int(self.model.tables.counts[0])
        ahead = [moments(NODES, 1.0 + c) - WEIGHTS for c in self.nodes]
        return [d.advance(x, h * (weights @ state.z[:, :rates])) for weights in ahead]

    def stage_points(self, state: NaturalState, h: float, x: Array) -> list[Array]:
        """The states at the nodes of the step that was solved last."""
        return list(self._scratch.x.copy())

    def advance(
        self, state: NaturalState, h: float, steps: int, inputs: Array | None = None
    ) -> tuple[NaturalState, Chunk]:
        """Up to ``steps`` steps of h seconds; the chunk names the cause of an early stop.

        Parameters
        ----------
        inputs
            (3, …) values at the outer ports at the nodes of these steps, the model's own where None.
        """
        model, t = self.model, self.model.tables
        given = np.tile(model.input_values(), (STAGES, 1)) if inputs is None else np.ascontiguousarray(inputs)
        x, z, previous, sums = (a.copy() for a in (state.x, state.z, state.previous, state.sums))
        rows, energies, ledgers = np.empty((steps, x.size)), np.empty((steps, t.kind.size)), np.empty((steps, 5))
        done = iterations = 0
        failure: SolveError | None = None
        tried = AT_START if self._order is None else AS_BEFORE
        while failure is None:
            try:
                if self._order is None:
                    self._decide(x, z, h, given, tried)
            except SolveError as error:
                failure = error
                break
            assert self._order is not None
            o = replace(self._order, floor=np.zeros_like(self._order.floor)) if tried else self._order
            wanted = min(steps - done, 1) if tried else steps - done
            loop = self._loop(o, wanted)
            status, component, taken, spent = loop.run((x, z, previous, sums), h, given, wanted)
            for out, found in zip((rows, energies, ledgers), loop.rows, strict=True):
                out[done : done + taken] = found[:taken]
            done, iterations = done + taken, iterations + spent
            if status == DONE:
                tried = AS_BEFORE
                if done >= steps:
                    break
            elif status >= COMPONENT and (tried == WITHIN or not has_choice(o.dropped, status)):
                failure = SolveError.of_component(status, model, component)
            elif tried == WITHIN:
                blame = Blame(model, o.dropped[: model.unknowns])
                failure = blame.contradicted(x, z[-1], h) if status == INCONSISTENT else of_status(status)
                if status == DIVERGED:
                    failure = blame.diverged(self._scratch.residual, self._scratch.scale)
            else:  # another order, at these values
                self._order, tried = None, tried + 1
        after = NaturalState(x, z, previous, sums)
        return after, Chunk(rows[:done], energies[:done], ledgers[:done], int(iterations), failure)

    def snapshot(self) -> Snapshot:
        """Origin of the present order of elimination, and the equations left out before."""
        return {
            "decided": parts(self._decided) if self._order is not None else None,
            "inputs": self._inputs,
            "dropped": self._dropped,
            "changes": self.changes,
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Decide the order as it was decided."""
        self._order, found = None, snapshot["decided"]
        if found is not None:
            self._dropped = found["before"]
            self._decide(found["x"], found["z"], found["h"], snapshot["inputs"], found["tried"])
        self._dropped, self.changes = snapshot["dropped"], snapshot["changes"]

    def _loop(self, o: Order, steps: int) -> Loop:
        """The compiled loop in an order, with room for so many steps."""
        if self._bound is None or self._bound.order is not o or self._bound.room < steps:
            model = self.model
            parts = map(parts_of, (model.tables, self._groups, o, self._memory, self._scratch))
            still = model.scal(0.0)

            def bind(state: Sequence[Array], scal: Array, inputs: Array, results: Sequence[Any]) -> Any:
                x, z, previous, sums = state
                advance = gauss_program().compiled()["advance"]
                return advance.bind(*parts, x, z, previous, scal, still, inputs, SCHEME.ravel(), sums, *results)

            self._bound = Loop(model, o, steps, bind, (STAGES,))
        return self._bound

    def _decide(self, x: Array, z: Array, h: float, inputs: Array, tried: int) -> None:
        """Rank of the constraints, and an order of elimination for all stages, at these values."""
        model, t, n = self.model, self.model.tables, self.model.unknowns
        self._decided, self._inputs = Decided(x.copy(), z.copy(), float(h), self._dropped, tried), inputs.copy()
        _, ranked = entries_at(model, x, z[0], h, tried)
        dropped = self._dropped = dependent_rows(model, x, ranked, self._dropped, self._closing)
        s = self._scratch
        fault = gauss_program().compiled()["linearise"](
            parts_of(t), parts_of(self._groups), dropped, x, z, model.scal(h), model.scal(0.0), inputs,
            parts_of(self._memory), parts_of(s), 1,
        )  # fmt: skip
        if fault:
            raise SolveError.of_component(fault % FAULTS, model, fault // FAULTS)
        where = self._groups.where
        i, j, source = where.T
        inside = source >= 0
        rows = np.where(inside, t.row[source], -source - 1) + i * n
        columns = np.where(inside, t.column[source], -source - 1) + j * n
        in_rates = inside & (t.column[source] < t.counts[0])
        data = np.where(inside & (i == j), s.data[i, source], 0.0)
        data += np.where(in_rates, h * SCHEME[i, j] * s.slope[i, source], 0.0)
        out = dropped[np.where(inside, t.row[source], -source - 1)] == 1
        data[~inside] = 1.0
        active = np.where(inside, ~out, out)
        chosen = np.flatnonzero(active)
        entries = np.where(data[chosen] == 0.0, TINY, data[chosen])  # a place that is zero now may fill later
        try:
            found = order(STAGES * n, rows[chosen], columns[chosen], entries)
        except RuntimeError as error:
            raise self._singular(x, z, h) from error
        place = np.full(len(where), -1, dtype=np.int64)
        place[chosen] = found.place
        made = OrderOf(
            found.rows, found.columns, found.start, found.column, found.diagonal, place, np.tile(dropped, STAGES),
            np.zeros(STAGES * n), np.array([DEFECT]),
        )  # fmt: skip
        self._memory, ratio = replace(self._memory, factors=np.zeros(found.fill)), np.zeros(STAGES * n)
        matrix = np.where(active, data, 0.0)
        factorise = sparse_lu().compiled()["factorise"]
        if not factorise(
            place, made.start, made.entry, made.diagonal, matrix, self._memory.factors, s.dense, made.floor, ratio
        ):
            raise self._singular(x, z, h)
        self._order = replace(made, floor=SHRUNK * ratio)
        self.redundant = tuple(model.row_name(int(row)) for row in np.flatnonzero(dropped))
        self.changes += 1

    def _singular(self, x: Array, z: Array, h: float) -> SolveError:
        """Why there is no order of elimination: an unknown without equation, or only these values."""
        try:
            analyse(self.model, x, z[0], h, self._dropped)
        except SolveError as error:
            return error
        return SolveError(Outcome.SINGULAR, "", "")


def _groups(model: Model, where: Index) -> Groups:
    """The velocities of joints: twists of two frames, and a velocity on the pair's group; storages of entropy alone."""
    rows: list[tuple[int, int, int, int]] = []
    metrics: list[Array] = []
    for number, slot in enumerate(model.descriptor.components):
        kernel = slot.primitive.kernel
        if kernel is not None and isinstance(kernel.relation, Holonomic):
            code, efforts = kernel.relation.code, list(slot.efforts)
            for (first, matrix), group in zip(_ports(kernel, len(efforts)), (SE3, SE3, code), strict=True):
                dim = matrix.shape[1]
                if dim:
                    rows.append((number, group, efforts[first], dim))
                    metric = np.zeros((6, 6))
                    metric[:dim, :dim] = matrix.T @ matrix
                    metrics.append(metric)
    table = np.array(rows, dtype=np.int64).reshape(-1, 4)
    node = _nodes(model)
    place = {source: k for k, source in enumerate(node[:, 3].tolist())}
    entry = np.zeros((len(node), STAGES, STAGES), dtype=np.int64)
    for k, (i, j, source) in enumerate(where.tolist()):
        if source in place:
            entry[place[source], i, j] = k
    return GroupsOf(table, np.array(metrics).ravel(), node, entry, where)


def _nodes(model: Model) -> Index:
    """(nodes, 4): storages of entropy alone whose temperature depends on it, as `Groups` has them."""
    t = model.tables
    found: list[tuple[int, int, int, int]] = []
    for c in np.flatnonzero((t.kind == STORING) & (t.dims[:, 0] == 1)).tolist():
        effort, slope = int(t.e_index[t.e_at[c]]), int(t.jacobian[t.jacobian_at[c]])
        if t.entropy[effort] == 1.0 and slope >= 0:
            found.append((c, int(t.read_w[t.read_w_at[c]]), int(t.counts[0]) + effort, slope))
    return np.array(found, dtype=np.int64).reshape(-1, 4)


def _closing(model: Model, groups: Groups) -> NDArray[np.bool_]:
    """(rows,) the equations of components whose relation holds over a step."""
    t, out = model.tables, np.zeros(model.unknowns, dtype=np.bool_)
    for number in np.unique(groups.velocity[:, 0]):
        first = int(t.counts[0] + t.counts[1] + t.multiplier_at[number])
        out[first : first + int(t.dims[number, 1])] = True
    return out


def _ports(kernel: Kernel, size: int) -> list[tuple[int, Array]]:
    """(first of its efforts, the map by which the relation sees them) of the two frames and the degrees of freedom of a
    joint.
    """
    found = [(at, matrix) for _, _, at, _, matrix in pulled_ports(kernel)]
    if not found:
        return [(0, np.eye(6)), (6, np.eye(6)), (12, np.eye(size - 12))]
    return found if len(found) == 3 else [*found, (size, np.zeros((0, 0)))]


def _entries(model: Model) -> Index:
    """(entries, 3): stage of the row, stage of the column, entry of the model's matrix; −1 − row: its place holder."""
    t, n = model.tables, model.unknowns
    plain, rates = t.row.size - n, int(t.counts[0])
    out: list[tuple[int, int, int]] = []
    for i in range(STAGES):
        for source in range(plain):
            others = range(STAGES) if t.column[source] < rates else (i,)
            out += [(i, j, source) for j in others]
        out += [(i, i, -1 - row) for row in range(n)]
    return np.array(out, dtype=np.int64).reshape(-1, 3)
