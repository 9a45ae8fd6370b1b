"""A mechanism by dense matrices: slow, and careful where constraints nearly repeat each other."""

from collections.abc import Callable
from itertools import pairwise
from typing import final

import numpy as np
from scipy.linalg import solve_triangular

from ephs.mechanics.tree.equations.given import Given
from ephs.mechanics.tree.equations.residual import Residual
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.finding.tables import CUT
from ephs.mechanics.tree.sweeps.acting import TOTALS
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.kernel_table import TEMPERATURE
from ephs.semantics.linear.rows import row_program
from ephs.semantics.spaces.rank import CLOSED_SINGULAR, GAP
from ephs.solve.equations.heats import Heats
from ephs.solve.march.records import Status
from ephs.solve.posing.errors import Outcome, SolveError

ROUNDS = 12
SLIP = 1e-2
"""Part of the rates by which constraints may be missed that are left out as repeating others: where they only nearly
repeat them, a rate is missed by as much as the rank decision drops."""

STOPPED = 1e-10
"""Part of the rates before that rounding leaves of constraints where a mechanism is brought to rest."""


def unmoved(reduced: Reduced, freedom: int) -> SolveError:
    """A degree of freedom whose motion no inertia determines."""
    at = reduced.tables.r_at[: reduced.links]
    link = int(np.flatnonzero(at <= freedom)[-1])
    edge, body = reduced.edges[link], reduced.bodies[link]
    name = f"joint {edge.name}" if edge.name else f"body {body}"
    return SolveError(Outcome.UNDETERMINED, str(reduced.path(link)), f"the rate of {name}, which moves no mass")


def require_determined(reduced: Reduced) -> None:
    """Look for links without mass whose motion no mass determines, which rounding may hide from the sweeps.

    Raises
    ------
    SolveError
        There is one.
    """
    if moving := [i for i in reduced.loose if reduced.tables.dim[i]]:
        raise unmoved(reduced, int(reduced.tables.r_at[moving[0]]))


@final
class Dense:
    """Mass matrix, constraints orthogonalised in its metric, and derived matrices.

    Attributes
    ----------
    residual
        The equations; what they found last is in their memory.
    rate, multiplier
        (n,) and (m,) the accelerations and multipliers that `forward` found last: of prescribed rates, then of loops.
    """

    def __init__(self, reduced: Reduced, scal: Array, supply: Array, lead: Array) -> None:
        self.reduced, self.residual = reduced, Residual(reduced, scal, supply)
        t, found, arrays = reduced.tables, self.residual, self.residual.arrays
        self._driven, self._lead, self._led = int(t.driven.sum()), lead, np.flatnonzero(t.driven)
        self._m, self._rank = found.m + self._driven, 0
        closed = [e for e, kind in zip(reduced.edges, t.kind, strict=True) if kind == CUT]
        self._closed = [(edge.path or Path(), f"the loop that {edge.name} closes") for edge in closed]
        self._closed += [(path, f"the gear {path}") for path in reduced.gears]
        m, n, calls = self._m, found.n, row_program().compiled()
        self._scaled, self._triangle = np.zeros((m, n)), np.zeros((m, m))
        self._chosen, self._step = np.zeros(m, dtype=np.int64), np.zeros(max(n, m))
        self._target, self._change = np.zeros(m), np.zeros(n)
        self.rate, self.multiplier = np.zeros(n), np.zeros(m)
        rows = (
            arrays["jacobian"], arrays["terms"], arrays["factor"], self._scaled, np.zeros((m, n)), self._triangle,
            self._chosen,
        )  # fmt: skip
        self._orthonormalise = calls["orthonormalise"].bind(*rows, m)
        self._correct = calls["correct"].bind(*rows, 0, self._target, self._step, self._change)
        self._multipliers = calls["multipliers"].bind(*rows, m, 0, self._step, self.multiplier)

    def mass(self, q: Array, r: Array) -> Array:
        """(n, n) the mass matrix at q."""
        require_determined(self.reduced)
        self._assemble(q, r)
        return self.residual.arrays["mass"].copy()

    def rows(self) -> Array:
        """(m, n) rows of prescribed joints, then of loops, on the tree's rates, where the mass matrix was made last."""
        return self.residual.arrays["jacobian"].copy()

    def gaps(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Position residuals of loops at q, zeros for prescribed joints before them; and the rows (m, n) there."""
        q = self.fitted(q, r)
        residual = np.concatenate([np.zeros(self._driven), self.residual.gaps()[0]])
        self._assemble(q, r)
        return residual, self.rows()

    def fitted(self, q: Array, r: Array) -> Array:
        """q with the cut joints' elements nearest to where their bodies put them."""
        return self.residual.fitted(q, r)

    # ---- dynamics ----------------------------------------------------------------------------------------------

    def forward(self, q: Array, r: Array, s: Array, drive: Array, wrench: Array) -> tuple[int, int]:
        """Accelerations and multipliers, into ``rate`` and ``multiplier``; (status, component)."""
        found = self.residual
        status, component = found.about(q, r, s, drive, wrench)
        if status:
            return status, component
        if still := found.assemble(q, r):
            return int(Status.STILL), still - 1
        bare = found.at(np.zeros(found.n), np.zeros(found.m))
        self._orthonormalised()
        rows = np.concatenate([-self._lead[self._led], bare[found.rows]])
        self.rate[:] = self.solved(-bare[found.forces][:, None], rows[:, None])[:, 0]
        self._target[:] = -rows - found.arrays["jacobian"] @ self._free[:, 0]
        self._corrected(self._target)
        if self._m:
            self._multipliers(self._m, self._rank)
            self.multiplier += found.stiffness * rows
        return 0, 0

    def solved(self, forces: Array, rows: Array) -> Array:
        """M⁻¹(forces + Jᵀλ) with J · that = −rows, column by column, where `forward` or `closed` has been.

        Parameters
        ----------
        forces, rows
            (n, k) and (m, k).
        """
        factor = self.residual.arrays["factor"]
        lower = solve_triangular(factor, forces, lower=True, check_finite=False)
        out = self._free = solve_triangular(factor, lower, lower=True, trans=1, check_finite=False)
        if self._rank:
            chosen = self._chosen[: self._rank]
            target = (-rows - self.residual.arrays["jacobian"] @ out)[chosen]
            step = solve_triangular(self._triangle[np.ix_(chosen, chosen)], target, lower=True, check_finite=False)
            along = self._scaled[chosen].T @ step
            out = out + solve_triangular(factor, along, lower=True, trans=1, check_finite=False)
        return out

    def targets(self) -> tuple[Array, int]:
        """(m,) the accelerations on the rows that `forward` asked for, −(d rows/dt)·r; and the rows' rank."""
        found = self.residual
        bare = found.at(np.zeros(found.n), np.zeros(found.m))[found.rows]
        return np.concatenate([self._lead[self._led], -bare]), self._rank

    def settle(self) -> Array:
        """The residual at the accelerations and multipliers that `forward` found."""
        return self.residual.at(self.rate, self.multiplier[self._driven :])

    def totals(self) -> Array:
        """Rates in W of `TOTALS`, where `forward` has been."""
        prescribed, found = self.residual.arrays["r"][self.reduced.tables.driven == 1], self.residual.powers
        found[1] += float(self.multiplier[: self._driven] @ prescribed)
        return found

    def rates(self, q: Array, y: Array, given: Given, heats: Heats, out: Array) -> tuple[int, int]:
        """Rates of the tree, of the entropies and of the totals, as the engine's; (status, component)."""
        found = self.residual
        n, nv, ns = found.n, found.nv, found.ns
        r, s, at = slice(nv, nv + n), slice(nv + n, nv + n + ns), nv + n + ns
        out[at:] = 0.0
        if (frozen := heats.frozen(y[s])) is not None:
            return TEMPERATURE, frozen
        status, component = self.forward(q, y[r], heats.entropies(y[s]), given.drive, given.wrench)
        if status:
            return status, component
        out[r], out[s] = self.rate, self.settle()[found.entropy_rates] * heats.temperatures(y[s])
        out[at : at + TOTALS], out[at + TOTALS :] = self.totals(), heats.flows(y[s], found.made)
        return 0, 0

    # ---- loops -------------------------------------------------------------------------------------------------

    def closed(self, q: Array, r: Array, motions: Array, moved: Callable[[Array, Array], Array]) -> tuple[Array, Array]:
        """q and r with loops closed and prescribed rates met, by the least change; ``moved(q, change)`` is q·exp.

        Raises
        ------
        SolveError
            The loops do not close near by.
        """
        residual, gap, before = np.zeros(self._m), np.inf, np.inf
        for _ in range(ROUNDS):
            q = self.fitted(q, r)
            residual[self._driven :], gap = self.residual.gaps()
            if gap <= GAP or gap > 0.5 * before:
                break
            before = gap
            self._reduce(q, r)
            q = moved(q, self._corrected(-residual))
        if not gap <= CLOSED_SINGULAR:
            raise self.opened(residual, gap)
        self._reduce(q, r)
        row = self.residual.arrays["jacobian"]
        target = -row @ r
        target[: motions.size] += motions
        change = self._corrected(target)
        left = np.abs(row @ change - target)
        rates = max(np.abs(r + change).max(initial=0.0), np.abs(motions).max(initial=0.0))
        if not left.max(initial=0.0) <= SLIP * rates + STOPPED * np.abs(r).max(initial=0.0):
            raise self._contradicted(left, motions.size)
        return q, r + change

    def carrying(self, q: Array, prescribed: Array, momenta: Array) -> Array:
        """(n,) rates that meet all constraints, with the rates (n,) of driven joints as prescribed, under momenta
        (bodies, 6) in the bodies' frames.

        Raises
        ------
        SolveError
            No mass and no constraint determines a rate.
        """
        self._reduce(q, prescribed)
        rows = np.zeros(self._m)
        rows[: self._driven] = -prescribed[self._led]
        carried = sum((self.residual.twists(i).T @ p for i, p in enumerate(momenta)), np.zeros(self.residual.n))
        return self.solved(carried[:, None], rows[:, None])[:, 0]

    def opened(self, residual: Array, gap: float) -> SolveError:
        """Loop that stays open, by the rows that `gaps` gives."""
        parts = np.split(residual[self._driven :], np.cumsum(self.residual.counts)[:-1])
        sizes = [float(np.abs(part).max(initial=0.0)) for part in parts]
        path, what = self._closed[int(np.argmax(np.nan_to_num(sizes, nan=np.inf)))]
        return SolveError(Outcome.OPEN, str(path), f"{what} stays open by {gap:.1e} m or rad")

    def _contradicted(self, left: Array, driven: int) -> SolveError:
        """Prescribed rate or loop that contradicts the others."""
        worst = int(np.argmax(np.nan_to_num(left, nan=np.inf)))
        if worst < driven:
            places = np.flatnonzero(self.reduced.tables.driven)
            link = int(np.flatnonzero(self.reduced.tables.r_at[: self.reduced.links] <= places[worst])[-1])
            edge = self.reduced.edges[link]
            return SolveError(Outcome.CONTRADICTION, str(edge.path or ""), f"the prescribed rate of {edge.name}")
        failed = self.opened(left, 0.0)
        return SolveError(
            Outcome.CONTRADICTION, failed.path, "the velocities of the loop that it closes, or of its gear"
        )

    def back(self, change: Array) -> Array:
        """Correction of a change of the rates (n,) across the constraints, where loops were closed last."""
        return self._corrected(-self.residual.arrays["jacobian"] @ change)

    def independent(self, q: Array, r: Array) -> list[Array]:
        """Of each cut joint, then of each gear, which of its rows no others imply."""
        self._reduce(q, r)
        chosen = {int(row) - self._driven for row in self._chosen[: self._rank]}
        first = np.cumsum([0, *self.residual.counts])
        return [np.array([j for j in range(b - a) if a + j in chosen], dtype=int) for a, b in pairwise(first)]

    # ---- inside ------------------------------------------------------------------------------------------------

    def _assemble(self, q: Array, r: Array) -> None:
        if found := self.residual.assemble(q, r):
            raise unmoved(self.reduced, found - 1)

    def _orthonormalised(self) -> None:
        self._rank = int(self._orthonormalise()) if self._m else 0

    def _reduce(self, q: Array, r: Array) -> None:
        self._assemble(q, r)
        self._orthonormalised()

    def _corrected(self, target: Array) -> Array:
        """(n,) the least change in the mass metric that changes the rows by a target."""
        if not self._m:
            return np.zeros(self.residual.n)
        self._target[:] = target
        self._correct(self._rank)
        return self._change.copy()
