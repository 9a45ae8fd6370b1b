"""Elements from plain functions: their tapes, gradients for Python, and relations in machine code."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.operad import Interface, Path
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.derive import relations
from ephs.semantics.derive.recording import Untraceable, record
from ephs.semantics.derive.relating import StatePort
from ephs.semantics.derive.tape import Tape, evaluate
from ephs.semantics.primitives.primitives import (
    Domain,
    Formula,
    Irreversible,
    Kernel,
    Point,
    Primitive,
    Reversible,
    Storage,
    state_ports,
)
from ephs.semantics.spaces import manifold
from ephs.semantics.stage.plain import PLAIN

LARGEST = 32
"""Largest number of state and effort coordinates together: a relation is written out, every derivative for itself."""
WITHOUT_SLOPE = ("sign", "sinhc", "choose")
"""Functions that jump, or have no rule for their slope between two arguments."""
Carried = dict[int, tuple[tuple[str, float], ...]]


@final
@dataclass(frozen=True, slots=True)
class StorageForm:
    """A recorded energy: its value, gradient and discrete gradient for Python, its relation."""

    energy: Callable[[Point], float]
    gradient: Callable[[Point], Array]
    discrete_gradient: Callable[[Point, Array], Array]
    kernel: Kernel


def stored(
    name: str,
    interface: Interface,
    energy: Callable[..., Any],
    numbers: Mapping[str, Any],
    parameters: tuple[tuple[str, object], ...] | None = None,
    printed: bool = True,
    **said: Any,
) -> Storage:
    """Storage of one energy, a function of the ports' states and of the numbers by name.

    Parameters
    ----------
    parameters
        As of a `Storage`; the numbers where None.
    printed
        Whether the energy is the formula that is printed and proved.
    **said
        As of a `Storage`.
    """

    def whole(**states: Any) -> Any:
        return energy(**states, **numbers)

    def called(x: Point) -> float:
        with np.errstate(all="ignore"):  # NaN and infinities are detected in the value
            return float(whole(**_named(x)))

    try:
        form = storage_form(interface, whole, label=name)
    except Untraceable:  # called back; the library's own are recorded, as tests ask
        form = None
    kept: dict[str, Any] = {"formula": Formula(energy, tuple(numbers)) if printed else None}
    return Storage(
        name,
        interface,
        energy=called if form is None else form.energy,
        gradient=None if form is None else form.gradient,
        discrete_gradient=None if form is None else form.discrete_gradient,
        parameters=tuple(numbers.items()) if parameters is None else parameters,
        kernel=None if form is None else form.kernel,
        **(kept | said),
    )


def dissipated(
    name: str,
    interface: Interface,
    matrix: Callable[..., Any],
    numbers: Mapping[str, Any],
    parameters: tuple[tuple[str, object], ...] | None = None,
    label: str = "relation",
    printed: bool = True,
    **said: Any,
) -> Irreversible:
    """Process of one M, a function of energy efforts, states that are read, and the numbers, by name; as `stored`."""
    bundle = Bundle.of(interface)
    reads = state_ports(interface)

    def whole(**values: Any) -> Any:
        return matrix(**values, **numbers)

    def called(x: Point, e: Array, reference: Reference) -> Array:
        given = bundle.split(e + bundle.intensive(reference)) | {port: x[port] for port in reads}
        with np.errstate(all="ignore"):
            return np.array(whole(**_named(given)), dtype=float)

    try:
        kernel = irreversible_kernel(interface, reads, Formula(whole), label=label)
    except Untraceable:  # called back; the library's own are recorded, as tests ask
        kernel = None
    evaluate = called if kernel is None else recorded_matrix(kernel, bundle, reads)
    entries = tuple(numbers.items()) if parameters is None else parameters
    kept: dict[str, Any] = {"formula": Formula(matrix, tuple(numbers)) if printed else None}
    return Irreversible(name, interface, evaluate, reads, entries, kernel, **(kept | said))


def coupled(
    name: str,
    interface: Interface,
    structure: Callable[..., Any],
    multipliers: int = 0,
    reads: tuple[Path, ...] = (),
    label: str = "",
    **said: Any,
) -> Reversible:
    """Reversible exchange of one function of the states that are read, by name: (L, C), either of which may be None.

    Parameters
    ----------
    reads
        Where not the state ports are read.
    """
    reads = reads or state_ports(interface)
    formula = Formula(structure)
    kernel = reversible_kernel(interface, reads, formula, multipliers, label=label or name)
    evaluate = recorded_structure(kernel, Bundle.of(interface).size, reads)
    return Reversible(name, interface, evaluate, reads, multipliers=multipliers, kernel=kernel, formula=formula, **said)


def recorded_matrix(
    kernel: Kernel, bundle: Bundle, reads: tuple[Path, ...]
) -> Callable[[Point, Array, Reference], Array]:
    """M (n, n) of a recorded process, from states, exergetic efforts (n,) and the reference; NaN where it has none."""
    value = recorded_values(kernel)
    return lambda x, e, reference: value([*(e + bundle.intensive(reference)), *_numbers_of(x, reads)])


def recorded_structure(kernel: Kernel, n: int, reads: tuple[Path, ...]) -> Callable[[Point], tuple[Array, Array]]:
    """(L (n, n), C (k, n)) of a recorded structure from states; NaN where it has none."""
    value = recorded_values(kernel)

    def structure(x: Point) -> tuple[Array, Array]:
        rows = value(_numbers_of(x, reads))
        return rows[:n], rows[n:]

    return structure


def tape_of(kernel: Kernel) -> Tape | None:
    """The record of a formula, of a kernel that has one."""
    match kernel.relation:
        case relations.StorageStep():
            return kernel.relation.energy
        case relations.ReversibleStep():
            return kernel.relation.structure
        case relations.IrreversibleStep():
            return kernel.relation.matrix
        case _:
            return None


def own_tape(kernel: Kernel) -> Tape | None:
    """The same of a kernel that is not seen through maps: its tape gives the component's own matrix."""
    of = kernel.relation
    seen = isinstance(of, relations.ReversibleStep | relations.IrreversibleStep) and of.maps is not None
    return None if seen else tape_of(kernel)


def recorded_values(kernel: Kernel) -> Callable[[Sequence[float]], Array]:
    """Evaluation of a kernel's tape at numbers, in the recorded shape; NaN where it has no value."""
    tape = tape_of(kernel)
    if tape is None:
        raise TypeError(f"{type(kernel.relation).__name__} has no tape")
    first = len(kernel.potentials)
    parameters = kernel.parameters[first : first + tape.parameters]
    return lambda numbers: run_tape(tape, numbers, parameters)


def run_tape(tape: Tape, numbers: Sequence[float], parameters: Sequence[float]) -> Array:
    """The values of a tape at numbers, in its shape; NaN where one has no value."""
    with np.errstate(all="ignore"):
        try:
            found = evaluate(PLAIN, tape, [np.float64(x) for x in numbers], [np.float64(p) for p in parameters])
        except ArithmeticError:  # of two numbers of the formula, as 1/0
            return np.full(tape.shape, np.nan)
    return np.array(found, dtype=float).reshape(tape.shape)


def _numbers_of(x: Point, ports: Sequence[Path]) -> list[float]:
    return [float(entry) for port in ports for entry in x[port]]


def _named(values: Point) -> dict[str, Any]:
    return {str(port): np.float64(value[0]) if value.size == 1 else value for port, value in values.items()}


def storage_form(
    interface: Interface, energy: Callable[..., Any], domain: Domain = (), label: str = "storage"
) -> StorageForm:
    """Record an energy of the states of power ports.

    Raises
    ------
    Untraceable
        It needs numbers, or has more states than a relation is written out for.
    """
    bundle = Bundle.of(interface)
    ports = bundle.ports
    found = record(energy, _arguments(interface, ports))
    if len(found.tape.outputs) != 1 or found.tape.inputs > LARGEST:
        raise Untraceable(f"an energy is one number, of states with at most {LARGEST}")
    steep = [name for name, _, _ in found.tape.operations if name in WITHOUT_SLOPE]
    if steep:
        raise Untraceable(f"an energy with {steep[0]}(…) has no discrete gradient")
    carried = _carried(bundle)
    bounds = _numbers(interface, ports, domain)
    hot = tuple(int(i) for i in np.flatnonzero(bundle.indicator(ENTROPY) > 0.0))
    relation = relations.StorageStep(
        found.tape, _ports(interface, ports), _reference(bundle), hot, tuple(carried), bounds
    )

    def discrete(x: Point, v: Array) -> Array:
        numbers = _numbers_of(x, ports)
        parameters = [np.float64(value) for value in found.parameters]
        with np.errstate(all="ignore"):
            try:
                return np.array(relation.slopes(PLAIN, numbers, list(v), parameters)[0], dtype=float)
            except ArithmeticError:  # of two numbers of the formula, as 1/0
                return np.full(bundle.size, np.nan)

    kernel = _kernel(label, relation, carried, found.parameters)
    value = recorded_values(kernel)
    return StorageForm(
        lambda x: value(_numbers_of(x, ports)).item(), lambda x: discrete(x, np.zeros(bundle.size)), discrete, kernel
    )


def reversible_kernel(
    interface: Interface,
    reads: tuple[Path, ...],
    formula: Formula,
    multipliers: int,
    domain: Domain = (),
    label: str = "relation",
) -> Kernel:
    """Record f = L(x) e + C(x)ᵀ λ, 0 = C(x) e.

    Raises
    ------
    Untraceable
        As `storage_form`.
    """
    n = Bundle.of(interface).size
    found = record(stacked(formula, n, multipliers), _arguments(interface, reads))
    _limited(found.tape.inputs + n + multipliers)
    relation = relations.ReversibleStep(found.tape, _ports(interface, reads), _numbers(interface, reads, domain))
    return _kernel(label, relation, {}, found.parameters)


def irreversible_kernel(
    interface: Interface, reads: tuple[Path, ...], formula: Formula, domain: Domain = (), label: str = "relation"
) -> Kernel:
    """Record f = M(x, eᴱ) e / θ₀.

    Raises
    ------
    Untraceable
        As `storage_form`.
    """
    bundle = Bundle.of(interface)
    n = bundle.size
    spans = {str(port): where for port, where, _ in bundle.items()}
    efforts = {port: _vector(where.stop - where.start) for port, where in spans.items()}
    states = _arguments(interface, reads)
    found = record(formula.function, {**efforts, **states})
    if found.tape.shape != (n, n):
        raise Untraceable(f"the matrix is {found.tape.shape}, expected {(n, n)}")
    _limited(found.tape.inputs)
    takes = [(True, i) for where in spans.values() for i in range(where.start, where.stop)]
    takes += [(False, i) for i in range(found.tape.inputs - n)]
    hot = tuple(where.start for _, where, quantity in bundle.items() if quantity.kind == "entropy")
    carried = _carried(bundle)
    mine = [bound for bound in domain if bound[0] not in reads]
    bounds = tuple(
        (i, low, high) for port, low, high in mine for i in range(spans[str(port)].start, spans[str(port)].stop)
    )
    relation = relations.IrreversibleStep(
        found.tape, tuple(takes), _ports(interface, reads), _reference(bundle), hot, tuple(carried),
        _numbers(interface, reads, domain), bounds,
    )  # fmt: skip
    return _kernel(label, relation, carried, found.parameters)


def obstacle(primitive: Primitive) -> str:
    """Why a primitive's function cannot be recorded, with the line."""
    if primitive.formula is None:
        return "it has no formula"
    try:
        if isinstance(primitive, Storage):
            storage_form(primitive.interface, primitive.formula.function)
        elif isinstance(primitive, Reversible):
            reversible_kernel(primitive.interface, primitive.reads, primitive.formula, primitive.multipliers)
        else:
            irreversible_kernel(primitive.interface, primitive.reads, primitive.formula)
    except Untraceable as error:
        return str(error)
    return "it was made without"


def stacked(formula: Formula, n: int, multipliers: int) -> Callable[..., Any]:
    """The two matrices of a reversible structure as one: L (n, n) above C (k, n)."""
    function, k = formula.function, multipliers

    def both(**x: Any) -> Any:
        skew, constraint = function(**x)
        upper = np.zeros((n, n)) if skew is None else np.asarray(skew, dtype=object)
        lower = np.zeros((k, n)) if constraint is None else np.asarray(constraint, dtype=object)
        return np.vstack([upper.reshape(n, n), lower.reshape(k, n)]).astype(object)

    return both


def _limited(numbers: int) -> None:
    if numbers > LARGEST:
        raise Untraceable(f"states and efforts have {numbers} numbers, expected at most {LARGEST}")


def _kernel(name: str, relation: relations.Relation, carried: Carried, parameters: Sequence[float]) -> Kernel:
    """The relation with its numbers: reference potentials first, known when the environment is."""
    numbers = (*[0.0] * len(carried), *parameters)
    return Kernel(name, relation, numbers, potentials=tuple(enumerate(carried.values())))


def _vector(size: int) -> int | None:
    """A vector of so many numbers, or a number."""
    return None if size == 1 else size


def _arguments(interface: Interface, ports: Sequence[Path]) -> dict[str, int | None]:
    sizes = {str(port): manifold(interface[port].quantity.space).size for port in ports}
    return {port: _vector(size) for port, size in sizes.items()}


def _ports(interface: Interface, ports: Sequence[Path]) -> tuple[StatePort, ...]:
    out: list[StatePort] = []
    for port in ports:
        space = manifold(interface[port].quantity.space)
        out.append(StatePort(space.code, space.size, space.dim, bool(interface[port].quantity.positive)))
    return tuple(out)


def _numbers(interface: Interface, ports: Sequence[Path], domain: Domain) -> tuple[tuple[int, float, float], ...]:
    """The bounds of each number of the states."""
    at, first = 0, dict[Path, range]()
    for port in ports:
        size = manifold(interface[port].quantity.space).size
        first[port] = range(at, at + size)
        at += size
    return tuple((i, low, high) for port, low, high in domain if port in first for i in first[port])


def _reference(bundle: Bundle) -> tuple[tuple[float, float], ...]:
    """Shares of θ₀ and of π₀ in each effort of the environment."""
    hot, wide = bundle.indicator(ENTROPY), bundle.indicator(VOLUME)
    return tuple((float(a), 0.0 - float(b)) for a, b in zip(hot, wide, strict=True))


def _carried(bundle: Bundle) -> Carried:
    """Effort -> charges with a potential, per unit of flow."""
    rows = {charge: bundle.indicator(charge) for charge in bundle.charges if charge not in (ENTROPY, VOLUME)}
    found = {i: tuple((charge, float(row[i])) for charge, row in rows.items() if row[i]) for i in range(bundle.size)}
    return {i: carried for i, carried in found.items() if carried}
