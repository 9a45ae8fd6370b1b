"""Forces of hard contacts at an instant, complementary to the velocities after it.

Between impacts a state says its forces: contacts whose gaps are closed and do not part press where the accelerations
without them would close them, stick where they can, and slip where they do.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.impacts.mobility import answer
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.bundle import Array
from ephs.solve.sparse import Index

__all__ = ["Pressing", "forces_at", "pressing_at"]

CLOSED = 1e-7
"""Gap in the mechanism's length, and speed in its own, below which a contact is closed."""
INSTANT = 1e-6
"""Time, in the mechanism's own, over which forces act."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Pressing:
    """Forces of contacts that press at an instant.

    Parameters
    ----------
    which
        (k,) numbers of the points and stops.
    axes
        (k,) of their rows.
    forces
        (k, 3) along these.
    rates
        (n,) what they add to the accelerations of the tree's rates.
    """

    which: Index
    axes: Index
    forces: Array
    rates: Array


def forces_at(equations: Equations, touching: Touching, state: ReducedState, accelerations: Array) -> Array:
    """(points, 3) forces in N on second bodies in world axes; see `pressing_at`."""
    out = np.zeros((len(touching), 3))
    found = pressing_at(equations, touching, state, accelerations)
    for i, axis, force in zip(found.which.tolist(), found.axes.tolist(), found.forces, strict=True):
        out[i] = force @ touching.ways(i, axis)
    return out


def pressing_at(equations: Equations, touching: Touching, state: ReducedState, accelerations: Array) -> Pressing:
    """Forces of contacts at a state, whose links are placed; NaN where no forces were found.

    Parameters
    ----------
    accelerations
        (n,) of the tree's rates without contacts.
    """
    eq, none = equations, np.zeros(0, dtype=np.int64)
    length = eq.problem.length
    gaps, rates = touching.motion(state.q, state.r)
    speed = max(float(np.sqrt(np.linalg.norm(eq.gravity) * length)), float(np.abs(rates).max(initial=0.0)))
    held = np.flatnonzero((np.abs(gaps) <= CLOSED * length) & (np.abs(rates) <= CLOSED * speed))
    if not held.size:
        return Pressing(none, none, np.zeros((0, 3)), np.zeros(eq.n))
    h = INSTANT * length / speed
    rows, axes = touching.rows(state.q, state.r, held)
    now = rows @ state.r
    q, r = eq.moved(state.q, h * (state.r + 0.5 * h * accelerations)), state.r + h * accelerations
    later, _ = touching.rows(q, r, held, axes)
    change, before = later @ r - now, now.copy()
    before[::3] = 0.0
    before[np.repeat(np.hypot(now[1::3], now[2::3]) <= CLOSED * speed, 3)] = 0.0
    by = answer(eq, state, rows)
    mobility = rows @ by
    found = impulses(mobility, change + 2.0 * before, [touching.laws[i].friction for i in held])
    forces = np.full(3 * held.size, np.nan) if found is None else found / h
    touching.gaps(state.q, state.r)  # the links are placed here again
    return Pressing(held, axes, forces.reshape(-1, 3), by @ forces)
