"""The generalised-α method on Lie groups: order 2, damps motions that the step does not resolve, to ρ∞ a step.

Chung and Hulbert, *J. Appl. Mech.* 60 (1993), 371-375; on groups Brüls, Cardona and Arnold, *Mech. Mach. Theory* 48
(2012), 121-137. Here on the reduced form: accelerations are those along the constraints, loops are closed after each
step. Heats follow by the trapezoidal rule and the energies, see `Heats`. A state's memory holds ẏ there, and the mean
acceleration.
"""

from dataclasses import replace
from typing import Any, final

import numpy as np
from scipy.linalg import lu_solve

from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.finding.naming import counted
from ephs.semantics.bundle import Array
from ephs.solve.control import Control
from ephs.solve.errors import OptionError, Outcome, SolveError, number_of
from ephs.solve.methods.factors import factors
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt

CONSTANT = 1e-6
"""Tolerance of the equations of a constant step, relative to its change: well below the error of order 2."""
ITERATIONS = 20
ROUNDING = 1e-14


@final
class Alpha(ReducedMethod):
    """The method on one mechanism.

    Parameters
    ----------
    rho
        ρ∞, what is left after a step of a mode that is far too fast for it: 1 nothing damped, 0 all.
    keep
        ``"damping"``, what it takes from fast modes is missing in the balance; or ``"energy"``, which a correction
        gives back to the motion; or ``"energy and momenta"``.
    """

    name = "alpha"
    exponent = 3.0
    share = 1.0

    def __init__(self, equations: Equations, control: Control, rho: float = 0.8, keep: str = "damping") -> None:
        self._keep = keep
        if not 0.0 <= number_of("options['rho']", rho, "a number from 0 to 1") <= 1.0:
            raise OptionError("options['rho']", rho, "a number from 0 to 1")
        super().__init__(equations, control)
        equations.accounts.keep(keep, ("damping",))
        self._m, self._f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self._gamma = 0.5 + self._f - self._m
        self._beta = 0.25 * (0.5 + self._gamma) ** 2
        self._enough = 1e-4 if control.step is None else CONSTANT
        # acceptable where iterations stagnate: a hundredth of a tolerance near rounding is unattainable
        self._rough = max(1e-2, ROUNDING / max(float(np.min(self.rtol, initial=1.0)), ROUNDING))
        self.counts = {"iterations": 0, "rho": rho, "keep": keep}
        self.jacobian = Jacobian(equations, self.counts)

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq = self.equations
        nv, n, ns = eq.nv, eq.n, eq.ns
        y0 = eq.vector(state)
        if state.memory:
            before, mean = state.memory
        else:  # at a start the mean acceleration is the true one
            before = eq.rates(state.t, state.q, y0)
            mean = before[nv : nv + n]
        rate, fall = slice(nv, nv + n), slice(nv + n, nv + n + ns)
        solver, across = self._solver(state, h)
        tree, moved_on = np.arange(n), np.zeros(nv - n)
        mean1, rates = mean.copy(), before.copy()
        y1, last, moved, worst = y0.copy(), np.inf, np.inf, np.zeros(2 * n + ns)
        for _ in range(ITERATIONS):
            y1[tree] = h * y0[rate] + h * h * ((0.5 - self._beta) * mean + self._beta * mean1)
            y1[n:nv] = 0.5 * h * (before[n:nv] + rates[n:nv]) + moved_on
            y1[rate] = y0[rate] + h * ((1.0 - self._gamma) * mean + self._gamma * mean1)
            y1[fall] = y0[fall] + 0.5 * h * (before[fall] + rates[fall])
            found = eq.rates(state.t + h, state.q, y1)
            self.counts["iterations"] += 1
            target = (1.0 - self._f) * found[rate] + self._f * before[rate] - self._m * mean
            change = lu_solve(solver, (1.0 - self._m) * mean1 - target, check_finite=False)
            drift = 0.5 * h * (found - rates)
            rates = found
            mean1 -= change
            moved_on = -across @ change
            scale = self.atol + self.rtol * eq.sizes(y0, y1)
            parts = np.concatenate([self._beta * h * h * change, self._gamma * h * change, drift[fall]])
            worst = np.abs(parts) / scale
            moved = float(np.max(worst, initial=0.0))
            if not np.isfinite(moved) or moved <= self._enough or (moved > 0.5 * last and moved <= self._rough):
                break
            last = moved
        if not moved <= self._rough:
            if self.jacobian.fresh(state):
                path, what = counted(eq.reduced, int(np.argmax(np.nan_to_num(worst, nan=np.inf))))
                raise SolveError(Outcome.DIVERGED, path, f"{what} at the end of the step")
            self.jacobian.at(state, renew=True)
            return self.step(state, h)
        flows, missed, work, fallen = self._passed(state, y0, y1, before, rates, h)
        closed, allowed = eq.closed(eq.state(state, y1, state.t + h)), self.atol + self.rtol * eq.sizes(y0, y1)
        closed = eq.booking.step(state, closed, flows, work, missed=missed)
        left = 0.0
        if self._keep != "damping":
            closed, left = eq.accounts.corrected(
                state, closed, h, allowed, chosen=self.control.step is None, alone=True
            )
        missed = h * h * (self._beta - 1.0 / 6.0) * (mean1 - mean)
        estimate = np.concatenate([missed, np.zeros(n), fallen])
        error = max(left, float(np.max(np.abs(eq.along(estimate)) / allowed, initial=0.0)))
        return Attempt(state, replace(closed, memory=(rates, mean1)), h, error, eq.least(state, closed))

    def _passed(
        self, state: ReducedState, y0: Array, y1: Array, before: Array, rates: Array, h: float
    ) -> tuple[Array, Array, float, Array]:
        """Flows of the step in J by the trapezoidal rule, by how much that may be off, the work in J, and the error of
        heats and attached states, by Simpson's rule.

        Of a mode that decays within the step heat is between h·√(P⁰P¹), zero where its rate changes sign, and what the
        trapezoidal rule finds: for powers that are squares of rates, twice its difference to the midpoint rule.
        """
        eq = self.equations
        fall, totals = eq.nv + eq.n, eq.nv + eq.n + eq.ns + 2
        work = 0.5 * h * float(before[totals - 1] + rates[totals - 1])
        if not (eq.reduced.made or eq.ns):
            return np.zeros(0), np.zeros(0), work, np.zeros(0)
        middle = 0.5 * (y0 + y1)
        here = eq.rates(state.t + 0.5 * h, state.q, middle)
        bent = h / 3.0 * (before + rates - 2.0 * here)
        first, half, last = (h * rate[totals:] for rate in (before, here, rates))
        flows = 0.5 * (first + last)
        return flows, 2.0 * (flows - half), work, bent[fall : fall + eq.ns]

    def taken(self, state: ReducedState) -> Snapshot:
        """State at which the matrix was made."""
        return {"jacobian": self.jacobian.snapshot(state)}

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        self.jacobian.restore(own["jacobian"], state)

    def _solver(self, state: ReducedState, h: float) -> tuple[Any, Array]:
        """Factors of the matrix of mean accelerations, and by how much these move cut joints, whose forces count."""
        eq = self.equations
        whole = self.jacobian.at(state)
        cut, rate = slice(eq.n, eq.nv), slice(eq.nv, eq.nv + eq.n)
        moved, turned = self._beta * h * h, self._gamma * h
        across = 0.5 * h * (moved * whole[cut, : eq.n] + turned * whole[cut, rate])
        slope = moved * whole[rate, : eq.n] + turned * whole[rate, rate] + whole[rate, cut] @ across
        return factors((1.0 - self._m) * np.eye(eq.n) - (1.0 - self._f) * slope), across
