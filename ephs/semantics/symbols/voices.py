"""Symbolic relation of a component between its port variables: efforts of storages, flows and conditions of processes.

A component of numbers is traced from its formula. One between vectors is written in blocks, or by its own `notation`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.forms import stacked
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.calculus import TEMPERATURE, intensive
from ephs.semantics.symbols.tracing import Untraceable, trace
from ephs.semantics.symbols.words import Words, curved, latex_name, operator, pairing, plain


@final
@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """Relations of a component.

    Parameters
    ----------
    efforts
        Port -> effort, of a storage.
    flows
        Port -> flow, of a process.
    conditions
        Expressions that vanish.
    multipliers
        The symbols λ that occur in the flows.
    """

    efforts: Mapping[Path, Expr] = field(default_factory=dict[Path, Expr])
    flows: Mapping[Path, Expr] = field(default_factory=dict[Path, Expr])
    conditions: tuple[Expr, ...] = ()
    multipliers: tuple[Expr, ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Voice:
    """A component with symbols for its variables: what a `notation` is written with.

    Parameters
    ----------
    x, e
        State and effort by port name.
    """

    path: Path
    primitive: Primitive
    words: Words
    x: Mapping[str, Expr]
    e: Mapping[str, Expr]
    parameter: Callable[[str], Expr]

    @property
    def label(self) -> Expr:
        """The component's path, as a subscript."""
        return self.words.label(self.path)

    @property
    def element(self) -> Expr:
        """A constant of a group that bears the name of the component's box, as the offsets o1 and o2 do."""
        return self.words.symbol(str(self.path), latex_name(self.path), scalar=False)

    def operator(self, name: str, *arguments: Expr) -> Expr:
        """An operator of `words.OPERATORS`."""
        return operator(name, *arguments)

    def pairing(self, one: Expr, other: Expr) -> Expr:
        """μ(one, other), with the component's own form."""
        return pairing(self.label, one, other)

    def multiplier(self) -> Expr:
        """The component's one multiplier, a vector."""
        return self.words.multiplier(self.path, None, scalar=False)

    def temperature(self, port: str) -> Expr:
        """θ₀ + the effort of an entropy port."""
        return TEMPERATURE + self.e[port]


def say(voice: Voice) -> Said:
    """The relations of a component."""
    primitive = voice.primitive
    if primitive.notation is not None:
        return _noted(voice, primitive.notation)
    numbers = all(plain(port.quantity) for port in primitive.interface.values())
    try:
        if isinstance(primitive, Storage):
            return Said(efforts=_gradient(voice, primitive, numbers=numbers))
        if isinstance(primitive, Reversible):
            return _reversible(voice, primitive) if numbers else _blocks(voice, primitive)
        if numbers:
            return Said(flows=_dissipation(voice, primitive))
    except Untraceable:
        pass
    return _unknown(voice)


def formula_symbols(primitive: Primitive, parameter: Callable[[str], Expr], arguments: Mapping[str, Expr]) -> Any:
    """Formula of a primitive at symbols: an array of expressions, with numbers filled in.

    Raises
    ------
    Untraceable
        It has none, or it needs numbers.
    """
    formula = primitive.formula
    if formula is None:
        raise Untraceable("no formula")
    given = {**arguments, **{name: parameter(name) for name in formula.parameters}}
    function = formula.function
    if isinstance(primitive, Reversible):
        function = stacked(formula, primitive.bundle.size, primitive.multipliers)
    return trace(function, given).numbered


def formula_text(primitive: Primitive) -> str:
    """The energy or the matrices of a primitive by its formula: E = …, L = …, C = …, M = ….

    Raises
    ------
    Untraceable
        The formula needs numbers.
    """
    ports = primitive.bundle.ports if isinstance(primitive, Irreversible) else ()
    names = {str(port): sp.Symbol(str(port), real=True) for port in (*ports, *primitive.reads)}
    found = formula_symbols(primitive, lambda name: sp.Symbol(name, positive=True), names)
    if isinstance(primitive, Storage):
        return f"E = {found.item()}"
    if isinstance(primitive, Irreversible):
        return f"M = {found.tolist()}"
    n = primitive.bundle.size
    parts = [("L", found[:n]), ("C", found[n:])]
    return ", ".join(f"{name} = {matrix.tolist()}" for name, matrix in parts if matrix.any())


def _intensive(quantity: Quantity) -> Expr:
    """Expression of a number; vectors that carry charges are written by name."""
    return intensive(quantity)[0] if plain(quantity) else sp.Integer(0)


def _gradient(voice: Voice, storage: Storage, *, numbers: bool) -> dict[Path, Expr]:
    ports = {port: storage.bundle.quantity(port) for port in storage.bundle.ports}
    if storage.environment:
        return dict.fromkeys(ports, sp.Integer(0))
    if numbers and storage.formula is not None:
        energy = formula_symbols(storage, voice.parameter, voice.x).item()
        return {p: sp.diff(energy, voice.x[str(p)]) - _intensive(q) for p, q in ports.items()}
    return _slopes(voice, storage)


def _slopes(voice: Voice, storage: Storage) -> dict[Path, Expr]:
    """The efforts of an unknown energy, by its name."""
    states = [voice.x[str(port)] for port in storage.bundle.ports]
    out: dict[Path, Expr] = {}
    for port, _, quantity in storage.bundle.items():
        x = voice.x[str(port)]
        if plain(quantity):
            out[port] = sp.Function(f"dE[{voice.path}]/d{x}", real=True)(*states) - _intensive(quantity)
            continue
        if len(states) == 1:
            slope = operator("differential", voice.label, x)
        else:
            slope = operator("partial", voice.label, x, sp.Tuple(*states))
        out[port] = operator("cotangent", x) * slope if curved(quantity) else slope
    return out


def _reversible(voice: Voice, reversible: Reversible) -> Said:
    n, k = reversible.bundle.size, reversible.multipliers
    reads = {str(port): voice.x[str(port)] for port in reversible.reads}
    matrices = sp.Matrix(n + k, n, list(formula_symbols(reversible, voice.parameter, reads).flat))
    e = sp.Matrix(n, 1, [voice.e[str(port)] for port in reversible.bundle.ports])
    lam = [voice.words.multiplier(voice.path, None if k == 1 else i, scalar=True) for i in range(k)]
    skew, constraint = matrices[:n, :], matrices[n:, :]
    flows = skew * e + (constraint.T * sp.Matrix(k, 1, lam) if k else sp.zeros(n, 1))
    conditions = tuple(constraint * e) if k else ()
    return Said(
        flows=dict(zip(reversible.bundle.ports, flows, strict=True)), conditions=conditions, multipliers=tuple(lam)
    )


def _dissipation(voice: Voice, irreversible: Irreversible) -> dict[Path, Expr]:
    ports = irreversible.bundle.ports
    # a temperature as one symbol: the formula is simple in it
    hot = {port: True if q.kind == "entropy" else None for port, _, q in irreversible.bundle.items()}
    energy = {str(port): sp.Symbol(f"E_{port}", real=True, positive=hot[port]) for port in ports}
    shift = {energy[str(p)]: voice.e[str(p)] + _intensive(irreversible.bundle.quantity(p)) for p in ports}
    reads = {str(port): voice.x[str(port)] for port in irreversible.reads}
    found = formula_symbols(irreversible, voice.parameter, {**energy, **reads})
    matrix = sp.Matrix(len(ports), len(ports), list(found.flat))
    exergy = [energy[str(p)] - _intensive(irreversible.bundle.quantity(p)) for p in ports]
    flows = matrix * sp.Matrix(len(ports), 1, exergy) / TEMPERATURE
    return {port: sp.simplify(flow).subs(shift) for port, flow in zip(ports, flows, strict=True)}


def _blocks(voice: Voice, reversible: Reversible) -> Said:
    """A constant structure between vectors, port by port: zeros are left out, ones are not written."""
    if reversible.reads:
        return _unknown(voice)
    skew, constraint = reversible.structure({})
    bundle, k = reversible.bundle, reversible.multipliers
    places = [(port, where) for port, where, _ in bundle.items()]
    lam = (voice.multiplier(),) if k else ()
    flows: dict[Path, Expr] = {}
    for port, where in places:
        terms = [_block(voice, "L", skew[where, there], port, other) * voice.e[str(other)] for other, there in places]
        terms += [_block(voice, "C", constraint[:, where].T, port, Path(()), dual=True) * one for one in lam]
        flows[port] = sum(terms, sp.Integer(0))
    condition = sum(
        (_block(voice, "C", constraint[:, where], port, Path(())) * voice.e[str(port)] for port, where in places),
        sp.Integer(0),
    )
    return Said(flows=flows, conditions=(condition,) if k else (), multipliers=lam)


def _block(voice: Voice, name: str, block: Array, port: Path, other: Path, *, dual: bool = False) -> Expr:
    if not np.any(block):
        return sp.Integer(0)
    if block.shape[0] == block.shape[1]:
        for sign in (1, -1):
            if np.array_equal(block, sign * np.eye(block.shape[0])):
                return sp.Integer(sign)
    where = voice.words.label(port / other)
    return operator("dual block" if dual else "block", sp.Symbol(name), voice.label, where)


def _unknown(voice: Voice) -> Said:
    """A component without a formula: names of its flows and conditions only."""
    primitive = voice.primitive
    given = sp.Tuple(*(voice.e[str(port)] for port in primitive.bundle.ports))
    if isinstance(primitive, Storage):
        return Said(efforts=_slopes(voice, primitive))
    flows = {port: operator("flow of", voice.words.label(voice.path / port), given) for port in primitive.bundle.ports}
    if not isinstance(primitive, Reversible) or not primitive.multipliers:
        return Said(flows=flows)
    lam = voice.multiplier()
    for port in primitive.bundle.ports:
        flows[port] += operator("dual block", sp.Symbol("C"), voice.label, voice.words.label(port)) * lam
    condition = sum(
        (
            operator("block", sp.Symbol("C"), voice.label, voice.words.label(port)) * voice.e[str(port)]
            for port in primitive.bundle.ports
        ),
        sp.Integer(0),
    )
    return Said(flows=flows, conditions=(condition,), multipliers=(lam,))


def _noted(voice: Voice, notation: Callable[[Any], Any]) -> Said:
    """Relation by a component's own notation: efforts by port; or flows by port, and conditions."""
    said = notation(voice)
    if isinstance(voice.primitive, Storage):
        return Said(efforts={Path.of(port): sp.sympify(entry) for port, entry in said.items()})
    flows, conditions = said
    multipliers = (voice.multiplier(),) if conditions else ()
    return Said(
        flows={Path.of(port): sp.sympify(entry) for port, entry in flows.items()},
        conditions=tuple(conditions),
        multipliers=multipliers,
    )
