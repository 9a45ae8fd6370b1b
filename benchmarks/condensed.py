"""Steps and rates by static condensation: inner unknowns of each kind of part eliminated for all copies at once.

Newton's equations of a part are a linear relation between its inner unknowns and those at its ports. Elimination leaves
a relation at the ports (a Schur complement), and a map that gives the inner unknowns back. What has no pivot inside,
as the multipliers of a constraint between two ports, stays: so nothing has to be invertible, and the relation has as
many unknowns as the interface needs. In plain NumPy, level by level: what the compiled elimination is held against.
"""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from benchmarks.copies import copies_of
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index, starts
from ephs.semantics.spaces.decompositions import least_squares, singular_values
from ephs.semantics.spaces.rank import IMPLICIT
from ephs.semantics.systems.kept import once
from ephs.solve.equations.model import Evaluation, Model
from ephs.solve.equations.sparse import equilibrate
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import Outcome, SolveError

SOUND = 1e-6
"""A pivot is used if it is at least this part of its row's largest entry, in every copy."""
DENSE = 400
"""Number of remaining equations up to which they are solved densely."""
STALLED, SOLVED, MOST = 1e-11, 4e-16, 40


def solved_by_parts(model: Model, x: Array, h: float) -> Array:
    """The unknowns of a natural step of h seconds from the states x; of the continuous equations where h is 0.

    Raises
    ------
    SolveError
        A component is outside its domain, or Newton's method does not converge.
    """
    z, before = StoredEnergies(model).efforts(x), np.inf
    kept = np.zeros(model.unknowns, dtype=np.int64)
    evaluation = Evaluation(model)
    memory = evaluation.memory
    for _ in range(MOST):
        status, component = evaluation.at(x, z, h)
        if status:
            raise SolveError.of_component(status, model, component)
        ratio = evaluation.measure(kept)
        if not np.isfinite(ratio):
            break
        if ratio <= SOLVED or (ratio < STALLED and ratio > 0.7 * before):
            return z
        before = ratio
        z = z - condensed(model, memory.data, memory.residual)
    raise SolveError(Outcome.DIVERGED, "", "")


def condensed(model: Model, values: Array, right: Array) -> Array:
    """Solution z of A z = right, of least norm in the remaining equations.

    Parameters
    ----------
    values
        Entries of A at the model's places.
    """
    t, n = model.tables, model.unknowns
    there = values != 0.0
    row, column = t.row[there], t.column[there]
    scale_r, scale_c = equilibrate(n, row, column, values[there])
    system = _System(row, column, values[there] * scale_r[row] * scale_c[column], right * scale_r)
    z, back = np.zeros(n), list[_Back]()
    left = np.ones((2, n), dtype=np.bool_)  # rows, columns
    for inner in _inner_unknowns(model):
        if inner.shape[0] > 1 and inner.shape[1]:
            system, eliminated = _eliminated(system, inner, left)
            back.append(eliminated)
    rows, columns = np.flatnonzero(left[0]), np.flatnonzero(left[1])
    z[columns] = system.solved(rows, columns)
    for eliminated in reversed(back):
        eliminated.fill(z)
    return z * scale_c


def _inner_unknowns(model: Model) -> list[Index]:
    """(copies, unknowns) rates, efforts and multipliers inside the copies of each kind, innermost first."""
    n, t = model.descriptor.numbering, model.tables
    places = (
        (starts(n.dims(n.states)), n.dims(n.states), 0),
        (starts(n.dims(n.junctions)), n.dims(n.junctions), int(t.counts[0])),
        (starts(n.multipliers), n.multipliers, int(t.counts[0] + t.counts[1])),
    )
    found: list[Index] = []
    d = model.descriptor
    for part in once(d, "copies", lambda: copies_of(d.system)):
        blocks = [np.zeros((part.components.shape[0], 0), dtype=np.int64)]
        for numbers, (at, length, first) in zip((part.states, part.junctions, part.components), places, strict=True):
            if numbers.size:  # the unknowns inside a part are contiguous
                width = int(length[numbers[0]].sum())
                blocks.append(first + at[numbers[:, :1]] + np.arange(width))
        found.append(np.hstack(blocks))
    return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class _System:
    """Condensed equations: entries, and right sides of all rows."""

    row: Index
    column: Index
    value: Array
    right: Array

    def solved(self, rows: Index, columns: Index) -> Array:
        """The solution in these rows and columns; of least norm where there are several."""
        place = np.zeros((2, self.right.size), dtype=np.int64)
        place[0, rows], place[1, columns] = np.arange(rows.size), np.arange(columns.size)
        at = (place[0, self.row], place[1, self.column])
        if rows.size > DENSE:
            from scipy.sparse import csc_array
            from scipy.sparse.linalg import spsolve

            found: Any = spsolve(csc_array((self.value, at), shape=(rows.size, columns.size)), self.right[rows])
            return found
        matrix = np.zeros((rows.size, columns.size))
        np.add.at(matrix, at, self.value)
        sizes = singular_values(matrix) if rows.size else np.zeros(1)
        if sizes[-1] > IMPLICIT * sizes[0]:  # scaling preserves the digits of small unknowns
            return np.linalg.solve(matrix, self.right[rows]).astype(float)
        return np.asarray(least_squares(matrix, self.right[rows], part=IMPLICIT), dtype=float)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Back:
    """Gives the eliminated unknowns of each copy from those outside: z[inner] = constant − slope z[outer].

    Parameters
    ----------
    inner, outer
        (copies, p), (copies, w) unknowns; of the latter −1 fills up.
    slope, constant
        (copies, p, w), (copies, p).
    """

    inner: Index
    outer: Index
    slope: Array
    constant: Array

    def fill(self, z: Array) -> None:
        """Write the eliminated unknowns."""
        known = np.where(self.outer >= 0, z[self.outer], 0.0)
        z[self.inner] = self.constant - np.einsum("mpw,mw->mp", self.slope, known)


def _eliminated(system: _System, inner: Index, left: NDArray[np.bool_]) -> tuple[_System, _Back]:
    """Eliminate the unknowns ``inner`` (copies, u), as far as possible, by the equations of the same numbers.

    ``left`` (2, n) marks the rows and columns that are not eliminated yet, and is brought up to date.
    """
    s, (copies, width), n = system, inner.shape, left.shape[1]
    copy, local = np.full(n, -1), np.zeros(n, dtype=np.int64)
    copy[inner], local[inner] = np.arange(copies)[:, None], np.arange(width)
    inside = (copy[s.row] >= 0) & (copy[s.row] == copy[s.column])
    blocks = np.zeros((copies, width, width))
    np.add.at(blocks, (copy[s.row[inside]], local[s.row[inside]], local[s.column[inside]]), s.value[inside])
    largest = np.zeros(n)
    np.maximum.at(largest, s.row, np.abs(s.value))
    # an unknown that another copy's equations contain, as the rate of a state that is read there, is none of its own
    across = ~inside & (copy[s.row] >= 0) & (copy[s.column] >= 0)
    own = np.stack([left[0, inner].all(axis=0), left[1, inner].all(axis=0)])
    own[1, local[s.column[across]]] = False
    rows, columns = _pivots(blocks, largest[inner], own)
    mine, taken = inner[:, rows], inner[:, columns]
    left[0, mine], left[1, taken] = False, False
    in_row, in_column = ~left[0][s.row] & (copy[s.row] >= 0), ~left[1][s.column] & (copy[s.column] >= 0)
    place = np.zeros(width, dtype=np.int64)
    place[rows] = np.arange(rows.size)
    outer, beside = _gathered(copy[s.row], s.column, place[local[s.row]], s.value, in_row & ~in_column, mine.shape)
    place[columns] = np.arange(columns.size)
    others, below = _gathered(copy[s.column], s.row, place[local[s.column]], s.value, in_column & ~in_row, mine.shape)
    pivots = blocks[:, rows[:, None], columns[None, :]]
    solved: Array = np.linalg.solve(pivots, np.concatenate([beside, s.right[mine][:, :, None]], axis=2)).astype(float)
    slope, constant = solved[:, :, :-1], solved[:, :, -1]
    right = s.right.copy()
    change = np.einsum("mpw,mp->mw", below, constant)
    np.subtract.at(right, others[others >= 0], change[others >= 0])
    schur = -np.einsum("mpi,mpj->mij", below, slope)
    at = (others[:, :, None] >= 0) & (outer[:, None, :] >= 0)
    both = np.broadcast_arrays(others[:, :, None], outer[:, None, :])
    kept = ~(in_row | in_column)
    after = _System(
        np.concatenate([s.row[kept], both[0][at]]), np.concatenate([s.column[kept], both[1][at]]),
        np.concatenate([s.value[kept], schur[at]]), right,
    )  # fmt: skip
    return after, _Back(taken, outer, slope, constant)


def _pivots(blocks: Array, largest: Array, own: NDArray[np.bool_]) -> tuple[Index, Index]:
    """Rows and columns that serve as pivots in all copies: the largest first, in the copy where it is least."""
    work = blocks.copy()
    scale = np.where(largest > 0.0, largest, 1.0)[:, :, None]
    free = own[0][:, None] & own[1][None, :]
    rows: list[int] = []
    columns: list[int] = []
    while free.any():
        worth = np.where(free, (np.abs(work) / scale).min(axis=0), -1.0)
        i, j = divmod(int(np.argmax(worth)), worth.shape[1])
        if worth[i, j] < SOUND:
            break
        work -= work[:, :, j, None] * (work[:, i, :] / work[:, i, j, None])[:, None, :]
        free[i], free[:, j] = False, False
        rows.append(i)
        columns.append(j)
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


def _gathered(
    copy: Index, other: Index, place: Index, value: Array, chosen: NDArray[np.bool_], shape: tuple[int, ...]
) -> tuple[Index, Array]:
    """Entries between the p eliminated numbers of copies and others: (copies, w) which, (copies, p, w) the entries."""
    m, number, at, entry = copy[chosen], other[chosen], place[chosen], value[chosen]
    size = int(number.max(initial=0)) + 1
    keys, inverse = np.unique(m * size + number, return_inverse=True)
    of = keys // size
    slot = np.arange(keys.size) - np.searchsorted(of, of)
    width = int(slot.max(initial=-1)) + 1
    found, entries = np.full((shape[0], width), -1), np.zeros((*shape, width))
    found[of, slot] = keys % size
    np.add.at(entries, (m, at, slot[inverse.ravel()]), entry)
    return found, entries
