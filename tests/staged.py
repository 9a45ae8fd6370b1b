"""Programs of the staged language, run with floats and as machine code: one result, as both have the same bits."""

from copy import deepcopy
from typing import Any

import numpy as np

from ephs.semantics.stage import Program

__all__ = ["bits", "run_both"]


def bits(values: Any) -> list[int]:
    """The bits of numbers; all that is not a number is one."""
    values = np.ravel(values)
    whole = values if values.dtype.kind in "ib" else np.where(np.isnan(values), np.nan, values).view(np.int64)
    return whole.tolist()


def run_both(program: Program, entry: str, *arguments: Any, signed: bool = True) -> list[Any]:
    """Result, and arguments as they are left, of an entry function by floats and by machine code, to the bit.

    Arguments are numbers, arrays, or arrays by name. Zeros have their signs, but with ``signed=False``: staging drops
    zeros that it knows, and signs with them.
    """
    runs: list[list[Any]] = []
    for calls in (program.plain(), program.compiled()):
        given = deepcopy(arguments)
        result = calls[entry](*given)
        runs.append([0 if result is None else result, *given])
    for i, (one, other) in enumerate(zip(*runs, strict=True)):
        pairs = [(one[key], other[key]) for key in one] if isinstance(one, dict) else [(one, other)]
        assert all(bits(a if signed else a + 0) == bits(b if signed else b + 0) for a, b in pairs), (entry, i)
    return runs[1]
