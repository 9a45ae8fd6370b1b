"""Calls of machine code, repeated in plain evaluation: what a run calls, from Python or by an address, bit for bit."""

from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from ephs.semantics.stage import PLAIN, evaluator
from ephs.semantics.stage.calling import Bound
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals, HeldCells
from ephs.semantics.stage.programs import _made, located
from ephs.semantics.stage.reaching import called

Key = tuple[str, str]
"""Names of a program and of an entry function."""


@dataclass(slots=True)
class Watch:
    """What was compared.

    Attributes
    ----------
    most
        Calls of each entry function that are compared.
    seen
        Their names. Programs of elements have one name, and each is compared.
    differing
        Those whose results or memory differ.
    """

    most: int
    seen: set[Key] = field(default_factory=set)
    differing: set[Key] = field(default_factory=set)
    calls: "Counter[int]" = field(default_factory=Counter)

    def wanted(self, address: int) -> Key | None:
        """The entry function at an address, where a call of it is to be compared."""
        found = located(address)
        if found is None:
            return None
        key = found[0].name, found[1]
        self.seen.add(key)
        self.calls[address] += 1
        return key if self.calls[address] <= self.most else None

    def plainly(self, address: int, atoms: list[Any]) -> Any:
        """The result of a float run, on arrays that it writes to."""
        program, name = located(address) or (None, "")
        assert program is not None
        with np.errstate(all="ignore"):
            return program.entries[name].run(PLAIN, iter(atoms))

    def judge(self, key: Key, mine: Any, theirs: Any, pairs: list[tuple[Any, Any]]) -> None:
        """Note a difference: not-a-numbers are one, and what is known to be zero while staging has no sign."""
        same = mine is None or theirs is None or np.array_equal(bits(mine), bits(theirs))
        if not (same and all(np.array_equal(bits(one), bits(other)) for one, other in pairs)):
            self.differing.add(key)


def bits(value: Any) -> Any:
    """The bits of an array or a number."""
    array = np.asarray(value)
    if array.dtype == np.float64:
        return np.where(array == array, array + 0.0, np.nan).view(np.int64)
    return array.astype(np.int64)


@contextmanager
def watching(most: int = 1) -> Generator[Watch]:
    """Compare the first calls of each entry function within."""
    watch, bound = Watch(most), Bound.__call__

    def call(self: Bound, *numbers: float) -> Any:
        key = watch.wanted(self.call.address)
        if key is None:
            return bound(self, *numbers)
        parts = list(self.parts)
        for place, number in zip(self.call.numbers, numbers, strict=False):
            parts[place] = number
        copies = [part.copy() if isinstance(part, np.ndarray) else part for part in parts]
        atoms = [_made(atom, copy, False) for (_, atom), copy in zip(self.call.entry.atoms, copies, strict=True)]
        mine = watch.plainly(self.call.address, atoms)
        theirs = bound(self, *numbers)
        pairs = [(one, other) for one, other in zip(copies, parts, strict=True) if isinstance(one, np.ndarray)]
        watch.judge(key, mine, theirs, pairs)
        return theirs

    def reached(function: Any, parts: Any) -> int:
        key = watch.wanted(function.address)
        if key is None:
            return called(function, parts)
        copies = _Memory(parts)
        atoms = [
            _made(atom, copies.window(*value) if atom in ("reals", "integers") else value, False)
            for atom, value in parts
        ]
        mine = watch.plainly(function.address, atoms)
        theirs = called(function, parts)
        pairs = [(copies.arrays[place], array) for place, array in _Memory(parts).arrays.items()]
        watch.judge(key, mine if function.signature.returns else None, theirs, pairs)
        return theirs

    with pytest.MonkeyPatch.context() as change:
        change.setattr(Bound, "__call__", call)
        change.setattr(evaluator, "called", reached)
        yield watch


class _Memory:
    """Copies of all memory that a call is handed windows of, which may lie in one array."""

    def __init__(self, parts: Sequence[tuple[str, Any]]) -> None:
        self.arrays: dict[int, np.ndarray[Any, Any]] = {}
        for atom, value in parts:
            if atom in ("reals", "integers"):
                self.arrays[id(value[0])] = _array(value[0], atom).copy()

    def window(self, cells: Any, start: int) -> "np.ndarray[Any, Any]":
        """The copy of the numbers from a place on."""
        return self.arrays[id(cells)][start:]


def _array(cells: Any, atom: str) -> "np.ndarray[Any, Any]":
    if isinstance(cells, ArrayReals | ArrayIntegers):
        return cells.array
    assert isinstance(cells, HeldCells)
    return np.array(cells.entries, dtype=np.int64 if atom == "integers" else np.float64)
