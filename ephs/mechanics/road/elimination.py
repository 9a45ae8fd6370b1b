"""Order of elimination of the constraints of loops, and the rows that each of its steps touches.

A constraint between links is carried with the articulated inertias from each towards the ground, and eliminated at
the link where their paths meet. What is open at one link at the same time becomes coupled. For chains of loops few are
open at a time, and the cost grows with their number, not with its cube. The order and the pattern depend on the tree
only: they are found once. Sathya and Carpentier, *Constrained Articulated Body Dynamics Algorithms*, 2024, describe
the elimination.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ephs.operad.disjoint import DisjointSets
from ephs.solve.equations.sparse import Index


class ClosingProgram(NamedTuple):
    """The program of the elimination, for links 0 … n − 1 and the ground as link n."""

    at: Index  # (n + 1, 4): first slot, slots, of them eliminated here (they come first), first pair in `flat`
    slot: Index  # (slots, 2): row, slot at the parent or −1
    end: Index  # slots at the rows' links, row by row
    row: Index  # (rows, 4): first neighbour in `flat`, neighbours, first pair in `flat`, block
    flat: Index  # neighbours (row, slot, entry); pairs: entries
    entries: int  # of the matrix that couples rows: its diagonal by row, then what is off it
    blocks: int  # groups of rows that are coupled


def closing(parents: Sequence[int], ends: Sequence[Sequence[int]]) -> ClosingProgram:
    """The program for links with these parents, −1 for the ground, and rows among these links.

    A link's number is larger than its parent's.
    """
    n, m = len(parents), len(ends)
    ground = n
    above = [p if p >= 0 else ground for p in parents]
    meet, paths = [], []
    for links in ends:
        left = {x if x >= 0 else ground for x in links}
        passed = set(left)
        while len(left) > 1:  # the deepest one goes up; the ground is above all
            deepest = max(left - {ground})
            left.remove(deepest)
            left.add(above[deepest])
            passed.add(above[deepest])
        meet.append(left.pop())
        paths.append(passed)
    open_at: list[list[int]] = [[] for _ in range(n + 1)]
    closed_at: list[list[int]] = [[] for _ in range(n + 1)]
    for row in range(m):
        closed_at[meet[row]].append(row)
        for link in paths[row]:
            if link != meet[row]:
                open_at[link].append(row)
    beside: list[set[int]] = [set() for _ in range(m)]
    later: list[list[int]] = [[] for _ in range(m)]
    order: list[list[int]] = [[] for _ in range(n + 1)]
    rank: dict[int, int] = {}
    for link in [*range(n - 1, -1, -1), ground]:
        waiting = set(closed_at[link])
        while waiting:  # the one with the fewest neighbours left goes first
            row = min(waiting, key=lambda r: (len(beside[r]), r))
            waiting.remove(row)
            rank[row] = len(rank)
            order[link].append(row)
            others = beside[row]
            later[row] = list(others)
            for other in others:
                beside[other] |= others
                beside[other] -= {row, other}
        for row in open_at[link]:
            beside[row] |= set(open_at[link]) - {row}
    entry = {(row, row): row for row in range(m)}

    def place(a: int, b: int) -> int:
        key = (a, b) if rank[a] < rank[b] else (b, a)
        return entry.setdefault(key, len(entry))

    slots: list[list[int]] = []
    number: dict[tuple[int, int], int] = {}
    at = np.zeros((n + 1, 4), dtype=np.int64)
    flat: list[int] = []
    for link in range(n + 1):
        rows = order[link] + sorted(open_at[link], key=lambda r: rank[r])
        at[link] = len(slots), len(rows), len(order[link]), len(flat)
        for row in rows:
            number[link, row] = len(slots)
            slots.append([row, -1])
        carried = rows[len(order[link]) :]
        flat += [place(a, b) for i, b in enumerate(carried) for a in carried[: i + 1]]
    for (link, row), s in number.items():
        if link != meet[row]:
            slots[s][1] = number[above[link], row]
    rows_at = np.zeros((m, 4), dtype=np.int64)
    sets = DisjointSets[int]()
    for row in range(m):
        others = sorted(later[row], key=lambda r: rank[r])
        rows_at[row, :2] = len(flat), len(others)
        for other in others:
            flat += [other, number[meet[row], other], place(row, other)]
            sets.join(row, other)
        rows_at[row, 2] = len(flat)
        flat += [place(a, b) for i, a in enumerate(others) for b in others[i:]]
    blocks: dict[int, int] = {}
    rows_at[:, 3] = [blocks.setdefault(sets.leader(row), len(blocks)) for row in range(m)]
    places = [number[x if x >= 0 else ground, row] for row, links in enumerate(ends) for x in links]
    return ClosingProgram(
        at,
        np.array(slots, dtype=np.int64).reshape(-1, 2),
        np.array(places, dtype=np.int64),
        rows_at,
        np.array(flat, dtype=np.int64),
        len(entry),
        len(blocks),
    )
