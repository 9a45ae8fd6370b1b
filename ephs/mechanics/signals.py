"""Inputs as signals: constants, functions of time, functions of time and state."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ephs.mechanics.solve.problem import Signal
from ephs.semantics.bundle import Array
from ephs.semantics.errors import AssemblyError

__all__ = ["numbers_of", "signal"]


def signal(value: Any, *, effort: bool, name: str, size: int | None) -> Signal:
    """A signal from a constant, f(t), or f(t, state), of ``size`` numbers.

    Raises
    ------
    AssemblyError
        A constant is something else.
    """
    if not callable(value):
        found = numbers_of(value)
        expected = f"{size or ''} finite number{'' if size == 1 else 's'}".strip()
        if found is None or not np.isfinite(found).all() or (size is not None and found.shape != (size,)):
            raise AssemblyError("input", name, found=value, expected=expected)
        return Signal(found, effort, name, size)
    function: Any = value
    if _takes_state(function):
        return Signal(function, effort, name, size)
    return Signal(lambda t, _state: function(t), effort, name, size)


def numbers_of(value: Any) -> Array | None:
    """Input as an array of numbers, None where it is none."""
    try:
        return np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        return None


def _takes_state(function: Callable[..., Any]) -> bool:
    """Whether it wants a second argument: one that must be given, or is called state."""
    import inspect

    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # functions in C tell no signature; those of mathematics take one argument
        return False
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    given = [p for p in parameters if p.kind in places and (p.default is p.empty or p.name == "state")]
    return len(given) >= 2 and not isinstance(function, np.ufunc)
