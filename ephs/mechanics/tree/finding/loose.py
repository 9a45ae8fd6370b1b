"""Links without mass that move while all others rest, so that no inertia determines their motion.

The sweeps find those along whose joints no mass is left at all. Where axes are in no plane of the coordinates, rounding
leaves some there, and determines the motion.
"""

from collections.abc import Collection, Sequence

import numpy as np

from ephs.mechanics.tree.finding.spanning import Edge
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import singular_values, svd
from ephs.semantics.spaces.rank import ALIGNED


def loose_links(
    edges: Sequence[Edge],
    twists: Sequence[Array],
    frames: Sequence[Array],
    light: Collection[int],
    length: float,
    *,
    alone: bool,
) -> list[int]:
    """Numbers of the links without mass that move while all others rest.

    Parameters
    ----------
    edges, twists, frames
        The joints, their degrees of freedom in the world, (6, d), which are those that mass alone determines, and their
        frames there (7,).
    light
        Numbers of the links without mass.
    length
        Of the mechanism, in m, by which velocities are compared with angular ones.
    alone
        Whether to look at links only that no joint connects with another one of these: the freedoms of two joints of a
        link have the same part in common in all configurations.
    """
    beside = [i for i, edge in enumerate(edges) if {edge.body1, edge.body2} & {*light}]
    groups = DisjointSets[int]()
    for i in beside:
        if edges[i].body1 in light and edges[i].body2 in light:
            groups.join(edges[i].body1, edges[i].body2)
    found: list[int] = []
    for leader in sorted({groups.leader(link) for link in light}):
        group = [link for link in sorted(light) if groups.leader(link) == leader]
        mine = [i for i in beside if {edges[i].body1, edges[i].body2} & {*group}]
        if mine and not (alone and len(group) > 1) and _moves(edges, twists, frames, mine, group, length):
            found += group
    return found


def _moves(
    edges: Sequence[Edge],
    twists: Sequence[Array],
    frames: Sequence[Array],
    joints: Sequence[int],
    group: Sequence[int],
    length: float,
) -> bool:
    """Whether twists of a group of links are in the freedoms of all its joints, about the first of these."""
    about = SE3.inverse(np.concatenate([SE3.identity()[:4], frames[joints[0]][4:]]))
    seen = np.diag([1.0] * 3 + [1.0 / length] * 3) @ SE3.adjoint(about)
    rows = np.zeros((len(joints), 6, 6 * len(group)))
    for row, i in zip(rows, joints, strict=True):
        basis, sizes, _ = svd(seen @ twists[i], full_matrices=False)
        basis = basis[:, sizes > ALIGNED * sizes.max(initial=0.0)]
        for body, sign in ((edges[i].body1, -1.0), (edges[i].body2, 1.0)):
            if body in group:
                at = 6 * group.index(body)
                row[:, at : at + 6] += sign * (np.eye(6) - basis @ basis.T)
    return bool(singular_values(rows.reshape(-1, 6 * len(group)))[-1] < ALIGNED)
