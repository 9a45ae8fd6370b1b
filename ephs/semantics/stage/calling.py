"""Calls of machine code on NumPy arrays: checked once, bound, and made without the interpreter's lock."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast, final

import numpy as np

from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.kinds import Atom, Kind
from ephs.semantics.stage.llvm import Library

RESULTS = {"void": None, "double": ctypes.c_double, "i64": ctypes.c_int64}
NUMBERS = ("real", "integer")


Span = tuple[int, int, str]
"""Begin and end of an array in memory, and the name of its argument."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class First:
    """The first arguments of several calls, checked once.

    Attributes
    ----------
    kinds
        Of these arguments, those of the calls.
    parts
        The arguments as machine code takes them.
    block
        The same as numbers of eight bytes.
    spans
        Where their arrays lie.
    """

    kinds: tuple[Kind, ...]
    parts: tuple[Any, ...]
    block: "np.ndarray[Any, np.dtype[np.int64]]"
    spans: list[Span]

    def begins(self, entry: Entry) -> bool:
        """Tell whether an entry function has these arguments first."""
        own = tuple(entry.kinds.values())[: len(self.kinds)]
        return len(own) == len(self.kinds) and all(one is other for one, other in zip(own, self.kinds, strict=True))


@final
class Bound:
    """A compiled function with addresses of its arrays, looked up once; not thread-safe.

    Call it without arguments, or with new values of the numbers among the arguments, in their order.

    Parameters
    ----------
    call
        The function.
    parts
        Its arguments, arrays and numbers, as machine code takes them; those after the first where these are given.
    first
        Its first arguments.

    Attributes
    ----------
    block
        All of them as numbers of eight bytes.
    """

    __slots__ = ("_at", "_function", "block", "call", "parts")

    def __init__(self, call: "Call", parts: tuple[Any, ...], first: First | None = None) -> None:
        self.call, self._function = call, call.function
        known = 0 if first is None else len(first.parts)
        self.block = np.zeros(known + len(parts), dtype=np.int64)
        passed, spans = _addresses(call.entry.atoms[known:], parts)
        if first is not None:
            self.block[:known], spans = first.block, [*first.spans, *spans]
        _distinct(call.entry, spans)
        _write_block(self.block, range(known, self.block.size), passed, call.scalars)
        self.parts = parts if first is None else (*first.parts, *parts)
        self._at = int(self.block.ctypes.data)

    def __call__(self, *numbers: float) -> Any:
        self.write(numbers, self.block)
        return self._function(self._at)

    def write(self, numbers: Sequence[float], block: "np.ndarray[Any, np.dtype[np.int64]]") -> None:
        """Write new values of all numbers among the arguments, or none, into a block of arguments."""
        places = self.call.numbers
        if numbers and len(numbers) != len(places):
            expected = f"{len(places)} numbers"
            raise StageError("parameters", where=self.call.entry.name, expected=expected, found=len(numbers))
        _write_block(block, places[: len(numbers)], numbers, self.call.scalars)


@final
class Call:
    """An entry function in machine code; calls release the interpreter's lock.

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

    Attributes
    ----------
    packed
        Address of the function on a block of its arguments, see `packed`.
    silent
        Whether it returns nothing.
    """

    def __init__(
        self, entry: Entry, library: Library, symbol: str, result: str, trail: Callable[[str], tuple[int | None, ...]]
    ) -> None:
        self.entry, self.library, self.trail = entry, library, trail
        self.address = library.address(symbol)
        self.scalars = ["" if trail(name) and atom == "real" else atom for name, atom in entry.atoms]
        self.packed, self.silent = library.address(packed_name(symbol)), RESULTS[result] is None
        self.function: Callable[[int], Any] = ctypes.CFUNCTYPE(RESULTS[result], ctypes.c_void_p)(self.packed)
        names = [name for name, _ in entry.atoms]
        self.numbers = [k for k, atom in enumerate(self.scalars) if atom in NUMBERS and names.count(names[k]) == 1]

    def bind(self, *arguments: Any, first: First | None = None) -> Bound:
        """Check arguments once; the returned function may be called repeatedly.

        Parameters
        ----------
        *arguments
            All of them, or those that follow the first ones.
        first
            The first ones, as `first` of a call with the same kinds made them.
        """
        if first is not None and not first.begins(self.entry):
            expected = "first arguments of the same kinds"
            raise StageError("parameters", where=self.entry.name, expected=expected, found="others")
        known = 0 if first is None else len(first.kinds)
        return Bound(self, tuple(self.entry.split(arguments, self.trail, known)), first)

    def first(self, *arguments: Any) -> First:
        """Check the first arguments, which several calls share."""
        count = len(arguments)
        parts = tuple(self.entry.split(arguments, self.trail, 0, count))
        passed, spans = _addresses(self.entry.atoms[: len(parts)], parts)
        block = np.zeros(len(parts), dtype=np.int64)
        _write_block(block, range(len(parts)), passed, self.scalars)
        return First(tuple(self.entry.kinds.values())[:count], parts, block, spans)

    def __call__(self, *arguments: Any) -> Any:
        return self.bind(*arguments)()


def packed_name(symbol: str) -> str:
    """Return the name of a function that takes the arguments of another from one block of memory."""
    return f"{symbol}_packed"


def packed(symbol: str, result: str, kinds: Sequence[str]) -> str:
    """Return the text of that function: the block contains the arguments in order, eight bytes each.

    One argument is handed over in a fraction of the time that a hundred take.
    """
    lines: list[str] = []
    for k, kind in enumerate(kinds):
        lines.append(f"  %p{k} = getelementptr i64, ptr %block, i64 {k}")
        lines.append(f"  %a{k} = load {kind.split()[0]}, ptr %p{k}")
    passed = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(kinds))
    # inside it the function would be in the module twice
    call = f"call {result} @{symbol}({passed}) noinline"
    last = ["  call" + call[4:], "  ret void"] if result == "void" else [f"  %r = {call}", f"  ret {result} %r"]
    return "\n".join([f"define {result} @{packed_name(symbol)}(ptr %block) {{", "entry:", *lines, *last, "}"])


def _write_block(
    block: "np.ndarray[Any, np.dtype[np.int64]]", places: Sequence[int], values: Sequence[Any], scalars: Sequence[str]
) -> None:
    """Write addresses and numbers to their places of a block, as the kinds of all places say."""
    reals = block.view(np.float64)
    for place, value in zip(places, values, strict=True):
        (reals if scalars[place] == "real" else block)[place] = value


def address_of(array: "np.ndarray[Any, Any]") -> int:
    """Return the address of an array's data."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(cast("Any", array)))
    except (TypeError, ValueError):  # read-only, or empty
        return int(array.__array_interface__["data"][0])


def _addresses(atoms: Sequence[tuple[str, Atom]], parts: Sequence[Any]) -> tuple[list[Any], list[Span]]:
    """Return the addresses of arrays, the numbers unchanged, and the positions of the arrays."""
    passed: list[Any] = []
    spans: list[Span] = []
    for (name, _), part in zip(atoms, parts, strict=True):
        if isinstance(part, np.ndarray):
            start = address_of(cast("np.ndarray[Any, Any]", part))
            passed.append(start)
            if size := part.nbytes:
                spans.append((start, start + size, name))
        else:
            passed.append(part)
    return passed, spans


def _distinct(entry: Entry, spans: list[Span]) -> None:
    """Refuse arrays that share memory: programs are compiled as if none did."""
    spans.sort()
    for (_, end, one), (start, _, other) in pairwise(spans):
        if start < end:
            raise StageError("overlap", where=entry.name, argument=one, other=other)


def apart(entry: Entry, parts: Sequence[Any]) -> None:
    """Refuse arguments whose arrays share memory.

    Raises
    ------
    StageError
        It names two of them.
    """
    _distinct(entry, _addresses(entry.atoms, parts)[1])
