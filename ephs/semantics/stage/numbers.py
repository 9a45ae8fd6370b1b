"""Abstract numbers: real numbers, integers and conditions that a staged function computes with.

A real number is a Python float, which is known while staging, or a `Number`, whose value only its evaluator knows.
Operators work on both and drop what a known number makes idle: x + 0, x − 0, x · 1 and x / 1 are x, x · 0 and
0 / x are 0. So columns of zeros vanish from a program by themselves. The rules hold for finite x, and up to the
sign of a zero.
"""

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Final, Generic, Literal, NoReturn, TypeAlias, TypeVar, Union, cast, final

import numpy as np

from ephs.semantics.stage.errors import StageError

Real: TypeAlias = Union[float, "Number"]
"""A real number, known or not."""
Integer: TypeAlias = Union[int, "Count"]
"""An integer, known or not."""
Truth: TypeAlias = Union[bool, "StagedCondition"]
"""A truth value, known or not."""
Operation: TypeAlias = Literal["+", "-", "*", "/"]
IntegerOperation: TypeAlias = Literal["+", "-", "*", "//", "%"]
Order: TypeAlias = Literal["<", "<=", ">", ">="]

Value = TypeVar("Value")
ARITHMETIC: Final[dict[Operation, Callable[[Any, Any], Any]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": lambda a, b: a / b,
}
ORDERS: Final[dict[Order, Callable[[Any, Any], Any]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


class StagedCondition:
    """A truth value that is not known while staging."""

    __slots__ = ()

    @final
    def __bool__(self) -> bool:
        raise StageError("branch", what="a Python statement (if, while, and, or, not, min, max, assert)")


class _Unknown:
    """A value that cannot become a number of Python."""

    __slots__ = ()

    @final
    def __float__(self) -> NoReturn:
        raise StageError("number", what="float(…) or a function of math", advice="take on.sqrt, on.sin, …")

    @final
    def __int__(self) -> NoReturn:
        raise StageError("number", what="int(…)", advice="take on.integer(…)")

    @final
    def __index__(self) -> NoReturn:
        raise StageError("number", what="a Python list or range", advice="take a Vector or Integers, and on.loop(…)")

    @final
    def __pow__(self, power: object) -> NoReturn:
        raise StageError("number", what="**", advice="write products, or on.exp and on.log")

    @final
    def __abs__(self) -> NoReturn:
        raise StageError("number", what="abs(…)", advice="take on.absolute(…)")

    @final
    def __eq__(self, other: object) -> NoReturn:
        raise StageError("equality")

    @final
    def __ne__(self, other: object) -> NoReturn:
        raise StageError("equality")

    __hash__ = object.__hash__


class _Operand(_Unknown, ABC, Generic[Value]):
    """Operators that real numbers and integers have in common; known zeros and ones are idle."""

    __slots__ = ()
    _plain: ClassVar[tuple[type, ...]]
    """Python's own types of such numbers."""
    _zero: ClassVar[Any]

    @abstractmethod
    def _apply(self, operation: Any, left: Value, right: Value) -> Value:
        """Apply an operation; at least one side is of this class."""

    @abstractmethod
    def _order(self, order: Order, left: Value, right: Value) -> Truth:
        """Compare; at least one side is of this class."""

    @final
    def _require(self, operation: str, left: object, right: object) -> None:
        other = right if left is self else left
        if not isinstance(other, self._plain) and type(other) is not type(self):
            raise StageError("operand", what=operation, left=type(left).__name__, right=type(right).__name__)

    @final
    def _binary(self, operation: str, left: object, right: object) -> Any:
        self._require(operation, left, right)
        return self._apply(operation, cast("Value", left), cast("Value", right))

    @final
    def _compare(self, order: Order, other: object) -> Truth:
        self._require(order, self, other)
        return self._order(order, cast("Value", self), cast("Value", other))

    @final
    def __add__(self, other: Value) -> Value:
        return cast("Value", self) if _is(other, 0.0) else self._binary("+", self, other)

    @final
    def __radd__(self, other: Value) -> Value:
        return cast("Value", self) if _is(other, 0.0) else self._binary("+", other, self)

    @final
    def __sub__(self, other: Value) -> Value:
        return cast("Value", self) if _is(other, 0.0) else self._binary("-", self, other)

    @final
    def __mul__(self, other: Value) -> Value:
        if _is(other, 0.0):
            return self._zero
        return cast("Value", self) if _is(other, 1.0) else self._binary("*", self, other)

    @final
    def __rmul__(self, other: Value) -> Value:
        if _is(other, 0.0):
            return self._zero
        return cast("Value", self) if _is(other, 1.0) else self._binary("*", other, self)

    @final
    def __lt__(self, other: Value) -> Truth:
        return self._compare("<", other)

    @final
    def __le__(self, other: Value) -> Truth:
        return self._compare("<=", other)

    @final
    def __gt__(self, other: Value) -> Truth:
        return self._compare(">", other)

    @final
    def __ge__(self, other: Value) -> Truth:
        return self._compare(">=", other)


def _is(other: object, value: float) -> bool:
    return isinstance(other, float | int) and other == value


class Number(_Operand[Real]):
    """A real number with a known value."""

    __slots__ = ()
    __array_ufunc__ = None  # A number of NumPy on the left leaves operators to this class.
    _plain = (float, int)
    _zero = np.float64(0.0)  # It follows IEEE where it divides a known number; Python's own raises.

    @abstractmethod
    def _negative(self) -> Real:
        """Return −x."""

    @final
    def __rsub__(self, other: Real) -> Real:
        return self._negative() if _is(other, 0.0) else self._binary("-", other, self)

    @final
    def __truediv__(self, other: Real) -> Real:
        return self if _is(other, 1.0) else self._binary("/", self, other)

    @final
    def __rtruediv__(self, other: Real) -> Real:
        return self._zero if _is(other, 0.0) else self._binary("/", other, self)

    @final
    def __neg__(self) -> Real:
        return self._negative()

    @final
    def __pos__(self) -> Real:
        return self


class Count(_Operand[Integer]):
    """An integer with a known value; // and % round down, as in Python."""

    __slots__ = ()
    _plain = (int,)
    _zero = 0

    @final
    def __rsub__(self, other: Integer) -> Integer:
        return self._binary("-", other, self)

    @final
    def __floordiv__(self, other: Integer) -> Integer:
        return self if _is(other, 1) else self._binary("//", self, other)

    @final
    def __rfloordiv__(self, other: Integer) -> Integer:
        return self._binary("//", other, self)

    @final
    def __mod__(self, other: Integer) -> Integer:
        return self._binary("%", self, other)

    @final
    def __rmod__(self, other: Integer) -> Integer:
        return self._binary("%", other, self)

    @final
    def __neg__(self) -> Integer:
        return self._binary("-", 0, self)
