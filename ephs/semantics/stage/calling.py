"""Calls of machine code on NumPy arrays: checked once, bound, and made without the interpreter's lock."""

import ctypes
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, cast, final

import numpy as np

from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.llvm import Library

__all__ = ["Bound", "Call", "apart", "packed"]

RESULTS = {"void": None, "double": ctypes.c_double, "i64": ctypes.c_int64}
NUMBERS = ("real", "integer")


@final
class Bound:
    """A compiled function whose arrays are fetched once and kept alive; one thread calls it at a time.

    Call it without arguments, or with new values of the numbers among the arguments, in their order.

    Parameters
    ----------
    call
        The function.
    parts
        Its arguments, arrays and numbers, as machine code takes them.
    """

    __slots__ = ("_block", "_function", "_integers", "_reals", "call", "parts")

    def __init__(self, call: "Call", parts: tuple[Any, ...]) -> None:
        self.call, self.parts, self._function = call, parts, call.function
        self._integers = np.zeros(len(parts), dtype=np.int64)
        self._reals = self._integers.view(np.float64)
        for place, (part, number) in enumerate(zip(apart(call.entry, parts), call.scalars, strict=True)):
            self._into(number)[place] = part
        self._block = int(self._integers.ctypes.data)

    def _into(self, number: str) -> "np.ndarray[Any, Any]":
        return self._reals if number == "real" else self._integers

    def __call__(self, *numbers: float) -> Any:
        if numbers:
            places = self.call.numbers
            if len(numbers) != len(places):
                expected = f"{len(places)} numbers"
                raise StageError("parameters", where=self.call.entry.name, expected=expected, found=len(numbers))
            for place, number in zip(places, numbers, strict=True):
                self._into(self.call.scalars[place])[place] = number
        return self._function(self._block)


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
        self.scalars = ["" if trail(name) and atom == "real" else atom for name, atom in entry.atoms]
        packed = library.address(packed_name(symbol))
        self.function: Callable[[int], Any] = ctypes.CFUNCTYPE(RESULTS[result], ctypes.c_void_p)(packed)
        names = [name for name, _ in entry.atoms]
        self.numbers = [k for k, atom in enumerate(self.scalars) if atom in NUMBERS and names.count(names[k]) == 1]

    def bind(self, *arguments: Any) -> Bound:
        """Check arguments once; what comes back may be called again and again."""
        return Bound(self, tuple(self.entry.split(arguments, self.trail)))

    def __call__(self, *arguments: Any) -> Any:
        return self.bind(*arguments)()


def packed_name(symbol: str) -> str:
    """Return the name of a function that takes the arguments of another from one block of memory."""
    return f"{symbol}_packed"


def packed(symbol: str, result: str, kinds: Sequence[str]) -> str:
    """Return the text of that function: arguments stand in the block in order, each in eight bytes.

    One argument is handed over in a fraction of the time that a hundred take.
    """
    lines: list[str] = []
    for k, kind in enumerate(kinds):
        lines.append(f"  %p{k} = getelementptr i64, ptr %block, i64 {k}")
        lines.append(f"  %a{k} = load {kind.split()[0]}, ptr %p{k}")
    passed = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(kinds))
    # within it the function would stand in the module twice
    call = f"call {result} @{symbol}({passed}) noinline"
    last = ["  call" + call[4:], "  ret void"] if result == "void" else [f"  %r = {call}", f"  ret {result} %r"]
    return "\n".join([f"define {result} @{packed_name(symbol)}(ptr %block) {{", "entry:", *lines, *last, "}"])


def _address(array: "np.ndarray[Any, Any]") -> int:
    """Return where the numbers of an array lie."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(cast("Any", array)))
    except (TypeError, ValueError):  # read-only, or empty
        return int(array.__array_interface__["data"][0])


def apart(entry: Entry, parts: Sequence[Any]) -> tuple[Any, ...]:
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
