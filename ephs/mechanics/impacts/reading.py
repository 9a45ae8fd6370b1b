"""Forces of hard contacts at an instant, complementary to the velocities after it.

Between impacts a state says its forces: contacts whose gaps are closed and do not part press where the accelerations
without them would close them, stick where they can, and slip where they do.
"""

import numpy as np

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.impacts.mobility import answer
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.bundle import Array

__all__ = ["forces_at"]

CLOSED = 1e-7
"""Gap in the mechanism's length, and speed in its own, below which a contact is closed."""
INSTANT = 1e-6
"""Time, in the mechanism's own, over which forces act."""


def forces_at(equations: Equations, touching: Touching, state: ReducedState, accelerations: Array) -> Array:
    """(points, 3) forces in N on second bodies in world axes.

    Parameters
    ----------
    accelerations
        (n,) of the tree's rates without contacts.
    """
    eq, out = equations, np.zeros((len(touching), 3))
    length = eq.problem.length
    gaps, rates = touching.motion(state.q, state.r)
    speed = max(float(np.sqrt(np.linalg.norm(eq.gravity) * length)), float(np.abs(rates).max(initial=0.0)))
    held = np.flatnonzero((np.abs(gaps) <= CLOSED * length) & (np.abs(rates) <= CLOSED * speed))
    if not held.size:
        return out
    h = INSTANT * length / speed
    rows, axes = touching.rows(state.q, state.r, held)
    now = rows @ state.r
    q, r = eq.moved(state.q, h * (state.r + 0.5 * h * accelerations)), state.r + h * accelerations
    later, _ = touching.rows(q, r, held, axes)
    change, before = later @ r - now, now.copy()
    before[::3] = 0.0
    before[np.repeat(np.hypot(now[1::3], now[2::3]) <= CLOSED * speed, 3)] = 0.0
    mobility = rows @ answer(eq, state, rows)
    found = impulses(mobility, change + 2.0 * before, [touching.laws[i].friction for i in held])
    if found is None:
        return np.full_like(out, np.nan)
    touching.gaps(state.q, state.r)  # the links are placed here again
    for k, (i, axis) in enumerate(zip(held.tolist(), axes.tolist(), strict=True)):
        out[i] = found[3 * k : 3 * k + 3] / h @ touching.ways(i, axis)
    return out
