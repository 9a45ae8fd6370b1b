"""Exact derivatives of a mechanism's equations at a state, by the equations themselves over dual numbers."""

from typing import final

import numpy as np

from ephs.mechanics.rewrite.coordinates import unread
from ephs.mechanics.road.records import LinkPlace
from ephs.mechanics.tree.equations.dense import require_determined
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index


@final
class Linearised:
    """The equations of one mechanism and their derivatives at a state. It shares the equations' memory."""

    def __init__(self, equations: ReducedEquations) -> None:
        self.equations = equations
        self._dense = dense = equations.dense
        self._residual = found = dense.residual
        self._slopes = found.slopes()
        first = found.nv + found.n
        still = np.flatnonzero(unread(equations.reduced))
        environment = first + np.flatnonzero(equations.reduced.tables.node == -1)  # it is as warm as it is
        self._known = np.concatenate([still, environment])

    def forward(self, q: Array, r: Array, s: Array) -> Array:
        """(nv,) the accelerations of all joints under what drives at present: tree joints, then cut ones.

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        eq = self.equations
        require_determined(eq.reduced)
        eq.refuse(*self._dense.forward(q, r, s, eq.drive, eq.wrench))
        settled = self._dense.settle()
        return np.concatenate([self._dense.rate, settled[self._residual.cut_changes]])

    def inverse(self, q: Array, r: Array, s: Array, a: Array) -> Array:
        """(n,) the forces on the tree's degrees of freedom, beside what drives at present, that make its accelerations
        a (n,).

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        eq, found = self.equations, self._residual
        eq.refuse(*found.about(q, r, s, eq.drive, eq.wrench))
        return found.at(a, np.zeros(found.m))[found.forces].copy()

    def columns(self, *, solve: bool) -> Array:
        """(nv + ns, nv + n + ns) the derivatives where `forward` (with ``solve``) or `inverse` was called last.

        Columns are changes of the elements of tree and cut joints, left-trivialised, of the tree's rates, of entropies;
        rows are the tree's accelerations (or forces), the cut joints' rates, ṡ. Cut joints' elements follow the tree's;
        their own columns are zero.
        """
        found = self._residual
        n, nv, ns = found.n, found.nv, found.ns
        wanted = np.setdiff1d(np.arange(nv + n + ns), self._known)
        slopes = np.zeros((found.out.size, nv + n + ns))
        slopes[:, wanted] = self._slopes.along("residual", ("increment", "r", "entropy"), wanted)
        slopes[:, :n] += slopes[:, n:nv] @ slopes[found.cut_rates, nv : nv + n]
        slopes[:, n:nv] = 0.0
        slopes[:, self._known] = 0.0
        forces = slopes[found.forces]
        if solve:
            forces = self._dense.solved(-forces, self._rows(slopes))
        return np.concatenate([forces, slopes[found.cut_rates], slopes[found.entropy_rates]])

    def resting(self, q: Array, s: Array, following: Index) -> Array:
        """(n, n) the derivatives by the tree's elements of the forces that hold the mechanism at rest, with those that
        its loops need as they are.

        Parameters
        ----------
        following
            Places of entropies whose rates are those of a place, which are states of the configuration.
        """
        found = self._residual
        self.forward(q, np.zeros(found.n), s)
        found.at(np.zeros(found.n), self._dense.multiplier[self._dense.multiplier.size - found.m :])
        slopes, first = self.columns(solve=False), found.nv + found.n
        moved = slopes[found.nv + following, found.nv : found.nv + found.n]
        return slopes[: found.n, : found.n] + slopes[: found.n, first + following] @ moved

    def _rows(self, slopes: Array) -> Array:
        """Slopes of all rows' accelerations: those that are prescribed stay."""
        driven = self._dense.multiplier.size - self._residual.m
        return np.concatenate([np.zeros((driven, slopes.shape[1])), slopes[self._residual.rows]])

    def mobility(self) -> Array:
        """(n, n) the derivatives of the tree's accelerations by forces on its degrees of freedom, after `forward`."""
        n = self._residual.n
        return self._dense.solved(np.eye(n), np.zeros((self._dense.multiplier.size, n)))

    def action(self, q: Array, r: Array, s: Array, h: float) -> tuple[Array, Array]:
        """((n, 2n), (n, 2n)) ∂/∂(q, r) of the momenta ∂L/∂r and of ∂L/∂q with the forces that no potential has.

        States of what is attached follow by the midpoint rule over a step of h seconds, in whose middle this is.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        eq, found = self.equations, self._residual
        eq.refuse(*found.about(q, r, s, eq.drive, eq.wrench))
        n, nv = found.n, found.nv
        slopes = self._slopes.along("action", ("increment", "r", "entropy"))
        plain = np.flatnonzero(eq.heats.plain)
        if plain.size:
            rates, columns = 2 * nv + plain, nv + n + plain
            left = np.eye(plain.size) - 0.5 * h * slopes[np.ix_(rates, columns)]
            slopes += slopes[:, columns] @ np.linalg.solve(left, 0.5 * h * slopes[rates])
        slopes = slopes[:, : nv + n]
        slopes[:, :n] += slopes[:, n:nv] @ slopes[2 * n : n + nv, nv:]
        kept = np.concatenate([slopes[:, :n], slopes[:, nv:]], axis=1)
        return kept[:n], kept[n : 2 * n]

    def turning(self, q: Array, r: Array) -> tuple[Array, Array, Array]:
        """((m, n), (nv − n, n), (links + 1, 6, n)) derivatives by the tree's elements, at fixed rates r, of what the
        rates make: of all rows, of cut joints' rates, of links' twists in their frames. Cut joints' elements follow the
        tree's.

        At rest the accelerations of what the rows, joints and links have are what they make of the tree's: J a, so that
        a in place of r gives J r.
        """
        found = self._residual
        n, nv, gravity = found.n, found.nv, found.arrays["gravity"]
        pull = gravity.copy()
        gravity[:] = 0.0
        found.place(q, np.zeros(n))
        found.arrays["base"][:] = q
        found.at(r, np.zeros(found.m))
        units = np.eye(nv + n)
        slopes, places = self._slopes.of("residual", {"increment": units[:nv], "r": units[nv:]}, nv + n, "work")
        gravity[:] = pull
        following = slopes[found.cut_rates, nv:]
        slopes[:, :n] += slopes[:, n:nv] @ following
        moved = _seen(found.places, places[..., :n].reshape(*found.places.shape, n))
        return self._rows(slopes[:, :n]), slopes[found.cut_changes, :n], moved

    @property
    def cut_rates(self) -> Array:
        """(nv − n,) the rates of cut joints where `forward` or `inverse` was called last."""
        return self._residual.cut_twists()

    def targets(self, q: Array, r: Array, s: Array) -> tuple[Array, int]:
        """(m,) what the constraints' rows on the accelerations are to be, −(d rows/dt)·r; and the rows' rank."""
        self.forward(q, r, s)
        return self._dense.targets()


def _seen(place: Array, slopes: Array) -> Array:
    """(links + 1, 6, n) derivatives of links' accelerations in their own axes, from those (links + 1, …, n) of their
    places, whose accelerations are in world axes.
    """
    turn, turned = place[:, :9].reshape(-1, 3, 3), slopes[:, :9].reshape(len(place), 3, 3, -1)
    bias, change = (slice(field.offset, field.offset + 6) for field in (LinkPlace.bias, LinkPlace.change))
    moved = (place[:, bias] + place[:, change]).reshape(-1, 2, 3)
    moving = (slopes[:, bias] + slopes[:, change]).reshape(len(place), 2, 3, -1)
    found = np.einsum("lijn,lhi->lhjn", turned, moved) + np.einsum("lij,lhin->lhjn", turn, moving)
    return found.reshape(len(place), 6, -1)
