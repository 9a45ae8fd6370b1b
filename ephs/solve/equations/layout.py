"""Sparsity layout of a descriptor form's matrix: positions of the entries of each component's Jacobian.

What vanishes of a component's Jacobian is found once for all components of one formula, and components of one pattern
are placed at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.kernel_table import Callback, address_of
from ephs.semantics.descriptor.numbering import Index, spans, starts
from ephs.semantics.descriptor.sparsity import Mask, jacobian_mask
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.solve.methods.records import IRREVERSIBLE, REVERSIBLE, STORING, WORKING, Tables, efforts_of, rates_of


@final
@dataclass(frozen=True, slots=True, eq=False)
class LayoutEntry:
    """Entry of a primitive in the tables.

    Parameters
    ----------
    counts
        Kind, numbers, efforts, multipliers, read ports.
    """

    primitive: Primitive
    address: int
    numbers: Array
    callback: Callback | None
    counts: tuple[int, int, int, int, int]


def entry_of(primitive: Primitive, reference: Reference, *, reversible: bool = True) -> LayoutEntry:
    """The entry of a primitive; its kernel is compiled if necessary; of reversible primitives on request."""
    if reversible or not isinstance(primitive, Reversible):
        address, numbers, callback = address_of(primitive, reference)
    else:
        address, numbers, callback = 0, (), None
    if isinstance(primitive, Reversible):
        kind, multipliers = WORKING if primitive.working else REVERSIBLE, primitive.multipliers
    else:
        kind, multipliers = IRREVERSIBLE, 0
    bundle = primitive.bundle
    counts = (
        STORING if isinstance(primitive, Storage) else kind,
        len(numbers), bundle.size, multipliers, len(primitive.reads),
    )  # fmt: skip
    return LayoutEntry(primitive, address, np.array(numbers, dtype=float), callback, counts)


def laid_out(t: Tables, primitive: Index, entries: Sequence[LayoutEntry], reference: Reference) -> Tables:
    """The tables with the layout of the matrix.

    Parameters
    ----------
    primitive
        (components,) which of the entries each component is.
    """
    size = int(t.counts[3])
    flat, j_at = _places(t, primitive, [jacobian_mask(entry.primitive, reference) for entry in entries])
    constant_at, values = _constant_entries(t, size)
    place, found = _numbered(np.concatenate([constant_at, flat, np.full(1, -1)]))
    template = np.zeros(place.size + size)
    np.add.at(template, found[: values.size], values)
    diagonal = np.arange(size, dtype=np.int64)  # separate entries for the loop's additions
    row, column = place // size, place % size
    by_effort = (column >= t.counts[0]) & (column < t.counts[0] + t.counts[1])
    return replace(
        t,
        jacobian=np.append(found[values.size : -1], 0),
        jacobian_at=j_at,
        row=np.concatenate([row, diagonal]),
        column=np.concatenate([column, diagonal]),
        template=template,
        constraining=np.flatnonzero(by_effort & (row >= t.counts[0] + t.counts[1])),
        balancing=np.flatnonzero(by_effort & (row >= t.counts[0]) & (row < t.counts[0] + t.counts[1])),
    )


def _numbered(keys: Index) -> tuple[Index, Index]:
    """The keys ≥ 0, each once, in the order of their first appearance; and each key's number there, or −1."""
    there = keys >= 0
    unique, first, inverse = np.unique(keys[there], return_index=True, return_inverse=True)
    order = np.argsort(first)
    number, found = np.empty_like(order), np.full(keys.size, -1)
    number[order] = np.arange(order.size)
    found[there] = number[inverse]
    return unique[order], found


def _constant_entries(t: Tables, size: int) -> tuple[Index, Array]:
    """Places, row · size + column, and values of the entries that never change."""
    n_rate, storing = t.counts[0], np.flatnonzero(t.kind == STORING)
    rates, efforts = rates_of(t, storing), n_rate + efforts_of(t, storing)
    stored = np.stack([rates * size + efforts, efforts * size + rates], axis=1).ravel()
    at, dim, _, unknown = t.outer[t.outer[:, 2] == 1].T
    junctions, flows = n_rate + spans(at, dim), spans(unknown, dim)
    prescribed = np.stack([flows * size + junctions, junctions * size + flows], axis=1).ravel()
    values = np.concatenate([np.ones(stored.size), np.tile([1.0, -1.0], junctions.size)])
    return np.concatenate([stored, prescribed]), values


def _places(t: Tables, primitive: Index, patterns: Sequence[Mask]) -> tuple[Index, Index]:
    """Positions of local Jacobian entries in the matrix, row · size + column, −1 where it is structurally zero; and
    where those of each component begin. Components of one pattern are placed at once."""
    n_rate, n_effort, size = t.counts[0], t.counts[1], t.counts[3]
    same = {id(pattern): pattern for pattern in patterns}
    number = {key: i for i, key in enumerate(same)}
    of = np.array([number[id(pattern)] for pattern in patterns], dtype=np.int64)[primitive]
    j_at = starts(np.array([pattern.size for pattern in same.values()], dtype=np.int64)[of])
    out = np.full(sum(pattern.size * int((of == i).sum()) for i, pattern in enumerate(same.values())), -1)
    for i, pattern in enumerate(same.values()):
        these = np.flatnonzero(of == i)
        rates = t.read_w[t.read_w_at[these, None] + np.arange(t.dims[these[0], 2])]
        rows = columns = rates
        if t.kind[these[0]] != STORING:
            efforts = n_rate + t.e_index[t.e_at[these, None] + np.arange(t.dims[these[0], 0])]
            lam = n_rate + n_effort + t.multiplier_at[these, None] + np.arange(t.dims[these[0], 1])
            rows, columns = np.hstack([efforts, lam]), np.hstack([efforts, lam, rates])
        at = np.where(pattern, rows[:, :, None] * size + columns[:, None, :], -1)
        out[j_at[these, None] + np.arange(pattern.size)] = at.reshape(these.size, -1)
    return out, j_at
