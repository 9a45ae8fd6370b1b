"""Second derivatives of energies at a point, by the same compiled relations that runs step with."""

import ctypes

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.kernel_table import OK, address_of, prototype
from ephs.semantics.primitives.primitives import Point, Storage
from ephs.semantics.spaces import manifold


def curvature(storage: Storage, x: Point, reference: Reference | None = None) -> Array:
    """H″ (n, n) in trivialised directions, of E(x exp(v) exp(w)) by w and v.

    The effort over a step v is dE + ½ S v + …, with S of E(x exp(v)), which the bracket of increments makes H″:
    exp(v) exp(w) = exp(v + w + ½ [v, w] + …). Exact of recorded energies, else by differences of the efforts; no
    numbers outside of the domain.
    """
    given = reference or Reference()
    n = storage.bundle.size
    address, numbers, _callback = address_of(storage, given)
    dims = np.array([n, 0, n, sum(x[port].size for port in storage.reads)], dtype=np.int64)
    scal = np.array([0.0, given.temperature, given.pressure])
    point = np.concatenate([*(x[port] for port in storage.reads), np.zeros(1)])
    effort, slope, rest = np.zeros(n + 1), np.zeros(n * n + 1), np.zeros(n * n + 4096)
    arrays = (scal, np.append(numbers, 0.0), point, np.zeros(n + 1), effort, rest, slope, rest, rest, rest)
    pointers = [each.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for each in arrays]
    if prototype(address)(dims.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), *pointers) != OK:
        return np.full((n, n), np.nan)
    half = slope[: n * n].reshape(n, n)
    out = half + half.T
    for _, where, quantity in storage.bundle.items():
        group = manifold(quantity.space)
        for j, way in enumerate(np.eye(group.dim)):
            out[where, where.start + j] += 0.5 * effort[where] @ group.ad(way)
    return out
