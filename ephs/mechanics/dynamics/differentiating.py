"""Exact derivatives of a mechanism's dynamics, and its constraints, from the linearised equations."""

from collections.abc import Sequence

import numpy as np

from ephs.mechanics.dynamics.links import PlacedLinks
from ephs.mechanics.dynamics.loading import Loading
from ephs.mechanics.dynamics.results import Constraints, Derivatives, VelocityDerivatives
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.mechanics.tree.finding.tables import CUT, TREE
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.posing.errors import failing_at

Slopes = tuple[Array, Array, Array]
"""(n,) accelerations, their derivatives as `Linearised.columns` has them, and those by forces (n, n)."""


def forward_slopes(linear: Linearised, q: Array, r: Array, s: Array) -> Slopes:
    """Accelerations and their derivatives under the present inputs."""
    a = linear.forward(q, r, s)[: linear.equations.n]
    return a, linear.columns(solve=True), linear.mobility()


def derivatives_of(linear: Linearised, under: Slopes, q: Array, r: Array, s: Array, given: Array | None) -> Derivatives:
    """Those by `forward_slopes`, and of inverse dynamics at given or solved accelerations; see `Derivatives`."""
    n, nv = linear.equations.n, linear.equations.nv
    a, forward, by_force = under
    linear.inverse(q, r, s, a if given is None else given)
    inverse = linear.columns(solve=False)[:n]
    at_q, at_r, at_s = slice(0, n), slice(nv, nv + n), slice(nv + n, None)
    return Derivatives(
        forward[:n, at_q], forward[:n, at_r], by_force, forward[:n, at_s],
        inverse[:, at_q], inverse[:, at_r], linear.equations.mass(q, r),
        forward[nv:, at_q], forward[nv:, at_r], forward[nv:, at_s],
    )  # fmt: skip


def stiffness_of(linear: Linearised, loading: Loading, q: Array, r: Array, s: Array, following: Sequence[int]) -> Array:
    """(n, n) derivatives by the tree's elements of the forces that hold a mechanism at rest, exact at unbalanced
    states, too; loops keep the forces that close them.

    Parameters
    ----------
    following
        Places of the entropies that are tendons' lengths, which follow the joints.

    Raises
    ------
    SimulationError
        A component cannot be evaluated there.
    """
    still = np.zeros_like(r)
    loading.place(q, still)
    with failing_at(0.0):
        found = linear.resting(q, s, np.asarray(following, dtype=np.int64))
    return found - loading.slopes(q, still)


def constraints_of(linear: Linearised, q: Array, r: Array, s: Array) -> Constraints:
    """The equations of prescribed joints and closed loops; see `Constraints`."""
    eq, t = linear.equations, linear.equations.reduced.tables
    target, rank = linear.targets(q, r, s)
    gaps, rows = eq.gaps(q, r)
    edges = eq.reduced.edges
    driven = [
        e.name
        for i, e in enumerate(edges[: eq.reduced.links])
        for _ in range(int(t.driven[t.r_at[i] : t.r_at[i] + t.dim[i]].sum()))
    ]
    cut = [e.name for i, e in enumerate(edges) if t.kind[i] == CUT for _ in range(int(t.rows[i]))]
    return Constraints(rows, target, gaps, (*driven, *cut, *map(str, eq.reduced.gears)), rank)


def velocity_derivatives_of(linear: Linearised, links: PlacedLinks, q: Array, r: Array) -> VelocityDerivatives:
    """Those of rows, cut joints and bodies; see `VelocityDerivatives`."""
    rows, cut, twists = linear.turning(q, r)
    layout, n = linear.equations.layout, linear.equations.n
    joints = {name: cut[where - n] for name, where in layout.freedoms.items() if where.size and where[0] >= n}
    return VelocityDerivatives(rows, joints, links.inside(twists))


def state_derivatives_of(linear: Linearised, links: PlacedLinks, q: Array, r: Array) -> dict[Path, tuple[Array, Array]]:
    """State of the system -> ((d, n), (d, n)) its change by the tree's elements at fixed rates, and by these.

    Of poses, momenta, relative poses of joints and springs; entropies and states of attachments are states themselves.
    """
    eq, found = linear.equations, linear.equations.dense.residual
    reduced, t, n = eq.reduced, eq.reduced.tables, eq.n
    _, _, moved = linear.turning(q, r)
    links.place(q, r)
    out: dict[Path, tuple[Array, Array]] = {}
    still, unit = np.zeros((6, n)), SE3.identity()
    twists = [found.twists(i) for i in range(reduced.links)] + [still]
    poses = [found.pose(i) for i in range(reduced.links)] + [unit]
    for i, link in enumerate(reduced.places):
        if link.pose is not None:
            out[link.pose.path] = twists[i], still
        if link.momentum is not None:
            change = found.inside(i, moved[found.link(i)].T).T
            out[link.momentum.path] = t.inertia[i] @ change, t.inertia[i] @ twists[i]
    for i, edge in enumerate(reduced.edges):
        if edge.path is None or edge.state is None:
            continue
        d = edge.pair.dim
        if t.kind[i] == TREE:
            by_place = np.eye(n)[int(t.r_at[i]) : int(t.r_at[i]) + d]
        else:
            one, two, near, far = int(t.first[i]), int(t.second[i]), t.offset1[i], t.offset2[i]
            inside = SE3.compose(SE3.inverse(SE3.compose(poses[one], near)), SE3.compose(poses[two], far))
            turned = SE3.adjoint(SE3.inverse(far)) @ twists[two]
            turned -= SE3.adjoint(SE3.inverse(SE3.compose(near, inside))) @ twists[one]
            by_place = t.left[i][:d] @ turned
        out[edge.state] = by_place, np.zeros((d, n))
    for one in reduced.attaching.network.inertias:
        turning = np.eye(n)[int(reduced.attaching.ports[one.rate])]
        out[one.state.path] = np.zeros((1, n)), one.inertia * one.ratio * turning[None]
    return out
