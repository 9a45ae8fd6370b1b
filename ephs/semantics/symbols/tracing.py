"""A plain Python function of symbols: its tape, run with expressions of SymPy.

Numbers that meet a symbol become parameters of the formula, so that functions which differ in numbers only share it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, final

import numpy as np

from ephs.semantics.derive.recording import Untraceable, record
from ephs.semantics.symbols.algebra import Expr, sp

# SymPy's counterparts of `ephs.semantics.primitives.special`: derivatives, signs, and printing.

_Function: Any = sp.Function


class Sinhc(_Function):
    """sinh(z)/z."""

    nargs = 1

    @classmethod
    def eval(cls, z: Expr) -> Any:
        """1 at zero; even."""
        if z.is_zero:
            return sp.Integer(1)
        return cls(-z) if z.could_extract_minus_sign() else None

    def fdiff(self, argindex: int = 1) -> Expr:
        """The derivative."""
        return SinhcSlope(self.args[0])

    def _eval_is_real(self) -> bool | None:
        return self.args[0].is_real

    def _eval_is_positive(self) -> bool | None:
        return True if self.args[0].is_real else None

    def _eval_evalf(self, prec: int) -> Expr:
        z = self.args[0]._eval_evalf(prec)
        return sp.sinh(z) / z

    def _eval_rewrite_as_sinh(self, z: Expr, **_: Any) -> Expr:
        return sp.sinh(z) / z

    def _latex(self, printer: Any, **_: Any) -> str:
        return rf"\operatorname{{sinhc}}\left({printer._print(self.args[0])}\right)"


class SinhcSlope(_Function):
    """(cosh(z) − sinh(z)/z)/z, the derivative of sinh(z)/z."""

    nargs = 1

    @classmethod
    def eval(cls, z: Expr) -> Any:
        """0 at zero; odd."""
        if z.is_zero:
            return sp.Integer(0)
        mirrored: Any = cls(-z) if z.could_extract_minus_sign() else None
        return None if mirrored is None else -mirrored

    def fdiff(self, argindex: int = 1) -> Expr:
        """From z (z sinhc)'' = z² sinhc."""
        z = self.args[0]
        return Sinhc(z) - 2 * self / z

    def _eval_is_real(self) -> bool | None:
        return self.args[0].is_real

    def _eval_evalf(self, prec: int) -> Expr:
        z = self.args[0]._eval_evalf(prec)
        return (sp.cosh(z) - sp.sinh(z) / z) / z


__all__ = ["Trace", "Untraceable", "trace"]

DIGITS = 10**30
"""Rational numbers beyond this become floats: a formula could make exact numbers of any size."""


@final
@dataclass(frozen=True, slots=True)
class Trace:
    """Result of a function of symbols.

    Parameters
    ----------
    outputs
        Expressions, with the shape of what the function returns.
    parameters
        Symbol -> number, in the order in which the numbers were met.
    """

    outputs: np.ndarray[Any, np.dtype[np.object_]]
    parameters: Mapping[Expr, float]

    @property
    def numbered(self) -> np.ndarray[Any, np.dtype[np.object_]]:
        """The expressions with the numbers in place."""
        values = {symbol: _number(value) for symbol, value in self.parameters.items()}
        out = np.empty_like(self.outputs)
        for index, entry in np.ndenumerate(self.outputs):
            out[index] = sp.sympify(entry).subs(values)
        return out


def trace(function: Callable[..., Any], arguments: Mapping[str, Any]) -> Trace:
    """Result of a function of symbols.

    Parameters
    ----------
    arguments
        Name -> SymPy expression, or a sequence of them for a vector.

    Raises
    ------
    Untraceable
        The function needs numbers, or does not return real ones.
    """
    vectors: dict[str, Sequence[Expr]] = {n: v for n, v in arguments.items() if isinstance(v, (tuple, list))}
    found = record(function, {name: len(vectors[name]) if name in vectors else None for name in arguments})
    inputs = [sp.sympify(x) for name, value in arguments.items() for x in vectors.get(name, (value,))]
    parameters = tuple(sp.Symbol(f"c_{i}", real=True) for i in range(len(found.parameters)))
    try:
        entries = found.tape.run(_TABLE, lambda number: sp.Integer(int(number)), inputs, parameters)
    except Exception as error:  # SymPy may raise anything for expressions without a value
        raise Untraceable(str(error)) from error
    if any(not e.is_commutative or e.has(sp.I, sp.nan, sp.zoo) for e in entries):
        raise Untraceable("the function does not return real numbers")
    shaped = np.empty(len(entries), dtype=object)
    shaped[:] = entries
    return Trace(shaped.reshape(found.tape.shape), dict(zip(parameters, found.parameters, strict=True)))


def _number(value: float) -> Expr:
    """A number in its simplest form: an integer or a simple fraction if equal to one."""
    if value == int(value) and abs(value) < 1e6:
        return sp.Integer(int(value))
    simple = sp.Rational(value).limit_denominator(12)
    return simple if float(simple) == value else sp.Float(value)


def _bounded(found: Expr) -> Expr:
    return sp.Float(found) if found.is_Rational and max(abs(found.p), found.q) > DIGITS else found


def _power(a: Expr, exponent: float) -> Expr:
    return _bounded(a ** sp.Rational(int(4 * exponent), 4))


def _choose(number: Expr, one: Expr, other: Expr) -> Expr:
    return sp.Piecewise((one, number > 0), (other, True))


def _squared_turn(w: Expr, x: Expr, y: Expr, z: Expr) -> Expr:
    return 4 * sp.atan2(sp.sqrt(x * x + y * y + z * z), sp.Abs(w)) ** 2


_TURN: Final = sp.Symbol("turn", positive=True)


def _turn_curve(a: Expr) -> Expr:
    return (1 - sp.sqrt(a) / 2 * sp.cot(sp.sqrt(a) / 2)) / a


def _table() -> Mapping[str, Callable[..., Expr]]:
    same = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
    same += ("exp", "log", "sqrt", "sign", "atan2")
    out: dict[str, Callable[..., Expr]] = {name: getattr(sp, name) for name in same}
    one: dict[str, Callable[[Expr], Expr]] = {
        "negative": lambda a: -a,
        "absolute": sp.Abs,
        "expm1": lambda a: sp.exp(a) - 1,
        "log1p": lambda a: sp.log(1 + a),
        "sinhc": Sinhc,
        "turn_ratio": lambda a: sp.sqrt(a) / 2 / sp.sin(sp.sqrt(a) / 2),
        "turn_curve": _turn_curve,
        "turn_curve_slope": lambda a: sp.diff(_turn_curve(_TURN), _TURN).subs(_TURN, a),
    }
    two: dict[str, Callable[[Expr, Expr], Expr]] = {
        "+": lambda a, b: _bounded(a + b),
        "-": lambda a, b: a - b,
        "*": lambda a, b: _bounded(a * b),
        "/": lambda a, b: _bounded(a / b),
        "power": _power,
        "exponential": lambda a, b: a**b,
    }
    more: dict[str, Callable[..., Expr]] = {"choose": _choose, "squared turn": _squared_turn}
    return MappingProxyType(out | one | two | more)


_TABLE: Final = _table()
"""Operations of a tape on expressions."""
