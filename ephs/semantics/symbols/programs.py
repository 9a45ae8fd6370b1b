"""From formulas to programs: derivatives, left-trivialised on groups, written out as source and compiled once a type.

Programs differ in their structure only: numbers are parameters. So the number of compilations does not grow with the
number of instances.
"""

import hashlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from types import ModuleType
from typing import Any, final

import numpy as np

from ephs.operad import Quantity
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import codes, jit
from ephs.semantics.symbols.algebra import Expr, python_code, sp

__all__ = ["Base", "Program", "address_of_source", "intensive", "potential", "relation_program", "storage_program"]

Symbols = tuple[Expr, ...]
Base = tuple[tuple[int, Symbols], ...]
"""The states that a formula reads: the code of each group, and symbols for the numbers of its point."""
TEMPERATURE, PRESSURE = sp.Symbol("theta_0", positive=True), sp.Symbol("pi_0", nonnegative=True)
"""θ₀ and π₀ of the reference environment."""


def intensive(quantity: Quantity) -> Symbols:
    """Energy efforts of a quantity in the reference environment, (dim,): of θ₀, π₀ and a potential of each charge."""
    out: list[Expr] = [sp.Integer(0)] * quantity.space.dim
    for charge, row in quantity.charges:
        known = {ENTROPY: TEMPERATURE, VOLUME: -PRESSURE}
        value = known[charge] if charge in known else potential(charge)
        out = [entry + _whole(number) * value for entry, number in zip(out, row, strict=True)]
    return tuple(out)


def potential(charge: str) -> Expr:
    """μ₀ of a charge in the reference environment."""
    return sp.Symbol(f"mu_0[{charge}]", real=True)


def _whole(number: float) -> Expr:
    return sp.Integer(int(number)) if number.is_integer() else sp.Float(number)


@final
@dataclass(frozen=True, slots=True)
class Program:
    """Assignments to numbered places of output arrays, as source."""

    source: str

    def __call__(self, scal: Array, p: Array, x0: Array, e: Array, lam: Array, outputs: Sequence[Array]) -> None:
        """Run it in Python: outputs (f, c, jac) are filled, with NaN outside of the formula's domain."""
        try:
            _plain(self.source)(scal, p, x0, e, lam, *outputs)
        except (ArithmeticError, ValueError, TypeError):  # 1/0, log(−1), a root that is complex
            for out in outputs:
                out[:] = np.nan


def tangent(base: Base) -> list[list[Expr]]:
    """(numbers, dimension) of the points: the derivatives of x·exp(v) by v at v = 0, group by group."""
    blocks = [_frame(code, x) for code, x in base]
    return sp.diag(*blocks).tolist() if blocks else []


def _frame(code: int, x: Symbols) -> Expr:
    if code == codes.VECTOR:
        return sp.eye(len(x))
    if code == codes.SE2:
        c, s = sp.cos(x[0]), sp.sin(x[0])
        return sp.Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])
    w, a, b, c = x[:4]
    half = sp.Matrix([[-a, -b, -c], [w, -c, b], [c, w, -a], [-b, a, w]]) / 2
    if code == codes.SO3:
        return half
    if code == codes.SO3xR3:
        return sp.diag(half, sp.eye(3))
    rotation = sp.Matrix(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    return sp.diag(half, rotation)


def trivialised(expression: Expr, base: Base) -> list[Expr]:
    """The left-trivialised derivative of an expression by the states, an entry for each direction."""
    symbols = [symbol for _, x in base for symbol in x]
    by = [_smooth(sp.diff(expression, symbol)) for symbol in symbols]
    frame = tangent(base)
    width = len(frame[0]) if frame else 0
    return [sum((by[i] * frame[i][j] for i in range(len(symbols))), sp.Integer(0)) for j in range(width)]


def _smooth(expression: Expr) -> Expr:
    """Without the impulses that derivatives of |x| have at a point."""
    return expression.subs({impulse: 0 for impulse in expression.atoms(sp.DiracDelta)})


@lru_cache(maxsize=512)
def storage_program(energy: Expr, parameters: Symbols, base: Base) -> Program:
    """A storage: E in c, its gradient (n,) in f, the derivatives (n, n) of that by the states in jac."""
    gradient = trivialised(energy, base)
    hessian = [entry for g in gradient for entry in trivialised(g, base)]
    return _written({"c": [energy], "f": gradient, "jac": hessian}, {"p": parameters, "x0": _points(base)})


@lru_cache(maxsize=512)
def relation_program(
    flows: Symbols, conditions: Symbols, parameters: Symbols, base: Base, efforts: Symbols, multipliers: Symbols
) -> Program:
    """A relation: flows in f, conditions in c, and in jac (n + k, n + k + m) their derivatives by (e, λ, states)."""
    rows: list[Expr] = []
    for entry in (*flows, *conditions):
        rows += [_smooth(sp.diff(entry, symbol)) for symbol in (*efforts, *multipliers)]
        rows += trivialised(entry, base)
    places = {"p": parameters, "x0": _points(base), "e": efforts, "lam": multipliers}
    return _written({"f": list(flows), "c": list(conditions), "jac": rows}, places)


def _points(base: Base) -> Symbols:
    return tuple(symbol for _, x in base for symbol in x)


_LENGTHS = {"scal": "3", "p": "{p}", "x0": "{x0}", "e": "{e}", "lam": "{lam}", "f": "{f}", "c": "{c}", "jac": "{jac}"}
_HEADER = '''"""Made from a formula; its name is the digest of this text."""

import math

import numba as nb


def value(dims, scal, p, x0, v, e, lam, f, c, jac, work):
'''


def _written(outputs: dict[str, list[Expr]], places: dict[str, Symbols]) -> Program:
    names = {
        symbol: sp.Symbol(f"{array}[{i}]") for array, symbols in places.items() for i, symbol in enumerate(symbols)
    }
    names |= {TEMPERATURE: sp.Symbol("scal[1]"), PRESSURE: sp.Symbol("scal[2]")}
    expressions = [sp.sympify(entry) for entries in outputs.values() for entry in entries]
    common, reduced = sp.cse(expressions, symbols=sp.numbered_symbols("t"), order="none")
    lengths = {array: len(symbols) for array, symbols in places.items()}
    lengths |= {array: len(entries) for array, entries in outputs.items()}
    lines = [
        f"    {array} = nb.carray({array}, {length.format_map({array: max(lengths.get(array, 0), 1)})})"
        for array, length in _LENGTHS.items()
    ]
    lines += [f"    {symbol} = {python_code(entry.xreplace(names))}" for symbol, entry in common]
    at = 0
    for array, entries in outputs.items():
        for i in range(len(entries)):
            lines.append(f"    {array}[{i}] = {python_code(reduced[at].xreplace(names))}")
            at += 1
    return Program(_HEADER + "\n".join([*lines, "    return 0"]) + "\n")


@lru_cache(maxsize=512)
def _plain(source: str) -> Callable[..., Any]:
    """The same assignments for arrays in place of pointers."""
    lines = [line for line in source.splitlines() if "nb.carray" not in line and line != "import numba as nb"]
    text = "\n".join(lines).replace(
        "def value(dims, scal, p, x0, v, e, lam, f, c, jac, work)", "def value(scal, p, x0, e, lam, f, c, jac)"
    )
    return _defined(text, {})


@cache  # without a limit: a function that is dropped would leave its address behind in models
def address_of_source(source: str) -> tuple[int, Any]:
    """(address, what keeps it alive) of a program's compiled function; kept on disk where there is a cache."""
    from ephs.semantics.kernel_table import SIGNATURE

    module = ModuleType("formula_" + hashlib.sha256(source.encode()).hexdigest()[:24])
    sys.modules[module.__name__] = module  # by this name the compiler tells functions apart, and finds them again
    compiled: Any = jit.cfunc_kernel(SIGNATURE, source)(_defined(source, module.__dict__))
    return int(compiled.address), compiled


def _defined(source: str, names: dict[str, Any]) -> Callable[..., Any]:
    exec(compile(source, "<formula>", "exec"), names)  # the text is our own, written from expressions
    return names["value"]
