"""Initial states: numbers that storages carry, and that systems collect."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError, listed
from ephs.semantics.primitives.primitives import Initial, Storage
from ephs.semantics.spaces import Pair, manifold

SLIVER = 1e-9
"""Relative difference of times that are the same but for rounding."""


ROUNDED = 4.0 * float(np.finfo(float).eps)
"""Change by which elements that were normalised change when they are again: these are kept, as documents have them."""


def started(storage: Storage, values: Mapping[Path, object], at: Path) -> Storage:
    """The storage in the box ``at`` with initial states by port; those of other ports stay.

    Raises
    ------
    AssemblyError
        An unknown port, a wrong shape, or a number that is not finite.
    """
    found = dict(storage.initial)
    for port, value in values.items():
        if port not in storage.interface:
            raise AssemblyError("unknown-state", at / port, expected=listed(port, sorted(map(str, storage.interface))))
        found[port] = tuple(read_state(at / port, storage.interface[port].quantity, value).tolist())
    made: Storage = object.__new__(Storage)  # its structure was examined before
    for name in Storage.__slots__:
        object.__setattr__(made, name, getattr(storage, name))
    initial: Initial = tuple(sorted(found.items()))
    object.__setattr__(made, "initial", initial)
    return made


def read_state(path: Path, quantity: Quantity, value: object) -> Array:
    """Value of a state, (size,), from its short form.

    Raises
    ------
    AssemblyError
        A wrong shape, or a number that is not finite.
    """
    space = quantity.space
    try:
        array = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise AssemblyError("state-number", path, found=value, quantity=quantity.kind) from None
    if quantity.kind == "relative_pose" and array.shape == (space.dim,) != (space.size,):
        array = Pair.from_space(space).element(array)  # as solutions give them
    if array.shape != (space.size,):
        raise AssemblyError("state", path, found=array.shape, expected=(space.size,), quantity=quantity.kind)
    if not np.all(np.isfinite(array)):
        raise AssemblyError("state-number", path, found=array, quantity=quantity.kind)
    found = manifold(space).normalise(array)
    return found if np.abs(found - array).max(initial=0.0) > ROUNDED else array.copy()


def saved_at(times: Array, t: float) -> int | None:
    """Place of a time among those of a solution, (n,) in s; None where it is none of them."""
    k = int(np.argmin(np.abs(times - t)))
    return k if abs(times[k] - t) <= SLIVER * max(1.0, abs(t)) else None


def saved_state(solution: Any, t: float) -> dict[Path, Array]:
    """The states of a solution at one of its times.

    Raises
    ------
    AssemblyError
        The solution has no state at that time.
    """
    times = np.asarray(solution.t)
    k = saved_at(times, t)
    if k is None:
        raise AssemblyError("no-time", "time", found=t, first=float(times.min()), last=float(times.max()))
    return dict(solution.state_at(k))
