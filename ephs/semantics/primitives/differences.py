"""Slopes of functions, default gradients and discrete gradients of energies, by differences."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.extents import room
from ephs.semantics.spaces.rank import DIFFERENCE

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Point, Storage

NODE, WEIGHT = 0.5 * math.sqrt(0.6), 5.0 / 18.0
"""Gauss' quadrature with three nodes on an interval: the outer nodes' distance from the middle, their weight."""
STEPS = np.array([1e-3, 1e-4, 1e-5, 1e-6])
"""Steps of differences, by the room of a state."""
ROUNDING = 8.0 * float(np.finfo(float).eps)
"""Tolerance of a difference of energies, relative to them and to the rounding of the states times the gradient."""


def slope(function: Callable[[Array], Array], at: Array) -> Array:
    """The derivative (m, n) of a function at a point (n,) by central differences; rounding of their terms is zero."""
    columns: list[Array] = []
    for i in range(at.size):
        shift = DIFFERENCE * max(1.0, abs(float(at[i]))) * np.eye(at.size)[i]
        there, back = function(at + shift), function(at - shift)
        change, terms = there - back, np.abs(there) + np.abs(back)
        columns.append(np.where(np.abs(change) > ROUNDING * terms, change, 0.0) / (2.0 * shift[i]))
    return np.array(columns).T if columns else np.zeros((np.size(function(at)), 0))


def slope_within(function: Callable[[Array], Array], at: Array, rooms: Array) -> Array:
    """The derivative (m, n) of a function at a point (n,), whose numbers vary within rooms (n,); see `settled`."""
    columns = [settled(lambda k, way=way: function(at + k * way), 1.0) / way.sum() for way in np.diag(rooms)]
    return np.array(columns).T if columns else np.zeros((np.size(function(at)), 0))


def increments(storage: "Storage", x0: "Point", v: Array) -> Array:
    """The mean of the discrete gradients that move port after port, in the order of ports and in its reverse.

    So quantities of unlike units are never compared, and the two states may be exchanged.
    """
    out = np.zeros(storage.bundle.size)
    spans = [where for _, where, _ in storage.bundle.items()]
    orders = (spans, spans[::-1]) if len(spans) > 1 else (spans,)
    for order in orders:
        done = np.zeros(storage.bundle.size)
        for where in order:
            step = np.zeros(storage.bundle.size)
            step[where] = v[where]
            out[where] += _gonzalez(storage, storage.retract(x0, done), step, where) / len(orders)
            done = done + step
    return out


def _gonzalez(storage: "Storage", x0: "Point", v: Array, where: slice) -> Array:
    """The gradient at the midpoint, corrected along the increment v of one port.

    The correction makes ⟨∇̄E|v⟩ the difference of energies. Over short increments that is all rounding; where the
    quadrature of Gauss with three nodes agrees with it to rounding, the quadrature serves.
    """
    step = v[where]
    square = float(step @ step)
    low, gradient, high = (
        storage.energy_gradient(storage.retract(x0, share * v))[where] for share in (0.5 - NODE, 0.5, 0.5 + NODE)
    )
    along = float(gradient @ step)
    start, end = float(storage.energy(x0)), float(storage.energy(storage.retract(x0, v)))
    defect, near = end - start - along, WEIGHT * float((low + high - 2.0 * gradient) @ step)
    port = next(port for port, place, _ in storage.bundle.items() if place == where)
    terms = float(np.abs(gradient).sum()) * float(np.abs(x0[port]).max(initial=0.0))
    if abs(near - defect) <= ROUNDING * (abs(start) + abs(end) + terms):
        defect = near
    return gradient + (defect / square) * step if square > 0.0 else gradient


def settled(function: Callable[[float], Array], room: float) -> Array:
    """The derivative of a function at 0 by central differences of fourth order, of steps within a room.

    They are a thousandth of it, or as much shorter as it takes for those of one and of two steps to agree to a
    ten thousandth: then the result is good to 1e-8, and where a function varies within the room only, to 1e-12.
    """
    near = np.zeros(0)
    for size in room * STEPS:
        values = [(function(k * size), function(-k * size)) for k in (1.0, 2.0)]
        near, far = ((there - back) / (2.0 * k * size) for k, (there, back) in zip((1.0, 2.0), values, strict=True))
        noise = ROUNDING * sum(np.abs(part) for pair in values for part in pair) / size
        near, apart = (4.0 * near - far) / 3.0, np.abs(near - far)
        if np.all(apart <= np.maximum(1e-4 * np.abs(near).max(), noise)):
            break
    return near


def differences(storage: "Storage", x: "Point") -> Array:
    """dE by differences in the trivialised directions, see `settled`."""
    out = np.zeros(storage.bundle.size)
    for port, where, quantity in storage.bundle.items():
        for i in range(where.start, where.stop):
            way = np.eye(out.size)[i]
            out[i] = settled(
                lambda k, way=way: np.array([storage.energy(storage.retract(x, k * way))], dtype=float),
                room(quantity, x[port]),
            )[0]
    return out
