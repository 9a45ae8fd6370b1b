"""Tapes: a plain Python function of numbers, recorded once, and run with any number in their place.

A function that is called with recorded values in place of numbers leaves a list of operations. Numbers that meet a
recorded value become parameters, but 0 and ±1, which shape formulas; so functions that differ in numbers only leave
the same tape, and share what is made of it. What branches on its arguments, or turns them into floats, leaves none.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, TypeVar, final

import numpy as np

from ephs.semantics.derive.functions import COMPOSED, FUNCTIONS, ROOTS, SlopeRule, real_power, turn
from ephs.semantics.derive.slopes import Entries, Slope, Slopes, combined, lifted
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real, Truth
from ephs.semantics.stage.taped import Taped

# Roots of increasing functions between two numbers, in the numbers of any evaluator.

MOST: Final = 80
"""Steps at most: halvings alone end sooner."""
ENDED: Final = 2.0**-52
"""Size of the last step, by that of the ends."""


def root(on: Evaluator, function: Callable[[Real], tuple[Real, Real]], low: Real, high: Real) -> Real:
    """Return where an increasing function is zero: Newton's steps where they halve, else halvings of what is left.

    Parameters
    ----------
    function
        A number -> value and derivative.
    low, high
        Ends between which the root is.
    """
    below, above, at = on.variable(low), on.variable(high), on.variable(0.5 * (low + high))
    last, count = on.variable(high - low), on.variable(0.0)
    small = ENDED * (on.absolute(low) + on.absolute(high))

    def body() -> Truth:
        here = at.value
        value, slope = function(here)
        positive = value > 0.0
        left, right = on.select(positive, below.value, here), on.select(positive, here, above.value)
        below.value, above.value = left, right
        newton = -(value / slope)
        ended = on.absolute(newton) <= small
        inside = on.both(here + newton > left, here + newton < right)
        quick = on.both(inside, on.absolute(newton) <= 0.5 * last.value)
        step = on.select(on.either(ended, quick), newton, 0.5 * (left + right) - here)
        last.value, at.value = on.absolute(step), here + step
        count.value = count.value + 1.0
        return on.either(on.absolute(step) <= small, count.value >= float(MOST))

    on.repeat(body)
    return at.value


T = TypeVar("T")
Operation = tuple[str, tuple[int, ...], Any]
"""The name of an operation, the places of its arguments on the tape, and what shapes it: of ``"input"`` and
``"parameter"`` which one, of ``"constant"`` its value, of ``"power"`` the exponent, a multiple of 1/4, of ``"root"``
the tape of the function."""
SHAPED: Final = ("power", "root")
"""Operations with a shape beside their arguments."""


@final
@dataclass(frozen=True, slots=True)
class Tape:
    """Operations of a function.

    Parameters
    ----------
    operations
        Each refers to earlier ones.
    outputs
        Places of the results, with the shape of what the function returns.
    inputs, parameters
        How many numbers go in.
    """

    operations: tuple[Operation, ...]
    outputs: tuple[int, ...]
    shape: tuple[int, ...]
    inputs: int
    parameters: int

    def run(
        self,
        table: Mapping[str, Callable[..., T]],
        constant: Callable[[float], T],
        inputs: Sequence[T],
        parameters: Sequence[T],
    ) -> list[T]:
        """The results in terms of other numbers.

        Parameters
        ----------
        table
            Name of an operation -> function of its arguments, and of what shapes it (`SHAPED`).
        """
        values: list[T] = []
        for name, places, number in self.operations:
            if name == "input":
                values.append(inputs[int(number)])
            elif name == "parameter":
                values.append(parameters[int(number)])
            elif name == "constant":
                values.append(constant(number))
            elif name in SHAPED:
                values.append(table[name](*(values[i] for i in places), number))
            else:
                values.append(table[name](*(values[i] for i in places)))
        return [values[i] for i in self.outputs]


def evaluate(on: Evaluator, tape: Tape, inputs: Sequence[Real], parameters: Sequence[Real]) -> list[Real]:
    """Run a tape with the numbers of an evaluator."""

    def bound(operation: Callable[..., Real]) -> Callable[..., Real]:
        return lambda *arguments: operation(on, *arguments)

    table = {name: bound(OPERATIONS[name]) for name in {each[0] for each in tape.operations} if name in OPERATIONS}
    return tape.run(table, lambda number: number, inputs, parameters)


def over_step(on: Slopes, tape: Tape, inputs: Sequence[Real], parameters: Sequence[Real]) -> Slope:
    """The result of a tape with one over a step, its slopes accumulated from the end.

    Every operation says how its own arguments change it; the result's slope along each number is then the sum over
    those that it goes into: two products an operation, whatever the number of increments.
    """
    values: list[Slope] = []
    parts: list[Entries] = []
    given: dict[str, Callable[[float], Real]] = {
        "input": lambda number: inputs[int(number)],
        "parameter": lambda number: parameters[int(number)],
        "constant": lambda number: number,
    }
    for place, (name, places, number) in enumerate(tape.operations):
        arguments = [values[i] for i in places]
        if name in given:
            found = lifted(given[name](number))
        elif name in SHAPED:
            found = lifted(OPERATIONS[name](on, *arguments, number))
        else:
            found = lifted(OPERATIONS[name](on, *arguments))
        parts.append(found.slopes)
        values.append(Slope(found.start, found.end, {place: 1.0} if found.slopes else {}))
    (last,) = tape.outputs
    weights: dict[int, Real] = {last: 1.0}
    entries: dict[int, Real] = {}
    for place in range(last, -1, -1):
        if place in weights:
            into = entries if tape.operations[place][0] == "input" else weights
            for i, part in parts[place].items():
                more = part * weights[place]
                into[i] = into[i] + more if i in into else more
    return Slope(values[last].start, values[last].end, entries)


def _function(name: str) -> Callable[[Evaluator, Real], Real]:
    rule = FUNCTIONS[name]
    return lambda on, x: _ruled(on, x, rule)


def _ruled(on: Evaluator, x: Real, rule: SlopeRule) -> Real:
    return on.along(x, rule) if isinstance(on, Slopes) and isinstance(x, Slope) else rule.value(on, x)


def _exponential(on: Evaluator, a: Real, b: Real) -> Real:
    if isinstance(b, Slope):
        if b.slopes:
            return on.exp(b * on.log(a))
        b = b.start
    return _ruled(on, a, real_power(b))


def _whole(x: Real, n: int) -> Real:
    """xⁿ by squaring, n ≥ 1."""
    out: Real | None = None
    while n:
        if n & 1:
            out = x if out is None else out * x
        n >>= 1
        x = x * x if n else x
    return 1.0 if out is None else out


def _power(on: Evaluator, x: Real, exponent: float) -> Real:
    """Powers by quarters: products, quotients and roots."""
    if exponent == 0.0:
        return 1.0
    quarters = round(4.0 * abs(exponent))
    whole, rest = divmod(quarters, 4)
    out: Real | None = _whole(x, whole) if whole else None
    if quarters <= 2:
        out = on.sqrt(x) if rest == 2 else on.sqrt(on.sqrt(x))
    elif rest:
        part = _ruled(on, x, ROOTS[rest])
        out = part if out is None else out * part
    assert out is not None
    return out if exponent > 0.0 else 1.0 / out


def _sign(on: Evaluator, x: Real) -> Real:
    return on.select(x > 0.0, 1.0, on.select(x < 0.0, -1.0, x))


def _choose(on: Evaluator, number: Real, one: Real, other: Real) -> Real:
    return on.select(number > 0.0, one, other)


def _squared_turn(on: Evaluator, *q: Real) -> Real:
    if isinstance(on, Slopes):
        return on.squared_turn([lifted(x) for x in q])
    angle = turn(on, q)
    return angle * angle


def _root(on: Evaluator, low: Real, high: Real, *rest: Any) -> Real:
    """The root of a function on a tape, with the derivatives and slopes of an implicit function."""
    *given, tape = rest
    if isinstance(on, Slopes):
        ends = [lifted(x) for x in (low, high, *given)]
        start = _root(on.base, *(x.start for x in ends), tape)
        moved = [k for k, x in enumerate(ends[2:]) if x.slopes]
        if not moved:
            return lifted(start)
        end = _root(on.base, *(x.end for x in ends), tape)
        own = [Slope(x.start, x.end, {k: 1.0} if x.slopes else {}) for k, x in enumerate(ends[2:])]
        value = over_step(on, tape, [Slope(start, end, {-1: 1.0}), *own[: tape.inputs - 1]], own[tape.inputs - 1 :])
        by = -1.0 / value.slopes[-1]
        entries: Entries = {}
        for k in moved:
            if k in value.slopes:
                entries = combined(entries, 1.0, ends[2 + k].slopes, by * value.slopes[k])
        return Slope(start, end, entries)
    if isinstance(on, Duals | Taped):
        below = [on.bare(x) for x in (low, high, *given)]
        at = _root(on.base, *below, tape)
        _, slope = _along(on.base, tape, at, below[2:])
        here = on.constant(at)
        return here - _value(on, tape, here, given) / on.constant(slope)  # the derivatives; the value is rounded away
    return root(on, lambda x: _along(on, tape, x, given), low, high)


def _value(on: Evaluator, tape: Tape, at: Real, given: Sequence[Real]) -> Real:
    return evaluate(on, tape, [at, *given[: tape.inputs - 1]], given[tape.inputs - 1 :])[0]


def _along(on: Evaluator, tape: Tape, at: Real, given: Sequence[Real]) -> tuple[Real, Real]:
    """The value of a function on a tape, and its derivative by the first input."""
    duals = Duals(on)
    found = duals.dual(_value(duals, tape, duals.along(at, 0), [duals.dual(x) for x in given]))
    return found.value, found.slopes[0]


def _operations() -> Mapping[str, Callable[..., Real]]:
    one: dict[str, Callable[[Evaluator, Real], Real]] = {"negative": lambda _, a: -a, "sign": _sign}
    one |= {name: _function(name) for name in FUNCTIONS}
    two: dict[str, Callable[[Evaluator, Real, Real], Real]] = {
        "+": lambda _, a, b: a + b,
        "-": lambda _, a, b: a - b,
        "*": lambda _, a, b: a * b,
        "/": lambda _, a, b: a / b,
        "exponential": _exponential,
        "atan2": lambda on, a, b: on.atan2(a, b),
    }
    power: dict[str, Callable[[Evaluator, Real, float], Real]] = {"power": _power}
    more: dict[str, Callable[..., Real]] = {"choose": _choose, "squared turn": _squared_turn, "root": _root}
    return MappingProxyType(one | dict(COMPOSED) | two | power | more)


OPERATIONS: Final = _operations()
"""Operations on the numbers of an evaluator."""


def quarter(value: object) -> float | None:
    """An exponent that shapes the formula: a whole number of quarters."""
    if isinstance(value, int | float | np.integer):
        number = float(value)  # pyright: ignore[reportUnknownArgumentType]
        if math.isfinite(number) and (4.0 * number).is_integer():
            return number
    return None


@final
class Recorder:
    """Writes a tape; equal operations are written once."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self.parameters: list[float] = []
        self._places: dict[Operation, int] = {}

    def place(self, name: str, arguments: tuple[int, ...] = (), number: Any = 0.0) -> int:
        """Position of an operation on the tape."""
        operation = name, arguments, number
        found = self._places.get(operation)
        if found is None:
            found = self._places[operation] = len(self.operations)
            self.operations.append(operation)
        return found

    def number(self, value: float) -> int:
        """A number that meets a recorded value."""
        if value in (0.0, 1.0, -1.0):
            return self.place("constant", (), value)
        self.parameters.append(value)
        return self.place("parameter", (), float(len(self.parameters) - 1))
