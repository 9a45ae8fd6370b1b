"""Forces of hard contacts at an instant, complementary to the velocities after it.

Between impacts a state says its forces: contacts whose gaps are closed and do not part press where the accelerations
without them would close them, stick where they can, and slip where they do. Of redundant contacts only sums of forces
are determinate; forces that balance each other say which of them are not.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.impacts.mobility import answer
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import CONSTRAINT, rank_of
from ephs.solve.equations.sparse import Index

CLOSED = 1e-7
"""Gap in the mechanism's length, and speed in its own, below which a contact is closed."""
INSTANT = 1e-6
"""Time, in the mechanism's own, over which forces act."""
PRESSING = 1e-6
"""Least force of a contact that presses, relative to the largest."""


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
    balanced
        (k, 3, m) forces along the rows that accelerate nothing, orthonormal: m ways in which forces are indeterminate.
    """

    which: Index
    axes: Index
    forces: Array
    rates: Array
    balanced: Array


def forces_at(
    equations: ReducedEquations, touching: Touching, state: ReducedState, accelerations: Array
) -> tuple[Array, Array]:
    """(points, 3) forces in N on second bodies in world axes, and (points, 3, m) those that balance each other.

    See `pressing_at`.
    """
    found = pressing_at(equations, touching, state, accelerations)
    out, balanced = np.zeros((len(touching), 3)), np.zeros((len(touching), 3, found.balanced.shape[2]))
    for k, (i, axis) in enumerate(zip(found.which.tolist(), found.axes.tolist(), strict=True)):
        ways = touching.ways(i, axis)
        out[i], balanced[i] = found.forces[k] @ ways, ways.T @ found.balanced[k]
    return out, balanced


def pressing_at(equations: ReducedEquations, touching: Touching, state: ReducedState, accelerations: Array) -> Pressing:
    """Forces of contacts at a state, whose links are placed; NaN where no forces were found.

    Parameters
    ----------
    accelerations
        (n,) of the tree's rates without contacts.
    """
    eq, none = equations, np.zeros(0, dtype=np.int64)
    length = eq.problem.length
    speed = touching.speed(state.q, state.r, accelerations)
    gaps, rates = touching.motion(state.q, state.r)
    held = np.flatnonzero((np.abs(gaps) <= CLOSED * length) & (np.abs(rates) <= CLOSED * speed))
    if not held.size:
        return Pressing(none, none, np.zeros((0, 3)), np.zeros(eq.n), np.zeros((0, 3, 0)))
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
    friction = np.array([touching.laws[i].friction for i in held])
    slipping = np.hypot(now[1::3], now[2::3]) > CLOSED * speed
    return Pressing(held, axes, forces.reshape(-1, 3), by @ forces, _balanced(by, forces, friction, slipping))


def _balanced(by: Array, forces: Array, friction: Array, slipping: NDArray[np.bool_]) -> Array:
    """(k, 3, m) forces that accelerate nothing: normal ones and, of contacts that stick, tangential ones.

    Parameters
    ----------
    by
        (n, 3k) accelerations by unit forces.
    """
    pressing = forces[::3] > PRESSING * float(forces[::3].max(initial=0.0))
    columns: list[Array] = []
    for i in np.flatnonzero(pressing):
        own = np.eye(forces.size)[:, 3 * i : 3 * i + 3]
        if slipping[i]:  # friction follows from the normal force
            along = np.where(np.arange(forces.size) // 3 == i, forces, 0.0)
            columns.append(along / np.linalg.norm(along))
        else:
            columns += list(own.T if friction[i] > 0.0 else own.T[:1])
    if not columns:
        return np.zeros((forces.size // 3, 3, 0))
    unknown = np.array(columns).T
    _, sigma, right = svd(by @ unknown)
    return (unknown @ right[rank_of(sigma, CONSTRAINT) :].T).reshape(forces.size // 3, 3, -1)
