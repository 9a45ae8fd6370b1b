"""The network attached to a mechanism, as the arrays of `ephs.mechanics.tree.sweeps.network.Net`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.tables import copied
from ephs.mechanics.tree.sweeps.acting import Tables, Work
from ephs.mechanics.tree.sweeps.network import INTEGERS, REALS, Called, Net, Stores
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import starts
from ephs.semantics.stage import Evaluator, Integer, Vector
from ephs.solve.equations.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced


@final
@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """The two arrays of a network; one's own, as they hold memory."""

    integers: Index
    reals: Array

    def part(self, name: str) -> Array:
        """A part of the reals, as it is there."""
        at, size = self.integers[2 * (len(INTEGERS) + REALS.index(name)) :][:2]
        return self.reals[at : at + size]

    def whole(self, name: str) -> Index:
        """A part of the integers, as it is there."""
        at, size = self.integers[2 * INTEGERS.index(name) :][:2]
        return self.integers[at : at + size]


def attachment_of(reduced: "Reduced") -> Attachment:
    """The arrays of a mechanism's network, with its components' relations at rest."""
    t, there = reduced.tables, reduced.attaching
    net = there.network
    size, nodes = net.skew.shape[0], len(reduced.entropies) - len(net.states)
    rows: list[tuple[Index, Array]] = []
    places: list[tuple[int, int]] = []
    called, reads, varies, kept = list[list[int]](), list[int](), list[int](), 0
    stores: list[list[int]] = []
    for component, first in net.storages:
        n = int(t.dims[component, 0])
        stores.append([*_head(reduced, component), first, net.state_at + first, kept])
        kept += n * n
    for one, read, vary, flows in zip(net.attached, there.reads, there.varies, there.flows, strict=True):
        called.append([*_head(reduced, one.component), len(rows), len(reads), len(varies), kept])
        reads += read.tolist()
        varies += vary.tolist()
        n, k, nv, _ = t.dims[one.component].tolist()
        kept += (n + k) * (n + k + nv)
        made = {at: (int(flow), int(0 <= to < nodes)) for (at, to), flow in zip(one.heated, flows, strict=True)}
        for j, row in enumerate(one.rows):
            rows.append(_sparse(row))
            places.append(made.get(j, (-1, 0)))
    rows += [_sparse(row) for row in net.skew]
    places += [(-1, 0)] * size
    at = np.cumsum([0, *(where.size for where, _ in rows)])
    dims = t.dims[[one[6] for one in (*stores, *called)]] if stores or called else np.zeros((0, 4), dtype=np.int64)
    n, k, nv, nx = (int(column.max(initial=0)) for column in dims.T)
    named = called[0][6] if called else -1
    lists: dict[str, Any] = {
        "head": [len(net.rates), len(net.nodes), len(net.inputs), len(net.states), net.unknown, nodes, named],
        "store": stores, "called": called,
        "row": [[at[i], where.size, *place] for i, ((where, _), place) in enumerate(zip(rows, places, strict=True))],
        "term": [place for where, _ in rows for place in where], "read": reads, "vary": varies,
        "bent": there.bent,
        "temperature": net.nodes, "pivot": [0] * net.unknown, "fault": [0],
    }  # fmt: skip
    integers = {name: np.array(values, dtype=np.int64).ravel() for name, values in lists.items()}
    sizes = {
        "effort": size, "flow": size, "gross": size, "kept": kept, "x": nx + 8, "v": max(nv, 6) + 1, "e": n + k + 1,
        "f": n * n + n + k + 8, "work": 4096, "matrix": net.unknown**2, "step": net.unknown, "turned": size,
        "changed": size, "moved": len(varies), "power": 3,
    }  # fmt: skip
    reals = {"weight": np.concatenate([by for _, by in rows]) if rows else np.zeros(0)}
    reals |= {name: np.zeros(count) for name, count in sizes.items()} | {"outer": there.outer}
    whole, numbers = [integers[name] for name in INTEGERS], [reals[name] for name in REALS]
    head = np.concatenate([_places(whole, 2 * (len(INTEGERS) + len(REALS))), _places(numbers, 0)])
    return Attachment(np.concatenate([head, *whole]).astype(np.int64), np.concatenate(numbers))


def attached_energy(on: Evaluator, tables: Tables, work: Work, out: Vector) -> Integer:
    """Add the energy of attached storages at the states in the memory to out[1], sizes to out[2]; return a status."""
    net = Net.of(tables.net, tables.numbers, tables.parameters, tables.scal, tables.supply)
    status = net.energies(on, work.entropy, out)
    work.fault[0] = on.select(on.same(status, 0), work.fault[0], net.fault[0])
    return status


def _places(parts: Sequence[Array | Index], first: int) -> Index:
    """(2 parts,): where each starts, and its size, one after the other from a place on."""
    size = np.array([part.size for part in parts], dtype=np.int64)
    return np.column_stack([first + starts(size), size]).ravel()


def _head(reduced: "Reduced", component: int) -> list[int]:
    t = reduced.tables
    return [int(t.resting[component]), *t.dims[component].tolist(), int(t.parameter_at[component]), component]


def _sparse(row: Array) -> tuple[Index, Array]:
    where = np.flatnonzero(row)
    return where, row[where]


def laws_in(integers: Index) -> list[tuple[int, int]]:
    """Positions of addresses of components' relations in a network's integers, and the components."""
    found: list[tuple[int, int]] = []
    for name, record in (("store", Stores), ("called", Called)):
        at, size = integers[2 * INTEGERS.index(name) :][:2].tolist()
        rows = range(at, at + size, record.integer_width)
        found += [(row + record.law.offset, int(integers[row + record.component.offset])) for row in rows]
    return found


def with_derivatives(tables: Mapping[str, Any], address: Index) -> dict[str, Any]:
    """Tables with relations of components at addresses (components,), which may give derivatives, and with memory of
    the network apart.
    """
    component, net = copied(tables["component"]), tables["net"].copy()
    for number, law in enumerate(address.tolist()):
        component[number].law = law
    for place, number in laws_in(net):
        net[place] = address[number]
    return {**tables, "component": component, "net": net, "numbers": tables["numbers"].copy()}
