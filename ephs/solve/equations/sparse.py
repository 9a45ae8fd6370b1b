"""Ordering and fill of a sparse LU factorisation, decided once; the numbers follow in compiled code.

SuperLU chooses the pivots at sample values (columns by minimum degree, rows by size), once as they come, once, of
large matrices, with rows and columns paired by large entries. The fill of exactly this order is then known, and each
later factorisation only computes numbers in fixed places, watching its pivots.
"""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.linear.sparse import sparse_lu
from ephs.semantics.spaces.rank import TINY

Index = NDArray[np.int64]

PARTS = (0.5, 0.1, 1e-2, 1e-4, 1e-8, 0.0)
"""Fractions of the largest entry below which entries are excluded from the diagonal unless no others remain."""
MANY = 1000
"""Least number of unknowns for pairing rows and columns: below it fill is irrelevant, small pivots indicate rank."""


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

    scale_r, scale_c = equilibrate(n, row, column, value)
    scaled = value * scale_r[row] * scale_c[column]
    matrix = sparse.csc_matrix((scaled, (row, column)), shape=(n, n))
    by_size = paired(n, row, column, scaled) if n > MANY else np.arange(n)
    plans: list[_Plan] = []
    for choice, given in (("COLAMD", np.arange(n)), ("MMD_AT_PLUS_A", by_size)):
        symmetric = {"SymmetricMode": choice != "COLAMD"}
        factor = splu(matrix[given], permc_spec=choice, diag_pivot_thresh=0.1, options=symmetric)
        rows, columns = given[np.argsort(factor.perm_r)], np.argsort(factor.perm_c).astype(np.int64)
        plans.append(_Plan.of(n, row, column, rows, columns))
    room = 4 * row.size + n
    while True:  # the better of two orders within the allowed memory; the other may fill a hundred times as much
        found = [made for plan in plans if (made := plan.filled(room)) is not None]
        if found:
            return min(found, key=lambda made: made.fill)
        room *= 2


def paired(n: int, row: Index, column: Index, value: Array) -> Index:
    """(n,) rows by columns, so that no entry of the diagonal is small: orders of the sum with the transpose need it.

    Of small entries on the diagonal the pivots are taken elsewhere, against the order: fill grows with the square.

    Raises
    ------
    RuntimeError
        No such rows exist: the matrix is singular by its pattern.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    size = np.abs(value)
    for part in PARTS:
        seen = size > part * size.max(initial=TINY)
        there = csr_array((np.ones(int(seen.sum())), (column[seen], row[seen])), shape=(n, n))
        rows = maximum_bipartite_matching(there, perm_type="column")
        if np.all(rows >= 0):
            return rows.astype(np.int64)
    raise RuntimeError("singular by its pattern")


def row_parts(matrix: Any) -> list[Index]:
    """The rows of each part that a sparse matrix falls into: rows of different parts have no column in common."""
    from scipy.sparse import block_array
    from scipy.sparse.csgraph import connected_components

    count, part = connected_components(block_array([[None, matrix], [matrix.T, None]]), directed=False)
    part = part[: matrix.shape[0]]
    found = np.argsort(part, kind="stable")
    return [each for each in np.split(found, np.searchsorted(part[found], np.arange(1, count))) if each.size]


def equilibrate(n: int, row: Index, column: Index, value: Array) -> tuple[Array, Array]:
    """Powers of two that bring the largest entry of each row and column near one."""
    magnitude = np.abs(value)
    scale_r, scale_c = np.ones(n), np.ones(n)
    for scale, at in 2 * ((scale_r, row), (scale_c, column)):
        largest = np.zeros(n)
        np.maximum.at(largest, at, magnitude * scale_r[row] * scale_c[column])
        scale /= np.exp2(np.round(np.log2(np.where(largest > 0.0, largest, 1.0))))
    return scale_r, scale_c


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """An order of rows and columns that needs no further pivoting.

    Parameters
    ----------
    places
        Entries as single numbers, row · n + column in that order, ascending, with the diagonal.
    own, given
        The diagonal's places, and those of the matrix' entries.
    """

    rows: Index
    columns: Index
    places: Index
    own: Index
    given: Index

    @staticmethod
    def of(n: int, row: Index, column: Index, rows: Index, columns: Index) -> "_Plan":
        to_row, to_column = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
        to_row[rows], to_column[columns] = np.arange(n), np.arange(n)
        given, own = to_row[row] * n + to_column[column], np.arange(n) * n + np.arange(n)
        places = np.sort(np.concatenate([given, own]))  # 100 times as fast as NumPy's unique, which hashes
        return _Plan(rows, columns, places[np.diff(places, prepend=-1) > 0], own, given)

    def filled(self, room: int) -> Elimination | None:
        """The elimination, or None if its factors exceed this number of entries."""
        n = self.rows.size
        first = np.searchsorted(self.places, np.arange(n + 1) * n).astype(np.int64)
        start, link, mark = (np.zeros(size, dtype=np.int64) for size in (n + 1, n + 1, n))
        out = np.empty(room, dtype=np.int64)
        count = sparse_lu().compiled()["fill"](first, self.places % n, start, out, link, mark)
        if count < 0:
            return None
        flat = out[:count].copy()
        filled = np.repeat(np.arange(n), np.diff(start)) * n + flat
        return Elimination(
            self.rows, self.columns, start, flat, np.searchsorted(filled, self.own).astype(np.int64),
            np.searchsorted(filled, self.given).astype(np.int64),
        )  # fmt: skip
