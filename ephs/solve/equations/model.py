"""The compiled model of a system: its descriptor form as tables of numbers and addresses."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.operad import Path, quantity
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.derive.relations import compiled
from ephs.semantics.descriptor.descriptor import Descriptor, Input
from ephs.semantics.descriptor.kernel_table import Callback
from ephs.semantics.descriptor.numbering import spans, starts, sums
from ephs.semantics.linear.sums import uncancelled
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.systems.kept import once
from ephs.solve.equations.layout import entry_of, laid_out
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.records import Memory, MemoryOf, Tables, TablesOf
from ephs.solve.methods.residuals import FAULTS, evaluation_program
from ephs.solve.posing.problem import Problem
from ephs.solve.running.snapshot import parts


@final
@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A system ready for the time loop.

    Parameters
    ----------
    descriptor
        The flat system and the places of its unknowns.
    inputs
        What is prescribed at the outer ports.
    tables
        The same for compiled code.
    callbacks
        Python primitives by component number; they must outlive the tables that hold their addresses.
    constraint_rows
        The rows of the equations that may depend on one another: constraints and prescribed efforts.
    """

    descriptor: Descriptor
    reference: Reference
    inputs: Mapping[Path, Input]
    tables: Tables
    callbacks: Mapping[int, Callback]
    constraint_rows: Index

    @property
    def unknowns(self) -> int:
        """Number of unknowns and equations."""
        return int(self.tables.counts[3])

    def scal(self, h: float) -> Array:
        """(h, θ₀, π₀), arguments of kernels."""
        return np.array([h, self.reference.temperature, self.reference.pressure])

    def input_values(self, inputs: Mapping[Path, Input] | None = None) -> Array:
        """The values of inputs, port by port; its own where None."""
        given = self.inputs if inputs is None else inputs
        return np.concatenate([*(given[slot.path].value for slot in self.descriptor.outer), np.zeros(1)])

    def memory(self) -> Memory:
        """Scratch memory for the loop, but for factors."""
        t = self.tables
        n, k, nv, nx = (int(t.dims[:, i].max(initial=0)) for i in range(4))
        sizes = {
            "e": n + 1, "lam": k + 1, "v": max(nv, 6) + 1, "x": nx + 8, "f": n * n + n + 1, "c": k + 2,
            "jac": (n + k) * (n + k + nv) + 1, "work": 4096, "data": t.row.size, "factors": 1, "block": t.group.size,
            "group": t.group.max(initial=0) + 1, "flows": t.e_index.size + 1, "energy": t.kind.size, "defect": 2,
            **dict.fromkeys(("residual", "scale", "step", "dense", "pivot"), self.unknowns),
        }  # fmt: skip
        return MemoryOf(**{name: np.zeros(size) for name, size in sizes.items()})

    def only(self, chosen: Index) -> "Model":
        """The model with these components alone, in this order, at the same places."""
        t = self.tables
        keys = (
            "kind", "address", "dims", "parameter_at", "e_at", "multiplier_at", "read_x_at", "read_w_at", "jacobian_at"
        )  # fmt: skip
        return replace(self, tables=replace(t, **{key: getattr(t, key)[chosen] for key in keys}))

    def resting(self, chosen: Index) -> Index:
        """(components,) addresses; those of the chosen ones are of relations at rest, without derivatives, where they
        are compiled."""
        found, d = self.tables.address.copy(), self.descriptor
        at, addresses = once(d, ("resting", chosen.tobytes()), lambda: _resting(d, chosen))
        found[at] = addresses
        return found

    def path_of(self, component: int) -> Path:
        """The path of a component by its number."""
        return self.descriptor.components[component].path

    def depth_of(self, component: int) -> float:
        """Overlap in m beyond which the energy of a component, by its number, is no number; infinite of most."""
        primitive = self.descriptor.components[component].primitive
        support = primitive.support if isinstance(primitive, Storage) else None
        return np.inf if support is None else support.depth

    def state_path(self, entry: int) -> str:
        """The path of the state that an entry of the state vector belongs to."""
        return str(next(s.path for s in self.descriptor.states if s.point.start <= entry < s.point.stop))

    def unknown_name(self, column: int) -> str:
        """An unknown, in words."""
        _, unknown, path = self._owner(column)
        return f"{unknown} {path}".strip()

    def row_path(self, row: int) -> str:
        """The path of the state, junction or component that the equation of a row, or its unknown, belongs to."""
        return self._owner(row)[2]

    def row_name(self, row: int) -> str:
        """The equation of a row, in words."""
        equation, _, path = self._owner(row)
        return f"{equation} {path}".strip()

    def _owner(self, row: int) -> tuple[str, str, str]:
        """Kind of a row's equation, kind of the unknown with its number, and the path of both."""
        d, n_rate = self.descriptor, int(self.tables.counts[0])
        at = row - n_rate - int(self.tables.counts[1])
        if row < n_rate:
            path = next(s.path for s in d.states if s.rates.start <= row < s.rates.stop)
            return "the effort of storage", "the rate of", str(path)
        if at < 0:
            path = next(j.path for j in d.junctions if j.efforts.start <= row - n_rate < j.efforts.stop)
            return "the balance of flows at junction", "the effort at junction", str(path)
        for slot in d.components:
            if slot.multiplier <= at < slot.multiplier + slot.multipliers:
                return "the constraint of", "a multiplier of", str(slot.path)
        return "the prescribed effort of an outer port", "the prescribed effort of an outer port", ""


def compile_model(
    descriptor: Descriptor, reference: Reference, inputs: Mapping[Path, Input] | None, *, matrix: bool = True
) -> Model:
    """Tabulate a descriptor form, once: its tables are kept with it, and shared by all models without Python.

    Parameters
    ----------
    matrix
        Whether to lay out the Jacobian, which most of the tables is; without it storages, irreversible components, and
        those that read nothing but numbers are there, and the whole cannot be evaluated.

    Raises
    ------
    AssemblyError
        An outer port without input, or an input without port.
    """
    given = descriptor.complete_inputs(inputs)
    sides = tuple((path, one.effort) for path, one in given.items())
    key = "model", reference, sides, matrix

    def made() -> Model:
        return _compiled(descriptor, reference, given, matrix=matrix)

    if any(primitive.kernel is None for primitive in descriptor.numbering.primitives):
        return made()  # an exception of a Python component belongs to one run
    return replace(once(descriptor, key, made), inputs=given)


def model_of(problem: Problem, t0: float, *, matrix: bool = True) -> Model:
    """The compiled model of a problem with its inputs at the start, t0 in s; see `compile_model`."""
    given = problem.inputs(t0, problem.initial)
    return compile_model(problem.descriptor, problem.reference, given, matrix=matrix)


def _resting(d: Descriptor, chosen: Index) -> tuple[Index, Index]:
    """Those of the chosen components whose relations are compiled, and their addresses at rest."""
    n = d.numbering
    numbers, places = np.unique(n.primitive[chosen], return_inverse=True)
    kernels = [n.primitives[number].kernel for number in numbers.tolist()]
    addresses = [0 if kernel is None else compiled(kernel.relation, rest=True).address for kernel in kernels]
    has = np.array([kernel is not None for kernel in kernels], dtype=bool)[places]
    return chosen[has], np.array(addresses, dtype=np.int64)[places[has]]


def _compiled(d: Descriptor, reference: Reference, given: Mapping[Path, Input], *, matrix: bool) -> Model:
    n = d.numbering
    n_rate, n_effort, n_lam = d.rate_size, d.effort_size, d.multiplier_size
    size = d.unknowns(given)
    each = [entry_of(one, reference, reversible=matrix or _may_be_attached(one)) for one in n.primitives]
    counts = np.array([entry.counts for entry in each], dtype=np.int64).reshape(-1, 5)[n.primitive]
    kinds, numbers, reads = counts[:, 0], counts[:, 1], counts[:, 4]
    junction_dims, state_dims, state_sizes = n.dims(n.junctions), n.dims(n.states), n.sizes(n.states)
    effort_at, rate_at, point_at = starts(junction_dims), starts(state_dims), starts(state_sizes)
    e_flat = spans(effort_at[n.wires], junction_dims[n.wires])
    x_flat = spans(point_at[n.reads], state_sizes[n.reads])
    w_flat = spans(rate_at[n.reads], state_dims[n.reads])
    dims = np.stack(
        [counts[:, 2], counts[:, 3], sums(state_dims[n.reads], reads), sums(state_sizes[n.reads], reads)], axis=1
    )
    known = np.concatenate([*(entry.numbers for entry in each), np.zeros(1)])
    known_at = starts(np.array([entry.numbers.size for entry in each], dtype=np.int64))[n.primitive]
    callbacks = {
        int(i): callback
        for number, entry in enumerate(each)
        if (callback := entry.callback) is not None
        for i in np.flatnonzero(n.primitive == number)
    }
    there = np.concatenate([np.zeros(0), *(reference.intensive(q) for q in n.quantities)])
    there_at = starts(np.array([q.space.dim for q in n.quantities], dtype=np.int64))
    intensive = there[spans(there_at[n.junctions], junction_dims)]
    entropy = np.array([float(q.kind == "entropy") for q in n.quantities])[n.junctions]
    codes = np.array([manifold(q.space).code for q in n.quantities], dtype=np.int64)[n.states]
    outer, input_at, at, unknown = [], [], 0, n_rate + n_effort + n_lam
    for junction in d.outer:
        dim, prescribed = junction.quantity.space.dim, given[junction.path].effort
        outer.append([junction.at, dim, int(prescribed), unknown if prescribed else -1])
        input_at.append(at)
        at += dim
        unknown += dim if prescribed else 0
    (block, group), none = _blocks(d, given), np.zeros(kinds.size, dtype=np.int64)
    table = TablesOf(
        counts=np.array([n_rate, n_effort, n_lam, size], dtype=np.int64),
        kind=np.ascontiguousarray(kinds),
        address=np.array([entry.address for entry in each], dtype=np.int64)[n.primitive],
        dims=dims,
        parameters=np.append(known[spans(known_at, numbers)], 0.0),
        parameter_at=starts(numbers),
        e_index=np.append(e_flat, 0),
        e_at=starts(dims[:, 0]),
        multiplier_at=starts(n.multipliers),
        read_x=np.append(x_flat, 0),
        read_x_at=starts(dims[:, 3]),
        read_w=np.append(w_flat, 0),
        read_w_at=starts(dims[:, 2]),
        jacobian=none[:1],
        jacobian_at=none,
        states=np.stack([codes, point_at, state_sizes, rate_at, state_dims], axis=1),
        intensive=intensive,
        entropy=np.repeat(entropy, junction_dims),
        row=none[:1],
        column=none[:1],
        template=np.zeros(1),
        constraining=none[:0],
        balancing=none[:0],
        block=block,
        group=group,
        outer=np.array(outer, dtype=np.int64).reshape(-1, 4),
        input_at=np.array(input_at, dtype=np.int64),
    )
    first = n_rate + n_effort
    model = Model(d, reference, given, table, callbacks, np.arange(first, size, dtype=np.int64))
    if not matrix:
        return model
    return replace(model, tables=laid_out(table, n.primitive, each, reference))


def _may_be_attached(primitive: Primitive) -> bool:
    """Whether a component reads states, and may be attached to a mechanism: it does not act on bodies."""
    return bool(primitive.reads) and all(of != quantity.body_momentum for _, _, of in primitive.bundle.items())


def _blocks(d: Descriptor, given: Mapping[Path, Input]) -> tuple[Index, Index]:
    """Rows whose residuals share one scale, those of one storage port, junction, component, outer port; and blocks of
    one kind: the same quantity in the same sort of equation."""
    n = d.numbering
    words: list[tuple[str, str]] = []
    lengths: list[Index] = []
    of: list[Index] = []

    def add(sort: str, kinds: Iterable[str], number: Index, length: Index) -> None:
        named = [(sort, kind) for kind in kinds]
        words.extend(word for word in dict.fromkeys(named) if word not in words)
        of.append(np.array([words.index(word) for word in named], dtype=np.int64)[number])
        lengths.append(length)

    kinds = [quantity.kind for quantity in n.quantities]
    firsts = [next((q.kind for _, _, q in primitive.bundle.items()), "") for primitive in n.primitives]
    constrained = n.multipliers > 0
    prescribed = [junction for junction in d.outer if given[junction.path].effort]
    add("effort", kinds, n.states, n.dims(n.states))
    add("balance", kinds, n.junctions, n.dims(n.junctions))
    add("effort", firsts, n.primitive[constrained], n.multipliers[constrained])
    add(
        "effort",
        [junction.quantity.kind for junction in prescribed],
        np.arange(len(prescribed)),
        np.array([junction.quantity.space.dim for junction in prescribed], dtype=np.int64),
    )
    group, length = np.concatenate(of), np.concatenate(lengths)
    return np.repeat(np.arange(length.size), length), group


@final
class Evaluation:
    """Residual, matrix and ledgers of a model at points, in memory of its own: use one for each thread.

    Attributes
    ----------
    memory
        Holds what was found last.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.memory = model, model.memory()
        d, inputs = model.descriptor, model.input_values()
        self._x, self._z = np.zeros(d.point_size), np.zeros(model.unknowns)
        self._scal, self._inputs, self._sums = model.scal(0.0), inputs, np.zeros(4 + model.tables.kind.size)
        calls, t, m = evaluation_program().compiled(), parts(model.tables), parts(self.memory)
        self._evaluate = calls["evaluate"].bind(t, self._x, self._z, self._scal, self._inputs, m, 0.0)
        self._calls, self._parts = calls, (t, m)

    def at(
        self, x: Array, z: Array, h: float, inputs: Array | None = None, weight: float | None = None
    ) -> tuple[int, int]:
        """Evaluate at states and unknowns, over a step: (status, component).

        Parameters
        ----------
        inputs
            Values at the outer ports, the model's own where None.
        weight
            Of derivatives by increments of states in the matrix; h where None.
        """
        self._x[:], self._z[:], self._scal[0] = x, z, h
        given = self.model.input_values() if inputs is None else inputs
        self._inputs[: given.size] = given
        fault = int(self._evaluate(h if weight is None else weight))
        return fault % FAULTS, fault // FAULTS

    def ledgers(self, h: float) -> Array:
        """(4 + components,): heat, energy and exergy supplied, entropy made in a step of h, and by each component."""
        t, m = self._parts
        self._sums[:] = 0.0
        self._calls["account"](t, self._z, h, self._inputs, m, self._sums)
        return self._sums.copy()

    def measure(self, dropped: Index) -> float:
        """The largest residual relative to its scale; omitted equations become the unknown itself."""
        t, m = self._parts
        return float(self._calls["measure"](t, self._z, dropped, m))


def evaluate_at(model: Model, x: Array, z: Array, h: float) -> tuple[int, int, Memory]:
    """Residual and matrix at a point, for analysis and tests: (status, component, memory that holds them)."""
    evaluation = Evaluation(model)
    return *evaluation.at(x, z, h), evaluation.memory


def cancelled(model: Model, x: Array) -> tuple[Index, Index]:
    """Entries of the matrix that are rounding, as ports of one component cancel each other on a junction.

    And the rows of constraints of which nothing else is left: they are no equations.
    """
    t, d = model.tables, model.descriptor

    def shared_ports() -> tuple[int, ...]:
        owner = np.repeat(np.arange(t.kind.size), t.dims[:, 0])
        efforts = t.e_index[: owner.size] + t.counts[1] * owner
        shared = np.setdiff1d(np.arange(owner.size), np.unique(efforts, return_index=True)[1])
        return tuple(np.unique(owner[shared]).tolist())

    entries, rows = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for number in once(d, "components with ports that share a junction", shared_ports):
        slot = d.components[number]
        if slot.multipliers and isinstance(slot.primitive, Reversible):
            _, constraint = slot.primitive.structure(d.point(slot, x))
            (k, n), width = constraint.shape, int(t.dims[number, :3].sum())
            left = uncancelled(constraint, slot.efforts)
            gone = np.zeros((k, width), dtype=bool)
            gone[:, :n] = left != constraint
            empty = gone.any(axis=1) & ~left.any(axis=1)
            gone[empty, n:] = True  # by states, all rounding
            first = t.jacobian_at[number] + width * n
            place = t.jacobian[first : first + width * k].reshape(k, width)
            entries.append(place[gone & (place >= 0)])
            rows.append(t.counts[0] + t.counts[1] + t.multiplier_at[number] + np.flatnonzero(empty))
    return np.concatenate(entries), np.concatenate(rows)
