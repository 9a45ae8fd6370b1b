"""Unrolling over any evaluator: loops with known bounds run while staging, memory may contain known values.

A staged function that is unrolled over a mechanism whose tables are given becomes a program with no more arithmetic
than that mechanism needs. Where a condition or a bound is not known, the base evaluator branches or loops; numbers
that change inside go through variables of its own.
"""

from collections.abc import Callable
from typing import Any, Final, TypeAlias, cast, final

import numpy as np

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Based, Evaluator, Function
from ephs.semantics.stage.memory import Cells, IntegerCells, RealCells
from ephs.semantics.stage.numbers import Count, Integer, Real, StagedCondition, Truth
from ephs.semantics.stage.reaching import Part, Reached

ROUNDS: Final = 100_000
"""Rounds of one `repeat` that are unrolled at most."""
Place: TypeAlias = tuple["Local", int]


@final
class Local(Cells[Any]):
    """Cells that exist while staging: each contains a known number or one of the evaluator's."""

    __slots__ = ("born", "entries", "on", "whole")

    def __init__(self, on: "Unrolled", entries: list[Any], whole: bool) -> None:
        self.on, self.entries, self.whole, self.born = on, entries, whole, on.birth()

    def load(self, index: Integer) -> Any:
        """Return the number at an index."""
        return self.on.table(self).load(index) if isinstance(index, Count) else self.entries[index]

    def store(self, index: Integer, value: Any) -> None:
        """Keep a number at an index."""
        if isinstance(index, Count):
            raise StageError("unrolled", what="a place to store at")
        self.on.written((self, index))
        self.entries[index] = np.float64(value) if type(value) is float else value


@final
class Unrolled(Based):
    """Evaluation over another evaluator, with known loops unrolled.

    Parameters
    ----------
    base
        The evaluator of all that is not known.
    """

    def __init__(self, base: Evaluator) -> None:
        self.base = base
        self._journals: list[dict[Place, Any]] = []
        self._births = 0

    def as_cells(self, part: Any) -> Any:
        """Return an array as cells that start with its numbers, or a number as it is; division by zero follows IEEE."""
        if not isinstance(part, np.ndarray):
            return part
        array = cast("np.ndarray[Any, np.dtype[Any]]", part)
        whole = array.dtype == np.int64
        return Local(self, array.reshape(-1).tolist() if whole else list(array.reshape(-1)), whole)

    def birth(self) -> int:
        """Return how many cells were made before."""
        self._births += 1
        return self._births

    def written(self, place: Place) -> None:
        """Record the number at a place before it changes, for enclosing branches and loops."""
        if self._journals:
            cells, index = place
            self._journals[-1].setdefault(place, cells.entries[index])

    def table(self, cells: Local) -> Cells[Any]:
        """Return known numbers as constants of the program, to be read at a place that is not known."""
        if not all(isinstance(entry, float | int) for entry in cells.entries):
            raise StageError("unrolled", what="a place in memory that changes")
        return self._constants(cells.entries, cells.whole)

    # Control

    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        if isinstance(count, int) and isinstance(start, int):
            for index in range(count - 1, start - 1, -1) if down else range(start, count):
                body(index)
            return
        places = self._changed(lambda: self.base.loop(count, body, start, down))
        slots = self._slots(places)
        self.base.loop(count, lambda index: self._through(slots, lambda: body(index)), start, down)
        self._fetch(slots)

    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        if not isinstance(truth, StagedCondition):
            chosen = yes if truth else no
            if chosen is not None:
                chosen()
            return
        self._branch(truth, yes)
        if no is not None:
            self._branch(self.negate(truth), no)

    def repeat(self, body: Callable[[], Truth]) -> None:
        for _ in range(ROUNDS):
            found: list[Truth] = []
            places = self._changed(lambda found=found: found.append(body()))
            if isinstance(found[0], StagedCondition):
                slots = self._slots(places)
                self.base.repeat(lambda slots=slots: self._through(slots, body))
                self._fetch(slots)
                return
            if body():
                return
        raise StageError("endless", limit=ROUNDS)

    def _branch(self, truth: Truth, body: Callable[[], None]) -> None:
        """Run a body under a condition; numbers that it changes are merged after it."""
        slots: dict[Place, Cells[Any]] = {}
        before: dict[Place, Any] = {}

        def inside() -> None:
            before.update(self._run(body))
            for (cells, index), old in before.items():
                slots[cells, index] = self._cell(cells.whole)
                slots[cells, index].store(0, cells.entries[index])
                cells.entries[index] = old

        def outside() -> None:
            for place, old in before.items():
                slots[place].store(0, old)

        self.base.when(truth, inside, outside)
        self._fetch(slots)

    def _run(self, body: Callable[[], Any]) -> dict[Place, Any]:
        """Run a body and return the places that it changed, with their former numbers."""
        births = self._births
        self._journals.append({})
        try:
            body()
        finally:
            journal = self._journals.pop()
        return {
            (cells, index): old
            for (cells, index), old in journal.items()
            if cells.born <= births and cells.entries[index] is not old
        }

    def _changed(self, body: Callable[[], Any]) -> set[Place]:
        """Return the places that a body changes in any of its rounds; nothing is emitted."""
        places: set[Place] = set()
        while True:
            found: dict[Place, Any] = {}

            def once(places: set[Place] = places) -> None:
                for cells, index in places:
                    cells.store(index, self._cell(cells.whole).load(0))
                body()

            self.base._rehearse(lambda found=found, once=once: found.update(self._run(once)))
            for (cells, index), old in found.items():
                cells.entries[index] = old
            if found.keys() <= places:
                return places
            places |= found.keys()

    def _cell(self, whole: bool) -> Cells[Any]:
        return cast("Cells[Any]", self.base._wholes(1) if whole else self.base._reals(1))

    def _slots(self, places: set[Place]) -> dict[Place, Cells[Any]]:
        """Return a variable of the base evaluator for each place, with its present number."""
        slots = {place: self._cell(place[0].whole) for place in places}
        for (cells, index), slot in slots.items():
            slot.store(0, cells.entries[index])
        return slots

    def _through(self, slots: dict[Place, Cells[Any]], body: Callable[[], Any]) -> Any:
        """Run a round of a loop, its changing numbers fetched before and put back behind."""
        results: list[Any] = []

        def once() -> None:
            for (cells, index), slot in slots.items():
                cells.store(index, slot.load(0))
            results.append(body())
            for (cells, index), slot in slots.items():
                slot.store(0, cells.entries[index])

        for (cells, index), old in self._run(once).items():
            cells.entries[index] = old
        return results[0]

    def _fetch(self, slots: dict[Place, Cells[Any]]) -> None:
        for (cells, index), slot in slots.items():
            cells.store(index, slot.load(0))

    # The rest is the base evaluator's

    def _reals(self, size: int) -> RealCells:
        return cast("RealCells", Local(self, [np.float64()] * size, False))

    def _wholes(self, size: int) -> IntegerCells:
        return cast("IntegerCells", Local(self, [0] * size, True))

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        return self.base._constants(values, whole)

    def _function(self, name: Function, *arguments: Real) -> Real:
        return self.base._function(name, *arguments)

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        return self.base.select(truth, one, other)

    def real(self, integer: Integer) -> Real:
        return self.base.real(integer)

    def integer(self, real: Real) -> Integer:
        return self.base.integer(real)

    def scale(self, real: Real, power: Integer) -> Real:
        return self.base.scale(real, power)

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return function(on, *arguments)

    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        """Call with numbers in registers copied to memory and back."""
        copies: dict[Local, Cells[Any]] = {}
        passed: list[Part] = []
        for atom, value in parts:
            cells, start = cast("tuple[Any, Integer]", value) if atom in ("reals", "integers") else (value, 0)
            if not isinstance(cells, Local):
                passed.append((atom, value))
                continue
            if cells not in copies:
                size = len(cells.entries)
                copies[cells] = self.base._wholes(size) if cells.whole else self.base._reals(size)
                for place, entry in enumerate(cells.entries):
                    copies[cells].store(place, entry)
            passed.append((atom, (copies[cells], start)))
        found = self.base._reach(function, passed)
        for local, cells in copies.items():
            for place in range(len(local.entries)):
                local.store(place, cells.load(place))
        return found
