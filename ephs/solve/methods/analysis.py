"""Rank of the constraints and order of the elimination, decided once and again whenever a matrix becomes singular.

Rank is decided on the constraint matrix, its columns scaled by the square root of the compliance that the storages
show over a step, (mass/h)^(−1/2); never on the saddle-point matrix, whose pivots are squares of singular values.
"""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd, symmetric_eigen
from ephs.semantics.spaces.rank import FOLLOWED, IMPLICIT, REGULAR, TINY, rank_of
from ephs.solve.equations.model import Model, cancelled, evaluate_at
from ephs.solve.equations.sparse import Index, row_parts
from ephs.solve.methods.records import STORING
from ephs.solve.posing.errors import SolveError

SHRUNK = 1e-3
"""Part of its first size to which a pivot may shrink: pivots fall with the part that omitted equations have in their
dependence, and rounding of the others, over this part, opens omitted joints."""
DEFECT = 1e-11
"""Tolerance for a dropped equation, relative to its terms; more asks for another rank decision."""
OTHERWISE = 1e-3
"""Weight of other equations relative to preferred ones in the choice of omitted equations."""

LARGE = 256
"""Rows above which those with an effort of their own are eliminated before the dense rank decision."""
SPECK = 1e-12
"""Part of the largest entry of a constraint up to which an entry is rounding."""
APART = 1e3
"""Largest factor between the entries of efforts that no storage gives, and of others in their rows."""
OWN = 1e-3
"""Part of a row above which an effort that is in no other row makes it independent of the others."""
ALIKE = 1e-6
"""Relative tolerance for equal components of null vectors."""
AS_BEFORE, AT_START, WITHIN = 0, 1, 2
"""Origin of a step's order of elimination: a step before it, at its start, by its unknowns."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Decided:
    """Origin of an order of elimination: states, unknowns, the step in s, the equations left out before."""

    x: Array
    z: Array
    h: float
    before: Index | None
    tried: int


def entries_at(model: Model, x: Array, z: Array, h: float, tried: int = AT_START) -> tuple[Array, Array]:
    """Entries of the matrix, and those by which the rank of constraints is decided.

    Where loops are closed, at the start of a step, equations follow from others that do not in a step that is not
    solved yet: they miss by its third power there, and rank would depend on it. Some follow within the step only, such
    as in alignment.
    """

    def entries_over(h: float) -> Array:
        status, component, memory = evaluate_at(model, x, z, h)
        if status:
            raise SolveError.of_component(status, model, component)
        return memory.data

    values = entries_over(h)
    if tried != AT_START:
        return values, values
    return values, np.where(np.isin(model.tables.row, model.constraint_rows), entries_over(0.0), values)


def dependent_rows(
    model: Model, x: Array, values: Array, before: Index | None = None, rather: NDArray[np.bool_] | None = None
) -> Index:
    """Marks constraint equations that depend on the others: (rows,) of 0 and 1.

    Rows that share no effort cannot depend on each other, so that the rank is decided part by part.

    Parameters
    ----------
    before
        (rows,) those marked last time.
    rather
        (rows,) those to be marked where there is a choice.
    """
    from scipy import linalg
    from scipy.sparse import csr_array, hstack

    t = model.tables
    n_rate, n_effort, size = int(t.counts[0]), int(t.counts[1]), model.unknowns
    out = np.zeros(size, dtype=np.int64)
    rows = model.constraint_rows
    if not rows.size:
        return out
    values = values.copy()
    values[cancelled(model, x)[0]] = 0.0
    of = np.full(size, -1)
    of[rows] = np.arange(rows.size)
    constrained = of[t.row] >= 0
    inside = constrained & (t.column >= n_rate) & (t.column < n_rate + n_effort)
    entries = (values[inside], (of[t.row[inside]], t.column[inside] - n_rate))
    matrix = csr_array(entries, shape=(rows.size, n_effort))
    matrix.data[np.abs(matrix.data) <= SPECK * _largest(matrix)] = 0.0  # else they would grow with their columns
    compliance, plain = _compliance(model, values)
    matrix = _balanced(csr_array(matrix @ compliance), plain)
    inside &= values != 0.0
    still = np.bincount(of[t.row[inside]], minlength=rows.size) == 0
    moving = constrained & (t.column < n_rate) & still[of[t.row]]
    if moving.any():  # conditions on rates alone, of the poses of stabilised joints
        rates = csr_array((values[moving], (of[t.row[moving]], t.column[moving])), shape=(rows.size, n_rate))
        matrix = csr_array(hstack([matrix, rates]))
    for members in row_parts(matrix):
        if members.size > LARGE:
            members = members[entangled(matrix[members])]
        local = matrix[members]
        dense = local[:, np.unique(local.indices)].toarray()
        if not dense.size:  # equations without efforts are identities, or contradictions
            out[rows[members]] = 1
            continue
        norms = np.linalg.norm(dense, axis=1)
        dense /= np.where(norms > 0.0, norms, 1.0)[:, None]
        factors: Any = linalg.qr(dense.T, mode="r", pivoting=True)
        triangle, pivots = factors
        sizes = np.zeros(members.size)
        sizes[: min(triangle.shape)] = np.abs(np.diag(triangle))
        rank = rank_of(sizes, IMPLICIT)
        if before is not None:
            held = members.size - int(before[rows[members]].sum())
            rank = min(rank, max(held, rank_of(sizes, FOLLOWED)))
        left = pivots[rank:]
        if rather is not None and left.size:
            left = exchanged(triangle, pivots, rank, np.where(rather[rows[members]], 1.0, OTHERWISE))
        out[rows[members[left]]] = 1
    return out


def entangled(matrix: Any) -> Index:
    """Rows that may be dependent: the remainder after elimination of those with an effort of their own.

    Such a row takes part in no dependence. Its effort has to be more than `OWN` of it, so that the rest is as well
    conditioned as the whole.
    """
    kept = np.arange(matrix.shape[0])
    while kept.size:
        local = abs(matrix[kept]).tocsc()
        local.eliminate_zeros()
        columns = np.flatnonzero(np.diff(local.indptr) == 1)
        at = local.indptr[columns]
        norms = np.sqrt(np.asarray(local.multiply(local).sum(axis=1)).ravel())
        own = local.indices[at][local.data[at] > OWN * norms[local.indices[at]]]
        if not own.size:
            break
        kept = np.delete(kept, own)
    return kept


def exchanged(triangle: Array, pivots: Index, rank: int, weights: Array) -> Index:
    """Rows whose omission preserves the rank: those with the largest weighted coefficients in the dependences.

    The dependences are the null vectors (of the transpose) of a matrix whose rows have this pivoted triangle.
    """
    from scipy import linalg

    dependences = np.zeros((pivots.size - rank, pivots.size))
    dependences[:, pivots[rank:]] = np.eye(pivots.size - rank)
    if rank:
        dependences[:, pivots[:rank]] = -linalg.solve_triangular(triangle[:rank, :rank], triangle[:rank, rank:]).T
    found: Any = linalg.qr(dependences * weights, mode="r", pivoting=True)
    return found[1][: pivots.size - rank]


def _compliance(model: Model, values: Array) -> Any:
    """Block-diagonal square root of ∂e/∂w at storages, the identity at efforts that no storage gives; sparse; and
    which efforts these are.
    """
    from scipy.sparse import csr_array

    t = model.tables
    rows: list[Index] = []
    columns: list[Index] = []
    entries: list[Array] = []
    plain = np.ones(int(t.counts[1]), dtype=bool)
    storing = np.flatnonzero(t.kind == STORING)
    for n in np.unique(t.dims[storing, 0]):
        if not n:  # of a fixed joint
            continue
        these = storing[t.dims[storing, 0] == n]
        places = t.jacobian[t.jacobian_at[these, None] + np.arange(n * n)]
        block = -np.where(places >= 0, values[places], 0.0).reshape(-1, n, n)
        sigma, vectors = symmetric_eigen(0.5 * (block + block.swapaxes(1, 2)))
        sound = (sigma[:, -1] > 0.0) & (sigma[:, 0] > REGULAR * sigma[:, -1])
        index = t.e_index[t.e_at[these[sound], None] + np.arange(n)]
        rows.append(np.repeat(index, n, axis=1).ravel())
        columns.append(np.tile(index, (1, n)).ravel())
        root = np.sqrt(sigma[sound])[:, None, :]
        entries.append(((vectors[sound] * root) @ vectors[sound].swapaxes(1, 2)).ravel())
        plain[index.ravel()] = False
    rest = np.flatnonzero(plain)
    whole = (
        np.concatenate([*entries, np.ones(rest.size)]),
        (np.concatenate([*rows, rest]), np.concatenate([*columns, rest])),
    )
    return csr_array(whole, shape=(plain.size, plain.size)), plain


def _largest(matrix: Any) -> Array:
    """(nnz,) largest size of an entry in each entry's row."""
    row = matrix.tocoo().row
    most = np.zeros(matrix.shape[0])
    np.maximum.at(most, row, np.abs(matrix.data))
    return most[row]


def _balanced(matrix: Any, plain: NDArray[np.bool_]) -> Any:
    """The matrix with columns of plain efforts within a range of what is in their rows: they have no size of their own.

    Sizes spread from those of storages, row by row.
    """
    row, column = matrix.tocoo().coords
    used, left = matrix.data != 0.0, plain.copy()
    while True:
        size, theirs = np.abs(matrix.data), left[column]
        most, wanted = np.zeros(matrix.shape[0]), np.full(plain.size, np.inf)
        np.maximum.at(most, row[~theirs], size[~theirs])
        beside = used & theirs & (most[row] > 0.0)
        if not beside.any():
            return matrix
        np.minimum.at(wanted, column[beside], most[row[beside]] / size[beside])
        now = wanted < np.inf
        factor = np.where(now, np.clip(1.0, wanted / APART, wanted * APART), 1.0)
        matrix.data = matrix.data * factor[column]
        left &= ~now


def null_unknown(size: int, row: Index, column: Index, values: Array) -> int:
    """The first of the unknowns with the largest components in the null space, independent of its basis."""
    matrix = np.zeros((size, size))
    np.add.at(matrix, (row, column), values)
    matrix /= np.maximum(np.abs(matrix).max(axis=1, initial=0.0), TINY)[:, None]
    _, sizes, vectors = svd(matrix)
    least = min(rank_of(sizes, IMPLICIT), size - 1)
    moved = np.linalg.norm(vectors[least:], axis=0)
    return int(np.flatnonzero(moved >= (1.0 - ALIKE) * moved.max())[0])
