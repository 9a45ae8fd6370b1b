"""Order of the unknowns of a sparse system by nested dissection (George, 1973), at places in space.

Unknowns are halved across their largest extent, and those of one half that meet the other half come last; both halves
alike. So factors of plane meshes of n unknowns have in the order of n log n entries, made by n^1.5 operations.
"""

import numpy as np
from scipy.sparse import csc_array

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index

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
