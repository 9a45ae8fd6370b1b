"""Calls of machine code on NumPy arrays: checked once, bound, and made without the interpreter's lock."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast, final

import numpy as np

from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.llvm import Library

__all__ = ["Bound", "Call", "apart"]

RESULTS = {"void": None, "double": ctypes.c_double, "i64": ctypes.c_int64}
NUMBERS = {"real": ctypes.c_double, "integer": ctypes.c_int64}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A compiled function whose arrays are fetched once and kept alive.

    Call it without arguments, or with new values of the numbers among the arguments, in their order.
    """

    call: "Call"
    passed: tuple[Any, ...]
    parts: tuple[Any, ...]

    def __call__(self, *numbers: float) -> Any:
        if not numbers:
            return self.call.function(*self.passed)
        passed, places = list(self.passed), self.call.numbers
        if len(numbers) != len(places):
            expected = f"{len(places)} numbers"
            raise StageError("parameters", where=self.call.entry.name, expected=expected, found=len(numbers))
        for place, number in zip(places, numbers, strict=True):
            passed[place] = number
        return self.call.function(*passed)


@final
class Call:
    """An entry function in machine code; calls do not hold the interpreter's lock.

    Parameters
    ----------
    entry
        The function and the kinds of its arguments.
    library, symbol
        Where it is in machine code.
    result
        LLVM's type of its result.
    trail
        What shape follows that of an argument's numbers: nothing, or the number of members.
    """

    def __init__(
        self, entry: Entry, library: Library, symbol: str, result: str, trail: Callable[[str], tuple[int | None, ...]]
    ) -> None:
        self.entry, self.library, self.trail = entry, library, trail
        self.address = library.address(symbol)
        scalars = [None if trail(name) and atom == "real" else NUMBERS.get(atom) for name, atom in entry.atoms]
        types = [ctypes.c_void_p if scalar is None else scalar for scalar in scalars]
        self.function: Callable[..., Any] = ctypes.CFUNCTYPE(RESULTS[result], *types)(self.address)
        names = [name for name, _ in entry.atoms]
        self.numbers = [k for k, scalar in enumerate(scalars) if scalar is not None and names.count(names[k]) == 1]

    def bind(self, *arguments: Any) -> Bound:
        """Check arguments once; what comes back may be called again and again."""
        parts = self.entry.split(arguments, self.trail)
        return Bound(self, apart(self.entry, parts), tuple(parts))

    def __call__(self, *arguments: Any) -> Any:
        return self.bind(*arguments)()


def _address(array: "np.ndarray[Any, Any]") -> int:
    """Return where the numbers of an array lie."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(cast("Any", array)))
    except (TypeError, ValueError):  # read-only, or empty
        return int(array.__array_interface__["data"][0])


def apart(entry: Entry, parts: list[Any]) -> tuple[Any, ...]:
    """Return the addresses of arrays, and numbers as they are.

    Raises
    ------
    StageError
        Arrays share memory: programs are compiled as if none did.
    """
    passed: list[Any] = []
    spans: list[tuple[int, int, str]] = []
    for (name, _), part in zip(entry.atoms, parts, strict=True):
        if isinstance(part, np.ndarray):
            start = _address(cast("np.ndarray[Any, Any]", part))
            passed.append(start)
            if size := part.nbytes:
                spans.append((start, start + size, name))
        else:
            passed.append(part)
    spans.sort()
    for (_, end, one), (start, _, other) in pairwise(spans):
        if start < end:
            raise StageError("overlap", where=entry.name, argument=one, other=other)
    return tuple(passed)
