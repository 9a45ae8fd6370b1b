"""Sums that know what of them is rounding: over many steps, and of entries in one place.

Knuth, *The Art of Computer Programming* 2, 4.2.2, theorem B. Numbers are floats, arrays, or abstract ones.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.spaces.rank import ROUNDED


def grown(total: Any, carry: Any, change: Any) -> tuple[Any, Any]:
    """Return total + carry + change, rounded, and the rounding error for the next sum (Kahan)."""
    wanted = change + carry
    found = total + wanted
    taken = found - total
    return found, (total - (found - taken)) + (wanted - taken)


def uncancelled(matrix: NDArray[Any], columns: Sequence[int]) -> NDArray[Any]:
    """Matrix (k, n) whose columns lie in these places, without the entries of a row that cancel in one place.

    Ports of one component may share a junction: what rounding leaves of a constraint there is no equation.
    """
    if len(set(columns)) == len(columns):
        return matrix
    same = np.equal.outer(columns, columns).astype(float)
    return np.where(np.abs(matrix @ same) > ROUNDED * (np.abs(matrix) @ same), matrix, 0.0)
