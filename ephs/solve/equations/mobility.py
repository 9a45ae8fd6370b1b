"""Mobility and redundant constraints of large systems: propagation along the constraints, dense for loop closures.

A constraint that has as many rows as one of its ports has efforts gives this port's effort from the others'; that is a
block of full rank. What is left over are the constraints that close loops: only they are written in the efforts that
remained free, and their rank is computed, group by group of those that have free efforts in common.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.descriptor.numbering import starts
from ephs.semantics.linear.sums import uncancelled
from ephs.semantics.primitives.primitives import Reversible
from ephs.semantics.spaces.decompositions import singular_values
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.solve.equations.instant import is_velocity, rate_balances
from ephs.solve.equations.sparse import Index, row_parts

SOUND = 1e-3
"""Least singular value of an invertible block, as a fraction of its row norms."""


@final
@dataclass(frozen=True, slots=True)
class Mobility:
    """Number of independent motions and of redundant constraint equations at a configuration."""

    mobility: int
    redundant: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class _EffortCondition:
    """Rows on the efforts of some junctions, 0 = Σ block · effort; ``size`` (k,) are the rows' norms."""

    blocks: Mapping[int, Array]
    size: Array


@final
class _SolvedEfforts:
    """Efforts of junctions as linear functions of free ones."""

    def __init__(self) -> None:
        self.given: dict[int, dict[int, Array]] = {}  # junction -> the junctions before it, with a matrix each
        self._whole: dict[int, dict[int, Array]] = {}

    def by_free(self, junction: int, dims: Index) -> dict[int, Array]:
        """The effort of a junction: free junction -> matrix; of a free junction itself the identity."""
        stack = [junction]
        while stack:
            here = stack[-1]
            before = self.given[here]
            missing = [other for other in before if other not in self._whole and other != here]
            if here in self._whole or not missing:
                stack.pop()
                if here not in self._whole:
                    self._whole[here] = self._sum(here, before, int(dims[here]))
            else:
                stack += missing
        return self._whole[junction]

    def _sum(self, here: int, before: Mapping[int, Array], dim: int) -> dict[int, Array]:
        if here in before:
            return {here: np.eye(dim)}
        out: dict[int, Array] = {}
        for other, matrix in before.items():
            for free, whole in self._whole[other].items():
                term = matrix @ whole
                out[free] = out[free] + term if free in out else term
        return out


def mobility(descriptor: Descriptor, x: Array, prescribed: Collection[Path] = ()) -> Mobility:
    """Count motions and redundant constraints at a state.

    Motions are velocities (`is_velocity`) that satisfy all constraints and vanish at ports whose effort is prescribed.
    """
    odd = [slot for slot in descriptor.junctions if is_velocity(slot.quantity)]
    dims = np.array([slot.quantity.space.dim for slot in odd], dtype=np.int64)
    conditions = _conditions(descriptor, x, prescribed, {slot.at: i for i, slot in enumerate(odd)}, dims)
    rows = sum(condition.size.size for condition in conditions)
    solved, left = _solve(_without_leaves(conditions), dims)
    rank = rows - sum(condition.size.size for condition in left) + _rank_of_loops(left, solved, dims)
    return Mobility(int(dims.sum()) - rank, rows - rank)


def _conditions(
    d: Descriptor, x: Array, prescribed: Collection[Path], number: Mapping[int, int], dims: Index
) -> list[_EffortCondition]:
    """All constraints on velocities, without zero rows."""
    out: list[_EffortCondition] = []
    junction_of = {at + i: (junction, i) for at, junction in number.items() for i in range(int(dims[junction]))}
    for slot in d.outer:
        if slot.path in prescribed and slot.at in number:
            dim = int(dims[number[slot.at]])
            out.append(_EffortCondition({number[slot.at]: np.eye(dim)}, np.ones(dim)))
    for balance in rate_balances(d, x):
        blocks: dict[int, Array] = {}
        for effort, by in balance.items():
            junction, i = junction_of[effort]
            blocks.setdefault(junction, np.zeros((1, int(dims[junction]))))[0, i] = by
        out.append(_EffortCondition(blocks, np.linalg.norm(np.hstack(list(blocks.values())), axis=1)))
    for slot in d.components:
        if not (slot.multipliers and isinstance(slot.primitive, Reversible)):
            continue
        constraint = uncancelled(slot.primitive.structure(d.point(slot, x))[1], slot.efforts)
        blocks = {}
        for column, effort in enumerate(slot.efforts):
            if effort in junction_of:
                junction, i = junction_of[effort]
                block = blocks.setdefault(junction, np.zeros((slot.multipliers, int(dims[junction]))))
                block[:, i] += constraint[:, column]
        whole = np.hstack([np.zeros((slot.multipliers, 0)), *blocks.values()])
        kept = np.abs(whole).max(axis=1, initial=0.0) > 0.0
        if kept.any():
            size = np.linalg.norm(whole[kept], axis=1)
            out.append(_EffortCondition({junction: block[kept] for junction, block in blocks.items()}, size))
    return out


def _without_leaves(conditions: list[_EffortCondition]) -> list[_EffortCondition]:
    """The conditions without those that determine an effort which no other has: these restrict nothing else.

    Such are the motions of two bodies relative to each other, where they may touch.
    """
    touching: dict[int, set[int]] = {}
    for i, condition in enumerate(conditions):
        for junction in condition.blocks:
            touching.setdefault(junction, set()).add(i)
    leaves, gone = [junction for junction, those in touching.items() if len(those) == 1], set[int]()
    while leaves:
        leaf = leaves.pop()
        if len(touching[leaf]) != 1:
            continue
        (i,) = touching[leaf]
        if not _sound(conditions[i], leaf):
            continue
        gone.add(i)
        for junction in conditions[i].blocks:
            touching[junction].discard(i)
            if len(touching[junction]) == 1:
                leaves.append(junction)
    return [condition for i, condition in enumerate(conditions) if i not in gone]


def _sound(condition: _EffortCondition, junction: int) -> bool:
    """Whether the rows determine the effort of a junction."""
    block = condition.blocks[junction]
    rows, columns = block.shape
    return rows == columns and bool(singular_values(block / condition.size[:, None])[-1] >= SOUND)


def _solve(conditions: list[_EffortCondition], dims: Index) -> tuple[_SolvedEfforts, list[_EffortCondition]]:
    """Propagate known efforts along the constraints; when stuck, declare an effort free.

    A condition serves when all its ports but those of one square block are known, or can be let free for it: conditions
    on one port first, then those that touch what is known.
    """
    solved, used = _SolvedEfforts(), set[int]()
    touching: dict[int, list[int]] = {}
    for i, condition in enumerate(conditions):
        for junction in condition.blocks:
            touching.setdefault(junction, []).append(i)
    queue = [i for i, condition in enumerate(conditions) if len(condition.blocks) == 1]
    seeds = iter(range(dims.size))
    while True:
        while queue:
            i = queue.pop()
            if i in used:
                continue
            fresh = _use(conditions[i], solved, dims)
            if fresh:
                used.add(i)
                queue += [j for junction in fresh for j in touching[junction] if j not in used]
        seed = next((j for j in seeds if j not in solved.given), None)
        if seed is None:
            break
        solved.given[seed] = {seed: np.eye(int(dims[seed]))}
        queue += [j for j in touching.get(seed, []) if j not in used]
    return solved, [condition for i, condition in enumerate(conditions) if i not in used]


def _use(condition: _EffortCondition, solved: _SolvedEfforts, dims: Index) -> list[int]:
    """The junctions that a condition determines, one by its rows and the others free; empty if unusable."""
    unknown = [junction for junction in condition.blocks if junction not in solved.given]
    for junction in unknown:
        if not _sound(condition, junction):
            continue
        block = condition.blocks[junction]
        for free in unknown:
            if free != junction:
                solved.given[free] = {free: np.eye(int(dims[free]))}
        inverse = np.linalg.inv(block)
        others = {other: -inverse @ matrix for other, matrix in condition.blocks.items() if other != junction}
        solved.given[junction] = others
        return unknown
    return []


def _rank_of_loops(left: list[_EffortCondition], solved: _SolvedEfforts, dims: Index) -> int:
    """Rank of the loop-closing constraints in the free efforts."""
    from scipy.sparse import csr_array

    entries: list[list[Array]] = [[np.zeros(0)] for _ in range(3)]
    at, count = starts(dims), 0
    for condition in left:
        for junction, block in condition.blocks.items():
            for free, matrix in solved.by_free(junction, dims).items():
                term = block @ matrix / condition.size[:, None]
                row, column = np.indices(term.shape)
                for kept, more in zip(entries, (term, count + row, at[free] + column), strict=True):
                    kept.append(more.ravel().astype(float))
        count += condition.size.size
    values, rows, columns = map(np.concatenate, entries)
    places = rows.astype(np.int64), columns.astype(np.int64)
    matrix = csr_array((values, places), shape=(count, int(dims.sum())))
    return sum(_rank(matrix[members]) for members in row_parts(matrix))


def _rank(part: Any) -> int:
    """Rank of a sparse matrix that does not fall apart."""
    sigma = singular_values(part[:, np.unique(part.indices)].toarray())
    return int(np.sum(sigma > CONSTRAINT * max(float(sigma[0]), 1.0))) if sigma.size else 0
