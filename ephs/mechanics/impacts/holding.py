"""Forces of closed contacts at every instant of a part of a step: they keep the velocities along rows that press.

With impulses that are constant in a part alone, what moves between the contacts would answer to each of them freely: a
light body with much friction beside a heavy one that rests on it would need steps of its own time constant, although
the two together are slow. With these forces no velocity along a row changes, J u̇ + J̇ u = 0, so rates are those of the
mechanism whose contacts are joints, and the impulses correct what is left.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.impacts.mobility import answer
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.solve.equations.sparse import Index

AT_ONCE = 1e-6
"""Part of a step within which slips count as velocities: their friction acts along them."""
INSIDE = 0.99
"""Part of the largest friction below which a contact at rest is held along its surface."""
PRESSING = 1e-6
"""Least force of a contact that presses, relative to the largest."""


@final
class Holding:
    """Forces that hold closed contacts of a state over a part of h s.

    Parameters
    ----------
    held, axes
        All k closed contacts, and the axes of their rows.
    slips
        (3k,) velocities along the surfaces of contacts that slip, others zero.
    may
        (k,) whether each may be held at every instant.
    """

    def __init__(
        self, equations: ReducedEquations, touching: Touching, state: ReducedState, h: float, held: Index, axes: Index,
        slips: Array, may: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        self._eq, self._touching = equations, touching
        self._seen: list[tuple[float, Array]] = []
        self._on, self._which, self._axes = np.zeros(3 * held.size, dtype=bool), held, axes
        mobility, _, free = self._met(state.q, state.r, equations.accelerations(state))
        friction = [touching.laws[i].friction for i in held]
        force = impulses(mobility, free + slips / (AT_ONCE * h), friction)
        if force is not None:
            pressed = may & (force[::3] > PRESSING * force[::3].max())
            sticking = pressed & ~np.any(slips.reshape(-1, 3), axis=1)
            sticking &= np.hypot(force[1::3], force[2::3]) < INSIDE * np.array(friction) * force[::3]
            self._on = np.stack([pressed, sticking, sticking], axis=1).ravel()
        some = self._on.reshape(-1, 3).any(axis=1)
        self._which, self._axes, self._rows = held[some], axes[some], self._on[np.repeat(some, 3)]

    def __bool__(self) -> bool:
        return bool(self._on.any())

    @contextmanager
    def acting(self) -> Iterator[None]:
        """Let the forces act on the rates meanwhile."""
        self._eq.holding = self if self else None
        try:
            yield
        finally:
            self._eq.holding = None

    def __call__(self, t: float, q: Array, r: Array, rates: Array) -> Array:
        """(n,) what the forces add to the accelerations that the tree would have without them."""
        mobility, answered, free = self._met(q, r, rates)
        on = self._rows
        force = np.asarray(least_squares(mobility[np.ix_(on, on)], -free[on], part=CONSTRAINT), dtype=float)
        self._seen.append((t, force))
        return answered[:, on] @ force

    def slopes(self, state: ReducedState, free: Array) -> Array:
        """(n, size) what the forces add to slopes of accelerations (n, size), by the rows at the state."""
        mobility, answered, _ = self._met(state.q, state.r, np.zeros(free.shape[0]))
        on = self._rows
        rows = self._touching.rows(state.q, state.r, self._which, self._axes)[0][on]
        return answered[:, on] @ least_squares(mobility[np.ix_(on, on)], -rows @ free, part=CONSTRAINT)

    def impulse(self) -> Array:
        """(3k,) impulses of the forces since they were asked for last, by trapezes; along the rows."""
        seen, self._seen = sorted(self._seen, key=lambda one: one[0]), []
        out = np.zeros(self._on.size)
        if seen:
            out[self._on] = np.trapezoid([force for _, force in seen], [t for t, _ in seen], axis=0)
        return out

    def _met(self, q: Array, r: Array, rates: Array) -> tuple[Array, Array, Array]:
        """Mobility of the contacts, the tree's answers (n, 3k), and accelerations along the rows without forces."""
        eq, touching = self._eq, self._touching
        rows, _ = touching.rows(q, r, self._which, self._axes)
        answered = answer(eq, ReducedState(0.0, q, r, np.zeros(0), np.zeros(0)), rows)
        return rows @ answered, answered, rows @ rates + touching.bending(q, r, self._which, self._axes)
