"""Exact derivatives of a mechanism's equations: memory of the compiled tangents, and what they give at a state."""

from typing import Any, NamedTuple, final

import numpy as np

from ephs.mechanics.reduced.action_tangent_kernels import action_slopes
from ephs.mechanics.reduced.dynamics_kernels import by_force, forward_dynamics, inverse_dynamics
from ephs.mechanics.reduced.equations import Equations
from ephs.mechanics.reduced.jacobian_kernels import jacobian
from ephs.mechanics.reduced.tables import CUT, Mechanism
from ephs.mechanics.reduced.tangent_kernels import by_push
from ephs.mechanics.reduction.coordinates import unread
from ephs.semantics.bundle import Array

__all__ = ["Linearised", "Tangents"]


class Tangents(NamedTuple):
    """Memory of the tangents of one mechanism: n tree freedoms, nv with those of cut joints, m constraint rows."""

    turn: Array  # (links, 3, 3) rotation of each link in its parent
    place: Array  # (links, 3)
    end_turn: Array  # (edges, 2, 3, 3): C2 in body 1 and in body 2, of cut joints and springs
    end_place: Array  # (edges, 2, 3)
    along: Array  # (links, 6): S r
    moving: Array  # (links, 6): what of the twist turns when the joint is moved
    lifted: Array  # (links, 6): the same of the acceleration
    speed: Array  # (links, 6): accelerations
    momentum: Array  # (links, 6)
    total: Array  # (links, 6): loads gathered from the links further out
    weight: Array  # (links, 6, 6): of gravity, by the pose
    slip: Array  # (edges, 6): relative twists
    held: Array  # (edges, 6): of body 1, in C2
    held_rate: Array  # (edges, 6): acceleration of body 1, in C2
    wrench: Array  # (edges, 6): of springs and friction on body 2, in C2
    closing: Array  # (edges, 6): of the multipliers
    stiffness: Array  # (edges, 6, 6)
    damping: Array  # (edges, 6, 6)
    softening: Array  # (edges, 6): friction by temperature
    made_by_place: Array  # (edges, 6): entropy flow
    made_by_rate: Array  # (edges, 6)
    made_by_warmth: Array  # (edges,)
    node: Array  # (entropies,): dθ/ds
    flow: Array  # (conductions, 2, 2)
    rate: Array  # (nv,): accelerations
    multiplier: Array  # (m,)
    row: Array  # (m,)
    change: Array  # (n,)
    force: Array  # (n,)
    cut: Array  # (nv − n,)
    heat: Array  # (entropies,)
    warmth: Array  # (entropies,)
    dq: Array  # (nv,)
    dr: Array  # (n,)
    da: Array  # (n,)
    ds: Array  # (entropies,)
    ddrive: Array  # (nv,)
    dwrench: Array  # (links, 6)
    dx: Array  # (6,)
    drate: Array  # (6,)
    dpull: Array  # (6,)
    eta: Array  # (links, 6): change of the pose
    dtwist: Array
    dspeed: Array
    dtotal: Array
    stirred: Any  # (links,)
    velocity: Array  # (links, 6): twists, in the world's frame as all that follows
    surge: Array  # (links, 6): accelerations
    carried: Array  # (links, 6): loads gathered
    axis: Array  # (links, 6, 6): of joints, rows
    heft: Array  # (links, 6, 6): inertia of the link and what it carries
    drift: Array  # (links, 6, 6): forces by rates
    pulled: Array  # (links, 6, 6): gravity by places
    by_gain: Array  # (links, 6, 6): rows of the three, of each joint
    by_drift: Array
    by_place: Array
    corner_turn: Array  # (edges, 3, 3): C2 of cut joints and springs
    corner_place: Array  # (edges, 3)
    world_turn: Array  # (3, 3)
    world_place: Array  # (3,)
    wide: Array  # (2, 6, 6)
    small: Array  # (96,)

    @staticmethod
    def of(t: Mechanism) -> "Tangents":
        """Memory for a mechanism."""
        links, edges, n, ns = t.parent.size, t.kind.size, t.driven.size, t.node.size
        m = int(t.rows.sum() + t.driven.sum())
        nv = n + int(t.dim[(t.kind == 1)].sum())
        names: list[tuple[str, tuple[int, ...]]] = [
            ("along moving lifted speed momentum total dwrench eta dtwist dspeed dtotal", (links, 6)),
            ("slip held held_rate wrench closing softening made_by_place made_by_rate", (edges, 6)),
            ("turn", (links, 3, 3)), ("place", (links, 3)),
            ("end_turn", (edges, 2, 3, 3)), ("end_place", (edges, 2, 3)),
            ("weight", (links, 6, 6)), ("stiffness damping", (edges, 6, 6)), ("made_by_warmth", (edges,)),
            ("flow", (t.conduction.shape[0], 2, 2)), ("dx drate dpull", (6,)), ("small", (96,)),
            ("change force dr da", (n,)), ("rate dq ddrive", (nv,)), ("cut", (nv - n,)), ("multiplier row", (m,)),
            ("node heat warmth ds", (ns,)), ("velocity surge carried", (links, 6)),
            ("axis heft drift pulled by_gain by_drift by_place", (links, 6, 6)), ("corner_turn", (edges, 3, 3)),
            ("corner_place", (edges, 3)), ("world_turn", (3, 3)), ("world_place", (3,)), ("wide", (2, 6, 6)),
        ]  # fmt: skip
        arrays: dict[str, Any] = {name: np.zeros(shape) for group, shape in names for name in group.split()}
        arrays["stirred"] = np.zeros(links, dtype=np.bool_)
        return Tangents(**arrays)


@final
class Linearised:
    """The equations of one mechanism and their derivatives at a state. It shares the equations' scratch memory."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self.memory = Tangents.of(equations.reduced.tables)
        self._unread = unread(equations.reduced)
        self._s_rate = np.zeros(equations.ns)
        self._made, self._powers = np.zeros(len(equations.reduced.made)), np.zeros(2)
        self._rows = self._rank = 0
        self._point = np.zeros(0), np.zeros(0), np.zeros(0)

    def forward(self, q: Array, r: Array, s: Array) -> Array:
        """(nv,) the accelerations of all joints under what drives at present: tree joints, then cut ones.

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        eq, d = self.equations, self.memory
        status, component, self._rows, self._rank = forward_dynamics(
            eq.reduced.tables, eq.work, d, q, r, s, eq.drive, eq.wrench, eq.scal, self._s_rate, self._made, self._powers
        )
        eq.refuse(int(status), int(component))
        self._point = q, r, s
        return d.rate.copy()

    def inverse(self, q: Array, r: Array, s: Array, a: Array) -> Array:
        """(n,) the forces on the tree's freedoms, beside what drives at present, that make its accelerations a (n,).

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        eq, d, out = self.equations, self.memory, np.zeros(self.equations.n)
        d.rate[: eq.n] = a
        eq.refuse(
            *inverse_dynamics(
                eq.reduced.tables, eq.work, d, q, r, s, eq.drive, eq.wrench, eq.scal,
                self._s_rate, self._made, self._powers, out,
            )
        )  # fmt: skip
        self._point = q, r, s
        return out

    def columns(self, *, solve: bool, fit: bool) -> Array:
        """(nv + ns, nv + n + ns) the derivatives where `forward` (with ``solve``) or `inverse` was called last.

        Columns are changes of the elements of tree and cut joints, left-trivialised, of the tree's rates, of entropies;
        rows are the tree's accelerations (or forces), the cut joints' rates, ṡ.

        Parameters
        ----------
        fit
            Cut joints' elements follow the tree's; else they change on their own.
        """
        eq = self.equations
        out = np.empty((eq.nv + eq.ns, eq.nv + eq.n + eq.ns))
        eq.refuse(
            *jacobian(
                eq.reduced.tables, eq.work, self.memory, self._unread, *self._point, eq.drive, eq.scal,
                self._rows, self._rank, int(fit), int(solve), out,
            )
        )  # fmt: skip
        return out

    def mobility(self) -> Array:
        """(n, n) the derivatives of the tree's accelerations by forces on its freedoms, after `forward`."""
        eq = self.equations
        out = np.empty((eq.n, eq.n))
        by_force(eq.work, self.memory, self._rows, self._rank, out)
        return out

    def action(self, q: Array, r: Array, s: Array) -> tuple[Array, Array]:
        """((n, 2n), (n, 2n)) ∂/∂(q, r) of the momenta ∂L/∂r and of ∂L/∂q with the forces that no potential has.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        eq = self.equations
        momentum, force = np.empty((eq.n, 2 * eq.n)), np.empty((eq.n, 2 * eq.n))
        eq.refuse(
            *action_slopes(
                eq.reduced.tables, eq.work, self.memory, q, r, s, eq.drive, eq.wrench, eq.scal,
                self._s_rate, self._made, self._powers, momentum, force,
            )
        )  # fmt: skip
        return momentum, force

    def pushed(self, drive: Array, wrench: Array) -> Array:
        """(n,) the change of the tree's accelerations under further forces (nv,) on all joints and wrenches (links, 6)
        on the links, after `forward` and `columns`."""
        eq, d, out = self.equations, self.memory, np.empty(self.equations.n)
        d.ddrive[:], d.dwrench[:] = drive, wrench
        by_push(eq.reduced.tables, eq.work, d, self._rows, self._rank, out)
        d.ddrive[:], d.dwrench[:] = 0.0, 0.0
        return out

    @property
    def cut_rates(self) -> Array:
        """(nv − n,) the rates of cut joints where the links' motion was computed last."""
        t, w = self.equations.reduced.tables, self.equations.work
        return np.concatenate([np.zeros(0), *(w.rate[i, : t.dim[i]] for i in range(t.kind.size) if t.kind[i] == CUT)])

    @property
    def entropy_rates(self) -> Array:
        """(entropies,) ṡ in J/(K s) where `forward` or `inverse` was called last."""
        return self._s_rate

    def targets(self, q: Array, r: Array, s: Array) -> tuple[Array, int]:
        """(m,) what the constraints' rows on the accelerations are to be, −(d rows/dt)·r; and the rows' rank."""
        self.forward(q, r, s)
        return self.equations.work.target[: self._rows].copy(), self._rank
