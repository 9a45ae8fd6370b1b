"""From a primitive to the address of a compiled function over its discrete relation.

All such functions have one signature, so that a driver calls any of them through a table of addresses and is itself
compiled once. Primitives that name a kernel have it compiled; the others (a user's own Python functions) are called
back in Python through the same signature, with a differenced Jacobian.
"""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.bundles.extents import room
from ephs.semantics.derive.relations import compiled
from ephs.semantics.primitives.behaviour import NaturalBehaviour, Storing
from ephs.semantics.primitives.differences import slope_within
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.stage import Signature
from ephs.semantics.stage.reaching import Atom

OK, TURN, TEMPERATURE, RAISED, EXTENT, DOMAIN = 0, 1, 2, 3, 4, 5
"""Results of kernels: done; half a turn in a step; θ ≤ 0; a Python function raised; a length or volume ≤ 0; a value
that is not a finite number."""

_REALS: Final[tuple[Atom, ...]] = ("reals",)
SIGNATURE: Final = Signature((("integers",), *[_REALS] * 10))
"""(dims, (h, θ₀, π₀), parameters, x⁰, v, e, λ, f, c, J, work); dims = n, k, dim of v, size of x⁰."""

_POINTER = ctypes.POINTER(ctypes.c_double)
_PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.POINTER(ctypes.c_int64), *[_POINTER] * 10)


def prototype(address: int) -> Any:
    """A kernel at an address, to be called from Python with pointers."""
    return _PROTOTYPE(address)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Callback:
    """A Python primitive behind the kernels' signature; it keeps the function and its exception alive."""

    function: Any
    errors: list[BaseException]

    @property
    def raised(self) -> BaseException | None:
        """The last exception that the function raised."""
        return self.errors[-1] if self.errors else None

    @property
    def address(self) -> int:
        """Address of the C function."""
        address = ctypes.cast(self.function, ctypes.c_void_p).value
        return address or 0


def address_of(
    primitive: Primitive, reference: Reference | None = None
) -> tuple[int, tuple[float, ...], Callback | None]:
    """(address, parameters, callback or None) of a primitive's discrete relation.

    Parameters
    ----------
    reference
        Whose potentials the parameters, or the callback, hold; temperature and pressure are arguments of kernels.
    """
    given = reference or Reference()
    if primitive.kernel is not None:
        return compiled(primitive.kernel.relation).address, primitive.kernel.numbers(given), None
    callback = _callback(primitive, given.potentials)
    return callback.address, (), callback


def _callback(primitive: Primitive, potentials: Mapping[str, float]) -> Callback:
    sizes = [manifold(primitive.interface[p].quantity.space).size for p in primitive.reads]
    dims = [manifold(primitive.interface[p].quantity.space).dim for p in primitive.reads]
    evaluate = _storage(primitive, potentials) if isinstance(primitive, Storage) else _relation(primitive, potentials)

    errors: list[BaseException] = []

    def call(counts: Any, *pointers: Any) -> int:
        n, k, m, size = (int(counts[i]) for i in range(4))
        try:
            scal = _view(pointers[0], 3)
            point = (
                dict(
                    zip(
                        primitive.reads,
                        np.split(_view(pointers[2], size).copy(), np.cumsum(sizes)[:-1]),
                        strict=True,
                    )
                )
                if sizes
                else {}
            )
            views = [_view(p, s) for p, s in zip(pointers[3:9], _lengths(primitive, n, k, m), strict=True)]
            evaluate(scal, point, dims, views)
            if not all(np.isfinite(values).all() for values in views):
                return DOMAIN
        except BaseException as error:
            if isinstance(error, SemanticsError) and error.kind == "domain":
                return DOMAIN
            errors.append(error)
            return RAISED
        return OK

    return Callback(_PROTOTYPE(call), errors)


def _lengths(primitive: Primitive, n: int, k: int, m: int) -> tuple[int, ...]:
    if isinstance(primitive, Storage):
        return (n, n, 0, n * n, 1, 0)
    return (m, n, k, n, k, (n + k) * (n + k + m))


def _view(pointer: Any, size: int) -> Array:
    return np.ctypeslib.as_array(pointer, (size,)) if size else np.zeros(0)


_Evaluate = Callable[[Array, dict[Any, Array], list[int], list[Array]], None]


def _storage(storage: Storage, potentials: Mapping[str, float]) -> _Evaluate:
    def evaluate(scal: Array, point: dict[Any, Array], _dims: list[int], views: list[Array]) -> None:
        v, effort, _, hessian, energy, _ = views
        reference = Reference(float(scal[1]), float(scal[2]), potentials)

        def outputs_at(step: Array) -> Array:
            return storage.discrete_effort(point, step, reference)

        step = v.copy()
        effort[:] = outputs_at(step)
        hessian[:] = slope_within(outputs_at, step, _rooms(storage, point)).ravel()
        energy[0] = storage.energy(storage.retract(point, step))

    return evaluate


def _relation(primitive: Primitive, potentials: Mapping[str, float]) -> _Evaluate:
    k = primitive.multipliers if isinstance(primitive, Reversible) else 0
    n = primitive.bundle.size

    def evaluate(scal: Array, point: dict[Any, Array], dims: list[int], views: list[Array]) -> None:
        v, e, lam, flow, condition, jacobian = views
        # h = 0 selects the continuous relation, whose increments v are zero.
        h = float(scal[0]) or 1.0
        local = NaturalBehaviour(Reference(float(scal[1]), float(scal[2]), potentials), h).behaviour(primitive, point)
        if isinstance(local, Storing):
            raise TypeError("a storage is not a relation")

        def outputs_at(z: Array) -> Array:
            rates = np.split(z[n + k :] / h, np.cumsum(dims)[:-1]) if dims else []
            read = dict(zip(primitive.reads, rates, strict=True))
            return np.concatenate(local.relate(z[:n], z[n : n + k], read))

        z = np.concatenate([e, lam, v])
        out = outputs_at(z)
        flow[:], condition[:] = out[:n], out[n:]
        rooms = np.concatenate([np.maximum(1.0, np.abs(z[: n + k])), _rooms(primitive, point)])
        jacobian[:] = slope_within(outputs_at, z, rooms).ravel()

    return evaluate


def _rooms(primitive: Primitive, point: Mapping[Any, Array]) -> Array:
    """(m,) lengths within which the states that are read may be moved."""
    of = [primitive.interface[port].quantity for port in primitive.reads]
    rooms = [np.full(each.space.dim, room(each, point[port])) for each, port in zip(of, primitive.reads, strict=True)]
    return np.concatenate([*rooms, np.zeros(0)])
