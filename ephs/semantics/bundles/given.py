"""Functions and numbers that users give for a structure: their arguments, values and shapes."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError


def real_number(name: str, value: Any) -> float:
    """Return an energy as a number."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise StructureError("parameter", name, key="energy", found=value, expected="a real number") from None


def require_arguments(name: str, key: str, function: object, ports: tuple[Path, ...]) -> None:
    """Raise an error unless the function can be called with the ports' names."""
    expected = f"a function of ({', '.join(map(str, ports))})"
    if not callable(function):
        raise StructureError("parameter", name, key=key, found=function, expected=expected)
    try:
        signature = inspect.signature(function)
    except ValueError:  # builtin functions have none
        return
    try:
        signature.bind(**{str(port): None for port in ports})
    except TypeError:
        found = f"a function of {signature}"
        raise StructureError("parameter", name, key=key, found=found, expected=expected) from None


def value_of(name: str, what: str, function: Callable[..., Any], values: Mapping[Path, Array]) -> Any:
    """Value of a user's function; a logarithm of a non-positive state names the state.

    Raises
    ------
    StructureError
        The function has no value there.
    """
    given = named_numbers(values)
    try:
        return function(**given)
    except ValueError as error:
        witness = ", ".join(f"{port}={value}" for port, value in given.items()) or "none is read"
        raise StructureError("domain", name, what=what, found=error, witness=witness) from error


def named_numbers(values: Mapping[Path, Array]) -> dict[str, Any]:
    """Return states by name, those of one number as numbers."""
    return {str(port): float(v[0]) if v.size == 1 else v for port, v in values.items()}


def flat_vector(name: str, value: Any, n: int) -> Array:
    """Return a gradient (n,), joined from its parts."""
    entries: list[Any] = list(value) if isinstance(value, list | tuple) else [value]  # pyright: ignore[reportUnknownArgumentType]
    out = np.concatenate([np.atleast_1d(np.asarray(entry, dtype=float)) for entry in entries])
    if out.shape != (n,):
        raise StructureError("gradient-shape", name, found=out.shape, expected=(n,))
    return out


def finite_matrix(name: str, value: ArrayLike, rows: int, columns: int) -> Array:
    """Return a finite matrix of this shape."""
    try:
        out = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        out = np.array(np.nan)
    if out.shape != (rows, columns) or not np.all(np.isfinite(out)):
        expected = f"finite numbers of shape ({rows}, {columns})"
        kind = "parameter" if out.shape != (rows, columns) else "undefined"
        raise StructureError(kind, name, key="matrix", found=value, expected=expected)
    return out


def defined(name: str, what: str, found: Array, values: Mapping[Path, Array]) -> Array:
    """Return what a record says at these values, if it is a number.

    Raises
    ------
    StructureError
        It is none: a root of a negative number, 0/0.
    """
    if not np.all(np.isfinite(found)):
        witness = ", ".join(f"{port} = {value}" for port, value in named_numbers(values).items()) or "any state"
        raise StructureError("no-value", name, what=what, witness=witness)
    return found
