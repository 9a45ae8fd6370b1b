"""Ordering and fill of a sparse LU factorisation, decided once; the numbers follow in compiled code.

SuperLU chooses the pivots at sample values (columns by minimum degree, rows by size). The fill of exactly this order
is then known, and each later factorisation only computes numbers in fixed places, watching its pivots.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.solve.lu_kernels import fill
from ephs.semantics.bundle import Array

Index = NDArray[np.int64]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """A fixed pivot order and the pattern of its factors.

    Parameters
    ----------
    rows, columns
        (n,): row and column of A that come in each place.
    start, column, diagonal
        The combined pattern of L and U by rows, columns ascending, and where each row's diagonal lies.
    place
        (nnz of A,): where each entry of A goes in the pattern.
    """

    rows: Index
    columns: Index
    start: Index
    column: Index
    diagonal: Index
    place: Index

    @property
    def fill(self) -> int:
        """Number of entries of both factors."""
        return int(self.column.size)


def order(n: int, row: Index, column: Index, value: Array) -> Elimination:
    """Choose pivots for the matrix with the given entries (one value for each place).

    Raises
    ------
    RuntimeError
        The matrix is exactly singular.
    """
    from scipy import sparse
    from scipy.sparse.linalg import splu

    scale_r, scale_c = _equilibrate(n, row, column, value)
    scaled = value * scale_r[row] * scale_c[column]
    pattern = sparse.csc_matrix((scaled, (row, column)), shape=(n, n))
    best: Elimination | None = None
    for choice in ("COLAMD", "MMD_AT_PLUS_A"):
        factor = splu(pattern, permc_spec=choice, diag_pivot_thresh=0.1, options={"SymmetricMode": choice != "COLAMD"})
        rows, columns = np.argsort(factor.perm_r).astype(np.int64), np.argsort(factor.perm_c).astype(np.int64)
        found = _eliminate(n, row, column, rows, columns)
        if best is None or found.fill < best.fill:
            best = found
    assert best is not None
    return best


def _equilibrate(n: int, row: Index, column: Index, value: Array) -> tuple[Array, Array]:
    """Powers of two that bring the largest entry of each row and column near one."""
    magnitude = np.abs(value)
    scale_r, scale_c = np.ones(n), np.ones(n)
    for _ in range(2):
        largest = np.zeros(n)
        np.maximum.at(largest, row, magnitude * scale_r[row] * scale_c[column])
        scale_r /= np.where(largest > 0.0, np.exp2(np.round(np.log2(np.where(largest > 0.0, largest, 1.0)))), 1.0)
        largest = np.zeros(n)
        np.maximum.at(largest, column, magnitude * scale_r[row] * scale_c[column])
        scale_c /= np.where(largest > 0.0, np.exp2(np.round(np.log2(np.where(largest > 0.0, largest, 1.0)))), 1.0)
    return scale_r, scale_c


def _eliminate(n: int, row: Index, column: Index, rows: Index, columns: Index) -> Elimination:
    """What rows and columns taken in the given order, without further pivoting, fill."""
    to_row, to_column = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    to_row[rows], to_column[columns] = np.arange(n), np.arange(n)
    # Places as single numbers, row by row, so that they sort and are found again.
    given = to_row[row] * n + to_column[column]
    own = np.arange(n) * n + np.arange(n)
    places = np.unique(np.concatenate([given, own]))
    first = np.searchsorted(places, np.arange(n + 1) * n).astype(np.int64)
    start, link = np.zeros(n + 1, dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    room = 4 * places.size
    while True:
        out = np.empty(room, dtype=np.int64)
        count = fill(first, places % n, start, out, link)
        if count >= 0:
            break
        room *= 2
    flat = out[:count].copy()
    filled = np.repeat(np.arange(n), np.diff(start)) * n + flat
    return Elimination(
        rows, columns, start, flat, np.searchsorted(filled, own).astype(np.int64),
        np.searchsorted(filled, given).astype(np.int64),
    )  # fmt: skip
