"""Exact derivatives of a mechanism's dynamics, and its constraints, from the linearised equations."""

from ephs.mechanics.dynamics.links import Links
from ephs.mechanics.dynamics.results import Constraints, Derivatives, VelocityDerivatives
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.mechanics.tree.finding.tables import CUT
from ephs.semantics.bundles.bundle import Array

Slopes = tuple[Array, Array, Array]
"""(n,) accelerations, their derivatives as `Linearised.columns` has them, and those by forces (n, n)."""


def forward_slopes(linear: Linearised, q: Array, r: Array, s: Array) -> Slopes:
    """Accelerations and their derivatives under the present inputs."""
    a = linear.forward(q, r, s)[: linear.equations.n]
    return a, linear.columns(solve=True, fit=True), linear.mobility()


def derivatives_of(linear: Linearised, under: Slopes, q: Array, r: Array, s: Array, given: Array | None) -> Derivatives:
    """Those by `forward_slopes`, and of inverse dynamics at given or solved accelerations; see `Derivatives`."""
    n, nv = linear.equations.n, linear.equations.nv
    a, forward, by_force = under
    linear.inverse(q, r, s, a if given is None else given)
    inverse = linear.columns(solve=False, fit=True)[:n]
    at_q, at_r, at_s = slice(0, n), slice(nv, nv + n), slice(nv + n, None)
    return Derivatives(
        forward[:n, at_q], forward[:n, at_r], by_force, forward[:n, at_s],
        inverse[:, at_q], inverse[:, at_r], linear.equations.mass(q, r),
        forward[nv:, at_q], forward[nv:, at_r], forward[nv:, at_s],
    )  # fmt: skip


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


def velocity_derivatives_of(linear: Linearised, links: Links, q: Array, r: Array) -> VelocityDerivatives:
    """Those of rows, cut joints and bodies; see `VelocityDerivatives`."""
    rows, cut, twists = linear.turning(q, r)
    layout, n = linear.equations.layout, linear.equations.n
    joints = {name: cut[where - n] for name, where in layout.freedoms.items() if where.size and where[0] >= n}
    return VelocityDerivatives(rows, joints, links.inside(twists))
