"""Evaluation with expressions of SymPy: the equation that a function computes, to print and to prove."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final, TypeAlias, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Function, Interpreted
from ephs.semantics.stage.numbers import ARITHMETIC, Integer, Number, Operation, Order, Real, StagedCondition, Truth

sp: Any = import_module("sympy")
Expr: TypeAlias = Any
_ORDERS: Final[dict[Order, Any]] = {"<": sp.Lt, "<=": sp.Le, ">": sp.Gt, ">=": sp.Ge}
_FUNCTIONS: Final[dict[Function, Callable[..., Expr]]] = {
    "sqrt": sp.sqrt,
    "absolute": sp.Abs,
    "floor": sp.floor,
    "sin": sp.sin,
    "cos": sp.cos,
    "exp": sp.exp,
    "log": sp.log,
    "atan2": sp.atan2,
}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Expression(Number):
    """A real number as an expression of SymPy; constants become their decimal fractions."""

    value: Expr

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        return Expression(ARITHMETIC[operation](expression(left), expression(right)))

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        return _truth(_ORDERS[order](expression(left), expression(right)))

    def _negative(self) -> Real:
        return Expression(-self.value)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Proposition(StagedCondition):
    """A condition as an expression of SymPy."""

    value: Expr


def expression(number: object) -> Expr:
    """Return a number or a condition as SymPy's."""
    if isinstance(number, Expression | Proposition):
        return number.value
    if isinstance(number, bool):
        return sp.true if number else sp.false
    return sp.Integer(number) if isinstance(number, int) else sp.Rational(repr(float(number)))  # pyright: ignore[reportArgumentType]


def _truth(value: Expr) -> Truth:
    return bool(value) if value in (sp.true, sp.false) else Proposition(value)


@final
class Symbolic(Interpreted):
    """Evaluation with expressions."""

    def _function(self, name: Function, *arguments: Real) -> Real:
        values = [expression(argument) for argument in arguments]
        if name == "copysign":  # The sign of zero is positive here.
            x, sign = values
            return Expression(sp.Abs(x) * sp.Piecewise((-1, sign < 0), (1, True)))
        return Expression(_FUNCTIONS[name](*values))

    def _known(self, truth: StagedCondition, what: str) -> bool:
        raise StageError("undecided", what=what, found=f"({expression(truth)})")

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        condition = expression(truth)
        if isinstance(one, bool | StagedCondition):
            return _truth(sp.ITE(condition, expression(one), expression(other)))
        return Expression(sp.Piecewise((expression(one), condition), (expression(other), True), evaluate=False))

    def _both(self, one: Truth, other: Truth) -> Truth:
        return _truth(sp.And(expression(one), expression(other)))

    def _negate(self, truth: StagedCondition) -> Truth:
        return _truth(sp.Not(expression(truth)))

    def _same(self, one: Integer, other: Integer) -> Truth:
        return one == other

    def real(self, integer: Integer) -> Real:
        return float(integer)

    def integer(self, real: Real) -> Integer:
        value = expression(real)
        if not value.is_number:
            raise StageError("undecided", what="on.integer", found=f"({value})")
        return int(value)

    def scale(self, real: Real, power: Integer) -> Real:
        return Expression(expression(real) * sp.Integer(2) ** int(power))


SYMBOLIC: Final = Symbolic()
