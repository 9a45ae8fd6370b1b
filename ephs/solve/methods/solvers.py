"""Solutions of the linear systems of implicit steps: dense, banded, or sparse, by the pattern of the matrix.

Chains, ladders and rods have narrow bands once their unknowns are ordered along them (reverse Cuthill–McKee); there
LAPACK's banded factorisation takes a quarter of the time of SuperLU's, which plane grids and what is wider are left to.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, final

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index
from ephs.solve.posing.errors import Outcome, SolveError

# Order of the unknowns of a sparse system by nested dissection (George, 1973), at places in space.
#
# Unknowns are halved across their largest extent, and those of one half that meet the other half come last; both halves
# alike. So factors of plane meshes of n unknowns have in the order of n log n entries, made by n^1.5 operations.

LEAF = 48
"""Unknowns that are not halved."""
SAME = 1e-9
"""Distance in parts of the extent within which places are on one line: rows of grids are not torn by rounding."""


def dissected(matrix: csc_array, places: Array) -> Index:
    """(n,) the unknowns of a matrix (n, n) in their order, by their places (n, 3)."""
    both = csc_array(abs(matrix) + abs(matrix).T)
    found: list[Index] = []
    below = np.zeros(len(places), dtype=bool)

    def halve(these: Index) -> None:
        if not these.size:
            return
        across = places[these]
        extent = np.ptp(across, axis=0)
        along, wide = across[:, int(extent.argmax())], SAME * float(extent.max())
        middle = np.sort(along)[these.size // 2]
        low = along < middle - wide if (along < middle - wide).any() else along <= middle + wide
        if these.size <= LEAF or low.all():
            found.append(these)
            return
        one, other = these[low], these[~low]
        below[one] = True
        near = both[:, other]
        met = np.append(0, np.cumsum(below[near.indices]))
        meeting = met[near.indptr[1:]] > met[near.indptr[:-1]]
        below[one] = False
        halve(one)
        halve(other[~meeting])
        found.append(other[meeting])

    halve(np.arange(len(places)))
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


DENSE = 48
"""Unknowns up to which factorising without regard to zeros is faster."""
NARROW = 16
"""Diagonals beside the main one, both sides together, up to which a band is faster than SuperLU."""

Solver: TypeAlias = Callable[[Array], Array]


def dense(whole: Any, fail: Callable[[int], SolveError]) -> Solver:
    """Solve with a dense matrix, which is overwritten.

    Raises
    ------
    SolveError
        What ``fail`` makes of the number of an unknown, or −1: the matrix is singular, or holds numbers that are not
        finite.
    """
    if not whole.size:
        return lambda right: right  # LAPACK takes no empty matrix
    factorise, solve = get_lapack_funcs(("getrf", "getrs"), (whole,))
    factors, pivots, info = factorise(whole, overwrite_a=True)
    if info > 0 or not np.isfinite(factors).all():
        raise fail(info - 1)
    return lambda right: solve(factors, pivots, right)[0]


@final
class _Band:
    """Order of unknowns, and how many diagonals below and above the main one it leaves.

    Attributes
    ----------
    order
        The unknowns in their order; None where they stand in it.
    """

    __slots__ = ("_cells", "_pattern", "above", "below", "order")

    def __init__(self, matrix: csc_array) -> None:
        self._pattern = matrix
        order: Index = reverse_cuthill_mckee(csr_array(matrix), symmetric_mode=False)
        unmoved = np.arange(order.size)
        place = np.empty(order.size, dtype=np.int64)
        place[order] = unmoved
        along = np.array_equal(order, unmoved) or np.array_equal(order[::-1], unmoved)
        self.order, place = (None, unmoved) if along else (order, place)
        found = coo_array(matrix)
        row, column = place[found.row], place[found.col]
        self.below, self.above = int((row - column).max(initial=0)), int((column - row).max(initial=0))
        self._cells = column * (2 * self.below + self.above + 1) + self.below + self.above + row - column

    @property
    def narrow(self) -> bool:
        """Whether a banded factorisation pays."""
        return self.below + self.above <= NARROW

    def orders(self, matrix: csc_array) -> bool:
        """Whether a matrix has the pattern that the order was made for."""
        return _alike(self._pattern, matrix)

    def solver(self, matrix: csc_array, fail: Callable[[int], SolveError]) -> Solver:
        """The factorised matrix."""
        below, above, order = self.below, self.above, self.order
        band = np.zeros((matrix.indptr.size - 1, 2 * below + above + 1), dtype=matrix.dtype)
        band.ravel()[self._cells] = matrix.data
        factorise, solve = get_lapack_funcs(("gbtrf", "gbtrs"), (band,))
        factors, pivots, info = factorise(band.T, below, above, overwrite_ab=True)
        if info > 0 or not np.isfinite(factors).all():
            at = info - 1 if order is None or info <= 0 else int(order[info - 1])
            raise fail(at)

        def solved(right: Array) -> Array:
            if order is None:
                return solve(factors, below, above, right, pivots)[0]
            out = np.empty_like(right, dtype=band.dtype)
            out[order] = solve(factors, below, above, right[order], pivots)[0]
            return out

        return solved


@final
class _Sums:
    """Sums a + w b of sparse matrices of two patterns, whose common pattern is found once."""

    __slots__ = ("_of", "_pattern", "_places")

    def __init__(self, a: csc_array, b: csc_array) -> None:
        self._of = a, b
        n = a.indptr.size - 1
        keys = [n * np.repeat(np.arange(n), np.diff(each.indptr)) + each.indices for each in (a, b)]
        joined = np.unique(np.concatenate(keys))
        self._places = [np.searchsorted(joined, each) for each in keys]
        counts = np.bincount(joined // n, minlength=n)
        self._pattern = joined % n, np.append(0, np.cumsum(counts))

    def fits(self, a: csc_array, b: csc_array) -> bool:
        """Whether two matrices have these patterns."""
        return all(_alike(one, other) for one, other in zip(self._of, (a, b), strict=True))

    def of(self, a: csc_array, weight: complex, b: csc_array) -> csc_array:
        """The sum."""
        rows, starts = self._pattern
        data = np.zeros(rows.size, dtype=np.result_type(a.dtype, type(weight)))
        data[self._places[0]] = a.data
        data[self._places[1]] += weight * b.data
        return csc_array((data, rows, starts), shape=a.shape)


def _alike(one: csc_array, other: csc_array) -> bool:
    """Whether two matrices have one pattern."""
    if one.indices is other.indices and one.indptr is other.indptr:
        return True
    return np.array_equal(one.indptr, other.indptr) and np.array_equal(one.indices, other.indices)


@final
class Solvers:
    """Solvers of one family of matrices; the order of a band is found once for each pattern.

    Parameters
    ----------
    name
        Of an unknown by its number, for messages.
    pivots
        How SuperLU is to choose pivots, options of `scipy.sparse.linalg.splu`.
    places
        (n, 3) of the unknowns of the matrices of n, in m: their order is then that of nested dissection.
    """

    __slots__ = ("_band", "_name", "_order", "_pivots", "_places", "_sums")

    def __init__(self, name: Callable[[int], str], pivots: Mapping[str, Any], places: Array | None = None) -> None:
        self._name, self._pivots, self._places = name, pivots, places
        self._band: _Band | None = None
        self._order: tuple[csc_array, Index] | None = None
        self._sums: _Sums | None = None

    def of_sum(self, a: "csc_array | Array", weight: complex, b: "csc_array | Array") -> Solver:
        """Solve with a + weight b, factorised once, as `of`; both are sparse without repeated entries, or dense."""
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
            return self.of(a + weight * b)
        if self._sums is None or not self._sums.fits(a, b):
            self._sums = _Sums(a, b)
        return self.of(self._sums.of(a, weight, b))

    def of(self, matrix: "csc_array | Array") -> Solver:
        """Solve with a matrix, factorised once.

        Raises
        ------
        SolveError
            The matrix is singular, or holds numbers that are not finite.
        """
        if isinstance(matrix, np.ndarray):
            return dense(matrix, self._singular)
        if matrix.indptr.size - 1 <= DENSE:
            return dense(matrix.toarray(), self._singular)
        if self._band is None or not self._band.orders(matrix):
            self._band = _Band(matrix)
        if self._band.narrow:
            return self._band.solver(matrix, self._singular)
        try:
            if self._places is None or len(self._places) != matrix.indptr.size - 1:
                return splu(matrix, **self._pivots).solve
            return self._dissected(matrix, self._places)
        except RuntimeError as error:  # SuperLU's message for a singular matrix
            raise self._singular(-1) from error

    def _dissected(self, matrix: csc_array, places: Array) -> Solver:
        if self._order is None or not _alike(self._order[0], matrix):
            self._order = matrix, dissected(matrix, places)
        _, order = self._order
        factors = splu(csc_array(matrix[order][:, order]), **{**self._pivots, "permc_spec": "NATURAL"})

        def solved(right: Array) -> Array:
            found = factors.solve(right[order])
            out = np.empty_like(found)
            out[order] = found
            return out

        return solved

    def _singular(self, unknown: int) -> SolveError:
        return SolveError(Outcome.SINGULAR, "", self._name(unknown) if unknown >= 0 else "")
