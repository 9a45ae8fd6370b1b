"""Sparsity of the Jacobian of a component, decided from the structure of its relation."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.derive.linear import Linear
from ephs.semantics.derive.relations import LogarithmLoss, LogarithmStep, Relation, entry_of
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.stage.evaluator import known
from ephs.semantics.stage.memory import HeldCells, Integers, Vector
from ephs.semantics.stage.numbers import Real
from ephs.semantics.stage.zeros import ANYTHING, Zeros

Mask = NDArray[np.bool_]


def jacobian_mask(primitive: Primitive, reference: Reference | None = None) -> Mask:
    """Entries that count: (n, n) of efforts by increments, else (n + k, n + k + m) of flows and conditions by efforts,
    multipliers and increments. All entries of a Python function that could not be recorded.

    Equal masks are one array.
    """
    kernel = primitive.kernel
    groups = [manifold(primitive.interface[port].quantity.space) for port in primitive.reads]
    k = primitive.multipliers if isinstance(primitive, Reversible) else 0
    dims = (primitive.bundle.size, k, sum(group.dim for group in groups), sum(group.size for group in groups))
    stores = isinstance(primitive, Storage)
    if kernel is None:
        return _full(stores, dims)
    numbers = kernel.numbers(reference or Reference())
    # of what is linear the numbers themselves are entries; of the others zeros may come from numbers that are zero
    given = numbers if isinstance(kernel.relation, Linear) else tuple(0.0 if x == 0.0 else None for x in numbers)
    return _mask(kernel.relation, stores, dims, given)


@cache
def _full(stores: bool, dims: tuple[int, ...]) -> Mask:
    n, k, m, _ = dims
    return np.ones((n, n) if stores else (n + k, n + k + m), dtype=bool)


@cache
def _mask(relation: Relation | Linear, stores: bool, dims: tuple[int, ...], given: tuple[float | None, ...]) -> Mask:
    """The mask with these numbers, None where they may be anything."""
    full = _full(stores, dims)
    if isinstance(relation, LogarithmStep | LogarithmLoss):  # stiffness and viscosity have no zeros
        return full
    (n, k, m, size), on = dims, Zeros()

    def vector(entry: Real, count: int) -> Vector:
        return on.vector([entry] * (count + 1))

    slope, jacobian = vector(0.0, n * n), vector(0.0, full.size)
    program, name = entry_of(relation)
    program.entries[name].function(
        on,
        Integers(HeldCells(list(dims)), 0, 4),
        vector(ANYTHING, 2),
        on.vector([ANYTHING if number is None else number for number in (*given, 0.0)]),
        vector(ANYTHING, size),
        vector(ANYTHING, m),
        vector(0.0 if stores else ANYTHING, n),
        vector(ANYTHING, k),
        slope,
        vector(0.0, k + 1),
        jacobian,
        vector(0.0, 1),
    )
    out = slope if stores else jacobian
    return np.array([not known(out[i]) or out[i] != 0.0 for i in range(full.size)], dtype=bool).reshape(full.shape)
