"""Systems 1/(h μ) − J of implicit stages where J is sparse, for the eigenvalues μ of a method's coefficients.

Where no rate depends on heats, rates r and heats are eliminated, and a system for the increments v alone is left: with
γ = 1/(h μ) and v̇ = r at v = 0, (γ² − γ (J_rr + J_vv) + J_rr J_vv − J_rv) δv = f_r + (γ − J_rr) f_v.
"""

from types import MappingProxyType
from typing import cast, final

import numpy as np
from scipy.sparse import csc_array, eye_array

from ephs.semantics.bundles.bundle import Array
from ephs.solve.methods.solvers import Solver, Solvers

NOTHING = 1e-14
"""Size beside the largest entry of a matrix at which derivatives by heats are rounding."""
PIVOTS = MappingProxyType({"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}})
"""Pivots of the diagonal, in the order of least degree: γ² besides what masses times it make of stiffness.

Pivots by size would spoil that order, as stiffness over rotary inertia is far larger than over mass."""


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
        n, rates = freedoms, 2 * freedoms
        largest = float(np.abs(matrix.data).max(initial=0.0))
        heats = np.abs(matrix[:, increments + n :].data).max(initial=0.0)
        self._split = increments == freedoms and float(heats) <= NOTHING * largest
        if self._split:
            self._unit = csc_array(eye_array(n))
            by_places, by_rates = csc_array(matrix[:n, :n]), csc_array(matrix[n:rates, n:rates])
            self._places, self._rates, self._heats = by_places, by_rates, csc_array(matrix[rates:, :rates])
            self._damping = csc_array(by_rates + by_places)
            self._spring = csc_array(by_rates @ by_places - matrix[n:rates, :n])
        else:
            self._unit = csc_array(eye_array(matrix.indptr.size - 1))

    def solver(self, length: complex) -> Solver:
        """Solver with 1/length − J.

        Raises
        ------
        SolveError
            The matrix is singular.
        """
        n, per = self._freedoms, cast("float", length)  # or complex, as what is solved for is then
        by = 1.0 / per
        if not self._split:
            whole = self._solvers.of_sum(self._unit, -length, self._matrix)
            return lambda right: per * whole(right)
        solve = self._solvers.of(csc_array(by * by * self._unit - by * self._damping + self._spring))

        def solved(right: Array) -> Array:
            places, rates, heats = right[:n], right[n : 2 * n], right[2 * n :]
            moved = solve(rates + by * places - self._rates @ places)
            change = np.concatenate([moved, by * moved - self._places @ moved - places])
            return np.concatenate([change, (heats + self._heats @ change) * per])

        return solved
