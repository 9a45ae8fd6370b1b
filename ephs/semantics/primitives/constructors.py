"""User-defined primitives from plain Python functions of the port variables.

Their structure is proved when they are made, or searched for counterexamples. The functions are recorded once:
gradients, discrete gradients, Jacobians, printed formulas and machine code come from that, once for all primitives that
differ in numbers only. A function that branches on its arguments or turns them into floats cannot be recorded; it is
then differenced, and called back in Python.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ephs.operad import Directory, Interface, PortType, Quantity
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.domains import Bounds, bounded, domain_of, within_domain
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.bundles.given import defined, finite_matrix, flat_vector, real_number, require_arguments, value_of
from ephs.semantics.derive.recording import Untraceable
from ephs.semantics.primitives import forms, structures
from ephs.semantics.primitives.primitives import (
    Domain,
    Formula,
    Irreversible,
    Kernel,
    Point,
    Reversible,
    Storage,
    state_ports,
)
from ephs.semantics.verdicts.checks import random_point

Ports = Mapping[str, Quantity]
Matrix = ArrayLike | Callable[..., ArrayLike]


def storage(
    ports: Ports,
    energy: Callable[..., float],
    gradient: Callable[..., Any] | None = None,
    *,
    initial: Mapping[str, object] | None = None,
    domain: Bounds | None = None,
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
        dE, left-trivialised: a sequence with an entry for each port, or (n,). By default derived from the
        energy, by finite differences if the energy cannot be recorded.
    initial
        Port name -> state in which a run starts; the identity of its space where not given.
    domain
        Port name -> (least, greatest) bounds of its states, within which the conditions must hold. A run that
        leaves the domain ends with a message.

    Raises
    ------
    StructureError
        The energy is not even under time reversal, the gradient is not its differential, a temperature is not
        positive, or a function does not take the ports' names.
    AssemblyError
        An initial value of no port, of a wrong shape, or that is not finite.

    Examples
    --------
    >>> from ephs import quantity as Q, storage
    >>> storage({"q": Q.displacement}, lambda q: 0.25 * q**4, lambda q: [q**3]).kind
    'storage'
    """
    interface = _interface(name, ports)
    n = Bundle.of(interface).size
    for port in state_ports(interface):
        raise StructureError("storage-ports", name, found=str(port))
    require_arguments(name, "energy", energy, tuple(interface))
    if gradient is not None:
        require_arguments(name, "gradient", gradient, tuple(interface))
    given = gradient

    bounds = domain_of(name, interface, domain)

    def called(x: Point) -> float:
        with np.errstate(all="ignore"):  # NaN and infinities are detected in the value
            return real_number(name, value_of(name, "the energy", energy, x))

    try:
        form = forms.storage_form(interface, energy, bounds)
    except Untraceable:
        form = None

    def slope(x: Point) -> Array:
        return (
            flat_vector(name, value_of(name, "the gradient", given, x), n) if given is not None else np.full(n, np.nan)
        )

    derived = slope if given is not None else None if form is None else form.gradient
    made = Storage(
        name,
        interface,
        energy=bounded(called if form is None else form.energy, bounds, math.nan),
        gradient=bounded(derived, bounds, np.full(n, np.nan)) if derived is not None and bounds else derived,
        discrete_gradient=None if form is None else form.discrete_gradient,
        parameters=(("energy", _name(energy)),),
        kernel=None if form is None else form.kernel,
        formula=Formula(energy, gradient=gradient),
        domain=bounds,
    )
    return made.with_initial(initial) if initial else made


def gyrator(
    ports: Ports,
    matrix: Matrix,
    *,
    domain: Bounds | None = None,
    external_field: bool = False,
    name: str = "gyrator",
) -> Reversible:
    """Reversible f = L(x) e with L skew.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        L (n, n) over the power ports in their order; or a function of the read states, by name, that gives it.
    domain
        Of the read states, as of a `storage`.
    external_field
        An external field turns around with time, as a magnet's or the rotation of a frame: L may join quantities of
        equal parity, as in a permanent-magnet motor, a circulator, or for the Lorentz force.

    Raises
    ------
    StructureError
        L is not skew, does not conserve an environment quantity, or is not invariant under time reversal.
    """
    interface = _interface(name, ports)
    n = Bundle.of(interface).size
    if not callable(matrix) and not domain:
        skew = finite_matrix(name, matrix, n, n)
        return structures.constant_structure(name, interface, skew, np.zeros((0, n)), external_field=external_field)
    given, read = _reader(name, interface, matrix, n, n)

    def called(x: Point) -> tuple[Array, Array]:
        return finite_matrix(name, read(x), n, n), np.zeros((0, n))

    return reversible(name, interface, called, Formula(_both(given, None)), 0, domain, external_field)


def transformer(
    ports: Ports,
    matrix: Matrix,
    *,
    domain: Bounds | None = None,
    external_field: bool = False,
    name: str = "transformer",
) -> Reversible:
    """Reversible e₂ = g(x) e₁, f₁ = −g(x)* f₂ from the first power port to the others.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        g (n₂, n₁); or a function of the read states, by name, that gives it.
    domain, external_field
        As of a `gyrator`.
    """
    interface = _interface(name, ports)
    bundle = Bundle.of(interface)
    if len(bundle.ports) < 2:
        found = ", ".join(map(str, bundle.ports))
        raise StructureError("parameter", name, key="ports", found=found, expected="two power ports or more")
    first = bundle.quantity(bundle.ports[0]).space.dim
    k = bundle.size - first

    def whole(g: Array) -> Array:
        return np.hstack([-g, np.eye(k)])

    if not callable(matrix) and not domain:
        zero = np.zeros((bundle.size, bundle.size))
        rows = whole(finite_matrix(name, matrix, k, first))
        return structures.constant_structure(name, interface, zero, rows, external_field=external_field)
    given, read = _reader(name, interface, matrix, k, first)
    right = np.eye(k).astype(object)

    def beside(**x: Any) -> Any:
        return np.hstack([-np.asarray(given(**x), dtype=object), right])

    def called(x: Point) -> tuple[Array, Array]:
        return np.zeros((bundle.size, bundle.size)), whole(finite_matrix(name, read(x), k, first))

    return reversible(name, interface, called, Formula(_both(None, beside)), k, domain, external_field)


def constraint(
    ports: Ports,
    matrix: Matrix,
    *,
    multipliers: int | None = None,
    domain: Bounds | None = None,
    external_field: bool = False,
    name: str = "constraint",
) -> Reversible:
    """Reversible f = C(x)* λ, 0 = C(x) e.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        C (k, n) over the power ports in their order; or a function of the read states, by name, that gives it.
    multipliers
        k; where None and the matrix is a function, its rows are counted at a random state.
    domain, external_field
        As of a `gyrator`.
    """
    interface = _interface(name, ports)
    n = Bundle.of(interface).size
    zero = np.zeros((n, n))
    if not callable(matrix) and not domain:
        given: Any = matrix
        k = len(given) if np.ndim(given) == 2 else 1
        rows = finite_matrix(name, np.atleast_2d(given), k, n)
        return structures.constant_structure(name, interface, zero, rows, external_field=external_field)
    given, read = _reader(name, interface, matrix, multipliers, n)
    k = _rows(interface, read) if multipliers is None else multipliers

    def called(x: Point) -> tuple[Array, Array]:
        return zero, finite_matrix(name, read(x), k, n)

    return reversible(name, interface, called, Formula(_both(None, given)), k, domain, external_field)


def irreversible(
    ports: Ports,
    matrix: Callable[..., Any],
    *,
    domain: Bounds | None = None,
    one_sided: bool = False,
    name: str = "irreversible",
) -> Irreversible:
    """Irreversible f = M e / θ₀ with M symmetric, non-negative and without effect on energy, M eᴱ = 0.

    Parameters
    ----------
    ports
        Port name -> quantity; ``"~name"`` for a state port, which the matrix may read.
    matrix
        M (n, n) over the power ports in their order: a function of the *energy* efforts of the power ports (so of the
        absolute temperature at an entropy port, of −π at a volume port) and of the read states, by port name.
    domain
        Of energy efforts and read states by port name, as of a `storage`.
    one_sided
        M depends on the direction of the flow, as of a valve or a diode: it need not be even under time reversal.

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
    interface = _interface(name, ports)
    bundle = Bundle.of(interface)
    require_arguments(name, "matrix", matrix, tuple(interface))
    bounds, n = domain_of(name, interface, domain), bundle.size

    formula, reads = Formula(matrix), state_ports(interface)
    kernel = _kernel(interface, formula, None, bounds)
    recorded = None if kernel is None else forms.recorded_matrix(kernel, bundle, reads)

    def evaluate(x: Point, e: Array, reference: Reference) -> Array:
        given = {**bundle.split(e + bundle.intensive(reference)), **x}
        if not within_domain(bounds, given):
            return np.full((n, n), np.nan)
        if recorded is None:
            return finite_matrix(name, value_of(name, "the matrix", matrix, given), n, n)
        return defined(name, "the matrix M", recorded(x, e, reference), given)

    return Irreversible(
        name, interface, evaluate, reads, kernel=kernel, formula=formula, domain=bounds, one_sided=one_sided
    )


def reversible(
    name: str,
    interface: Interface,
    called: Callable[[Point], tuple[Array, Array]],
    formula: Formula,
    multipliers: int,
    domain: Bounds | None,
    external_field: bool = False,
) -> Reversible:
    """A structure that reads states: that of its formula's record, else that of a function, ``called`` back.

    Its states may have a domain.
    """
    bounds = domain_of(name, Interface({port: interface[port] for port in state_ports(interface)}), domain)
    n, kernel = Bundle.of(interface).size, _kernel(interface, formula, multipliers, bounds)
    recorded = None if kernel is None else forms.recorded_structure(kernel, n, state_ports(interface))

    def structure(x: Point) -> tuple[Array, Array]:
        if recorded is None:
            return called(x)
        skew, constraint = recorded(x)
        return defined(name, "the matrix L", skew, x), defined(name, "the matrix C", constraint, x)

    nothing = np.full((n, n), np.nan), np.full((multipliers, n), np.nan)
    return Reversible(
        name,
        interface,
        bounded(structure, bounds, nothing) if bounds else structure,
        reads=state_ports(interface),
        multipliers=multipliers,
        kernel=kernel,
        formula=formula,
        domain=bounds,
        external_field=external_field,
    )


def _both(skew: Callable[..., Any] | None, constraint: Callable[..., Any] | None) -> Callable[..., Any]:
    """(L, C) as one function of the states."""

    def structure(**x: Any) -> tuple[Any, Any]:
        return None if skew is None else skew(**x), None if constraint is None else constraint(**x)

    return structure


def _kernel(interface: Interface, formula: Formula, multipliers: int | None, bounds: Domain) -> Kernel | None:
    """The kernel of a reversible structure with so many multipliers, or of an irreversible one; None if untraced."""
    reads = state_ports(interface)
    try:
        if multipliers is None:
            return forms.irreversible_kernel(interface, reads, formula, bounds)
        return forms.reversible_kernel(interface, reads, formula, multipliers, bounds)
    except Untraceable:
        return None


def _interface(name: str, ports: Ports) -> Interface:
    found: dict[str, PortType] = {}
    for port, quantity in ports.items():
        plain = port.removeprefix("~")
        if plain in found:
            expected = "one entry for a port, with or without ~"
            raise StructureError("parameter", name, key="ports", found=f"{plain} twice", expected=expected)
        found[plain] = PortType(quantity, power=plain == port)
    if not any(port.power for port in found.values()):
        given = ", ".join(ports) or "none"
        raise StructureError("parameter", name, key="ports", found=given, expected="a power port at least")
    return Directory(found)


def _reader(
    name: str, interface: Interface, matrix: Matrix, rows: int | None, columns: int
) -> tuple[Callable[..., Any], Callable[[Point], ArrayLike]]:
    """The matrix as a function of the states that are read: by name, of its shape, and as a point."""

    def constant(**_: Any) -> Any:
        return matrix

    given = matrix if callable(matrix) else constant
    require_arguments(name, "matrix", given, state_ports(interface))

    def shaped(**x: Any) -> Any:
        found = np.asarray(given(**x), dtype=object)
        expected = found.shape[0] if rows is None and found.ndim else rows, columns
        if found.shape != expected:
            raise ValueError(f"the matrix is {found.shape}, expected {expected}")
        return found

    return shaped, lambda x: value_of(name, "the matrix", given, x)


def _rows(interface: Interface, read: Callable[[Point], ArrayLike]) -> int:
    x = random_point(Bundle.of(interface), state_ports(interface), np.random.default_rng(24))
    return len(np.atleast_2d(np.asarray(read(x), dtype=float)))


def _name(function: Callable[..., Any]) -> str:
    return str(getattr(function, "__name__", type(function).__name__))
