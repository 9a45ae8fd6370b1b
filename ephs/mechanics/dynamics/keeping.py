"""States with some freedoms as they are given: those that loops and gears tie to them follow."""

from dataclasses import replace

import numpy as np

from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import pseudoinverse
from ephs.solve.equations.sparse import Index

ROUNDS = 30
"""Largest number of Newton steps."""
NEAR = 1e-9
"""Residual in m or rad, from which one more step ends at rounding."""


def following(equations: ReducedEquations, state: ReducedState, placed: Index, turning: Index) -> ReducedState:
    """The state with other freedoms changed least so that loops and gears hold, positions by Newton's method.

    The given state is returned unchanged where loops and gears do not hold with these freedoms.

    Parameters
    ----------
    placed, turning
        Freedoms of the tree whose coordinates, and whose rates, are given.
    """
    n, dense, q = equations.n, equations.dense, state.q
    free = np.setdiff1d(np.arange(n), placed)
    residual, rows = dense.gaps(q, state.r)
    for _ in range(ROUNDS):
        near = np.abs(residual).max(initial=0.0) <= NEAR
        change = np.zeros(n)
        change[free] = -pseudoinverse(rows[:, free]) @ residual
        q = equations.moved(q, change)
        residual, rows = dense.gaps(q, state.r)
        if near:  # the step from there ends at rounding
            break
    if not np.abs(residual).max(initial=0.0) <= NEAR:
        return state
    return replace(state, q=q, r=_with_rates(equations, rows, state, turning) if turning.size else state.r)


def _with_rates(equations: ReducedEquations, rows: Array, state: ReducedState, turning: Index) -> Array:
    """(n,) rates on the rows, by the least change of those that are not given."""
    target = -rows @ state.r
    target[: equations.driven.size] += equations.prescribed.rates(state.t)
    free, r = np.setdiff1d(np.arange(equations.n), turning), state.r.copy()
    r[free] += pseudoinverse(rows[:, free]) @ target
    return r
