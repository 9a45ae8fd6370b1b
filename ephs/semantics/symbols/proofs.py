"""Proofs that a traced structure satisfies its conditions for all states and efforts, and for all numbers of its signs.

Numbers in a formula stand for all of their sign; where the conditions rest on their values, these are taken exactly.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ephs.operad import Interface, Path, Quantity
from ephs.semantics.bundle import Bundle
from ephs.semantics.forms import stacked
from ephs.semantics.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.bounds import Interval
from ephs.semantics.symbols.calculus import trivialised
from ephs.semantics.symbols.signs import sign_shown, squares_shown, vanishes
from ephs.semantics.symbols.tracing import Trace, Untraceable, trace
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.trials import ROTATING, extent

SYMBOLIC = "symbolically"
LARGE = 4000
"""Operations of a formula times its rows, beyond which it is not proved: elimination would take up to a minute."""
ONCE = 200
"""Operations of a formula beyond which its definiteness is not tried again with the exact numbers."""
Symbols = tuple[Expr, ...]
Ports = tuple[tuple[Path, Quantity, Symbols], ...]
"""Ports with the symbols of their states."""
Findings = tuple[tuple[str, str], ...]
"""Statements with their proofs; an empty text means unproved."""


def findings_of(primitive: Primitive, signs: Mapping[str, int]) -> Findings:
    """The conditions on a primitive with a formula, and their proofs; empty if it cannot be traced.

    Parameters
    ----------
    signs
        Parameter -> its sign, -1, 0 or 1.
    """
    assert primitive.formula is not None
    functions = (primitive.formula.function, primitive.formula.gradient)
    try:
        if not primitive.formula.parameters:
            return _of_functions(primitive, functions, {})
        key = (primitive.kind, tuple(primitive.interface.items()), primitive.reads, primitive.domain)
        return _of_library(key, functions, tuple(signs.items()), _Same(primitive))
    except Untraceable:
        return ()


class _Same:
    """A primitive that compares equal to all of its kind, to keep it out of cache keys."""

    __slots__ = ("primitive",)

    def __init__(self, primitive: Primitive) -> None:
        self.primitive = primitive

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same)

    def __hash__(self) -> int:
        return 0


@lru_cache(maxsize=256)
def _of_library(key: object, functions: Any, signs: tuple[tuple[str, int], ...], like: _Same) -> Findings:
    """Findings of all primitives with these functions whose parameters have these signs."""
    del key
    symbols = {name: sp.Symbol(f"{name}_", positive=True) * sign if sign else sp.Integer(0) for name, sign in signs}
    return _of_functions(like.primitive, functions, symbols)


def _of_functions(primitive: Primitive, functions: Any, parameters: Mapping[str, Expr]) -> Findings:
    function, gradient = functions
    ports, arguments, bounds = _arguments(primitive)
    n, k = primitive.bundle.size, primitive.multipliers if isinstance(primitive, Reversible) else 0
    called = function if not isinstance(primitive, Reversible) else stacked(primitive.formula, n, k)  # pyright: ignore[reportArgumentType]
    found = trace(called, {**arguments, **parameters})
    slopes = None if gradient is None else trace(_flat(gradient), {**arguments, **parameters})
    size = sum(int(sp.sympify(entry).count_ops()) for entry in found.outputs.flat)
    if size * n > LARGE:
        raise Untraceable(f"the formula has {size} operations")
    best: Findings = ()
    for outputs, derived in zip(_values(found), _values(slopes) if slopes else _nothing(), strict=False):
        key = (primitive.kind, tuple(primitive.interface.items()), ports, tuple(bounds.items()))
        if isinstance(primitive, Storage):
            now = _storage(key, outputs[0], derived)
        elif isinstance(primitive, Reversible):
            now = _reversible(key, outputs, n)
        else:
            efforts = tuple(symbol for port in primitive.bundle.ports for symbol in _listed(arguments[str(port)]))
            now = _irreversible(key, outputs, efforts)
        best = now if not best else tuple(a if a[1] else b for a, b in zip(best, now, strict=True))
        if all(how or (size > ONCE and statement == STATEMENTS["irreversible"][1]) for statement, how in best):
            break
    return best


def _nothing() -> Iterator[None]:
    while True:
        yield None


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, (list, tuple)) else (value,)  # pyright: ignore[reportUnknownVariableType]


def _flat(function: Callable[..., Any]) -> Callable[..., Any]:
    def flat(**x: Any) -> Any:
        return np.concatenate([np.atleast_1d(np.asarray(part, dtype=object)) for part in _listed(function(**x))])

    return flat


def _values(found: Trace) -> Iterator[tuple[Expr, ...]]:
    """The expressions with numbers as symbols of their sign, equal ones alike; then with the exact numbers."""
    known: dict[float, Expr] = {}
    for value in found.parameters.values():
        known.setdefault(abs(value), sp.Symbol(f"k_{len(known)}", positive=True))
    signed = {symbol: known[abs(value)] * (1 if value > 0 else -1) for symbol, value in found.parameters.items()}
    exact = {symbol: sp.Rational(value) for symbol, value in found.parameters.items()}
    for values in (signed, exact):
        yield tuple(sp.sympify(entry).subs(values) for entry in found.outputs.flat)


def _arguments(primitive: Primitive) -> tuple[Ports, dict[str, Any], dict[Expr, Interval]]:
    """The read ports with symbols for their states; all arguments by name; the bounds of symbols that have some."""
    ports: list[tuple[Path, Quantity, Symbols]] = []
    arguments: dict[str, Any] = {}
    bounds: dict[Expr, Interval] = {}
    efforts = primitive.bundle.ports if isinstance(primitive, Irreversible) else ()
    for port in (*efforts, *(p for p in primitive.reads if p not in efforts)):
        quantity = primitive.interface[port].quantity
        reads = port in primitive.reads
        low, high = extent(primitive, port, quantity)
        size = manifold(quantity.space).size if reads else quantity.space.dim
        symbols = tuple(
            sp.Symbol(f"{port}_{i}" if size > 1 else str(port), real=True, **_sign(low, high)) for i in range(size)
        )
        if high - low < float("inf") or low > -float("inf") or high < float("inf"):
            bounds |= dict.fromkeys(symbols, (low, high))
        arguments[str(port)] = symbols[0] if size == 1 else symbols
        if reads:
            ports.append((port, quantity, symbols))
    return tuple(ports), arguments, bounds


def _sign(low: float, high: float) -> dict[str, bool]:
    return {"positive": True} if low >= 0.0 else {"negative": True} if high <= 0.0 else {}


def _reversed(interface: Interface, ports: Ports) -> dict[Expr, Expr]:
    return {symbol: -symbol for _, quantity, x in ports if quantity.parity < 0 for symbol in x}


def _opposite(ports: Ports) -> list[dict[Expr, Expr]]:
    """For each rotation, the other of its two quaternions."""
    turned = [x for _, quantity, x in ports if manifold(quantity.space).code in ROTATING]
    return [{symbol: -symbol for symbol in x[:4]} for x in turned]


def _changed(expressions: Sequence[Expr], change: Mapping[Expr, Expr]) -> list[Expr]:
    return [entry.subs(change, simultaneous=True) for entry in expressions]


def _same(one: Sequence[Expr], two: Sequence[Expr]) -> str:
    return SYMBOLIC if all(vanishes(a - b) for a, b in zip(one, two, strict=True)) else ""


def _all_opposite(outputs: Sequence[Expr], ports: Ports) -> str:
    found = [_same(outputs, _changed(outputs, change)) for change in _opposite(ports)]
    return "none is read" if not found else SYMBOLIC if all(found) else ""


@lru_cache(maxsize=512)
def _storage(key: Any, energy: Expr, gradient: Symbols | None) -> Findings:
    _, items, ports, bounds = key
    bundle = Bundle.of(Interface(items))
    even, turned, slope, hot = STATEMENTS["storage"]
    change = _reversed(bundle.interface, ports)
    base = tuple((manifold(quantity.space).code, x) for _, quantity, x in ports)
    derived = trivialised(energy, base)
    hows = ["it is derived" if gradient is None else _same(gradient, derived)]
    temperatures = [
        sign_shown(derived[where.start], dict(bounds), strict=True)
        for _, where, quantity in bundle.items()
        if quantity.kind == "entropy"
    ]
    warm = "no entropy is stored" if not temperatures else temperatures[0] if all(temperatures) else ""
    return (
        (even, _same([energy], _changed([energy], change)) if change else "all states are even"),
        (turned, _all_opposite([energy], ports)),
        (slope, hows[0]),
        (hot, warm),
    )


@lru_cache(maxsize=512)
def _reversible(key: Any, outputs: Symbols, n: int) -> Findings:
    _, items, ports, _ = key
    bundle = Bundle.of(Interface(items))
    skew, constraint = (
        sp.Matrix(len(outputs) // n, n, list(outputs))[rows, :] for rows in (slice(0, n), slice(n, None))
    )
    parity = sp.diag(*map(int, bundle.parity()))
    isotropic, conserving, mirrored, turned = STATEMENTS["reversible"]
    zero = [sp.Integer(0)]
    units = [sp.Matrix(n, 1, weights(bundle.indicator(kind))) for kind in bundle.charges]
    lost = [entry for one in units for entry in [*(skew * one), *(constraint * one)]]
    change = _reversed(bundle.interface, ports)
    there = sp.Matrix(_changed(list(outputs), change)).reshape(len(outputs) // n, n) if outputs else sp.Matrix(0, n, [])
    even = _same(list(there[:n, :]), list(-parity * skew * parity))
    rows = _rows_alike(there[n:, :], constraint * parity)
    blind = _all_opposite(list(skew), ports)
    for turn in _opposite(ports):
        if not _rows_alike(sp.Matrix(_changed(list(constraint), turn)).reshape(*constraint.shape), constraint):
            blind = ""
    return (
        (isotropic, _same(list(skew + skew.T), zero * n * n)),
        (conserving, _same(lost, zero * len(lost)) if units else "there are none"),
        (mirrored, SYMBOLIC if even and rows else ""),
        (turned, blind),
    )


def weights(row: Iterable[float]) -> list[Expr]:
    """Numbers of a charge, whole ones as such."""
    return [sp.Integer(int(number)) if float(number).is_integer() else sp.nsimplify(float(number)) for number in row]


def _rows_alike(one: Expr, two: Expr) -> bool:
    """Whether the rows of two constraints are the same, or opposite."""
    return all(
        any(all(vanishes(a - sign * b) for a, b in zip(one.row(i), two.row(i), strict=True)) for sign in (1, -1))
        for i in range(one.rows)
    )


@lru_cache(maxsize=512)
def _irreversible(key: Any, outputs: Symbols, efforts: Symbols) -> Findings:
    _, items, ports, bounds = key
    bundle = Bundle.of(Interface(items))
    n = bundle.size
    if len(outputs) != n * n:
        raise Untraceable(f"{len(outputs)} numbers where a matrix of {n} rows is wanted")
    matrix = sp.Matrix(n, n, list(outputs))
    parity = sp.diag(*map(int, bundle.parity()))
    symmetric, definite, energy, conserving, mirrored, turned = STATEMENTS["irreversible"]
    kinds = [kind for kind in bundle.charges if kind != "entropy"]
    lost = [entry for kind in kinds for entry in matrix * sp.Matrix(n, 1, weights(bundle.indicator(kind)))]
    zero = [sp.Integer(0)]
    change = _reversed(bundle.interface, ports)
    change |= {effort: sign * effort for effort, sign in zip(efforts, map(int, bundle.parity()), strict=True)}
    even = _same(_changed(list(outputs), change), list(parity * matrix * parity))
    same = _same(list(matrix), list(matrix.T))
    return (
        (symmetric, same),
        (definite, squares_shown(matrix, dict(bounds)) if same else ""),
        (energy, _same(list(matrix * sp.Matrix(n, 1, list(efforts))), zero * n)),
        (conserving, _same(lost, zero * len(lost)) if kinds else "there are none"),
        (mirrored, even),
        (turned, _all_opposite(outputs, ports)),
    )
