"""The evaluator: elementary functions, choices and control of the staged language, whatever a number is."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, Final, Literal, ParamSpec, TypeAlias, TypeVar, cast, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.memory import Cells, HeldCells, IntegerCells, RealCells, Variable, Vector
from ephs.semantics.stage.numbers import Count, Integer, Number, Real, StagedCondition, Truth
from ephs.semantics.stage.reaching import Argument, Atom, Part, Reached, Signature, called, parts_of

Function: TypeAlias = Literal["sqrt", "absolute", "floor", "sin", "cos", "exp", "log", "atan2", "copysign"]
FUNCTIONS: Final[dict[Function, int]] = {
    "sqrt": 1,
    "absolute": 1,
    "floor": 1,
    "sin": 1,
    "cos": 1,
    "exp": 1,
    "log": 1,
    "atan2": 2,
    "copysign": 2,
}
"""Functions that every evaluator has, and how many real arguments they take."""
Value = TypeVar("Value")
Parameters = ParamSpec("Parameters")


class Evaluator(ABC):
    """The evaluator of a staged function: its first argument, named `on`."""

    @abstractmethod
    def _function(self, name: Function, *arguments: Real) -> Real:
        """Evaluate a function of the table `FUNCTIONS`."""

    @abstractmethod
    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        """Choose between two reals, two integers or two truths."""

    @abstractmethod
    def _both(self, one: Truth, other: Truth) -> Truth:
        """Return the conjunction; at least one is a condition."""

    @abstractmethod
    def _negate(self, truth: StagedCondition) -> Truth:
        """Return the negation."""

    @abstractmethod
    def _same(self, one: Integer, other: Integer) -> Truth:
        """Compare two integers, at least one of which is not known."""

    @abstractmethod
    def real(self, integer: Integer) -> Real:
        """Return an integer as a real number."""

    @abstractmethod
    def integer(self, real: Real) -> Integer:
        """Return a real number, rounded towards zero, as an integer; 0 where it is not a number."""

    @abstractmethod
    def scale(self, real: Real, power: Integer) -> Real:
        """Return real · 2ᵖ, exact but for underflow and overflow; −1022 ≤ p ≤ 1023."""

    @abstractmethod
    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        """Call `body(i)` for i = start … count − 1, or down from count − 1."""

    @abstractmethod
    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        """Call `yes()` or `no()`."""

    @abstractmethod
    def repeat(self, body: Callable[[], Truth]) -> None:
        """Call `body()` until it returns true, at least once."""

    @abstractmethod
    def _reals(self, size: int) -> RealCells:
        """Return local cells, uninitialised."""

    @abstractmethod
    def _wholes(self, size: int) -> IntegerCells:
        """Return local cells for integers, uninitialised."""

    @abstractmethod
    def _call(self, on: "Evaluator", function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a function decorated by `staged`, with `on` as its evaluator."""

    @abstractmethod
    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        """Call a function by its address with checked arguments."""

    @abstractmethod
    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        """Return read-only cells with known integers or real numbers."""

    @abstractmethod
    def _rehearse(self, body: Callable[[], None]) -> None:
        """Run a body without effect on the program."""

    @final
    def variable(self, value: Real) -> Variable[Real]:
        """Return a real variable with its first value."""
        made = Variable(self._reals(1))
        made.value = value
        return made

    @final
    def counter(self, value: Integer) -> Variable[Integer]:
        """Return an integer variable with its first value."""
        made = Variable(self._wholes(1))
        made.value = value
        return made

    @final
    def scratch(self, size: int) -> Vector:
        """Return `size` zeros in memory that lives as long as the call of the function."""
        made = Vector(self._reals(size), 0, size)
        for place in range(size):
            made[place] = 0.0
        return made

    @final
    def sqrt(self, x: Real) -> Real:
        """Square root; not a number below zero."""
        return self._function("sqrt", x)

    @final
    def absolute(self, x: Real) -> Real:
        """Absolute value."""
        return self._function("absolute", x)

    @final
    def floor(self, x: Real) -> Real:
        """Largest whole number not above x, as a real number."""
        return self._function("floor", x)

    @final
    def sin(self, x: Real) -> Real:
        """Sine, x in rad."""
        return self._function("sin", x)

    @final
    def cos(self, x: Real) -> Real:
        """Cosine, x in rad."""
        return self._function("cos", x)

    @final
    def exp(self, x: Real) -> Real:
        """Exponential function."""
        return self._function("exp", x)

    @final
    def log(self, x: Real) -> Real:
        """Natural logarithm; −∞ at zero, not a number below."""
        return self._function("log", x)

    @final
    def atan2(self, y: Real, x: Real) -> Real:
        """Angle of (x, y) in rad, −π … π."""
        return self._function("atan2", y, x)

    @final
    def copysign(self, x: Real, sign: Real) -> Real:
        """Return the absolute value of `x` with the sign of `sign`."""
        return self._function("copysign", x, sign)

    @final
    def minimum(self, a: Real, b: Real) -> Real:
        """Return the smaller; `a` where they cannot be compared."""
        return self.select(b < a, b, a)

    @final
    def maximum(self, a: Real, b: Real) -> Real:
        """Return the larger; `a` where they cannot be compared."""
        return self.select(b > a, b, a)

    @final
    def select(self, truth: Truth, one: Value, other: Value) -> Value:
        """Choose one of two values, also entry by entry of lists; both have been evaluated."""
        if not isinstance(truth, StagedCondition):
            return one if truth else other
        if isinstance(one, list | tuple) and isinstance(other, list | tuple):
            entries: list[Any] = [
                self.select(truth, a, b) for a, b in zip(cast("list[Any]", one), cast("list[Any]", other), strict=True)
            ]
            return cast("Value", entries if isinstance(one, list) else tuple(entries))
        return self._choose(truth, one, other)

    @final
    def both(self, one: Truth, other: Truth) -> Truth:
        """Logical and; both have been evaluated."""
        if not isinstance(one, StagedCondition):
            return other if one else False
        if not isinstance(other, StagedCondition):
            return one if other else False
        return self._both(one, other)

    @final
    def either(self, one: Truth, other: Truth) -> Truth:
        """Logical or; both have been evaluated."""
        return self.negate(self.both(self.negate(one), self.negate(other)))

    @final
    def negate(self, truth: Truth) -> Truth:
        """Logical not."""
        return self._negate(truth) if isinstance(truth, StagedCondition) else not truth

    @final
    def same(self, one: Integer, other: Integer) -> Truth:
        """Tell whether two integers are equal."""
        return self._same(one, other) if isinstance(one, Count) or isinstance(other, Count) else one == other

    @final
    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function without inlining, as the decorator `staged` does."""
        return self._call(self, function, arguments)

    @final
    def reach(self, function: Reached, *arguments: Argument) -> Integer:
        """Call a function by its address; its status, 0 where it returns none.

        Raises
        ------
        StageError
            Arguments are not those of the signature, or this evaluation cannot leave the program.
        """
        return self._reach(function, parts_of(function, arguments))


def staged(
    function: Callable[Concatenate[Evaluator, Parameters], Value],
) -> Callable[Concatenate[Evaluator, Parameters], Value]:
    """Emit a function separately in machine code, once per signature; elsewhere a plain call.

    Its arguments and results are numbers, memory, lists, tuples and frozen dataclasses of these, and known values.
    """

    @wraps(function)
    def called(on: Evaluator, *args: Parameters.args, **kwargs: Parameters.kwargs) -> Value:
        if kwargs:
            raise StageError("parameters", expected="arguments by position", found=", ".join(kwargs))
        return on.call(function, *args)

    return called


class Interpreted(Evaluator):
    """Control by Python: conditions are known, or refuse."""

    @abstractmethod
    def _known(self, truth: StagedCondition, what: str) -> bool:
        """Return the one answer of a condition, or raise."""

    @final
    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        assert isinstance(count, int)
        assert isinstance(start, int)
        for index in range(count - 1, start - 1, -1) if down else range(start, count):
            body(index)

    @final
    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        if self._known(truth, "on.when") if isinstance(truth, StagedCondition) else truth:
            yes()
        elif no is not None:
            no()

    @final
    def repeat(self, body: Callable[[], Truth]) -> None:
        while True:
            truth = body()
            if self._known(truth, "on.repeat") if isinstance(truth, StagedCondition) else truth:
                return

    @final
    def _reals(self, size: int) -> RealCells:
        entries: list[Real] = [0.0] * size
        return HeldCells(entries)

    @final
    def _wholes(self, size: int) -> IntegerCells:
        entries: list[Integer] = [0] * size
        return HeldCells(entries)

    @final
    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        return HeldCells(values)

    @final
    def _rehearse(self, body: Callable[[], None]) -> None:
        body()

    @final
    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return function(on, *arguments)

    @final
    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        return called(function, parts)


class Based(Evaluator):
    """An evaluator that has another one: conditions are those of the base."""

    __slots__ = ()
    base: Evaluator

    @final
    def _both(self, one: Truth, other: Truth) -> Truth:
        return self.base.both(one, other)

    @final
    def _negate(self, truth: StagedCondition) -> Truth:
        return self.base.negate(truth)

    @final
    def _same(self, one: Integer, other: Integer) -> Truth:
        return self.base.same(one, other)

    @final
    def _rehearse(self, body: Callable[[], None]) -> None:
        self.base._rehearse(body)


class Layered(Based):
    """An evaluator whose real numbers are those of the base with something beside them: slopes, or rows of a tape."""

    __slots__ = ()

    @abstractmethod
    def constant(self, number: Real) -> Real:
        """Return a number of the base as a constant."""

    @abstractmethod
    def bare(self, number: Real) -> Real:
        """Return the base's number of one."""

    @abstractmethod
    def _handed(self, cells: Any, start: Integer) -> tuple[Part, Part]:
        """Arguments for cells from an index on: their values, and their slopes or rows of the tape."""

    @abstractmethod
    def _tape(self) -> list[Part]:
        """Arguments that a called function gets after all others."""

    @final
    def real(self, integer: Integer) -> Real:
        return self.constant(self.base.real(integer))

    @final
    def integer(self, real: Real) -> Integer:
        return self.base.integer(self.bare(real))

    @final
    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        self.base.loop(count, body, start, down)

    @final
    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        self.base.when(truth, yes, no)

    @final
    def repeat(self, body: Callable[[], Truth]) -> None:
        self.base.repeat(body)

    @final
    def _wholes(self, size: int) -> IntegerCells:
        return self.base._wholes(size)

    @final
    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        """Call by address what does the same as this evaluator with the function that is meant: its tangent, or the
        function that writes to the same tape. Tables of such programs contain addresses of these.
        """
        rest, passed = iter(parts), list[Part]()
        arguments: list[tuple[Atom, ...]] = []
        for atoms in function.signature.arguments:
            more: list[Part] = []
            for atom, value in (next(rest) for _ in atoms):
                if atom == "real":
                    raise StageError("unreached", what="the derivative of a number that is handed over by itself")
                if atom != "reals":
                    passed.append((atom, value))
                    continue
                own, beside = self._handed(*value)
                passed.append(own)
                more.append(beside)
            passed += more
            arguments.append((*atoms, *(atom for atom, _ in more)))
        last = self._tape()
        signature = Signature((*arguments, *((atom,) for atom, _ in last)), function.signature.returns)
        return self.base._reach(Reached(signature, function.address), [*passed, *last])


def known(*numbers: Real) -> bool:
    """Tell whether all numbers are known while staging."""
    return not any(isinstance(number, Number) for number in numbers)
