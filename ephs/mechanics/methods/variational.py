"""The variational midpoint method on the reduced form: symplectic, momentum maps exact or energy, order 2.

The discrete Lagrangian is L_d(q, ξ) = h L(q·exp(ξ/2), ξ/h) (Marsden and West, *Acta Numerica* 10 (2001), 357-514); in
terms of momenta it is a map (q⁰, p⁰) → (q¹, p¹) with

    p⁰ + G(q⁰)ᵀλ = D(−ξ)ᵀ(p̄ − ½h D(−ξ/2)⁻ᵀ g),   p¹ = D(ξ)ᵀ(p̄ + ½h D(ξ/2)⁻ᵀ g) + G(q¹)ᵀμ,   D = dexp⁻¹,

where p̄ = ∂L/∂r and g = ∂L/∂q + f in the middle of the step. λ closes the loops at q¹, μ makes their rates vanish there,
as in RATTLE. Forces f without potential act in the middle, as the discrete principle of Lagrange and d'Alembert says.
"""

from typing import Any, final

import numpy as np

from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.tableaux import MIDPOINT
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.mechanics.tree.finding.naming import counted
from ephs.mechanics.tree.finding.tables import CUT
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.differentials import dexp_left, dexp_left_inv
from ephs.semantics.spaces.rank import CONSTRAINT, TINY
from ephs.solve.posing.errors import Outcome, SolveError, worst_entry
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt

EXACT = 4e-16
"""Smallest attainable residual, relative to its terms: two roundings."""
ITERATIONS = 40
FAR = 1e4
"""Residuals beyond this, relative to momenta or in m, are of an iteration that has gone astray."""
STAGNANT = 1e-11
"""Residual below which stagnation means rounding."""
ROUNDING = 1e-13
"""Residuals below this do not ask for a new matrix: their fall is rounding's, and differs from machine to machine."""


@final
class Variational(ReducedMethod):
    """The method on one mechanism.

    Parameters
    ----------
    keep
        What every step keeps to rounding: ``"momentum"``, of what no force changes; or, by a correction, ``"energy"``,
        or both, ``"energy and momenta"``.
    """

    name = "variational"
    exponent = 3.0

    def __init__(self, equations: ReducedEquations, control: Control, keep: str = "momentum") -> None:
        super().__init__(equations, control)
        equations.accounts.keep(keep, ("momentum",))
        self._keep = keep
        t = equations.reduced.tables
        self._groups = [
            (int(t.code[i]), slice(int(t.r_at[i]), int(t.r_at[i] + t.dim[i])))
            for i in range(equations.reduced.links)
            if t.code[i] != VECTOR
        ]
        self._spaces = [e.pair.manifold for e in equations.reduced.edges[: equations.reduced.links]]
        self._spaces = [space for space in self._spaces if space.code != VECTOR]
        self._driven = np.flatnonzero(t.driven)
        self._linear = Linearised(equations)
        # springs at cut joints, and what reads their poses, are bent where these are, in the middle of the step too
        read = equations.reduced.attaching.bent >= equations.n
        self._bent = bool(np.any((t.kind == CUT) & (np.maximum(t.spring, t.several) >= 0)) or np.any(read))
        self._rows = equations.dense.residual.m + int(t.driven.sum())
        self._matrix: Array | None = None  # of a step of this length in s: it is larger as a step is shorter
        self._length = 0.0
        self._guess: tuple[Array, Array] | None = None
        self.counts: dict[str, Any] = {"iterations": 0, "jacobians": 0, "keep": keep}

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        return self.tried(state, h, part=False)

    def tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        """One step, or a part of one, after which the matrix of the steps stays."""
        kept = self._matrix, self._length, self._guess
        try:
            return self._step(state, h, part=part)
        finally:
            if part:
                self._matrix, self._length, self._guess = kept

    def _step(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        eq = self.equations
        n = eq.n
        if self._matrix is not None and self._length not in (0.0, h):
            self._matrix = self._matrix * (self._length / h)
        self._length = h
        momentum = eq.mass(state.q, state.r) @ state.r
        before = eq.rows() if self._rows else np.zeros((0, n))
        xi = h * (self._guess[1] if self._guess is not None and self._guess[0] is state.q else state.r)
        try:
            xi, push, middle = self._solved(state, h, momentum, before, xi)
        except SolveError:
            self._matrix = None
            xi, push, middle = self._solved(state, h, momentum, before, h * state.r)
        middle_momentum, force, flows, powers, states = middle
        after = self._turned(xi, middle_momentum + 0.5 * h * self._untwisted(0.5 * xi, force))
        q = eq.moved(state.q, xi)
        mass = eq.mass(q, state.r)
        free = np.asarray(np.linalg.solve(mass, after), dtype=float)
        closed = eq.closed(ReducedState(state.t + h, q, free, state.heats, state.totals, account=state.account))
        if self._driven.size:  # the work of prescribed motions: their impulses at both ends of the step
            impulse = mass @ closed.r - after
            rows = eq.rows()
            second = least_squares(rows.T, impulse, part=CONSTRAINT)[: self._driven.size]
            first = push[: self._driven.size]
            powers[1] += float(first @ state.r[self._driven] + second @ closed.r[self._driven]) / h
        warming = (states - state.heats) / (0.5 * h)
        rates = np.concatenate([np.zeros(eq.nv + n), warming, powers, flows])
        closed = eq.accounts.summed(state, closed, MIDPOINT, rates[None], h, part=part)
        sums = np.array(eq.engine.totals["low" if part else "whole"])
        if self._keep == "momentum":
            eq.row(closed)  # which refuses an end without an energy: steps ask for forces in their middle
        else:
            closed, _ = eq.accounts.corrected(
                state, closed, h, np.full(eq.counted.size, np.inf), chosen=False, alone=True
            )
        self._guess = closed.q, closed.r + (closed.r - state.r) * 0.5
        return Attempt(state, closed, h, 0.0, eq.least(state, closed), sums)

    def taken(self, state: ReducedState) -> Snapshot:
        """The matrix and the length of its step, and the guess of the next step."""
        guess = self._guess[1] if self._guess is not None and self._guess[0] is state.q else None
        return {"matrix": self._matrix, "length": self._length, "guess": guess}

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        self._matrix, self._length = own["matrix"], own.get("length", 0.0)
        self._guess = None if own["guess"] is None else (state.q, own["guess"])

    def _solved(
        self, state: ReducedState, h: float, momentum: Array, before: Array, xi: Array
    ) -> tuple[Array, Array, tuple[Array, ...]]:
        """ξ, the impulses G⁰ᵀλ, and the evaluation at the middle of the step, to rounding."""
        eq, m, n = self.equations, self._rows, xi.size
        push, last, residual = np.zeros(m), np.inf, np.zeros(n)
        middle = self._middle(state, h, xi)
        for iteration in range(ITERATIONS):
            residual = self._start(xi, h, middle) - momentum - before.T @ push
            gap, rows = self._gap(state, xi, h)
            scale = max(float(np.abs(momentum).max(initial=0.0)), abs(h) * float(np.abs(middle[1]).max(initial=0.0)))
            worst = max(
                float(np.abs(residual).max(initial=0.0)) / max(scale, TINY), float(np.abs(gap).max(initial=0.0))
            )
            if not worst < FAR:
                break
            if worst <= EXACT or (worst < STAGNANT and worst > 0.5 * last):
                return xi, push, middle
            if self._matrix is None or (iteration > 3 and worst > max(0.1 * last, ROUNDING)):
                self._matrix = self._slope(state, h, xi, middle)
            try:
                change, impulse = _least(self._matrix, before, rows, -residual, -gap)
            except ArithmeticError as error:
                raise SolveError(Outcome.SINGULAR, "", "") from error
            xi, push = xi + change, push + impulse
            middle = self._middle(state, h, xi)
            self.counts["iterations"] += 1
            last = worst
        path, what = counted(eq.reduced, n + worst_entry(np.abs(residual)))
        raise SolveError(Outcome.DIVERGED, path, f"{what} in the middle of the step")

    def _start(self, xi: Array, h: float, middle: tuple[Array, ...]) -> Array:
        """Momentum at the step's start implied by the middle of the step."""
        momentum, force = middle[:2]
        return self._turned(-xi, momentum - 0.5 * h * self._untwisted(-0.5 * xi, force))

    def _middle(self, state: ReducedState, h: float, xi: Array) -> tuple[Array, ...]:
        """p̄, g, the flows of heat in W, rates of `TOTALS`, and heats, in the middle of a step."""
        eq = self.equations
        q, r = eq.moved(state.q, 0.5 * xi), xi / h
        if self._bent:
            q = eq.fitted(q, r)
        heats, found = state.heats, eq.dense.residual
        flows, plain = np.zeros(len(eq.reduced.made)), eq.heats.plain
        least, last = 2 if eq.ns else 1, np.inf
        for passes in range(1, ITERATIONS):  # temperatures in the middle, by two passes
            eq.load(state.t + 0.5 * h, q, r, heats)
            eq.refuse(*found.about(q, r, eq.heats.entropies(heats), eq.drive, eq.wrench))
            flows = eq.heats.flows(heats, found.made)
            before, heats = heats, state.heats + eq.heats.taken(state.heats, 0.5 * h * flows)[0]
            if plain.any():
                heats[plain] = found.follow(state.heats[plain], before[plain], h)
            moved = float(np.max(np.abs(heats - before)[plain] / np.maximum(np.abs(heats[plain]), TINY), initial=0.0))
            if passes >= least and (moved <= ROUNDING or (moved <= STAGNANT and moved > 0.5 * last)):
                break
            last = moved
        eq.evaluations += 1
        return *found.momenta(), flows, found.powers, heats

    def _gap(self, state: ReducedState, xi: Array, h: float) -> tuple[Array, Array]:
        """Residuals of prescribed joints and loops at the end of the step, and their rows on changes of ξ."""
        eq = self.equations
        if not self._rows:
            return np.zeros(0), np.zeros((0, eq.n))
        residual, rows = eq.gaps(eq.moved(state.q, xi), state.r)
        residual[: self._driven.size] = xi[self._driven] - eq.prescribed.displaced(state.t, state.t + h)
        return residual, rows

    def _slope(self, state: ReducedState, h: float, xi: Array, middle: Any) -> Array:
        """∂p⁰/∂ξ: the mechanism's part exact, that of dexp⁻¹ to first order in ξ, where it does not vanish."""
        eq, n = self.equations, xi.size
        momentum, force = middle[:2]
        q, r = eq.moved(state.q, 0.5 * xi), xi / h
        eq.load(state.t + 0.5 * h, q, r, state.heats)
        by_momentum, by_force = self._linear.action(eq.fitted(q, r), r, eq.heats.entropies(middle[4]), h)
        along = np.eye(n)
        for code, where in self._groups:
            along[where, where] = dexp_left(code, 0.5 * xi[where])
        slopes = [0.5 * whole[:, :n] @ along + whole[:, n:] / h for whole in (by_momentum, by_force)]
        start = momentum - 0.5 * h * self._untwisted(-0.5 * xi, force)
        change = slopes[0] - 0.5 * h * (self._untwisted(-0.5 * xi, slopes[1]) + 0.25 * self._turning(force))
        self.counts["jacobians"] += 1
        return self._turned(-xi, change) - 0.5 * self._turning(start)

    def _turning(self, covector: Array) -> Array:
        """(n, n) the derivative of ad*_ξ of a covector by ξ, joint by joint."""
        out = np.zeros((covector.size, covector.size))
        for space, (_, where) in zip(self._spaces, self._groups, strict=True):
            out[where, where] = np.column_stack([space.ad(unit).T @ covector[where] for unit in np.eye(space.dim)])
        return out

    def _turned(self, xi: Array, covector: Array) -> Array:
        """D(ξ)ᵀ of a covector, joint by joint."""
        out = covector.copy()
        for code, where in self._groups:
            out[where] = dexp_left_inv(code, xi[where]).T @ covector[where]
        return out

    def _untwisted(self, xi: Array, covector: Array) -> Array:
        """D(ξ)⁻ᵀ of a covector, joint by joint."""
        out = covector.copy()
        for code, where in self._groups:
            out[where] = np.linalg.solve(dexp_left_inv(code, xi[where]).T, covector[where])
        return out


def _least(matrix: Array, before: Array, rows: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Changes of ξ and of the impulses; of least norm where rows depend on one another."""
    n, m = matrix.shape[0], rows.shape[0]
    if not m:
        return np.asarray(np.linalg.solve(matrix, first), dtype=float), np.zeros(0)
    # scaled so that impulses and increments count alike
    size = float(np.abs(matrix).max())
    whole = np.block([[matrix / size, -before.T], [rows, np.zeros((m, m))]])
    right = np.concatenate([first / size, second])
    found = np.asarray(least_squares(whole, right, part=CONSTRAINT), dtype=float)
    return found[:n], size * found[n:]
