"""A bound call for many members in turn, each with arrays of its own in place of some: one call from Python."""

from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np

from ephs.semantics.stage.calling import NUMBERS, Bound, address_of
from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import indices, table
from ephs.semantics.stage.memory import Integers
from ephs.semantics.stage.numbers import Integer
from ephs.semantics.stage.programs import Program
from ephs.semantics.stage.reaching import Signature
from ephs.semantics.stage.records import Record, Table, function, integer


class _Asking(Record):
    """A function on a block of arguments that returns an integer."""

    call = function(Signature((("integers",),)))


class _Silent(Record):
    """A function on a block of arguments that returns nothing."""

    call = function(Signature((("integers",),), returns=False))


def _shift(on: Evaluator, block: Integers, strides: Integers) -> None:
    def each_entry(k: Integer) -> None:
        block[k] = block[k] + strides[k]

    on.loop(block.size, each_entry)


def _ask(
    on: Evaluator, called: Table[_Asking], block: Integers, strides: Integers, results: Integers, count: Integer
) -> None:
    def each_entry(k: Integer) -> None:
        results[k] = on.reach(called[0].call, block)
        _shift(on, block, strides)

    on.loop(count, each_entry)


def _run(
    on: Evaluator, called: Table[_Silent], block: Integers, strides: Integers, results: Integers, count: Integer
) -> None:
    def each_entry(k: Integer) -> None:
        on.reach(called[0].call, block)
        results[k] = 0
        _shift(on, block, strides)

    on.loop(count, each_entry)


_MEMBERS: Final[dict[str, Any]] = {
    "block": indices(), "strides": indices(), "results": indices(), "count": integer(),
}  # fmt: skip
_REPEATING: Final = Program(
    "repeating",
    ask=Entry(_ask, called=table(_Asking), **_MEMBERS),
    run=Entry(_run, called=table(_Silent), **_MEMBERS),
)


@final
class Repeated:
    """A bound call for members in turn; not thread-safe.

    Parameters
    ----------
    bound
        The call. Members share all of its arrays that have no stack.
    stacks
        Arrays of the call, and for each a contiguous array of its type and shape for every member, row by row.
        An array that the call does not have is left out.
    """

    def __init__(self, bound: Bound, stacks: "Sequence[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]") -> None:
        self._bound = bound
        self._start = bound.block.copy()
        self._block, strides = bound.block.copy(), np.zeros_like(bound.block)
        most = min((len(stack) for _, stack in stacks), default=0)
        moved = {address_of(array): stack for array, stack in stacks if array.size}
        for place, (part, number) in enumerate(zip(bound.parts, bound.call.scalars, strict=True)):
            stack = None if number in NUMBERS or not part.size else moved.get(address_of(part))
            if stack is not None:
                self._start[place], strides[place] = address_of(stack), stack.strides[0]
        self._stacks, self._results = stacks, np.zeros(most, dtype=np.int64)  # addresses are of what lives
        record, entry = (_Silent, "run") if bound.call.silent else (_Asking, "ask")
        called = record.table(1)
        called.arrays[0][0] = bound.call.packed
        self._call = _REPEATING.compiled()[entry].bind(called, self._block, strides, self._results, most)

    def __call__(self, count: int, *numbers: float) -> "np.ndarray[Any, np.dtype[np.int64]]":
        """Call it for the first so many members; return their results.

        Parameters
        ----------
        *numbers
            Values of the numbers among the arguments, as of `Bound`; the same for all members.
        """
        self._block[:] = self._start
        self._bound.write(numbers, self._block)
        self._call(count)
        return self._results[:count].copy()
