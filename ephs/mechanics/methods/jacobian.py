"""The exact Jacobian of the reduced form."""

from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.apart import columns_of_trees, directions
from ephs.mechanics.tree.engine.slopes import Call, RateSlopes, calls_of
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.systems.kept import once
from ephs.solve.march.records import Status

if TYPE_CHECKING:
    from scipy.sparse import csc_array

RELATIVE = 6e-6
"""Relative length of the central differences in place of tangents: the cube root of rounding."""

MANY, FULL = 400, 0.1
"""Degrees of freedom from which on, and part of the entries up to which matrices are sparse."""
TANGENT, MADE = 8, 100
"""Evaluations that cost as much as one along several directions, and as all else that a matrix takes."""


@final
class Jacobian:
    """∂ẏ/∂y of y = (v, r, heats) at v = 0, by tangents.

    It is made of differences where inputs are Python functions of the state, unless it is sparse and these are soft:
    then their derivatives are left out, and iterations are those of an inexact matrix.
    With ``counts`` the matrices are counted there, as ``jacobians``; ``holding`` is what held contacts in the last one.

    Attributes
    ----------
    sparse
        Whether matrices by tangents are sparse: of many degrees of freedom each of which acts on few others. Where
        surfaces touch they are dense, as are those of compiled steps.
    """

    def __init__(self, equations: ReducedEquations, counts: dict[str, Any] | None = None) -> None:
        self.equations = equations
        self.size = equations.nv + equations.n + equations.ns
        self._counts = {} if counts is None else counts
        self._counts.setdefault("jacobians", 0)
        self._slopes: RateSlopes | None = None
        self._linear: Linearised | None = None
        self.holding = equations.holding
        touches = bool(equations.reduced.tables.support.any()) or equations.problem.descriptor.strikes is not None
        self.sparse = equations.n >= MANY and not touches and self._share <= FULL

    @property
    def cost(self) -> int:
        """Cost of all matrices so far, in evaluations."""
        if self._slopes is None:
            return 0
        return (MADE + TANGENT * self._slopes.calls) * self._counts["jacobians"]

    def at(self, state: ReducedState) -> "Array | csc_array":
        """The matrix (size, size) of a state.

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        self.holding = self.equations.holding
        value = self._by_tangents(state)
        if value is None:
            value = self._by_differences(state)
        elif self.holding is not None and isinstance(value, np.ndarray):
            rates = slice(self.equations.nv, self.equations.nv + self.equations.n)
            value[rates] += self.holding.slopes(state, value[rates])
        self._counts["jacobians"] += 1
        return value

    def _by_tangents(self, state: ReducedState) -> "Array | csc_array | None":
        """By tangents of the rates under the inputs there, where these know no state or, of a sparse matrix, are soft;
        by those of the dense equations where constraints nearly repeat each other."""
        eq = self.equations
        if not (eq.constant or eq.timed or (self.sparse and eq.problem.soft)):
            return None
        if self._slopes is None or self._slopes.engine is not eq.engine:
            self._slopes = RateSlopes(eq.engine, eq.reduced, self._calls, self.size, sparse=self.sparse)
        eq.load(state.t, state.q, state.r, state.heats)
        status, value = self._slopes.at(state.q, eq.vector(state))
        if status == Status.DEPENDENT:
            return self._of_dense(state)
        eq.refuse(status, self._slopes.failed)
        return value

    def _of_dense(self, state: ReducedState) -> Array:
        """By tangents of the dense equations, whose rows are chosen with care; cut joints follow the tree."""
        eq = self.equations
        n, nv, tables = eq.n, eq.nv, eq.reduced.tables
        self._linear = linear = self._linear or Linearised(eq)
        warmth = eq.heats.temperatures(state.heats)
        linear.forward(state.q, state.r, eq.heats.entropies(state.heats))
        columns = linear.columns(solve=True)
        rates, found = np.concatenate([state.r, linear.cut_rates]), eq.dense.residual
        value, heat = np.zeros((self.size, self.size)), slice(nv + n, self.size)
        value[:n, nv : nv + n] = np.eye(n)
        value[n:nv], value[nv : nv + n], value[heat] = columns[n:nv], columns[:n], columns[nv:]
        value[:, heat] /= warmth  # ds = dE/θ, and Ė = θ ṡ
        value[heat] *= warmth[:, None]
        value[heat, heat] += np.diag(found.out[found.entropy_rates] * eq.heats.slopes())
        for i, edge in enumerate(eq.reduced.joints):
            if tables.code[i] != VECTOR:  # v̇ = dexp⁻¹(v) r turns with v: r + ½ [v, r] + …
                where = slice(int(tables.r_at[i]), int(tables.r_at[i] + tables.dim[i]))
                value[where, where] -= 0.5 * edge.pair.manifold.ad(rates[where])
        return value

    @property
    def _calls(self) -> list[Call]:
        """Seeds of the tangents, and the rows and columns of the matrix that each gives."""
        return once(self.equations.reduced, "calls for slopes", self._planned)

    @property
    def _share(self) -> float:
        """Part of the entries that are asked for."""
        return sum(rows.size for _, rows, _, _ in self._calls) / self.size**2

    def _planned(self) -> list[Call]:
        eq, tables = self.equations, self.equations.reduced.tables
        warm = np.flatnonzero(tables.node != -1)  # the environment's temperature is constant
        if not (eq.engine.looped or eq.reduced.attaching.network.attached):
            return calls_of(directions(list(columns_of_trees(tables, eq.nv, eq.n, warm)), self.size))
        columns = [*range(eq.nv + eq.n), *(eq.nv + eq.n + warm).tolist()]
        return calls_of([[(column, np.arange(self.size))] for column in columns])

    def _by_differences(self, state: ReducedState) -> Array:
        """By central differences of the rates."""
        eq, y = self.equations, self.equations.vector(state)
        value = np.zeros((self.size, self.size))
        for j in range(self.size):
            ends = [y.copy(), y.copy()]
            for moved, sign in zip(ends, (1.0, -1.0), strict=True):
                moved[j] += sign * RELATIVE * max(1.0, abs(y[j]))
            rates = [eq.rates(state.t, state.q, moved).copy() for moved in ends]
            value[:, j] = (rates[0] - rates[1])[: self.size] / (ends[0][j] - ends[1][j])
        return value
