"""Ordering and fill of a sparse LU factorisation, decided once; the numbers follow in compiled code.

SuperLU chooses the pivots at sample values (columns by minimum degree, rows by size). The fill of exactly this order
is then known, and each later factorisation only computes numbers in fixed places, watching its pivots.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

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
    scale_r, scale_c = _equilibrate(n, row, column, value)
    scaled = value * scale_r[row] * scale_c[column]
    pattern = sparse.csc_matrix((scaled, (row, column)), shape=(n, n))
    best: tuple[int, Index, Index, list[list[int]]] | None = None
    for choice in ("COLAMD", "MMD_AT_PLUS_A"):
        factor = splu(pattern, permc_spec=choice, diag_pivot_thresh=0.1, options={"SymmetricMode": choice != "COLAMD"})
        rows, columns = np.argsort(factor.perm_r).astype(np.int64), np.argsort(factor.perm_c).astype(np.int64)
        filled = _fill(n, row, column, rows, columns)
        size = sum(map(len, filled))
        if best is None or size < best[0]:
            best = (size, rows, columns, filled)
    assert best is not None
    _, rows, columns, filled = best
    start = np.concatenate([[0], np.cumsum([len(r) for r in filled])]).astype(np.int64)
    flat = np.array([j for r in filled for j in r], dtype=np.int64)
    where = {(i, j): int(start[i]) + k for i, r in enumerate(filled) for k, j in enumerate(r)}
    to_row, to_column = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    to_row[rows], to_column[columns] = np.arange(n), np.arange(n)
    place = np.array(
        [where[int(i), int(j)] for i, j in zip(to_row[row], to_column[column], strict=True)], dtype=np.int64
    )
    diagonal = np.array([where[i, i] for i in range(n)], dtype=np.int64)
    return Elimination(rows, columns, start, flat, diagonal, place)


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


def _fill(n: int, row: Index, column: Index, rows: Index, columns: Index) -> list[list[int]]:
    """The pattern of L + U by rows when rows and columns are taken in the given order without further pivoting."""
    to_row, to_column = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    to_row[rows], to_column[columns] = np.arange(n), np.arange(n)
    pattern: list[set[int]] = [{i} for i in range(n)]
    for i, j in zip(to_row[row].tolist(), to_column[column].tolist(), strict=True):
        pattern[i].add(j)
    upper: list[list[int]] = []
    out: list[list[int]] = []
    for i in range(n):
        mine = pattern[i]
        pending = sorted(j for j in mine if j < i)
        done: set[int] = set()
        while pending:
            k = pending.pop(0)
            if k in done:
                continue
            done.add(k)
            fresh = [j for j in upper[k] if j not in mine]
            mine.update(fresh)
            if any(j < i for j in fresh):
                pending = sorted({*pending, *(j for j in fresh if j < i)})
        ordered = sorted(mine)
        out.append(ordered)
        upper.append([j for j in ordered if j > i])
    return out
