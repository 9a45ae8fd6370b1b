"""Traced primitives: from a function of port variables to its formula, its derivatives and its compiled kernel."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

import numpy as np

from ephs.operad import Interface, Path
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.bundle import Array, Bundle
from ephs.semantics.primitives import Formula, Kernel, Point
from ephs.semantics.spaces import manifold
from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.programs import TEMPERATURE, Base, intensive, potential, relation_program, storage_program
from ephs.semantics.symbols.tracing import Trace, Untraceable, symbols_of, trace

__all__ = ["StorageForm", "irreversible_kernel", "reversible_kernel", "stacked", "storage_form"]

KERNELS = "ephs.semantics.symbols.traced_kernels"
LARGEST = 16
"""Limit on the numbers in a storage's states, the scratch length of a traced kernel."""


@final
@dataclass(frozen=True, slots=True)
class StorageForm:
    """A traced energy: its gradient for Python, its kernel."""

    gradient: Callable[[Point], Array]
    kernel: Kernel


def storage_form(interface: Interface, energy: Callable[..., Any]) -> StorageForm:
    """Trace an energy of the states of power ports.

    Raises
    ------
    Untraceable
        It needs numbers, or has more states than a kernel's scratch can hold.
    """
    bundle = Bundle.of(interface)
    states, base = _states(interface, bundle.ports)
    traced = trace(energy, states)
    if traced.outputs.size != 1 or sum(len(x) for _, x in base) > LARGEST:
        raise Untraceable("one number is expected, of sixteen at most")
    parameters = tuple(traced.parameters)
    program = storage_program(traced.outputs.item(), parameters, base)
    numbers = np.array(list(traced.parameters.values()) or [0.0])
    n = bundle.size

    def gradient(x: Point) -> Array:
        out = (np.empty(n), np.empty(1), np.empty(n * n))
        program(np.zeros(3), numbers, np.concatenate([x[p] for p in bundle.ports]), np.empty(0), np.empty(0), out)
        return out[0]

    layout = [float(len(bundle.ports))]
    at = 0
    for (code, x), (_, where, _) in zip(base, bundle.items(), strict=True):
        layout += [float(code), float(at), float(len(x)), float(where.start), float(where.stop - where.start)]
        at += len(x)
    shifts = [*bundle.indicator(ENTROPY).tolist(), *(0.0 - bundle.indicator(VOLUME)).tolist(), *[0.0] * n]
    places = {len(layout) + 2 * n + i: carried for i, carried in _carried(bundle).items()}
    entries = (*layout, *shifts, *traced.parameters.values())
    kernel = Kernel(KERNELS, "storage", entries, program.source, potentials=tuple(places.items()))
    return StorageForm(gradient, kernel)


def _carried(bundle: Bundle) -> dict[int, tuple[tuple[str, float], ...]]:
    """Effort -> how much a unit there carries of the charges that have a potential."""
    rows = {charge: bundle.indicator(charge) for charge in bundle.charges if charge not in (ENTROPY, VOLUME)}
    found = {i: tuple((charge, float(row[i])) for charge, row in rows.items() if row[i]) for i in range(bundle.size)}
    return {i: carried for i, carried in found.items() if carried}


def reversible_kernel(interface: Interface, reads: tuple[Path, ...], formula: Formula, multipliers: int) -> Kernel:
    """Trace f = L(x) e + C(x)ᵀ λ, 0 = C(x) e."""
    bundle = Bundle.of(interface)
    states, base = _states(interface, reads)
    n, k = bundle.size, multipliers
    efforts, forces = tuple(sp.symbols(f"e_:{n}", real=True)), tuple(sp.symbols(f"lambda_:{k}", real=True))
    traced = trace(stacked(formula, n, k), states)
    skew, constraint = (sp.Matrix(len(rows), n, list(rows.flat)) for rows in np.split(traced.outputs, [n]))
    e, lam = sp.Matrix(n, 1, efforts), sp.Matrix(k, 1, forces)
    flows = (skew * e + constraint.T * lam) if k else skew * e
    conditions = constraint * e if k else sp.Matrix(0, 1, [])
    return _relation(interface, reads, base, traced, (tuple(flows), tuple(conditions)), (efforts, forces))


def irreversible_kernel(interface: Interface, reads: tuple[Path, ...], formula: Formula) -> Kernel:
    """Trace f = M(x, eᴱ) e / θ₀."""
    bundle = Bundle.of(interface)
    states, base = _states(interface, reads)
    n = bundle.size
    energy: dict[str, Any] = {}
    efforts: list[Expr] = []
    exergy: list[Expr] = []
    # the reference potentials of an effort are one number to the program
    potentials = {i: sp.Symbol(f"mu_{i}", real=True) for i in _carried(bundle)}
    for port, where, quantity in bundle.items():
        mine = tuple(sp.symbols(f"e_{where.start}:{where.stop}", real=True))
        unnamed = {potential(charge): 0 for charge, _ in quantity.charges}
        shifts = [
            entry.subs(unnamed) + potentials.get(where.start + i, 0) for i, entry in enumerate(intensive(quantity))
        ]
        efforts += mine
        exergy += mine
        shifted = tuple(symbol + shift for symbol, shift in zip(mine, shifts, strict=True))
        energy[str(port)] = shifted[0] if len(shifted) == 1 else shifted
    traced = trace(formula.function, {**energy, **states})
    if traced.outputs.shape != (n, n):
        raise Untraceable(f"the matrix is {traced.outputs.shape}")
    matrix = sp.Matrix(n, n, list(traced.outputs.flat))
    flows = tuple(matrix * sp.Matrix(n, 1, exergy) / TEMPERATURE)
    return _relation(interface, reads, base, traced, (flows, ()), (tuple(efforts), ()), potentials)


def stacked(formula: Formula, n: int, multipliers: int) -> Callable[..., Any]:
    """The two matrices of a reversible structure as one: L (n, n) above C (k, n)."""
    function, k = formula.function, multipliers

    def both(**x: Any) -> Any:
        skew, constraint = function(**x)
        upper = np.zeros((n, n)) if skew is None else np.asarray(skew, dtype=object)
        lower = np.zeros((k, n)) if constraint is None else np.asarray(constraint, dtype=object)
        return np.vstack([upper.reshape(n, n), lower.reshape(k, n)]).astype(object)

    return both


def _states(interface: Interface, ports: tuple[Path, ...]) -> tuple[dict[str, Any], Base]:
    states: dict[str, Any] = {}
    base: list[tuple[int, tuple[Expr, ...]]] = []
    for number, port in enumerate(ports):
        quantity = interface[port].quantity
        space = manifold(quantity.space)
        symbols = symbols_of(f"x_{number}", quantity, space.size)
        states[str(port)] = symbols[0] if len(symbols) == 1 else symbols
        base.append((space.code, symbols))
    return states, tuple(base)


def _relation(
    interface: Interface,
    reads: tuple[Path, ...],
    base: Base,
    traced: Trace,
    outputs: tuple[tuple[Expr, ...], tuple[Expr, ...]],
    unknowns: tuple[tuple[Expr, ...], tuple[Expr, ...]],
    potentials: Mapping[int, Expr] = MappingProxyType({}),
) -> Kernel:
    bundle = Bundle.of(interface)
    if any(len(x) > LARGEST for _, x in base):
        raise Untraceable("a state of more than sixteen numbers")
    program = relation_program(*outputs, (*potentials.values(), *traced.parameters), base, *unknowns)
    hot = [float(where.start) for _, where, quantity in bundle.items() if quantity.kind == "entropy"]
    if not any(TEMPERATURE in entry.free_symbols for entry in outputs[0]):
        hot = []  # a reversible relation divides by no temperature
    layout = [float(len(reads)), float(len(hot))]
    at = first = 0
    for (code, x), port in zip(base, reads, strict=True):
        dim = manifold(interface[port].quantity.space).dim
        layout += [float(code), float(at), float(len(x)), float(first), float(dim)]
        at, first = at + len(x), first + dim
    first = len(layout) + len(hot)
    carried = _carried(bundle)
    places = tuple((first + number, carried[i]) for number, i in enumerate(potentials))
    numbers = (*layout, *hot, *[0.0] * len(potentials), *traced.parameters.values())
    return Kernel(KERNELS, "relation", numbers, program.source, potentials=places)
