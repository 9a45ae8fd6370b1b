"""Radau IIA of order 5 on the reduced form: stiff, adaptive, loops closed after each step.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8. The stages live in the increments of one step,
y = (v, r, heats), so that the same collocation serves joints on every group; work is its quadrature,
heats follow that and the energies, see `Heats`.
"""

from typing import Any, final

import numpy as np
from scipy.linalg import lu_solve

from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.finding.naming import counted
from ephs.semantics.bundle import Array
from ephs.solve.control import Control
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.factors import factors
from ephs.solve.methods.radau import COEFFICIENTS, DEFECT, GAMMA, NODES, T_INVERSE, VALUES, T
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt

__all__ = ["Implicit"]

ITERATIONS = 10
ROUNDING = 1e-14
FAST = 2e-3
"""A rate of convergence that a new matrix would not better: an exact one costs about as much as an iteration."""
_S6 = 6.0**0.5
_EMBEDDED = np.array([-13.0 - 7.0 * _S6, -13.0 + 7.0 * _S6, -1.0]) / 3.0
_RATE = float((1.0 / VALUES[0]).real)
_INVERSE = np.linalg.inv(COEFFICIENTS)


@final
class Implicit(ReducedMethod):
    """The method on one mechanism."""

    name = "radau"
    exponent = 4.0

    def __init__(self, equations: Equations, control: Control) -> None:
        super().__init__(equations, control)
        if control.step is None:
            # As far as Newton's method is taken, relative to the tolerance: less than the method's own error.
            least = float(np.min(self.rtol, initial=1.0))
            self._enough, self._rough = max(1e-13 / max(least, 1e-13), min(0.03, least**0.5)), 1e-2
        else:  # to rounding, and near changes of rank as far as it goes
            self.rtol, self.atol = np.full_like(self.rtol, ROUNDING), np.full_like(self.atol, ROUNDING)
            self._enough, self._rough = 1.0, 1e5
        self._solvers: tuple[float, Any, Any] | None = None
        self._known: tuple[Array, Array] | None = None
        # Off the constraints the exact matrix grows as one over this: an old one is wrong there by as much.
        self._separation = self.equations.separation()
        self.counts = {"iterations": 0, "factorisations": 0}
        self.jacobian = Jacobian(equations, self.counts)

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq = self.equations
        y0 = eq.vector(state)
        if self._known is None or self._known[0] is not state.q:
            self._known = state.q, eq.rates(state.t, state.q, y0)
        first = self._known[1]
        try:
            stages, passed, fast = self._stages(state, y0, h)
        except SolveError:
            if self.jacobian.fresh(state):
                raise
            self._renew(state)
            stages, passed, fast = self._stages(state, y0, h)
        y1 = y0.copy()
        y1[: self.jacobian.size] += stages[-1]
        end = eq.state(state, y1, state.t + h)
        closed, error = self._closed(state, end, y0, y1, first, stages, h)
        missed = h * (GAMMA * first[eq.size - passed.shape[1] :] + DEFECT @ passed)
        passed = h * (COEFFICIENTS[-1] @ passed)
        closed = eq.booking.step(state, closed, passed[2:], missed[2:], float(passed[1]))
        if not fast or self._turned():
            self._renew(closed)
        return Attempt(state, closed, h, error, eq.least(state, closed))

    def taken(self, state: ReducedState) -> Snapshot:
        """Where the matrix was made, and the step for which it was factorised."""
        return {
            "jacobian": self.jacobian.snapshot(state),
            "separation": self._separation,
            "step": self._solvers[0] if self._solvers is not None else None,
        }

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Take along what `taken` said."""
        self.jacobian.restore(own["jacobian"], state)
        self._separation = own["separation"]
        self._solvers = None
        if own["step"] is not None:
            self._solve(state, own["step"])

    def _turned(self) -> bool:
        """Whether constraints have come nearer to repeating each other, or gone from it, since the matrix was made."""
        found = self.equations.separation()
        if found.shape != self._separation.shape:  # another rank
            return True
        return bool(np.any(np.abs(np.log2(found / self._separation)) > 1.0))

    def _renew(self, state: ReducedState) -> None:
        self.jacobian.at(state, renew=True)
        self._separation = self.equations.separation()
        self._solvers = None

    def _solve(self, state: ReducedState, h: float) -> tuple[Any, Any]:
        if self._solvers is None or self._solvers[0] != h:
            matrix, unit = self.jacobian.at(state), np.eye(self.jacobian.size)
            real = factors(_RATE / h * unit - matrix)
            rest = factors(1.0 / (complex(VALUES[1]) * h) * unit - matrix)
            self._solvers = h, real, rest
            self.counts["factorisations"] += 1
        return self._solvers[1], self._solvers[2]

    def _allowed(self, y0: Array, y1: Array) -> Array:
        return self.atol + self.rtol * self.equations.sizes(y0, y1)

    def _stages(self, state: ReducedState, y0: Array, h: float) -> tuple[Array, Array, bool]:
        """(increments of (v, r, heats) at the stages, rates of the books there, Newton was fast)."""
        eq, size = self.equations, self.jacobian.size
        real, rest = self._solve(state, h)
        stages, rates = np.zeros((3, size)), np.zeros((3, eq.size))
        heat = slice(eq.nv + eq.n, size)
        coldest = eq.heats.coldest(y0[heat])  # an iterate may overshoot, a solution is not below
        worst, before = np.zeros(eq.counted.size), np.inf
        rate = moved = np.inf
        for iteration in range(1, ITERATIONS + 1):
            for i, node in enumerate(NODES):
                y = y0.copy()
                y[:size] += stages[i]
                y[heat] = np.maximum(y[heat], coldest)
                rates[i] = eq.rates(state.t + node * h, state.q, y)
            self.counts["iterations"] += 1
            defect = T_INVERSE @ (rates[:, :size] - _INVERSE @ stages / h)
            pair = lu_solve(rest, defect[1], check_finite=False)
            change = np.real(
                T @ np.array([lu_solve(real, np.real(defect[0]), check_finite=False), pair, np.conj(pair)])
            )
            reached = np.abs(y0)  # what starts from nothing, as heat does, is measured by what it becomes
            reached[:size] += np.abs(stages + change).max(axis=0)
            worst = np.max(np.abs(change[:, eq.counted]) / self._allowed(y0, reached), axis=0, initial=0.0)
            moved = float(np.max(worst, initial=0.0))
            if not np.isfinite(moved):
                break
            stages += change
            if iteration > 1:
                rate = moved / before
                # heats are quadratic in rates: their first change says nothing of convergence
                if rate >= 1.0 and iteration > 2 and moved > max(10.0 * self._enough, self._rough):
                    break
            if moved <= self._enough or (iteration > 1 and moved * rate <= self._enough * (1.0 - min(rate, 0.9))):
                return stages, rates[:, eq.nv + eq.n + eq.ns :], iteration <= 2 or rate < FAST
            if iteration > 2 and rate > 0.5 and moved <= self._rough:  # rounding is all that is left
                return stages, rates[:, eq.nv + eq.n + eq.ns :], False
            before = moved
        if moved <= self._rough:  # near a change of rank the matrix is no good, and the iteration slow
            return stages, rates[:, eq.nv + eq.n + eq.ns :], False
        path, what = counted(eq.reduced, int(np.argmax(np.nan_to_num(worst, nan=np.inf))))
        raise SolveError(Outcome.DIVERGED, path, f"{what} at the stages")

    def _closed(
        self, state: ReducedState, end: ReducedState, y0: Array, y1: Array, first: Array, stages: Array, h: float
    ) -> tuple[ReducedState, float]:
        """The end with its loops closed, and the difference to the embedded method of order 3, filtered by the
        equations as its stiff part must be, relative to what is allowed."""
        eq, size = self.equations, self.jacobian.size
        heat = slice(eq.nv + eq.n, size)
        real, _ = self._solve(state, h)
        rough = _EMBEDDED @ stages / h
        allowed = self._allowed(y0, y1)
        found = lu_solve(real, first[:size] + rough, check_finite=False)
        closed = eq.closed(end)
        error = float(np.max(np.abs(eq.along(found[eq.counted])) / allowed, initial=0.0))
        if error > 1.0:  # again from where it leads: of stiff parts the first estimate is far too large
            moved = y0.copy()
            moved[:size] += found
            moved[heat] = np.maximum(moved[heat], eq.heats.coldest(y0[heat]))
            found = lu_solve(real, eq.rates(state.t, state.q, moved)[:size] + rough, check_finite=False)
            closed = eq.closed(end)
            error = float(np.max(np.abs(eq.along(found[eq.counted])) / allowed, initial=0.0))
        return closed, error
