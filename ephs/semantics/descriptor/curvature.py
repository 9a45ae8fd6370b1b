"""Derivatives at a point, by the same compiled relations that runs step with, over a step of no length."""

import ctypes

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.kernel_table import OK, address_of, prototype
from ephs.semantics.primitives.primitives import Irreversible, Point, Reversible, Storage
from ephs.semantics.spaces import manifold


def curvature(storage: Storage, x: Point, reference: Reference | None = None) -> Array:
    """H″ (n, n) in trivialised directions, of E(x exp(v) exp(w)) by w and v.

    The effort over a step v is dE + ½ S v + …, with S of E(x exp(v)), which the bracket of increments makes H″:
    exp(v) exp(w) = exp(v + w + ½ [v, w] + …). Exact of recorded energies, else by differences of the efforts; no
    numbers outside of the domain.
    """
    n = storage.bundle.size
    effort, slope, _ = _written(storage, x, np.zeros(n), 0, reference)
    half = slope[: n * n].reshape(n, n)
    out = half + half.T
    for _, where, quantity in storage.bundle.items():
        group = manifold(quantity.space)
        for j, way in enumerate(np.eye(group.dim)):
            out[where, where.start + j] += 0.5 * effort[where] @ group.ad(way)
    return out


def turned(process: Reversible, x: Point, efforts: Array, rates: Array, reference: Reference) -> Array:
    """dC/dt e (k,) at the rates (m,) of the states that are read.

    Over a step v the conditions are C(x exp(v/2)) e. Exact of recorded structures, else by differences; no numbers
    outside of the domain.
    """
    n, k, m = efforts.size, process.multipliers, rates.size
    jacobian = _written(process, x, efforts, k, reference)[2]
    return 2.0 * jacobian[: (n + k) * (n + k + m)].reshape(n + k, -1)[n:, n + k :] @ rates


def flow_slopes(process: Irreversible, x: Point, efforts: Array, reference: Reference) -> Array:
    """(n, n) derivatives of the flows by the efforts. Exact of recorded structures, else by differences; no numbers
    outside of the domain.
    """
    n, m = efforts.size, sum(manifold(process.interface[port].quantity.space).dim for port in process.reads)
    return _written(process, x, efforts, 0, reference)[2][: n * (n + m)].reshape(n, n + m)[:, :n]


def _written(
    primitive: Storage | Reversible | Irreversible, x: Point, efforts: Array, k: int, reference: Reference | None
) -> tuple[Array, Array, Array]:
    """Efforts, flows and derivatives of a relation; NaN outside of its domain."""
    given = reference or Reference()
    n, m = efforts.size, sum(manifold(primitive.interface[port].quantity.space).dim for port in primitive.reads)
    address, numbers, _callback = address_of(primitive, given)
    point = np.concatenate([*(x[port] for port in primitive.reads), np.zeros(1)])
    dims = np.array([n, k, m, point.size - 1], dtype=np.int64)
    scal = np.array([0.0, given.temperature, given.pressure])
    effort, flow, jacobian = np.append(efforts, 0.0), np.zeros(n * n + n + 1), np.zeros((n + k) * (n + k + m) + 1)
    rest = np.zeros(max(m, k) + 1)
    arrays = (scal, np.append(numbers, 0.0), point, rest, effort, rest, flow, rest.copy(), jacobian, np.zeros(4096))
    pointers = [each.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for each in arrays]
    if prototype(address)(dims.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), *pointers) != OK:
        effort, flow, jacobian = (np.full(each.size, np.nan) for each in (effort, flow, jacobian))
    return effort, flow, jacobian
