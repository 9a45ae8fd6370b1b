"""Methods with known failures, for demonstration in charts only: `simulate` does not accept their names.

Both are for mechanisms whose joints are all revolute, prismatic, screw or cylindrical, without heat; loops are what
they fail at.
"""

from collections.abc import Callable

import numpy as np

from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.registry import MethodEntry, on_joints
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import FOLLOWED
from ephs.show.charts.runs import Array
from ephs.solve.control import Control
from ephs.solve.errors import OptionError, Outcome, SolveError
from ephs.solve.stepping import Attempt

STAGNANT = 1e-9
"""Residual accepted where iterations stagnate."""
SOLVED, DIFFERENCE, ITERATIONS = 1e-12, 1e-7, 20


class _OnLoops(ReducedMethod):
    """Common base: generalised forces and rows of the loops at given coordinates and rates."""

    exponent = 3.0

    def __init__(self, equations: Equations, control: Control) -> None:
        super().__init__(equations, control)
        if equations.curved.size or equations.reduced.tables.driven.any():
            expected = "a scene of revolute, prismatic, screw and cylindrical joints, none prescribed"
            raise OptionError("method", self.name, expected)

    def forces(self, q: Array, r: Array, heats: Array) -> tuple[Array, Array]:
        """∂L/∂r and ∂L/∂q with the forces that no potential has."""
        eq = self.equations
        found = eq.dense.residual
        eq.refuse(*found.about(q, r, eq.heats.entropies(heats), eq.drive, eq.wrench))
        return found.momenta()

    def solved(self, residual: Callable[[Array], Array], guess: Array) -> Array:
        """A root by Newton's method, of least change where equations depend on one another."""
        z, before = guess.copy(), np.inf
        for _ in range(ITERATIONS):
            here = residual(z)
            size = float(np.abs(here).max())
            if not np.isfinite(size):
                break
            if size <= SOLVED or (size <= STAGNANT and size > 0.5 * before):
                return z
            before = size
            columns = [(residual(z + DIFFERENCE * unit) - here) / DIFFERENCE for unit in np.eye(z.size)]
            z = z - least_squares(np.column_stack(columns), here, part=FOLLOWED)
        raise SolveError(Outcome.DIVERGED, "", "")


class VelocityMidpoint(_OnLoops):
    """The midpoint rule with constraints on velocities (index 2): drift of positions is not corrected."""

    name = "velocity-midpoint"

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq, n = self.equations, self.equations.n
        before, _ = self.forces(state.q, state.r, state.heats)
        m = eq.gaps(state.q, state.r)[1].shape[0]

        def residual(z: Array) -> Array:
            r = 0.5 * (state.r + z[:n])
            middle = eq.moved(state.q, 0.5 * h * r)
            _, force = self.forces(middle, r, state.heats)
            rows = eq.gaps(middle, r)[1]
            after, _ = self.forces(eq.moved(state.q, h * r), z[:n], state.heats)
            return np.concatenate([after - before - h * force - rows.T @ z[n:], rows @ r])

        z = self.solved(residual, np.concatenate([state.r, np.zeros(m)]))
        q = eq.fitted(eq.moved(state.q, 0.5 * h * (state.r + z[:n])), z[:n])
        return Attempt(state, ReducedState(state.t + h, q, z[:n], state.heats, state.totals), h, 0.0, 0.0)


class TrapezoidalIndex3(_OnLoops):
    """The trapezoidal rule with constraints on positions alone (index 3): multipliers swing ever more."""

    name = "trapezoidal-index3"

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq, n = self.equations, self.equations.n
        before, pull = self.forces(state.q, state.r, state.heats)
        rows = eq.gaps(state.q, state.r)[1]
        known = state.memory[0] if state.memory else np.zeros(rows.shape[0])

        def residual(z: Array) -> Array:
            q, r = eq.moved(state.q, z[:n]), 2.0 * z[:n] / h - state.r
            after, force = self.forces(q, r, state.heats)
            gap, there = eq.gaps(q, r)
            balance = after - before - 0.5 * h * (pull + force + rows.T @ known + there.T @ z[n:])
            return np.concatenate([balance, gap])

        z = self.solved(residual, np.concatenate([h * state.r, known]))
        rates = 2.0 * z[:n] / h - state.r
        q = eq.fitted(eq.moved(state.q, z[:n]), rates)
        end = ReducedState(state.t + h, q, rates, state.heats, state.totals, (z[n:],))
        return Attempt(state, end, h, 0.0, 0.0)


SPECIMENS = {
    method.name: method
    for method in (
        MethodEntry(
            "velocity-midpoint", 2, False, True, False, True,
            "specimen: constraints on velocities, positions drift", on_joints(VelocityMidpoint),
        ),
        MethodEntry(
            "trapezoidal-index3", 2, False, True, False, True,
            "specimen: constraints on positions, multipliers swing", on_joints(TrapezoidalIndex3),
        ),
    )
}  # fmt: skip
"""Name -> method, for use as values in `simulate`."""
