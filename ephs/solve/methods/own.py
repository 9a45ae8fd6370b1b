"""Explicit methods of one's own: `Method`, whose stages are recorded once as the coefficients of a step.

What `Method.stages` does with the rates of a step, additions and multiplications by numbers, is linear, so that one
recording is the whole method: stages a, weights b, and the weights of its estimate. Compiled steps, events, saved
instants, corrections of the energy, audits and derivatives are those of every explicit method.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any, Never, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.methods.orders import order_of, power_of
from ephs.solve.posing.errors import OptionError

MOST_STAGES = 64


class _RecordedSum:
    """What only adds up and is multiplied by numbers."""

    __slots__ = ()
    __array_ufunc__ = None

    def __bool__(self) -> Never:
        raise _refused("a condition on it")

    def __float__(self) -> Never:
        raise _refused("a number of it")

    def __pow__(self, other: object) -> Never:
        raise _refused("a power of it")

    def __rtruediv__(self, other: object) -> Never:
        raise _refused("a division by it")


def _refused(found: str) -> OptionError:
    """What a recording cannot keep."""
    return OptionError(
        "method", found, "sums of rates times numbers, and step.h once: other methods define ReducedMethod.step"
    )


def _number(value: object) -> float | None:
    """A finite number; None of all else."""
    if isinstance(value, Real) and not isinstance(value, bool) and np.isfinite(float(value)):
        return float(value)
    return None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Combination(_RecordedSum):
    """A sum of a step's rates times numbers, and times the step's length where it is a change.

    Attributes
    ----------
    weights
        Number of a stage -> factor.
    change
        Whether it is multiplied by the length of the step: a change of the state, else a rate.
    """

    weights: Mapping[int, float]
    change: bool = False

    def __add__(self, other: object) -> "Combination":
        if _number(other) == 0.0:
            return self
        if not isinstance(other, Combination):
            return NotImplemented
        if other.change is not self.change:
            raise _refused("the sum of a rate and a change")
        keys = dict.fromkeys((*self.weights, *other.weights))
        return Combination({k: self.weights.get(k, 0.0) + other.weights.get(k, 0.0) for k in keys}, self.change)

    __radd__ = __add__

    def __mul__(self, other: object) -> "Combination":
        if isinstance(other, StepLength):
            if self.change:
                raise _refused("the square of step.h")
            return Combination({k: other.factor * w for k, w in self.weights.items()}, True)
        factor = _number(other)
        if factor is None:
            raise _refused(f"a product with {other!r}")
        return Combination({k: factor * w for k, w in self.weights.items()}, self.change)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> "Combination":
        divisor = _number(other)
        if not divisor:
            raise _refused(f"a division by {other!r}")
        return Combination({k: w / divisor for k, w in self.weights.items()}, self.change)

    def __neg__(self) -> "Combination":
        return -1.0 * self

    def __sub__(self, other: object) -> "Combination":
        return self + -1.0 * other if isinstance(other, Combination) else self.__add__(other)

    def __rsub__(self, other: object) -> "Combination":
        return -1.0 * self + other

    def row(self, size: int) -> Array:
        """(size,) its factors."""
        out = np.zeros(size)
        for k, weight in self.weights.items():
            out[k] = weight
        return out


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepLength(_RecordedSum):
    """The length of a step, in s, times a number."""

    factor: float = 1.0

    def __mul__(self, other: object) -> "Any":
        if isinstance(other, Combination):
            return other * self
        factor = _number(other)
        if factor is None:
            raise _refused(f"the product of step.h and {'itself' if isinstance(other, StepLength) else repr(other)}")
        return StepLength(factor * self.factor)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> "StepLength":
        divisor = _number(other)
        if not divisor:
            raise _refused(f"a division of step.h by {other!r}")
        return StepLength(self.factor / divisor)

    def __neg__(self) -> "StepLength":
        return StepLength(-self.factor)


@final
class RecordedStep:
    """A step that is recorded.

    Attributes
    ----------
    h
        Its length.
    taken
        The rates so far, the first at the start of the step.
    """

    def __init__(self) -> None:
        self.h = StepLength()
        self.taken = [Combination({0: 1.0})]
        self.rows: list[Combination] = [Combination({}, True)]

    def rates(self, change: "Combination | float | None" = None) -> Combination:
        """Rates where a change leads to from the start of the step; at the start itself without one.

        Raises
        ------
        OptionError
            It is no change, or there are more than 64 stages.
        """
        if change is None or _number(change) == 0.0:
            return self.taken[0]
        if not isinstance(change, Combination) or not change.change:
            raise OptionError("change", change, "step.h times rates")
        if len(self.taken) == MOST_STAGES:
            raise OptionError("method", f"more than {MOST_STAGES} stages", f"at most {MOST_STAGES}")
        self.rows.append(change)
        self.taken.append(Combination({len(self.taken): 1.0}))
        return self.taken[-1]


@dataclass(frozen=True, slots=True)
class Method(ABC):
    """An explicit method of one's own: a frozen dataclass with `stages`, and, if there is one, an embedded `estimate`.

    An instance is a ``method`` of `ephs.simulate`, `ephs.sensitivity`, `ephs.gradient` and `Dynamics.step`;
    `ephs.register_method` gives it a name for all else. Its order is found from its coefficients. Its fields are its
    parameters.
    """

    @property
    def name(self) -> str:
        """What solutions call it: its class, and its parameters if there are any."""
        parameters = repr(self).removeprefix(type(self).__qualname__)
        return type(self).__name__ + parameters.removesuffix("()")

    @abstractmethod
    def stages(self, step: RecordedStep) -> Combination:
        """The change of the state in a step: sums of ``step.rates(change)`` times numbers and ``step.h``.

        ``step.rates()`` are the rates at the start, ``step.rates(change)`` those where ``change`` leads to.
        """

    def estimate(self, step: RecordedStep, rates: tuple[Combination, ...], end: Combination) -> Combination | None:
        """The error of the step, as a change; None: the difference of two half steps and a whole one.

        Parameters
        ----------
        rates
            What `stages` took, in order.
        end
            The rates at the end of the step.
        """
        return None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Coefficients:
    """An explicit method in numbers.

    Attributes
    ----------
    a
        (s, s), strictly lower: stages, the first of which is the start.
    b
        (s,) weights.
    error
        (s + 1,) weights of the estimate, the last one of the rates at the end.
    order, power
        Order of the step; power of its length with which the estimate falls.
    """

    a: Array
    b: Array
    error: Array
    order: int
    power: int

    @property
    def numbers(self) -> Array:
        """All coefficients, row by row."""
        return np.concatenate([self.a.ravel(), self.b, self.error])

    @property
    def extended(self) -> Array:
        """(s + 1, s + 1) stages with the end of the step as the last."""
        return _with_end(self.a, self.b)


def coefficients_of(method: Method, *, chosen: bool = True) -> Coefficients:
    """The coefficients of a method.

    Parameters
    ----------
    chosen
        Whether steps are chosen by an estimate: a method without one then takes two half steps beside a whole one.

    Raises
    ------
    OptionError
        It is not linear in its rates, of order 0, or its estimate is none.
    """
    step = RecordedStep()
    change = _change(method.stages(step), "stages")
    count = len(step.rows)
    a, b = np.array([row.row(count) for row in step.rows]), change.row(count)
    order = order_of(a, b)
    if order == 0:
        raise OptionError("stages", f"weights whose sum is {float(b.sum()):.6g}", "weights whose sum is 1")
    given = method.estimate(step, tuple(step.taken), Combination({count: 1.0}))
    if len(step.rows) != count:
        raise OptionError("estimate", "further rates", "those of the stages and of the end")
    if given is None:
        return halved(a, b, order) if chosen else Coefficients(a, b, np.zeros(count + 1), order, order + 1)
    error = _change(given, "estimate").row(count + 1)
    power = power_of(_with_end(a, b), error)
    if power == 1 or power > order + 1:
        found = "of the size of the step itself" if power == 1 else f"of order h^{power} or none"
        raise OptionError("estimate", f"an estimate {found}", f"one that falls with h² to h^{order + 1}")
    return Coefficients(a, b, error, order, power)


def halved(a: Array, b: Array, order: int) -> Coefficients:
    """Two half steps of a method, with Richardson's estimate: their difference from a whole one over 2ᵖ − 1.

    The stages are the start, those of the whole step, and those of both halves.
    """
    s = b.size
    whole = np.arange(s)
    first, second = np.append(0, np.arange(s, 2 * s - 1)), np.arange(2 * s - 1, 3 * s - 1)
    rows, weights, compared = np.zeros((3 * s - 1, 3 * s - 1)), np.zeros(3 * s - 1), np.zeros(3 * s - 1)
    rows[np.ix_(whole, whole)] = a
    rows[np.ix_(first[1:], first)] = 0.5 * a[1:]
    rows[np.ix_(second, second)] = 0.5 * a
    rows[np.ix_(second, first)] = 0.5 * b
    weights[first] = 0.5 * b
    weights[second] = 0.5 * b
    compared[whole] = b
    error = np.append((weights - compared) / (2.0**order - 1.0), 0.0)
    return Coefficients(rows, weights, error, order_of(rows, weights), power_of(_with_end(rows, weights), error))


def _with_end(a: Array, b: Array) -> Array:
    return np.block([[a, np.zeros((b.size, 1))], [b[None], np.zeros((1, 1))]])


def _change(found: object, key: str) -> Combination:
    if not isinstance(found, Combination) or not found.change:
        raise OptionError(key, found, "a change: step.h times rates")
    return found
