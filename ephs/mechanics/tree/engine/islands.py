"""Islands of a mechanism: links that hang together, and the motions of space along which nothing holds them.

Joints to the ground let an island move by their subgroup, and leave what it moves by as it is; gravity lets it slide
across and turn about itself. What they have in common moves the island as a whole: by Noether's theorem it keeps
momenta.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.tree.engine.links import Found
from ephs.mechanics.tree.finding.tables import SPRING
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import ASSEMBLY, TINY
from ephs.solve.equations.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced


def islands_of(reduced: "Reduced", found: Found, acted: tuple[frozenset[int], frozenset[int]]) -> tuple[Index, Array]:
    """The island of each link, −1 where it is held, and (islands, 6, 6) bases of twists of the ground's frame.

    Parameters
    ----------
    acted
        Edges and bodies on which given forces act.

    Returns
    -------
    tuple[Index, Array]
        Columns beyond the dimension of what an island may do are zero.
    """
    t, link = reduced.tables, found.link
    both = zip(t.first.tolist(), t.second.tolist(), strict=True)
    ends = [[-1 if body < 0 else link[body] for body in bodies] for bodies in both]
    groups = _joined(len(found.parts), ends)
    weight = _of_gravity(reduced)
    barred: dict[int, list[Array]] = {group: [weight] for group in groups}
    held: dict[bytes, Array] = {}  # complements, which equal joints share
    for i, (one, two) in enumerate(ends):
        if (one < 0) == (two < 0):
            continue
        inside = max(t.spring[i], t.several[i], t.friction[i]) >= 0
        acting = inside or i in acted[0] or _inert(reduced, i)
        free = np.zeros((6, 0)) if acting else reduced.twists[i] if i < len(reduced.joints) else np.eye(6)
        key = free.tobytes()
        if key not in held:
            held[key] = complement(free)
        barred[groups[max(one, two)]].append(held[key])
    for body in acted[1]:
        if link[body] >= 0:
            barred[groups[link[body]]].append(np.eye(6))
    onto, bases, number = SE3.adjoint(found.ground), [], {}
    for group, rows in barred.items():
        free = complement(np.hstack(rows))
        if free.shape[1]:
            number[group] = len(bases)
            bases.append(np.hstack([onto @ free, np.zeros((6, 6 - free.shape[1]))]))
    island = np.array([number.get(group, -1) for group in groups], dtype=np.int64)
    return island, np.array(bases).reshape(-1, 6, 6)


def _joined(links: int, ends: Sequence[Sequence[int]]) -> list[int]:
    """For each link the least number among those that hang together with it, the ground left out."""
    sets = DisjointSets[int]()
    for one, two in ends:
        if one >= 0 and two >= 0:
            sets.join(*sorted(sets.leaders((one, two))))  # the least one leads
    return sets.leaders(range(links))


def _of_gravity(reduced: "Reduced") -> Array:
    """Covectors (6, n) that vanish on the twists which leave all weights as they are."""
    pull = reduced.gravity if np.any(reduced.tables.weight >= 0) else np.zeros(3)
    size = float(np.linalg.norm(pull))
    if size == 0.0:
        return np.zeros((6, 0))
    axes = svd(pull[:, None])[0]
    return np.vstack([np.column_stack([np.zeros(3), axes[:, 1:]]), np.column_stack([axes[:, 0], np.zeros((3, 2))])])


def _inert(reduced: "Reduced", i: int) -> bool:
    """Whether a joint's rate is prescribed, has inertia of its own, or something is attached to it."""
    t = reduced.tables
    if t.kind[i] == SPRING or not t.dim[i]:
        return False
    at = int(t.r_at[i])
    if at in reduced.attaching.edges:
        return True
    return at < t.driven.size and bool(t.driven[at] or np.any(t.armature[at : at + int(t.dim[i])] > 0.0))


def complement(columns: Array) -> Array:
    """(6, n) an orthonormal basis of the complement of all columns."""
    if not columns.shape[1]:
        return np.eye(6)
    whole = np.hstack([columns / max(float(np.linalg.norm(columns, axis=0).max()), TINY), np.zeros((6, 6))])
    left, sizes, _ = svd(whole, full_matrices=False)  # there may be thousands of columns
    return np.asarray(left[:, int(np.sum(sizes > ASSEMBLY)) :])
