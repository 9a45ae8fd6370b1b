"""Tracing: a plain Python function of numbers, called with symbols in their place, tells its formula.

Numbers that meet a symbol become parameters of the formula, so that functions which differ in numbers only share it,
and with it their derivatives and their compiled kernel. What branches on its arguments, or turns them into floats,
cannot be traced.
"""

import math
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.operad import Quantity
from ephs.semantics.special import sinhc
from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.functions import Sinhc

__all__ = ["Trace", "Traced", "Untraceable", "symbols_of", "trace"]


@final
class Untraceable(TypeError):
    """A function that needs the values of its arguments."""


@final
@dataclass(frozen=True, slots=True)
class Trace:
    """Value of a function at symbols.

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
    """Call a function with symbols.

    Parameters
    ----------
    arguments
        Name -> SymPy expression, or a sequence of them for a vector.

    Raises
    ------
    Untraceable
        The function needs numbers.
    """
    met: dict[Expr, float] = {}
    given = {name: _wrapped(value, met) for name, value in arguments.items()}
    try:
        out = np.asarray(_symbolic(function)(**given), dtype=object)
    except Untraceable:
        raise
    except Exception as error:  # a user's function may fail in any way on what is not a number
        raise Untraceable(str(error)) from error
    if out.dtype != object or any(isinstance(entry, (str, bytes, complex)) for entry in out.flat):
        raise Untraceable(f"the function returns {out.dtype}")
    entries = [_bare(entry, met) for entry in out.flat]
    if any(not e.is_commutative or e.has(sp.I, sp.nan, sp.zoo) for e in entries):
        raise Untraceable("the function does not return real numbers")
    shaped = np.empty(out.size, dtype=object)
    shaped[:] = entries
    return Trace(shaped.reshape(out.shape), met)


def symbols_of(name: str, quantity: Quantity, size: int) -> tuple[Expr, ...]:
    """Symbols for the numbers of a port's state."""
    positive = True if quantity.positive else None
    names = (name,) if size == 1 else tuple(f"{name}_{i}" for i in range(size))
    return tuple(sp.Symbol(each, real=True, positive=positive) for each in names)


def _wrapped(value: Any, met: dict[Expr, float]) -> Any:
    if isinstance(value, (tuple, list)):
        out = np.empty(len(value), dtype=object)  # pyright: ignore[reportUnknownArgumentType]
        out[:] = [Traced(sp.sympify(entry), met) for entry in value]  # pyright: ignore[reportUnknownVariableType]
        return out
    return Traced(sp.sympify(value), met)


def _number(value: float) -> Expr:
    """A number as one would write it: an integer or a simple fraction where it is one."""
    if value == int(value) and abs(value) < 1e6:
        return sp.Integer(int(value))
    simple = sp.Rational(value).limit_denominator(12)
    return simple if float(simple) == value else sp.Float(value)


def _bare(value: Any, met: dict[Expr, float]) -> Expr:
    """The expression of a traced value; a number becomes a parameter, but 0 and ±1, which shape formulas."""
    if isinstance(value, Traced):
        return value.expression
    if isinstance(value, sp.Basic):
        return value
    if isinstance(value, np.ndarray):
        raise Untraceable("an array where a number is expected")
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise Untraceable(f"{value!r} is not a number") from error
    if number in (0.0, 1.0, -1.0):
        return sp.Integer(int(number))
    symbol = sp.Symbol(f"c_{len(met)}", real=True)
    met[symbol] = number
    return symbol


def _power(value: Any, met: dict[Expr, float]) -> Expr:
    """An exponent: whole numbers and quarters shape the formula, others are parameters."""
    if isinstance(value, (int, float)) and math.isfinite(float(value)) and float(4 * value).is_integer():
        return sp.Rational(int(4 * value), 4)
    return _bare(value, met)


def _operation(combine: Callable[[Expr, Expr], Expr], *, swapped: bool = False) -> Any:
    def method(self: "Traced", other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented  # the array takes its entries one by one
        there = _bare(other, self.met)
        return Traced(combine(there, self.expression) if swapped else combine(self.expression, there), self.met)

    return method


def _function(of: Callable[[Expr], Expr]) -> Any:
    def method(self: "Traced") -> "Traced":
        return Traced(of(self.expression), self.met)

    return method


@final
class Traced:
    """A value under tracing: an expression that answers to operators and, by method, to NumPy's functions."""

    __slots__ = ("expression", "met")

    def __init__(self, expression: Expr, met: dict[Expr, float]) -> None:
        self.expression, self.met = expression, met

    __add__ = __radd__ = _operation(lambda a, b: a + b)
    __sub__ = _operation(lambda a, b: a - b)
    __rsub__ = _operation(lambda a, b: a - b, swapped=True)
    __mul__ = __rmul__ = _operation(lambda a, b: a * b)
    __truediv__ = _operation(lambda a, b: a / b)
    __rtruediv__ = _operation(lambda a, b: a / b, swapped=True)

    def __pow__(self, other: Any) -> "Traced":
        return Traced(self.expression ** _power(other, self.met), self.met)

    def __rpow__(self, other: Any) -> "Traced":
        return Traced(_bare(other, self.met) ** self.expression, self.met)

    __neg__ = _function(lambda a: -a)
    __pos__ = _function(lambda a: a)
    __abs__ = fabs = absolute = _function(sp.Abs)
    # the names under which NumPy's functions look for methods of objects
    sin, cos, tan = (_function(of) for of in (sp.sin, sp.cos, sp.tan))
    arcsin, arccos, arctan = (_function(of) for of in (sp.asin, sp.acos, sp.atan))
    sinh, cosh, tanh = (_function(of) for of in (sp.sinh, sp.cosh, sp.tanh))
    arcsinh, arccosh, arctanh = (_function(of) for of in (sp.asinh, sp.acosh, sp.atanh))
    exp, log, sqrt, sign = (_function(of) for of in (sp.exp, sp.log, sp.sqrt, sp.sign))
    expm1 = _function(lambda a: sp.exp(a) - 1)
    log1p = _function(lambda a: sp.log(1 + a))
    square = _function(lambda a: a**2)
    conjugate = _function(lambda a: a)

    def arctan2(self, other: Any) -> "Traced":
        """The angle of a point, as NumPy's function of this name."""
        return Traced(sp.atan2(self.expression, _bare(other, self.met)), self.met)

    def hypot(self, other: Any) -> "Traced":
        """The length of a vector, as NumPy's function of this name."""
        return Traced(sp.sqrt(self.expression**2 + _bare(other, self.met) ** 2), self.met)

    def _sympy_(self) -> Expr:  # pyright: ignore[reportUnusedFunction] - SymPy asks for it
        return self.expression

    def _refuse(self, *_: Any) -> Any:
        raise Untraceable("the function needs the value of an argument")

    __bool__ = __float__ = __int__ = __complex__ = __index__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse
    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"Traced({self.expression})"


@sinhc.register
def _(z: Traced) -> Traced:
    return Traced(Sinhc(z.expression), z.met)


def _mathematics() -> dict[str, Any]:
    """Functions of `math` that pass symbols on, by name."""
    renamed = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh"}
    renamed |= {"atanh": "arctanh", "pow": "power"}
    same = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "expm1", "log1p", "fabs", "hypot")
    out = {name: getattr(np, renamed.get(name, name)) for name in (*same, *renamed)}
    out["atan2"] = np.arctan2
    return out


_BY_IDENTITY = {id(getattr(math, name)): replacement for name, replacement in _mathematics().items()}
_MODULE = types.SimpleNamespace(**{**vars(math), **_mathematics()})
DEPTH = 8
"""Depth of nested functions to which `math` is searched for."""


def _symbolic(function: Callable[..., Any], depth: int = 0) -> Callable[..., Any]:
    """The function, and those it calls, with functions of `math` replaced by ones that take symbols too."""
    if not isinstance(function, types.FunctionType) or depth > DEPTH:
        return function
    names = {n: function.__globals__[n] for n in function.__code__.co_names if n in function.__globals__}
    used = {n: new for n, old in names.items() if (new := _replaced(old, depth)) is not old}
    cells = function.__closure__ or ()
    closed = [_replaced(cell.cell_contents, depth) if _filled(cell) else None for cell in cells]
    same = all(not _filled(cell) or new is cell.cell_contents for cell, new in zip(cells, closed, strict=True))
    if not used and same:
        return function
    closure = tuple(types.CellType(new) if _filled(cell) else cell for cell, new in zip(cells, closed, strict=True))
    namespace = {**function.__globals__, **used}
    copy = types.FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, closure)
    copy.__kwdefaults__ = function.__kwdefaults__
    return copy


def _replaced(value: Any, depth: int) -> Any:
    if value is math:
        return _MODULE
    if isinstance(value, types.BuiltinFunctionType):
        return _BY_IDENTITY.get(id(value), value)
    return _symbolic(value, depth + 1) if isinstance(value, types.FunctionType) else value


def _filled(cell: Any) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True
