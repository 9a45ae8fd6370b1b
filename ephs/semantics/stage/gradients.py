"""Gradients of a function's outputs by all its inputs: one run writes a tape, one pass reads it backwards."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, cast, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.kinds import indices, vector
from ephs.semantics.stage.programs import Program
from ephs.semantics.stage.records import Record, Table
from ephs.semantics.stage.taped import CAPACITY, COUNT, POSITION, ROWS, back

FIRST = 1 << 12
"""Room of a tape at first, in entries; it doubles until a run fits."""


@cache
def reading_program() -> Program:
    """Return the program that reads a tape backwards."""
    kinds = {"counters": indices(COUNT), "places": indices(), "slopes": vector(), "bars": vector()}
    return Program("reading", back=Entry(back, **kinds))


@cache
def _taped(entry: Entry) -> Program:
    return Program("taped", 0, run=entry.taped())


@final
class Gradients:
    """One function on arrays of its own, with gradients of its outputs.

    Parameters
    ----------
    entry
        The function; its arguments are arrays, tables and integers.
    **arguments
        Its arguments by name; arrays are read and written where they are. Numbers of a part of a group have the name
        of the group, a dot, and that of the part.
    compiled
        Whether it runs in machine code, or with floats.
    """

    def __init__(self, entry: Entry, *, compiled: bool = True, **arguments: Any) -> None:
        self._arguments, self._compiled, self._entry = dict(arguments), compiled, entry
        parts: dict[str, Any] = {}
        for name, value in arguments.items():
            group = cast("Mapping[str, Any]", value) if isinstance(value, Mapping) else None
            parts |= {name: value} if group is None else {f"{name}.{key}": part for key, part in group.items()}
        self._numbers = {name: numbers for name, value in parts.items() if (numbers := _numbers(value)) is not None}
        self._memory = [(array, array.copy()) for value in parts.values() for array in _arrays(value)]
        self._loose: dict[str, float] = {n: value for n, value in arguments.items() if isinstance(value, int | float)}
        self._flat = np.zeros(sum(numbers.size for numbers in self._numbers.values()), dtype=np.int64)
        self._first = np.arange(1, self._flat.size + 1)
        self._places: dict[str, NDArray[np.int64]] = {}
        self._which: dict[str, slice] = {}
        start = 0
        for name, numbers in self._numbers.items():
            self._which[name] = slice(start, start + numbers.size)
            self._places[name] = self._flat[self._which[name]].reshape(numbers.shape)
            start += numbers.size
        self._counters, self._tape, self._bars = np.zeros(COUNT, dtype=np.int64), np.zeros(0), np.zeros(0)
        self._bind(FIRST)

    def _bind(self, room: int) -> None:
        """Take memory for a tape of so many entries."""
        places, self._tape, self._bars = (
            np.zeros(room, dtype=np.int64),
            np.zeros(room),
            np.zeros(room + self._flat.size),
        )
        tape = self._counters, places, self._tape
        given = [self._paired(name, value) for name, value in self._arguments.items()]
        names = list(self._arguments)
        if self._compiled:
            bound = _taped(self._entry).compiled()["run"].bind(*given, *tape)
            self._back: Callable[[], Any] = reading_program().compiled()["back"].bind(*tape, self._bars)

            def run(numbers: dict[str, float]) -> Any:
                return bound(*numbers.values())
        else:
            plain = _taped(self._entry).plain()["run"]
            self._back = partial(reading_program().plain()["back"], *tape, self._bars)

            def run(numbers: dict[str, float]) -> Any:
                return plain(*(numbers.get(name, value) for name, value in zip(names, given, strict=True)), *tape)

        self._run = run

    def run(self, **numbers: float) -> Any:
        """Run the function and return its result; numbers among the arguments may be new ones."""
        self._loose |= numbers
        for array, kept in self._memory:
            kept[...] = array
        while True:
            self._flat[:] = self._first
            self._counters[:] = 0
            self._counters[ROWS], self._counters[CAPACITY] = self._flat.size + 1, self._tape.size
            result = self._run(self._loose)
            if self._counters[POSITION] <= self._tape.size:
                return result
            self._bind(2 * int(self._counters[POSITION]))
            for array, kept in self._memory:
                array[...] = kept

    def _paired(self, name: str, value: Any) -> Any:
        """An argument with the rows of its numbers."""
        if isinstance(value, Mapping):
            group = cast("Mapping[str, Any]", value)
            return {key: self._paired(f"{name}.{key}", part) for key, part in group.items()}
        return (value, self._places[name]) if name in self._places else value

    def pull(self, shares: Mapping[str, Any]) -> "Shares":
        """The derivatives of Σ shares · (arguments after `run`) by all numbers before it.

        Parameters
        ----------
        shares
            Argument -> weight of each of its numbers, in its shape.
        """
        self._bars[: self._counters[ROWS]] = 0.0
        for name, share in shares.items():
            np.add.at(self._bars, self._places[name].ravel(), np.broadcast_to(share, self._places[name].shape).ravel())
        self._bars[0] = 0.0
        self._back()
        return Shares(self._bars[1 : self._flat.size + 1].copy(), self._which, self._places)


@final
@dataclass(frozen=True, slots=True)
class Shares(Mapping[str, NDArray[np.float64]]):
    """Derivatives by each number of the arguments, by name.

    Attributes
    ----------
    flat
        All of them, one after another.
    """

    flat: NDArray[np.float64]
    _which: Mapping[str, slice]
    _places: Mapping[str, NDArray[np.int64]]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.flat[self._which[name]].reshape(self._places[name].shape)

    def __iter__(self) -> Iterator[str]:
        return iter(self._which)

    def __len__(self) -> int:
        return len(self._which)


def _arrays(value: Any) -> list[NDArray[Any]]:
    """The memory of an argument."""
    if isinstance(value, Table):
        return list(cast("Table[Record]", value).arrays)
    return [cast("NDArray[Any]", value)] if isinstance(value, np.ndarray) else []


def _numbers(value: Any) -> NDArray[np.float64] | None:
    """The real numbers of an argument."""
    return next((array for array in _arrays(value) if array.dtype == np.float64), None)
