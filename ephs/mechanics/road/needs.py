"""Memory that a class of mechanisms needs: which fields of its records vary, are constant, or affect nothing.

A program that is looped over links is run once with numbers that know only what they depend on. Fields that every link
sets to the same known number are constants of the class: the third dimension of planar mechanisms, the zero columns of
revolute joints. Fields from which nothing follows that the program returns need not be computed. Constants are assumed
first and confirmed by runs until nothing changes (sparse conditional constant propagation, through memory).
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, final

from ephs.semantics.stage import Evaluator, Integer, Reached, Real, Record, Truth, Vector
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Function
from ephs.semantics.stage.kinds import Atom, Kind
from ephs.semantics.stage.memory import Cells, IntegerCells, RealCells
from ephs.semantics.stage.numbers import Count, IntegerOperation, Number, Operation, Order, StagedCondition
from ephs.semantics.stage.reaching import Part

Row = TypeVar("Row", bound=Record)


@final
@dataclass(frozen=True, slots=True)
class FieldLayout:
    """Positions of the fields of a record.

    Attributes
    ----------
    constants
        Offset of a field's entry in the record -> its value in all rows.
    columns
        Offset -> column of a matrix with as many rows, which holds constants where others read them, too; entries in
        neither mapping affect nothing.
    """

    constants: Mapping[int, float]
    columns: Mapping[int, int]

    @property
    def width(self) -> int:
        """Columns of the matrix."""
        return len(self.columns)

    @property
    def pairs(self) -> tuple[list[tuple[int, float]], list[tuple[int, int]]]:
        """The items of both mappings."""
        return list(self.constants.items()), list(self.columns.items())


@final
@dataclass(frozen=True, slots=True, eq=False)
class LaidOut(RealCells):
    """The real numbers of one row of a record with a layout."""

    layout: FieldLayout
    cells: RealCells
    start: Integer

    def load(self, index: Integer) -> Real:
        assert isinstance(index, int)
        if index in self.layout.constants or index not in self.layout.columns:
            return self.layout.constants.get(index, 0.0)
        return self.cells.load(self.start + self.layout.columns[index])

    def store(self, index: Integer, value: Real) -> None:
        assert isinstance(index, int)
        column = self.layout.columns.get(index)
        if column is not None:
            self.cells.store(self.start + column, value)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Compact(Generic[Row]):
    """Rows of a record of real numbers, kept as a layout says."""

    record: type[Row]
    layout: FieldLayout
    memory: Vector

    def __getitem__(self, i: Integer) -> Row:
        cells = LaidOut(self.layout, self.memory.cells, self.memory.start + i * self.layout.width)
        return self.record(NO_INTEGERS, 0, cells, 0)


@final
class _NoIntegers(IntegerCells):
    """A record without integers."""

    def load(self, index: Integer) -> Integer:
        raise IndexError(index)

    def store(self, index: Integer, value: Integer) -> None:
        raise IndexError(index)


NO_INTEGERS = _NoIntegers()


# ---- the survey ---------------------------------------------------------------------------------------------------


@final
@dataclass(frozen=True, slots=True, eq=False)
class _DependenceTrace(Number):
    """A number of which nothing is known but the entries that it depends on, as bits."""

    on: int

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        return _DependenceTrace(_bits(left) | _bits(right))

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        return _TraceTruth(_bits(left) | _bits(right))

    def _negative(self) -> Real:
        return self


@final
@dataclass(frozen=True, slots=True, eq=False)
class _TraceTruth(StagedCondition):
    """An unknown condition with its dependencies."""

    on: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class _TraceCount(Count):
    """An unknown integer with its dependencies."""

    on: int = 0

    def _apply(self, operation: IntegerOperation, left: Integer, right: Integer) -> Integer:
        return _TraceCount(_bits(left) | _bits(right))

    def _order(self, order: Order, left: Integer, right: Integer) -> Truth:
        return _TraceTruth(_bits(left) | _bits(right))


def _bits(*values: object) -> int:
    found = 0
    for value in values:
        found |= value.on if isinstance(value, _DependenceTrace | _TraceTruth | _TraceCount) else 0
    return found


class _Entries:
    """Knowledge of the entries of memory and of variables: constants assumed, values written, dependences."""

    def __init__(self) -> None:
        self.assumed: dict[int, float | None] = {}
        self.written: dict[int, float | None] = {}
        self.follows: dict[int, int] = {}
        self.live = 0

    def load(self, entry: int) -> Real:
        value = self.assumed.get(entry, 0.0)
        return _DependenceTrace(1 << entry) if value is None else value

    def store(self, entry: int, value: Real, why: int) -> None:
        known = None if isinstance(value, Number) else float(value)
        before = self.written.get(entry, self.assumed.get(entry, known))
        self.written[entry] = known if before == known else None
        self.follows[entry] = self.follows.get(entry, 0) | _bits(value) | why

    def settled(self) -> bool:
        """Take what was written as what is assumed next; whether that was so already."""
        found = self.assumed | self.written
        settled, self.assumed, self.written = found == self.assumed, found, {}
        return settled

    def needed(self) -> int:
        """Entries on which results depend, as bits."""
        found, fresh = 0, self.live
        while fresh:
            entry = fresh.bit_length() - 1
            found |= 1 << entry
            fresh = (fresh | self.follows.get(entry, 0)) & ~found
        return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class _SurveyedReals(RealCells):
    """Real numbers of a record, all rows as one; those of arguments and results have no entries."""

    on: "Survey"
    entries: bool

    def load(self, index: Integer) -> Real:
        return self.on.entries.load(index) if self.entries and isinstance(index, int) else _DependenceTrace(0)

    def store(self, index: Integer, value: Real) -> None:
        if self.entries and isinstance(index, int):
            self.on.entries.store(index, value, self.on.why)
        else:
            self.on.entries.live |= _bits(value) | self.on.why


@final
@dataclass(frozen=True, slots=True, eq=False)
class _SurveyedIntegers(IntegerCells):
    """Integers of which nothing is known."""

    def load(self, index: Integer) -> Integer:
        return _TraceCount()

    def store(self, index: Integer, value: Integer) -> None: ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class _HeldReal(RealCells):
    """A function's own real numbers: one entry beyond the record's, which is never taken for constant."""

    on: "Survey"
    entry: int

    def load(self, index: Integer) -> Real:
        return _DependenceTrace(1 << self.entry)

    def store(self, index: Integer, value: Real) -> None:
        self.on.hold(self.entry, value)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _HeldInteger(IntegerCells):
    """A function's own integers, likewise."""

    on: "Survey"
    entry: int

    def load(self, index: Integer) -> Integer:
        return _TraceCount(1 << self.entry)

    def store(self, index: Integer, value: Integer) -> None:
        self.on.hold(self.entry, value)


@final
class Survey(Evaluator):
    """Evaluation that follows constants and dependences through the memory of one record with so many entries."""

    def __init__(self, width: int) -> None:
        self.width, self.entries, self.why, self._variables = width, _Entries(), 0, 0

    def begin(self) -> None:
        """Start a run: variables are numbered anew."""
        self._variables = 0

    def memory(self) -> RealCells:
        """The record's entries."""
        return _SurveyedReals(self, entries=True)

    def argument(self, kind: Kind) -> Any:
        """An unknown argument of a kind; values written to it are results."""
        makers: dict[Atom, Callable[[], Any]] = {
            "reals": lambda: _SurveyedReals(self, entries=False),
            "integers": _SurveyedIntegers,
            "real": lambda: _DependenceTrace(0),
            "integer": _TraceCount,
        }
        return kind.join([makers[atom]() for atom in kind.atoms])

    def returned(self, value: object) -> None:
        """Take a value as a result."""
        self.entries.live |= _bits(value)

    def _function(self, name: Function, *arguments: Real) -> Real:
        return _DependenceTrace(_bits(*arguments))

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        if isinstance(one, bool | _TraceTruth):
            return _TraceTruth(_bits(truth, one, other))
        if isinstance(one, _TraceCount | int) and isinstance(other, _TraceCount | int):
            return _TraceCount(_bits(truth, one, other))
        if not isinstance(one, Number) and not isinstance(other, Number) and one == other:
            return one
        return _DependenceTrace(_bits(truth, one, other))

    def _both(self, one: Truth, other: Truth) -> Truth:
        return _TraceTruth(_bits(one, other))

    def _negate(self, truth: StagedCondition) -> Truth:
        return truth

    def _same(self, one: Integer, other: Integer) -> Truth:
        return _TraceTruth(_bits(one, other))

    def real(self, integer: Integer) -> Real:
        return float(integer) if isinstance(integer, int) else _DependenceTrace(_bits(integer))

    def integer(self, real: Real) -> Integer:
        return _TraceCount(_bits(real))

    def scale(self, real: Real, power: Integer) -> Real:
        return _DependenceTrace(_bits(real, power))

    @contextmanager
    def _because(self, reason: object) -> Iterator[None]:
        before, self.why = self.why, self.why | _bits(reason)
        try:
            yield
        finally:
            self.why = before

    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        with self._because(count), self._because(start):
            body(_TraceCount())

    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        with self._because(truth):
            if isinstance(truth, StagedCondition) or truth:
                yes()
            if no is not None and (isinstance(truth, StagedCondition) or not truth):
                no()

    def repeat(self, body: Callable[[], Truth]) -> None:
        reason = body()
        with self._because(reason):
            body()

    def _reals(self, size: int) -> RealCells:
        return _HeldReal(self, self._fresh())

    def _wholes(self, size: int) -> IntegerCells:
        return _HeldInteger(self, self._fresh())

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        return _SurveyedIntegers() if whole else _SurveyedReals(self, entries=False)

    def _rehearse(self, body: Callable[[], None]) -> None:
        body()

    def _fresh(self) -> int:
        self._variables += 1
        return self.width + self._variables - 1

    def hold(self, entry: int, value: object) -> None:
        """Update a function's own numbers to a value."""
        self.entries.follows[entry] = self.entries.follows.get(entry, 0) | _bits(value) | self.why

    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        raise StageError("unreached", what="a survey of memory")

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return function(on, *arguments)


def layout_of(width: int, run: Callable[[Survey], None], shared: int = 0) -> FieldLayout:
    """The layout of a record with so many entries that a program needs.

    run(survey) evaluates all its entry functions, with ``survey.memory()`` as the record's numbers. The first entries,
    ``shared`` of them, stay where they are, since others read them.
    """
    survey = Survey(width)
    while True:  # what is known of an entry changes twice at most: nothing, one constant, any number
        survey.begin()
        survey.entries.follows, survey.entries.live = {}, 0
        run(survey)
        memory = survey.memory()
        survey.returned([memory.load(k) for k in range(shared)])
        if survey.entries.settled():
            break
    found, needed = survey.entries.assumed, survey.entries.needed()
    varying = [k for k in range(shared, width) if found.get(k, 0.0) is None and needed >> k & 1]
    constants = {k: value for k, value in found.items() if k < width and value is not None}
    return FieldLayout(constants, {k: column for column, k in enumerate([*range(shared), *varying])})
