"""Systems 1/(h μ) − J of implicit stages where J is sparse, for the eigenvalues μ of a method's coefficients.

Where no rate depends on heats, rates r and heats are eliminated, and a system for the increments v alone is left: with
γ = 1/(h μ) and v̇ = r at v = 0, (γ² − γ (J_rr + J_vv) + J_rr J_vv − J_rv) δv = f_r + (γ − J_rr) f_v.
"""

from types import MappingProxyType
from typing import Any, cast, final

import numpy as np
from scipy.sparse import csc_array, eye_array

from ephs.semantics.bundles.bundle import Array
from ephs.solve.methods.solvers import Solver, Solvers

NOTHING = 1e-14
"""Size beside the largest entry of a matrix at which derivatives by heats are rounding."""
PIVOTS = MappingProxyType({"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}})
"""Pivots of the diagonal, in the order of least degree: γ² besides what masses times it make of stiffness.

Pivots by size would spoil that order, as stiffness over rotary inertia is far larger than over mass."""


def by_freedoms(matrix: Any, increments: int, freedoms: int) -> tuple[Any, Any] | None:
    """J_rr + J_vv and J_rr J_vv − J_rv of J by (v, r, heats), dense or sparse.

    None where rates depend on heats, or there are other increments than those of the rates: joints close loops.
    """
    n, rates = freedoms, slice(freedoms, 2 * freedoms)
    if increments != n or _largest(matrix[:, 2 * n :]) > NOTHING * _largest(matrix):
        return None
    by_places, by_rates = matrix[:n, :n], matrix[rates, rates]
    return by_rates + by_places, by_rates @ by_places - matrix[rates, :n]


def _largest(matrix: Any) -> float:
    return float(abs(matrix).max()) if matrix.size else 0.0


@final
class SparseSystems:
    """The systems of one matrix J.

    Parameters
    ----------
    matrix
        J (size, size) by (v, r, heats).
    freedoms
        Number of the rates r. As many increments come first, unless joints close loops.
    solvers
        The family of solvers of these systems.
    """

    def __init__(self, matrix: csc_array, increments: int, freedoms: int, solvers: Solvers) -> None:
        self._matrix, self._solvers, self._freedoms = matrix, solvers, freedoms
        n, rates, self._split = freedoms, 2 * freedoms, by_freedoms(matrix, increments, freedoms)
        self._unit = csc_array(eye_array(matrix.indptr.size - 1 if self._split is None else n))
        self._places, self._rates, self._heats = matrix[:n, :n], matrix[n:rates, n:rates], matrix[rates:, :rates]

    def solver(self, length: complex) -> Solver:
        """Solver with 1/length − J.

        Raises
        ------
        SolveError
            The matrix is singular.
        """
        n, per = self._freedoms, cast("float", length)  # or complex, as what is solved for is then
        by = 1.0 / per
        if self._split is None:
            whole = self._solvers.of_sum(self._unit, -length, self._matrix)
            return lambda right: per * whole(right)
        damping, spring = self._split
        solve = self._solvers.of(csc_array(by * by * self._unit - by * damping + spring))

        def solved(right: Array) -> Array:
            places, rates, heats = right[:n], right[n : 2 * n], right[2 * n :]
            moved = solve(rates + by * places - self._rates @ places)
            change = np.concatenate([moved, by * moved - self._places @ moved - places])
            return np.concatenate([change, (heats + self._heats @ change) * per])

        return solved
