"""Plain evaluation: real numbers are floats with IEEE arithmetic, which makes it the oracle of all others."""

import math
from collections.abc import Callable
from typing import Any, Final, cast, final

import numpy as np

from ephs.semantics.stage.elementary import COMPOSED
from ephs.semantics.stage.evaluator import Function, Interpreted
from ephs.semantics.stage.numbers import Integer, Real, StagedCondition, Truth

_EXACT: Final[dict[Function, Callable[..., float]]] = {
    "sqrt": np.sqrt,
    "absolute": np.abs,
    "floor": np.floor,
    "copysign": np.copysign,
}


def elementary(name: Function, *arguments: float) -> float:
    """Evaluate a function of floats as the machine does."""
    with np.errstate(all="ignore"):
        numbers = [np.float64(argument) for argument in arguments]
        found = _EXACT[name](*numbers) if name in _EXACT else COMPOSED[name](PLAIN, *numbers)
    return np.float64(found)


@final
class Plain(Interpreted):
    """Evaluation with floats; division by zero and overflow follow IEEE where `numpy.errstate` lets them."""

    def _function(self, name: Function, *arguments: Real) -> Real:
        return elementary(name, *cast("tuple[float, ...]", arguments))

    def _known(self, truth: StagedCondition, what: str) -> bool:
        return bool(truth)

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        return one if truth else other

    def _both(self, one: Truth, other: Truth) -> Truth:
        return bool(one) and bool(other)

    def _negate(self, truth: StagedCondition) -> Truth:
        return not truth

    def _same(self, one: Integer, other: Integer) -> Truth:
        return one == other

    def real(self, integer: Integer) -> Real:
        return np.float64(cast("int", integer))

    def integer(self, real: Real) -> Integer:
        value = cast("float", real)
        if math.isnan(value):
            return 0
        return int(value) if abs(value) < 2.0**63 else _edge(value)

    def scale(self, real: Real, power: Integer) -> Real:
        return cast("float", real) * np.float64(math.ldexp(1.0, cast("int", power)))


def _edge(value: float) -> int:
    return 2**63 - 1 if value > 0.0 else -(2**63)


PLAIN: Final = Plain()
