"""A mechanism by dense matrices: slow, and careful where constraints nearly repeat each other."""

from collections.abc import Callable
from itertools import pairwise
from typing import final

import numpy as np

from ephs.mechanics.reduced.given import Given
from ephs.mechanics.reduced.loop_kernels import accelerate, constraint_rows, correct, loop_gaps, reduce_rows
from ephs.mechanics.reduced.mechanism import Reduced
from ephs.mechanics.reduced.sweep_kernels import inertia_sweep, kinematics
from ephs.mechanics.reduced.tables import CUT
from ephs.mechanics.solve.errors import Outcome, SolveError
from ephs.mechanics.solve.heats import Heats
from ephs.semantics.bundle import Array
from ephs.semantics.kernel_table import TEMPERATURE
from ephs.semantics.spaces.rank import CLOSED_SINGULAR, GAP

__all__ = ["Dense", "unmoved"]

ROUNDS = 12
SLIP = 1e-2
"""Part of the rates by which constraints may be missed that are left out as repeating others: where they only nearly
repeat them, a rate is missed by as much as the rank decision drops."""


def unmoved(reduced: Reduced, freedom: int) -> SolveError:
    """A freedom whose motion no inertia determines."""
    at = reduced.tables.r_at[: reduced.links]
    link = int(np.flatnonzero(at <= freedom)[-1])
    edge, body = reduced.edges[link], reduced.bodies[link]
    name = f"joint {edge.name}" if edge.name else f"body {body}"
    return SolveError(Outcome.UNDETERMINED, str(reduced.path(link)), f"the rate of {name}, which moves no mass")


@final
class Dense:
    """The mass matrix by composite inertias, constraints orthogonalised in its metric, and what follows from both.

    Attributes
    ----------
    work
        Scratch memory: what the last sweep found.
    """

    def __init__(self, reduced: Reduced) -> None:
        self.reduced, self.work = reduced, reduced.workspace(dense=True)
        t = reduced.tables
        self._m, self._rank = int(t.rows.sum() + t.driven.sum()), 0
        self._cut = [i for i in range(len(reduced.edges)) if t.kind[i] == CUT]

    def mass(self, q: Array, r: Array) -> Array:
        """(n, n) the mass matrix at q."""
        kinematics(self.reduced.tables, self.work, q, r)
        self._sweep()
        return self.work.mass.copy()

    def rows(self) -> Array:
        """(m, n) rows of prescribed joints, then of loops, on the tree's rates, where the mass matrix was made last."""
        return self.work.row[: int(constraint_rows(self.reduced.tables, self.work))].copy()

    def gaps(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Position residuals of loops at q, zeros for prescribed joints before them; and the rows (m, n) there."""
        residual = np.zeros(self._m)
        loop_gaps(self.reduced.tables, self.work, self.fitted(q, r), residual)
        self._sweep()
        return residual, self.rows()

    def fitted(self, q: Array, r: Array) -> Array:
        """q with the cut joints' elements nearest to where their bodies put them; leaves the sweep at q."""
        tables, w = self.reduced.tables, self.work
        out = np.array(q)
        kinematics(tables, w, out, r)
        for i in self._cut:
            where = slice(int(tables.q_at[i]), int(tables.q_at[i] + tables.q_size[i]))
            out[where] = self.reduced.edges[i].pair.fit(w.relative[i], out[where])
        return out

    def rates(self, q: Array, y: Array, given: Given, heats: Heats, scal: Array, out: Array) -> tuple[int, int]:
        """Rates of the tree, of the entropies and of the books, as the engine's; (status, component)."""
        n, nv, ns = self.reduced.freedoms, given.drive.size, len(self.reduced.entropies)
        r, s, at = slice(nv, nv + n), slice(nv + n, nv + n + ns), nv + n + ns
        out[at:] = 0.0
        if (frozen := heats.frozen(y[s])) is not None:
            return TEMPERATURE, frozen
        status, component = accelerate(
            self.reduced.tables, self.work, q, y[r], heats.entropies(y[s]), given.drive, given.wrench, scal,
            out[r], out[s], out[at + 2 :], out[at : at + 2],
        )  # fmt: skip
        out[at + 2 :] = heats.flows(y[s], out[at + 2 :])
        out[s] *= heats.temperatures(y[s])
        return int(status), int(component)

    def closed(self, q: Array, r: Array, motions: Array, moved: Callable[[Array, Array], Array]) -> tuple[Array, Array]:
        """q and r with loops closed and prescribed rates met, by the least change; ``moved(q, change)`` is q·exp.

        Raises
        ------
        SolveError
            The loops do not close near by.
        """
        tables, w = self.reduced.tables, self.work
        residual, change = np.zeros(self._m), np.zeros(self.reduced.freedoms)
        gap = before = np.inf
        for _ in range(ROUNDS):
            q = self.fitted(q, r)
            gap = float(loop_gaps(tables, w, q, residual))
            if gap <= GAP or gap > 0.5 * before:
                break
            before = gap
            self._reduce()
            correct(w, self._rank, -residual, change)
            q = moved(q, change)
        if not gap <= CLOSED_SINGULAR:
            raise self.opened(residual, gap)
        self._reduce()
        target = -w.row[: self._m] @ r
        target[: motions.size] += motions
        correct(w, self._rank, target, change)
        left = np.abs(w.row[: self._m] @ change - target)
        if not left.max(initial=0.0) <= SLIP * max(
            np.abs(r + change).max(initial=0.0), np.abs(motions).max(initial=0.0)
        ):
            raise self._contradicted(left, motions.size)
        return q, r + change

    def opened(self, residual: Array, gap: float) -> SolveError:
        """Loop that stays open, by the rows that `gaps` gives."""
        rows = self.reduced.tables.rows[self._cut]
        sizes = [
            float(np.abs(part).max(initial=0.0)) for part in np.split(residual[-rows.sum() :], np.cumsum(rows)[:-1])
        ]
        edge = self.reduced.edges[self._cut[int(np.argmax(np.nan_to_num(sizes, nan=np.inf)))]]
        found = f"the loop that {edge.name} closes stays open by {gap:.1e} m or rad"
        return SolveError(Outcome.OPEN, str(edge.path or ""), found)

    def _contradicted(self, left: Array, driven: int) -> SolveError:
        """Prescribed rate or loop that contradicts the others."""
        worst = int(np.argmax(np.nan_to_num(left, nan=np.inf)))
        if worst < driven:
            places = np.flatnonzero(self.reduced.tables.driven)
            link = int(np.flatnonzero(self.reduced.tables.r_at[: self.reduced.links] <= places[worst])[-1])
            edge = self.reduced.edges[link]
            return SolveError(Outcome.CONTRADICTION, str(edge.path or ""), f"the prescribed rate of {edge.name}")
        failed = self.opened(left, 0.0)
        return SolveError(Outcome.CONTRADICTION, failed.path, "the velocities of the loop that it closes")

    def back(self, change: Array) -> Array:
        """Correction of a change of the rates (n,) across the constraints, where loops were closed last."""
        out = np.zeros(change.size)
        correct(self.work, self._rank, -self.work.row[: self._m] @ change, out)
        return out

    def independent(self, q: Array, r: Array) -> list[Array]:
        """Of each cut joint, which of its rows no others imply."""
        kinematics(self.reduced.tables, self.work, q, r)
        self._reduce()
        driven = int(self.reduced.tables.driven.sum())
        chosen = {int(row) - driven for row in self.work.chosen[: self._rank]}
        first = np.cumsum([0, *self.reduced.tables.rows[self._cut]])
        return [np.array([j for j in range(b - a) if a + j in chosen], dtype=int) for a, b in pairwise(first)]

    def _sweep(self) -> None:
        found = inertia_sweep(self.reduced.tables, self.work)
        if found != 0:
            raise unmoved(self.reduced, int(found) - 1)

    def _reduce(self) -> None:
        self.work.load[:] = 0.0
        self._sweep()
        constraint_rows(self.reduced.tables, self.work)
        self._rank = int(reduce_rows(self.work, self._m))
