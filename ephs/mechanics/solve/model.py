"""The compiled model of a system: its descriptor form as tables of numbers and addresses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.mechanics.solve.natural_kernels import (
    IRREVERSIBLE,
    REVERSIBLE,
    STORING,
    Memory,
    Tables,
    evaluate,
)
from ephs.mechanics.solve.sparse import Index
from ephs.operad import Path
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.checks import random_efforts
from ephs.semantics.descriptor import ComponentSlot, Descriptor, Input
from ephs.semantics.kernel_table import Callback, address_of
from ephs.semantics.primitives import Irreversible, Storage
from ephs.semantics.spaces import manifold

__all__ = ["Model", "compile_model"]

LINEAR = frozenset({("ephs.semantics.kernels", "constant_structure"), ("ephs.semantics.kernels", "quadratic")})
"""Kernels whose Jacobian's entries are their parameters: what vanishes depends on which parameters do."""


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
        """(h, θ₀, π₀) as kernels want it."""
        return np.array([h, self.reference.temperature, self.reference.pressure])

    def input_values(self) -> Array:
        """The values of the inputs, port by port."""
        values = [self.inputs[slot.path].value for slot in self.descriptor.outer]
        return np.concatenate([*values, np.zeros(1)])

    def memory(self, fill: int = 1) -> Memory:
        """Scratch memory for the loop, for factors of ``fill`` entries."""
        t = self.tables
        n, k, nv, nx = (int(t.dims[:, i].max(initial=0)) for i in range(4))
        size, rows = int(t.row.size), self.unknowns
        return Memory(
            e=np.zeros(n + 1),
            lam=np.zeros(k + 1),
            v=np.zeros(max(nv, 6) + 1),
            x=np.zeros(nx + 8),
            f=np.zeros(n * n + n + 1),
            c=np.zeros(k + 2),
            jac=np.zeros((n + k) * (n + k + nv) + 1),
            work=np.zeros(4096),
            data=np.zeros(size),
            factors=np.zeros(fill),
            residual=np.zeros(rows),
            scale=np.zeros(rows),
            block=np.zeros(t.group.size),
            group=np.zeros(int(t.group.max(initial=0)) + 1),
            step=np.zeros(rows),
            dense=np.zeros(rows),
            flows=np.zeros(int(t.e_index.size) + 1),
            energy=np.zeros(t.kind.size),
            defect=np.zeros(1),
            pivot=np.zeros(rows),
        )

    def path_of(self, component: int) -> Path:
        """The path of a component by its number."""
        return self.descriptor.components[component].path

    def unknown_name(self, column: int) -> str:
        """An unknown, in words."""
        n_rate, n_effort = int(self.tables.counts[0]), int(self.tables.counts[1])
        if column < n_rate:
            return (
                f"the rate of {next(s for s in self.descriptor.states if s.rates.start <= column < s.rates.stop).path}"
            )
        if column < n_rate + n_effort:
            at = column - n_rate
            junctions = self.descriptor.junctions
            return f"the effort at junction {next(j for j in junctions if j.efforts.start <= at < j.efforts.stop).path}"
        return self.row_name(column).replace("the constraint of", "a multiplier of")

    def row_path(self, row: int) -> str:
        """The path of the state, junction or component that the equation of a row, or its unknown, belongs to."""
        n_rate, n_effort = int(self.tables.counts[0]), int(self.tables.counts[1])
        d, at = self.descriptor, row - n_rate - n_effort
        if row < n_rate:
            return str(next(s for s in d.states if s.rates.start <= row < s.rates.stop).path)
        if at < 0:
            return str(next(j for j in d.junctions if j.efforts.start <= row - n_rate < j.efforts.stop).path)
        return next((str(s.path) for s in d.components if s.multiplier <= at < s.multiplier + s.multipliers), "")

    def row_name(self, row: int) -> str:
        """The equation of a row, in words."""
        n_rate, n_effort = int(self.tables.counts[0]), int(self.tables.counts[1])
        d = self.descriptor
        if row < n_rate:
            state = next(s for s in d.states if s.rates.start <= row < s.rates.stop)
            return f"the effort of storage {state.path}"
        if row < n_rate + n_effort:
            junction = next(j for j in d.junctions if j.efforts.start <= row - n_rate < j.efforts.stop)
            return f"the balance of flows at junction {junction.path}"
        at = row - n_rate - n_effort
        for slot in d.components:
            if slot.multiplier <= at < slot.multiplier + slot.multipliers:
                return f"the constraint of {slot.path}"
        return "the prescribed effort of an outer port"


def compile_model(
    descriptor: Descriptor, reference: Reference, inputs: Mapping[Path, Input] | None, *, matrix: bool = True
) -> Model:
    """Tabulate a descriptor form. Kernels are compiled where needed, and cached on disk.

    Parameters
    ----------
    matrix
        Whether to lay out the Jacobian, which most of the tables is; without it the components are there, and the whole
        cannot be evaluated.

    Raises
    ------
    AssemblyError
        An outer port without input, or an input without port.
    """
    d = descriptor
    given = d.complete_inputs(inputs)
    n_rate, n_effort, n_lam = d.rate_size, d.effort_size, d.multiplier_size
    size = d.unknowns(given)
    callbacks: dict[int, Callback] = {}
    kinds, addresses, dims, parameters = [], [], [], []
    lists: dict[str, list[list[int]]] = {"e": [], "x": [], "w": []}
    for number, slot in enumerate(d.components):
        primitive = slot.primitive
        address, numbers, callback = address_of(primitive)
        if callback is not None:
            callbacks[number] = callback
        is_storage = isinstance(primitive, Storage)
        kinds.append(STORING if is_storage else IRREVERSIBLE if isinstance(primitive, Irreversible) else REVERSIBLE)
        addresses.append(address)
        parameters.append(list(numbers))
        reads_x = [i for s in slot.reads for i in range(s.point.start, s.point.stop)]
        reads_w = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
        dims.append([len(slot.efforts), slot.multipliers, len(reads_w), len(reads_x)])
        for key, values in (("e", list(slot.efforts)), ("x", reads_x), ("w", reads_w)):
            lists[key].append(values)
    e_flat, e_at = _flatten(lists["e"])
    x_flat, x_at = _flatten(lists["x"])
    w_flat, w_at = _flatten(lists["w"])
    p_flat, p_at = _flatten(parameters, float)
    entropy, intensive = np.zeros(n_effort), np.zeros(n_effort)
    for junction in d.junctions:
        intensive[junction.efforts] = reference.intensive(junction.quantity)
        entropy[junction.efforts] = 1.0 if junction.quantity.kind == "entropy" else 0.0
    outer, input_at, at, unknown = [], [], 0, n_rate + n_effort + n_lam
    for junction in d.outer:
        dim, prescribed = junction.quantity.space.dim, given[junction.path].effort
        outer.append([junction.at, dim, int(prescribed), unknown if prescribed else -1])
        input_at.append(at)
        at += dim
        unknown += dim if prescribed else 0
    states = [
        [manifold(s.quantity.space).code, s.at, s.quantity.space.size, s.rate, s.quantity.space.dim] for s in d.states
    ]
    block, group = _blocks(d, given, size)
    table = Tables(
        counts=np.array([n_rate, n_effort, n_lam, size], dtype=np.int64),
        kind=np.array(kinds, dtype=np.int64),
        address=np.array(addresses, dtype=np.int64),
        dims=np.array(dims, dtype=np.int64).reshape(-1, 4),
        parameters=p_flat,
        parameter_at=p_at,
        e_index=e_flat,
        e_at=e_at,
        multiplier_at=np.array([s.multiplier for s in d.components], dtype=np.int64),
        read_x=x_flat,
        read_x_at=x_at,
        read_w=w_flat,
        read_w_at=w_at,
        jacobian=np.zeros(1, dtype=np.int64),
        jacobian_at=np.zeros(len(kinds), dtype=np.int64),
        states=np.array(states, dtype=np.int64).reshape(-1, 5),
        intensive=intensive,
        entropy=entropy,
        row=np.zeros(1, dtype=np.int64),
        column=np.zeros(1, dtype=np.int64),
        template=np.zeros(1),
        block=block,
        group=group,
        outer=np.array(outer, dtype=np.int64).reshape(-1, 4),
        input_at=np.array(input_at, dtype=np.int64),
    )
    first = n_rate + n_effort
    model = Model(d, reference, given, table, callbacks, np.arange(first, size, dtype=np.int64))
    if not matrix:
        return model
    local = [
        _places(slot, _local_pattern(slot, reference, callbacks.get(number)), n_rate, n_effort, size)
        for number, slot in enumerate(d.components)
    ]
    constant_at, values = _constant_entries(d, outer, n_rate, size)
    j_at = np.cumsum([0, *map(len, local)])[:-1].astype(np.int64)
    flat = np.concatenate([*local, np.full(1, -1)])
    place, found = _numbered(np.concatenate([constant_at, flat]))
    template = np.zeros(place.size + size)
    np.add.at(template, found[: values.size], values)
    diagonal = np.arange(size, dtype=np.int64)  # entries of their own, which hold what the loop adds
    table = table._replace(
        jacobian=np.append(found[values.size : -1], 0),
        jacobian_at=j_at,
        row=np.concatenate([place // size, diagonal]),
        column=np.concatenate([place % size, diagonal]),
        template=template,
    )
    return replace(model, tables=table)


def _numbered(keys: Index) -> tuple[Index, Index]:
    """The keys ≥ 0, each once, in the order of their first appearance; and each key's number there, or −1."""
    unique, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first)
    order = order[unique[order] >= 0]
    number = np.full(unique.size, -1, dtype=np.int64)
    number[order] = np.arange(order.size)
    return unique[order].astype(np.int64), number[inverse.ravel()]


def _flatten(rows: list[list[Any]], kind: type = int) -> tuple[Any, Index]:
    at = np.cumsum([0, *map(len, rows)])[:-1].astype(np.int64)
    flat = np.array([value for row in rows for value in row] + [0], dtype=np.float64 if kind is float else np.int64)
    return flat, at


def _constant_entries(d: Descriptor, outer: list[list[int]], n_rate: int, size: int) -> tuple[Index, Array]:
    """Places, row · size + column, and values of the entries that never change."""
    rows: list[int] = []
    columns: list[int] = []
    values: list[float] = []

    def add(row: int, column: int, value: float) -> None:
        rows.append(row)
        columns.append(column)
        values.append(value)

    for slot in d.components:
        if isinstance(slot.primitive, Storage):
            rates = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
            for rate, effort in zip(rates, slot.efforts, strict=True):
                add(rate, n_rate + effort, 1.0)
                add(n_rate + effort, rate, 1.0)
    for at, dim, prescribed, unknown in outer:
        if prescribed:
            for j in range(dim):
                add(unknown + j, n_rate + at + j, 1.0)
                add(n_rate + at + j, unknown + j, -1.0)
    return np.array(rows, dtype=np.int64) * size + np.array(columns, dtype=np.int64), np.array(values)


def _places(slot: ComponentSlot, pattern: Array, n_rate: int, n_effort: int, size: int) -> Index:
    """Where each local Jacobian entry goes in the matrix, row · size + column; −1 where it is structurally zero."""
    rates = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
    efforts = [n_rate + i for i in slot.efforts]
    if isinstance(slot.primitive, Storage):
        rows, columns = rates, rates
    else:
        lam = [n_rate + n_effort + slot.multiplier + i for i in range(slot.multipliers)]
        rows, columns = [*efforts, *lam], [*efforts, *lam, *rates]
    at = np.array(rows, dtype=np.int64)[:, None] * size + np.array(columns, dtype=np.int64)[None, :]
    return np.where(pattern, at, -1).ravel()


def _local_pattern(slot: ComponentSlot, reference: Reference, callback: Callback | None) -> Array:
    """Which entries of a component's Jacobian are not identically zero.

    Compiled kernels are analytic in their arguments, so what vanishes at three random points vanishes. Callbacks may
    have branches: all their entries count.
    """
    n, k = len(slot.efforts), slot.multipliers
    nv = sum(s.quantity.space.dim for s in slot.reads)
    shape = (n, n) if isinstance(slot.primitive, Storage) else (n + k, n + k + nv)
    if callback is not None or not shape[0]:
        return np.ones(shape, dtype=bool)
    kernel = slot.primitive.kernel
    numbers = kernel.parameters if kernel is not None else ()
    if kernel is not None and (kernel.module, kernel.name) in LINEAR:
        numbers = tuple(number != 0.0 for number in numbers)
    names = None if kernel is None else (kernel.module, kernel.name, kernel.source)
    key = (names, numbers, tuple(s.quantity for s in slot.reads), n, k)
    if key not in _patterns:
        _patterns[key] = _sample_pattern(slot, reference, shape)
    return _patterns[key]


_patterns: dict[Any, Array] = {}  # a cache: the pattern is a function of the key


def _sample_pattern(slot: ComponentSlot, reference: Reference, shape: tuple[int, int]) -> Array:
    import ctypes

    from ephs.semantics.checks import random_point
    from ephs.semantics.kernel_table import prototype

    rng = np.random.default_rng(5)
    primitive = slot.primitive
    address, numbers, _ = address_of(primitive)
    call = prototype(address)
    n, k = len(slot.efforts), slot.multipliers
    nv = sum(s.quantity.space.dim for s in slot.reads)
    found = np.zeros(shape, dtype=bool)
    for _ in range(3):
        point = random_point(primitive.bundle, primitive.reads, rng)
        x = np.concatenate([*(point[p] for p in primitive.reads), np.zeros(1)])
        dims = np.array([n, k, nv, x.size - 1], dtype=np.int64)
        arrays = [
            np.array([1e-2, reference.temperature, reference.pressure]),
            np.array([*numbers, 0.0]),
            x,
            1e-2 * rng.standard_normal(nv + 1),
            np.concatenate([random_efforts(primitive.bundle, rng), np.zeros(1)]),
            rng.standard_normal(k + 1),
            np.zeros(n * n + n + 1),
            np.zeros(k + 2),
            np.zeros((n + k) * (n + k + nv) + 1),
            np.zeros(4096),
        ]
        pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in arrays]
        call(dims.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), *pointers)
        out = arrays[6] if isinstance(primitive, Storage) else arrays[8]
        found |= out[: shape[0] * shape[1]].reshape(shape) != 0.0
    return found


def _blocks(d: Descriptor, given: Mapping[Path, Input], size: int) -> tuple[Index, Index]:
    """Rows whose residuals share one scale, those of one storage port, junction, component, outer port; and blocks of
    one kind: the same quantity in the same sort of equation."""
    n_rate = d.rate_size
    lam = n_rate + d.effort_size
    blocks: list[tuple[int, int, tuple[str, str]]] = []
    for state in d.states:
        blocks.append((state.rates.start, state.rates.stop, ("effort", state.quantity.kind)))
    for junction in d.junctions:
        efforts = junction.efforts
        blocks.append((n_rate + efforts.start, n_rate + efforts.stop, ("balance", junction.quantity.kind)))
    for slot in d.components:
        if slot.multipliers:
            first = next(iter(slot.primitive.bundle.items()))[2]
            at = lam + slot.multiplier
            blocks.append((at, at + slot.multipliers, ("effort", first.kind)))
    at = lam + d.multiplier_size
    for junction in d.outer:
        if given[junction.path].effort:
            dim = junction.quantity.space.dim
            blocks.append((at, at + dim, ("effort", junction.quantity.kind)))
            at += dim
    kinds = list(dict.fromkeys(kind for _, _, kind in blocks))
    block = np.zeros(size, dtype=np.int64)
    for number, (start, stop, _) in enumerate(blocks):
        block[start:stop] = number
    return block, np.array([kinds.index(kind) for _, _, kind in blocks], dtype=np.int64)


def evaluate_at(model: Model, x: Array, z: Array, h: float) -> tuple[int, int, Memory]:
    """Residual and matrix at a point, for analysis and tests: (status, component, memory that holds them)."""
    memory = model.memory()
    status, component = evaluate(model.tables, x, z, model.scal(h), model.input_values(), memory)
    return int(status), int(component), memory
