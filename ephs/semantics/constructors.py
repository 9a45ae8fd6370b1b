"""Primitives of one's own, from plain Python functions of the port variables; their structure is checked when made."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.operad import Directory, Interface, Path, PortType, Quantity
from ephs.semantics import library
from ephs.semantics.bundle import Array, Bundle, Reference
from ephs.semantics.errors import StructureError
from ephs.semantics.primitives import Irreversible, Point, Reversible, Storage

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["constraint", "gyrator", "irreversible", "storage", "transformer"]

Ports = Mapping[str, Quantity]


def storage(
    ports: Ports,
    energy: Callable[..., float],
    gradient: "Callable[..., Any] | None" = None,
    *,
    name: str = "storage",
) -> Storage:
    """Storage of the energy E(x) at power ports.

    Parameters
    ----------
    ports
        Port name -> quantity.
    energy
        E in J, called with the ports' states by name: floats where scalar, else arrays.
    gradient
        dE, left-trivialised: a sequence with an entry for each port, or (n,); by differences where None.

    Raises
    ------
    StructureError
        The energy is not even under time reversal, the gradient is not its differential, a temperature is negative.

    Examples
    --------
    >>> from ephs import quantity as Q, storage
    >>> storage({"q": Q.displacement}, lambda q: 0.25 * q**4, lambda q: [q**3]).kind
    'storage'
    """
    interface = _interface(ports)
    n = Bundle.of(interface).size
    given = gradient
    return Storage(
        name,
        interface,
        energy=lambda x: float(energy(**_named(interface, x))),
        gradient=None if given is None else lambda x: _flat(given(**_named(interface, x)), n),
        parameters=(("energy", _name(energy)),),
    )


def gyrator(ports: Ports, matrix: Any, *, name: str = "gyrator") -> Reversible:
    """Reversible f = L(x) e with L skew.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        L (n, n) over the power ports in their order; or a function of the read states, by name, that gives it.

    Raises
    ------
    StructureError
        L is not skew, does not conserve an environment quantity, or is not invariant under time reversal.
    """
    interface = _interface(ports)
    n = Bundle.of(interface).size
    if not callable(matrix):
        return library.constant_structure(name, interface, _matrix(name, matrix, n, n), np.zeros((0, n)))
    read = _reader(interface, matrix)
    return Reversible(
        name, interface, lambda x: (_matrix(name, read(x), n, n), np.zeros((0, n))), reads=_reads(interface)
    )


def transformer(ports: Ports, matrix: Any, *, name: str = "transformer") -> Reversible:
    """Reversible e₂ = g(x) e₁, f₁ = −g(x)* f₂ from the first power port to the others.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        g (n₂, n₁); or a function of the read states, by name, that gives it.
    """
    interface = _interface(ports)
    bundle = Bundle.of(interface)
    first = bundle.quantity(bundle.ports[0]).space.dim
    k = bundle.size - first

    def whole(g: Array) -> Array:
        return np.hstack([-g, np.eye(k)])

    if not callable(matrix):
        zero = np.zeros((bundle.size, bundle.size))
        return library.constant_structure(name, interface, zero, whole(_matrix(name, matrix, k, first)))
    read = _reader(interface, matrix)
    return Reversible(
        name,
        interface,
        lambda x: (np.zeros((bundle.size, bundle.size)), whole(_matrix(name, read(x), k, first))),
        reads=_reads(interface),
        multipliers=k,
    )


def constraint(
    ports: Ports, matrix: Any, *, multipliers: int | None = None, name: str = "constraint"
) -> Reversible:
    """Reversible f = C(x)* λ, 0 = C(x) e.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        C (k, n) over the power ports in their order; or a function of the read states, by name, that gives it.
    multipliers
        k, needed where the matrix is a function.
    """
    interface = _interface(ports)
    n = Bundle.of(interface).size
    zero = np.zeros((n, n))
    if not callable(matrix):
        given = np.atleast_2d(np.asarray(matrix, dtype=float))
        return library.constant_structure(name, interface, zero, _matrix(name, given, given.shape[0], n))
    if multipliers is None:
        raise StructureError(
            "parameter", name, key="multipliers", found=None, expected="the number of rows of C"
        )
    k, read = multipliers, _reader(interface, matrix)
    return Reversible(
        name,
        interface,
        lambda x: (zero, _matrix(name, read(x), k, n)),
        reads=_reads(interface),
        multipliers=k,
    )


def irreversible(ports: Ports, matrix: Callable[..., Any], *, name: str = "irreversible") -> Irreversible:
    """Irreversible f = M e / θ₀ with M symmetric, non-negative and without effect on energy, M eᴱ = 0.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        M (n, n) over the power ports in their order: a function of the *energy* efforts of the power ports (so of the
        absolute temperature at an entropy port, of −π at a volume port) and of the read states, by port name.

    Examples
    --------
    Friction that grows with the speed:

    >>> from ephs import quantity as Q, irreversible
    >>> irreversible(
    ...     {"p": Q.momentum, "s": Q.entropy},
    ...     lambda p, s: abs(p) * np.array([[s, -p], [-p, p * p / s]]),
    ... ).kind
    'irreversible'
    """
    interface = _interface(ports)
    bundle = Bundle.of(interface)

    def evaluate(x: Point, e: Array, reference: Reference) -> Array:
        energy = bundle.split(e + bundle.intensive(reference))
        return _matrix(name, matrix(**_named(interface, {**energy, **x})), bundle.size, bundle.size)

    return Irreversible(name, interface, evaluate, _reads(interface))


def _interface(ports: Ports) -> Interface:
    return Directory(
        {
            port.removeprefix("~"): PortType(quantity, not port.startswith("~"))
            for port, quantity in ports.items()
        }
    )


def _reads(interface: Interface) -> tuple[Path, ...]:
    return tuple(port for port, port_type in interface.items() if not port_type.power)


def _reader(interface: Interface, matrix: Callable[..., Any]) -> Callable[[Point], Any]:
    return lambda x: matrix(**_named(interface, x))


def _named(interface: Interface, values: Mapping[Path, Array]) -> dict[str, Any]:
    return {str(port): float(v[0]) if v.size == 1 else v for port, v in values.items() if port in interface}


def _flat(value: Any, n: int) -> Array:
    entries = value if isinstance(value, list | tuple) else [value]
    parts = [np.atleast_1d(np.asarray(entry, dtype=float)) for entry in entries]
    out = np.concatenate(parts) if parts else np.zeros(0)
    if out.shape != (n,):
        raise StructureError("parameter", "storage", key="gradient", found=out.shape, expected=(n,))
    return out


def _matrix(name: str, value: Any, rows: int, columns: int) -> Array:
    out = np.asarray(value, dtype=float)
    if out.shape != (rows, columns) or not np.all(np.isfinite(out)):
        raise StructureError(
            "parameter",
            name,
            key="matrix",
            found=out.tolist(),
            expected=f"finite numbers of shape ({rows}, {columns})",
        )
    return out


def _name(function: Callable[..., Any]) -> str:
    return getattr(function, "__name__", type(function).__name__)
