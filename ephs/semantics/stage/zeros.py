"""Evaluation that knows of a number only whether it is zero whatever the arguments are.

Other numbers may be anything. Both sides of an open condition count, and cells keep all that was ever stored in them.
So what is zero here is zero in every evaluation; what is not zero here may be zero in some.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, cast, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator, Function, known
from ephs.semantics.stage.memory import Cells, IntegerCells, RealCells, Vector
from ephs.semantics.stage.numbers import Count, Integer, Number, Real, StagedCondition, Truth
from ephs.semantics.stage.plain import elementary


@final
class _Anything(Number):
    """A number that may be anything."""

    __slots__ = ()

    def _apply(self, operation: Any, left: Real, right: Real) -> Real:
        return ANYTHING

    def _order(self, order: Any, left: Real, right: Real) -> Truth:
        return _OPEN

    def _negative(self) -> Real:
        return ANYTHING


@final
class _AnyInteger(Count):
    """An integer that may be any."""

    __slots__ = ()

    def _apply(self, operation: Any, left: Integer, right: Integer) -> Integer:
        return _INTEGER

    def _order(self, order: Any, left: Integer, right: Integer) -> Truth:
        return _OPEN


@final
class _Open(StagedCondition):
    """A condition that holds or not."""

    __slots__ = ()


ANYTHING: Final = _Anything()
_INTEGER: Final = _AnyInteger()
_OPEN: Final = _Open()


def _either(one: Any, other: Any) -> Any:
    """One of two values: what is known of both."""
    if isinstance(one, StagedCondition | bool):
        return _OPEN
    if not isinstance(one, Number | Count) and not isinstance(other, Number | Count) and one == other:
        return one
    return _INTEGER if isinstance(one, Count | int) and isinstance(other, Count | int) else ANYTHING


@final
@dataclass(frozen=True, slots=True, eq=False)
class _JoinedCells(Cells[Any]):
    """Cells that keep all that was ever stored."""

    entries: list[Any]

    def load(self, index: Integer) -> Any:
        return self.entries[index]

    def store(self, index: Integer, value: Any) -> None:
        self.entries[index] = _either(self.entries[index], value)


@final
class Zeros(Evaluator):
    """Evaluation with numbers that are known, or may be anything."""

    __slots__ = ("_made",)

    def __init__(self) -> None:
        self._made: list[_JoinedCells] = []

    def vector(self, numbers: list[Real]) -> Vector:
        """Return a vector that holds numbers and all that is stored there."""
        return Vector(self._cells(numbers), 0, len(numbers))

    def _cells(self, numbers: list[Any]) -> "_JoinedCells":
        self._made.append(_JoinedCells(numbers))
        return self._made[-1]

    def _function(self, name: Function, *arguments: Real) -> Real:
        return elementary(name, *cast("tuple[float, ...]", arguments)) if known(*arguments) else ANYTHING

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        return _either(one, other)

    def _both(self, one: Truth, other: Truth) -> Truth:
        return _OPEN

    def _negate(self, truth: StagedCondition) -> Truth:
        return _OPEN

    def _same(self, one: Integer, other: Integer) -> Truth:
        return _OPEN

    def real(self, integer: Integer) -> Real:
        return float(integer) if isinstance(integer, int) else ANYTHING

    def integer(self, real: Real) -> Integer:
        return _INTEGER

    def scale(self, real: Real, power: Integer) -> Real:
        return ANYTHING

    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        for index in range(start, count):
            body(index)

    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        if isinstance(truth, StagedCondition) or truth:
            yes()
        if no is not None and (isinstance(truth, StagedCondition) or not truth):
            no()

    def repeat(self, body: Callable[[], Truth]) -> None:
        before = -1
        while before != (before := sum(entry is ANYTHING for cells in self._made for entry in cells.entries)):
            body()

    def _reals(self, size: int) -> RealCells:
        return self._cells([0.0] * size)

    def _wholes(self, size: int) -> IntegerCells:
        return self._cells([0] * size)

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        return self._cells(values)

    def _rehearse(self, body: Callable[[], None]) -> None:
        body()

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return function(on, *arguments)

    def _reach(self, function: Any, parts: Any) -> Integer:
        raise StageError("unreached", what="an evaluation without numbers")
