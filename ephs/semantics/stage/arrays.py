"""Evaluation with NumPy arrays as numbers: many members at once, an operation for all of them at a time."""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, cast, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.stage.elementary import COMPOSED
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Function, Interpreted
from ephs.semantics.stage.memory import Cells
from ephs.semantics.stage.numbers import (
    ARITHMETIC,
    ORDERS,
    Count,
    Integer,
    IntegerOperation,
    Number,
    Operation,
    Order,
    Real,
    StagedCondition,
    Truth,
)

_OPERATIONS: Final[dict[str, Callable[[Any, Any], Any]]] = {
    **ARITHMETIC, **ORDERS, "//": lambda a, b: a // b, "%": operator.mod
}  # fmt: skip
_EXACT: Final[dict[Function, Callable[..., Any]]] = {
    "sqrt": np.sqrt,
    "absolute": np.abs,
    "floor": np.floor,
    "copysign": np.copysign,
}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Batch(Number):
    """A real number of each member."""

    values: NDArray[np.float64]

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        return Batch(_OPERATIONS[operation](_member_values(left), _member_values(right)))

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        return Mask(_OPERATIONS[order](_member_values(left), _member_values(right)))

    def _negative(self) -> Real:
        return Batch(-self.values)


@final
@dataclass(frozen=True, slots=True, eq=False)
class BatchCount(Count):
    """An integer of each member."""

    values: NDArray[np.int64]

    def _apply(self, operation: IntegerOperation, left: Integer, right: Integer) -> Integer:
        return BatchCount(_OPERATIONS[operation](_member_values(left), _member_values(right)))

    def _order(self, order: Order, left: Integer, right: Integer) -> Truth:
        return Mask(_OPERATIONS[order](_member_values(left), _member_values(right)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mask(StagedCondition):
    """A truth value of each member."""

    values: NDArray[np.bool]


@final
@dataclass(frozen=True, slots=True, eq=False)
class BatchCells(Cells[Real]):
    """Cells in a NumPy array whose last axis counts members."""

    array: NDArray[np.float64]

    def load(self, index: Integer) -> Real:
        """Return the numbers at an index."""
        return Batch(self.array[cast("int", index)].copy())

    def store(self, index: Integer, value: Real) -> None:
        """Keep numbers at an index."""
        self.array[cast("int", index)] = _member_values(value)


def _member_values(value: object) -> Any:
    return value.values if isinstance(value, Batch | BatchCount | Mask) else value


@final
class Arrays(Interpreted):
    """Evaluation of all members at once; branches that differ between them need `select`, not `when`."""

    def _function(self, name: Function, *arguments: Real) -> Real:
        if name in COMPOSED:
            return COMPOSED[name](self, *arguments)
        return Batch(_EXACT[name](*map(_member_values, arguments)))

    def _known(self, truth: StagedCondition, what: str) -> bool:
        raise StageError("undecided", what=what, found="for all members")

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        values = cast("Any", np.where(_member_values(truth), _member_values(one), _member_values(other)))
        kinds: dict[str, Callable[[Any], Any]] = {"f": Batch, "i": BatchCount, "b": Mask}
        return kinds[values.dtype.kind](values)

    def _both(self, one: Truth, other: Truth) -> Truth:
        return Mask(np.logical_and(_member_values(one), _member_values(other)))

    def _negate(self, truth: StagedCondition) -> Truth:
        return Mask(np.logical_not(_member_values(truth)))

    def _same(self, one: Integer, other: Integer) -> Truth:
        return Mask(np.equal(_member_values(one), _member_values(other)))

    def real(self, integer: Integer) -> Real:
        if isinstance(integer, BatchCount):
            return Batch(integer.values.astype(np.float64))
        return np.float64(cast("int", integer))

    def integer(self, real: Real) -> Integer:
        values = np.trunc(np.nan_to_num(_member_values(real), posinf=np.inf, neginf=-np.inf))
        large = np.abs(values) >= 2.0**63
        edges = np.where(values > 0.0, np.int64(2**63 - 1), np.int64(-(2**63)))
        return BatchCount(np.where(large, edges, np.where(large, 0.0, values).astype(np.int64)))

    def scale(self, real: Real, power: Integer) -> Real:
        return Batch(_member_values(real) * np.ldexp(1.0, _member_values(power)))


ARRAYS: Final = Arrays()
