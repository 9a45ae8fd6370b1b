"""Columns of a Jacobian that have no row in common: one direction gives them all (Curtis, Powell and Reid, 1974)."""

from collections.abc import Iterator, Sequence

import numpy as np

from ephs.mechanics.tree.finding.tables import TREE, MechanismTables
from ephs.solve.equations.sparse import Index

Column = tuple[int, Index]
"""A column, and the rows in which it may have entries."""


def columns_of_trees(t: MechanismTables, increments: int, freedoms: int, warm: Index) -> Iterator[Column]:
    """The columns of ∂ẏ/∂y of y = (v, r, heats) and their rows, of a mechanism without loops or attached networks.

    A tree of bodies acts on itself, on those that springs and contacts tie to it, and on what takes the heat there.

    Parameters
    ----------
    increments, freedoms
        Sizes of v and r.
    warm
        Numbers of the heats with a column; they may act on all.
    """
    links, heats = len(t.parent), increments + freedoms
    root = np.arange(links)
    for link in range(links):
        root[link] = link if t.parent[link] < 0 else root[t.parent[link]]
    tied = {int(one): {int(one)} for one in root}
    heated: dict[int, set[int]] = {one: set() for one in tied}
    for i, kind in enumerate(t.kind):
        those = range(i, i + max(1, int(t.poses[i])))  # an energy of several relative poses ties the ends of all
        ends = [i] if kind == TREE else [int(end) for k in those for end in (t.first[k], t.second[k])]
        trees = {int(root[end]) for end in ends if end >= 0}
        for one in trees:
            tied[one] |= trees
            heated[one] |= {int(t.heat[i])} if t.heat[i] >= 0 else set()
    own: dict[int, list[int]] = {one: [] for one in tied}
    for i in range(links):
        own[int(root[i])] += range(int(t.r_at[i]), int(t.r_at[i] + t.dim[i]))
    rows: dict[int, Index] = {}
    for one, others in tied.items():
        moved = np.sort(np.concatenate([np.array(own[other], dtype=np.int64) for other in others]))
        warmed = np.array(sorted(heated[one]), dtype=np.int64)
        rows[one] = np.concatenate([moved, increments + moved, heats + warmed])
    owner = {freedom: one for one, found in own.items() for freedom in found}
    for start in (0, increments):
        yield from ((start + freedom, rows[owner[freedom]]) for freedom in sorted(owner))
    every = np.arange(heats + len(t.node))
    yield from ((heats + int(heat), every) for heat in warm)


def directions(columns: Sequence[Column], size: int) -> list[list[Column]]:
    """Columns of each direction, each in the first one where none has a row of it; rows are below ``size``."""
    found: list[list[Column]] = []
    taken = [0] * size  # of each row, the directions that have it, as bits
    for column, rows in columns:
        others, places = 0, rows.tolist()
        for row in places:
            others |= taken[row]
        free = ~others & (others + 1)
        for row in places:
            taken[row] |= free
        if free.bit_length() > len(found):
            found.append([])
        found[free.bit_length() - 1].append((column, rows))
    return found
