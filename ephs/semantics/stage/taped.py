"""Reverse accumulation over any evaluator: a function writes a tape as it runs, and the tape is read backwards.

A number knows its value and, where it is active, a linear combination of earlier rows of the tape: a row is written
where the combination gets long or the number is kept in memory. The gradient of one result by all arguments takes one
run and one reading, however many there are. Griewank and Walther, *Evaluating Derivatives*, 2008, chapter 6.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, wraps
from typing import Any, Final, TypeAlias, cast, final

from ephs.semantics.stage.duals import RULES
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator, Function, Layered
from ephs.semantics.stage.memory import Cells, IntegerCells, Integers, RealCells, Variable, Vector
from ephs.semantics.stage.numbers import ORDERS, Integer, Number, Operation, Order, Real, StagedCondition, Truth
from ephs.semantics.stage.reaching import Part
from ephs.semantics.stage.records import Record

POSITION, ROWS, CAPACITY, COUNT = range(4)
"""Counters of a tape: where the next entry goes, the number of the next row, room for entries; how many counters."""
LONG: Final = 8
"""Terms of a sum beyond which a row is written."""
PRODUCT: Final = 2
"""The same for factors: their terms would be computed for each product."""
Terms: TypeAlias = tuple[tuple[Integer, Real], ...]
"""Rows of the tape and what the number changes with each; row 0 is none."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class SlopeTape:
    """Rows of entries, each the index of an earlier row and a slope; the number of a row's entries follows them."""

    counters: IntegerCells
    places: IntegerCells
    slopes: RealCells

    def write(self, on: Evaluator, terms: Terms) -> Integer:
        """Write a row and return its number. Where there is no room the first entries are spoiled: the count shows."""
        size = len(terms) + 1
        position, row = self.counters.load(POSITION), self.counters.load(ROWS)
        at = on.select(position + size <= self.counters.load(CAPACITY), position, 0)
        for k, (place, slope) in enumerate(terms):
            self.places.store(at + k, place)
            self.slopes.store(at + k, slope)
        self.places.store(at + (size - 1), size - 1)
        self.counters.store(POSITION, position + size)
        self.counters.store(ROWS, row + 1)
        return row


@final
@dataclass(frozen=True, slots=True, eq=False)
class Traced(Number):
    """A value, and how it changes with rows of a tape."""

    on: "Taped"
    value: Real
    terms: Terms

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        on, (a, one), (b, other) = self.on, _split(left), _split(right)
        match operation:
            case "+":
                return on.traced(a + b, (*one, *other))
            case "-":
                return on.traced(a - b, (*one, *_scaled(other, -1.0)))
            case "*":
                one, other = on.short(one), on.short(other)
                return on.traced(a * b, (*_scaled(one, b), *_scaled(other, a)))
            case "/":
                quotient = a / b
                one, other = on.short(one), on.short(other)
                under = 1.0 / b
                return on.traced(quotient, (*_scaled(one, under), *_scaled(other, -(quotient * under))))

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        return ORDERS[order](_split(left)[0], _split(right)[0])

    def _negative(self) -> Real:
        return Traced(self.on, -self.value, _scaled(self.terms, -1.0))


def _split(number: Real) -> tuple[Real, Terms]:
    return (number.value, number.terms) if isinstance(number, Traced) else (number, ())


def _scaled(terms: Terms, by: Real) -> Terms:
    return tuple((place, slope * by) for place, slope in terms)


@final
@dataclass(frozen=True, slots=True, eq=False)
class TapedCells(Cells[Real]):
    """Cells of traced numbers: values, and the row of each; none where it is a constant."""

    on: "Taped"
    values: RealCells
    places: IntegerCells

    def load(self, index: Integer) -> Real:
        """Return the number at an index."""
        return Traced(self.on, self.values.load(index), ((self.places.load(index), 1.0),))

    def store(self, index: Integer, value: Real) -> None:
        """Keep a number at an index."""
        number, terms = _split(value)
        self.values.store(index, number)
        self.places.store(index, self.on.place(terms))


@final
@dataclass(frozen=True, slots=True)
class Taped(Layered):
    """Evaluation that writes a tape, with another evaluator's numbers."""

    base: Evaluator
    tape: SlopeTape

    def constant(self, number: Real) -> Real:
        """Return a number of the base as a constant."""
        return Traced(self, number, ())

    def bare(self, number: Real) -> Real:
        """Return the base's number of one."""
        return _split(number)[0]

    def traced(self, value: Real, terms: Terms) -> Real:
        """Return a number; a row is written where its terms are many, and a constant is one of the base."""
        merged: dict[int, tuple[Integer, Real]] = {}
        for place, slope in terms:
            known = merged.get(id(place))
            merged[id(place)] = (place, slope if known is None else known[1] + slope)
        found = tuple(merged.values())
        if len(found) > LONG:
            found = ((self.tape.write(self.base, found), 1.0),)
        return Traced(self, value, found)

    def short(self, terms: Terms) -> Terms:
        """Return few terms, by a row of the tape."""
        return terms if len(terms) <= PRODUCT else ((self.tape.write(self.base, terms), 1.0),)

    def place(self, terms: Terms) -> Integer:
        """Return the row that a number is."""
        if not terms:
            return 0
        place, slope = terms[0]
        if len(terms) == 1 and type(slope) is float and slope == 1.0:
            return place
        return self.tape.write(self.base, terms)

    def _function(self, name: Function, *arguments: Real) -> Real:
        parts = [_split(argument) for argument in arguments]
        value, factors = RULES[name](self.base, [value for value, _ in parts])
        terms = [_scaled(self.short(terms), factor) for (_, terms), factor in zip(parts, factors, strict=True)]
        return self.traced(value, tuple(term for part in terms for term in part))

    def scale(self, real: Real, power: Integer) -> Real:
        value, terms = _split(real)
        scaled = tuple((place, self.base.scale(slope, power)) for place, slope in terms)
        return self.traced(self.base.scale(value, power), scaled)

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        if not isinstance(one, float | Number) and not isinstance(other, float | Number):
            return self.base.select(truth, one, other)
        (a, left), (b, right) = _split(one), _split(other)
        place = self.base.select(truth, self.place(left), self.place(right))
        return Traced(self, self.base.select(truth, a, b), ((place, 1.0),))

    def _reals(self, size: int) -> RealCells:
        return TapedCells(self, self.base._reals(size), self.base._wholes(size))

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        constants = self.base._constants(values, whole)
        return constants if whole else TapedCells(self, constants, _Nothing())

    def _handed(self, cells: Any, start: Integer) -> tuple[Part, Part]:
        if not isinstance(cells, TapedCells):
            raise StageError("passive")
        return ("reals", (cells.values, start)), ("integers", (cells.places, start))

    def _tape(self) -> list[Part]:
        tape = self.tape
        return [("integers", (tape.counters, 0)), ("integers", (tape.places, 0)), ("reals", (tape.slopes, 0))]

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        if on is not self:
            return function(on, *arguments)
        passed = self.base.call(_writing(function), self.tape, _swapped(arguments, self.passed))
        return _swapped(passed, self.taken)

    def passed(self, number: Any) -> Any:
        """Return what stands for a number or for memory beside a tape that is handed over: its row is written."""
        match number:
            case Traced():
                return _PassedNumber(number.value, self.place(number.terms))
            case TapedCells():
                return _PassedCells(number.values, number.places)
            case _:
                return None

    def taken(self, passed: Any) -> Any:
        """Return the number or the memory that something stands for: `passed` undone."""
        match passed:
            case _PassedNumber():
                return Traced(self, passed.value, ((passed.place, 1.0),))
            case _PassedCells():
                return TapedCells(self, passed.values, passed.places)
            case _:
                return None


@final
@dataclass(frozen=True, slots=True, eq=False)
class _PassedNumber:
    """A traced number without its tape."""

    value: Real
    place: Integer


@final
@dataclass(frozen=True, slots=True, eq=False)
class _PassedCells:
    """Cells of traced numbers without their tape."""

    values: RealCells
    places: IntegerCells


@cache
def _writing(function: Callable[..., Any]) -> Callable[..., Any]:
    """A staged function as one that takes the tape that it writes to: emitted once, as the function itself is."""

    @wraps(function)
    def run(base: Evaluator, tape: SlopeTape, arguments: tuple[Any, ...]) -> Any:
        on = Taped(base, tape)
        return _swapped(function(on, *_swapped(arguments, on.taken)), on.passed)

    return run


def _swapped(value: Any, swap: Callable[[Any], Any]) -> Any:
    """A value with what is in it exchanged where ``swap`` does not return None: entries of lists, tuples, records,
    variables and frozen dataclasses.
    """
    found = swap(value)
    if found is not None:
        return found
    match value:
        case list() | tuple():
            entries = [_swapped(entry, swap) for entry in cast("list[Any]", value)]
            return entries if isinstance(value, list) else tuple(entries)
        case Variable():
            return Variable[Any](_swapped(cast("Variable[Any]", value).cells, swap))
        case Record():
            parts = (value.integers, value.integer_start, value.reals, value.real_start)
            return type(value)(*(_swapped(part, swap) for part in parts))
        case Number() | Cells():
            return cast("Any", value)
        case _ if is_dataclass(value) and not isinstance(value, type):
            made = cast("Callable[..., Any]", type(value))
            return made(*(_swapped(getattr(value, field.name), swap) for field in fields(value)))
        case _:
            return value


@final
class _Nothing(Cells[Integer]):
    """Rows of constants."""

    __slots__ = ()

    def load(self, index: Integer) -> Integer:
        """Return no row."""
        return 0

    def store(self, index: Integer, value: Integer) -> None:
        """Refuse: constants are read only."""
        raise StageError("passive")


def back(on: Evaluator, counters: Integers, places: Integers, slopes: Vector, bars: Vector) -> None:
    """Read a tape backwards: add to each row's share in the result what later rows have of it, and clear those.

    Parameters
    ----------
    bars
        By row: the share of each in the result; before, that of the rows that are results.
    """
    position, row = on.counter(counters[POSITION]), on.counter(counters[ROWS] - 1)

    def once() -> Truth:
        count = places[position.value - 1]
        first, share = position.value - 1 - count, bars[row.value]

        def entry(j: Integer) -> None:
            place = places[first + j]
            bars[place] = bars[place] + slopes[first + j] * share

        bars[row.value] = 0.0
        # Unused results are omitted: slopes may be infinite in a branch that was not selected.
        on.when(on.absolute(share) > 0.0, lambda: on.loop(count, entry))
        position.value, row.value = first, row.value - 1
        return first <= 0

    on.when(position.value > 0, lambda: on.repeat(once))
