"""Response of a mechanism to impulses, with loop closures and prescribed motions."""

from scipy.linalg import cho_factor, cho_solve

from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT


def answer(equations: ReducedEquations, state: ReducedState, rows: Array) -> Array:
    """(n, k) changes of the tree's rates by unit impulses along rows (k, n)."""
    factor = cho_factor(equations.mass(state.q, state.r))
    free = cho_solve(factor, rows.T)
    held = equations.rows()
    if not len(held):
        return free
    back = cho_solve(factor, held.T)
    return free - back @ least_squares(held @ back, held @ free, part=CONSTRAINT)
