"""Factors of a dense matrix, or the failure of the factorisation."""

from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs

from ephs.semantics.bundles.bundle import Array
from ephs.solve.errors import Outcome, SolveError


def factors(matrix: Any, equation: str = "") -> tuple[Array, Any]:
    """(LU, pivots) of a real or complex square matrix, for `scipy.linalg.lu_solve`.

    Raises
    ------
    SolveError
        The matrix is singular, or holds numbers that are not finite.
    """
    if not len(matrix):
        return matrix, np.zeros(0, dtype=np.intp)  # which LAPACK does not take
    (factorise,) = get_lapack_funcs(("getrf",), (matrix,))
    lu, pivots, info = factorise(matrix)
    if info > 0 or not np.isfinite(lu).all():
        raise SolveError(Outcome.SINGULAR, "", equation)
    return lu, pivots
