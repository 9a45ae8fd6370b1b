"""The exact Jacobian of the reduced form, reused while it converges."""

from dataclasses import replace
from typing import Any, final

import numpy as np

from ephs.mechanics.tree.engine.apart import columns_of_trees, directions
from ephs.mechanics.tree.engine.slopes import Call, RateSlopes, calls_of
from ephs.mechanics.tree.engine.tangents import evaluated
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.mechanics.tree.finding.tables import SPRING
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.relations import entry_of
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.stage import Program
from ephs.semantics.systems.kept import once
from ephs.solve.snapshot import Snapshot, like, parts

RELATIVE = 2e-8
"""Relative length of the differences by which inputs that are Python functions of the state are differentiated."""

TANGENT, MADE = 8, 100
"""Evaluations that cost as much as one along several directions, and as all else that a matrix takes."""


@final
class Jacobian:
    """∂ẏ/∂y of y = (v, r, heats) at v = 0: by tangents; of inputs that are functions, by differences of their values.

    With ``counts`` the matrices are counted there, as ``jacobians``; ``holding`` is what held contacts in the last one.
    """

    def __init__(self, equations: Equations, counts: dict[str, Any] | None = None) -> None:
        self.equations = equations
        self.size = equations.nv + equations.n + equations.ns
        self._counts = {} if counts is None else counts
        self._counts["jacobians"] = 0
        tree = equations.constant and not equations.engine.looped
        self._compiled = tree and once(equations.reduced, "recorded", lambda: _recorded(equations))
        self._linear: Linearised | None = None
        self._slopes: RateSlopes | None = None
        self._at: ReducedState | None = None
        self.holding = equations.holding
        self._value = np.zeros((self.size, self.size))

    @property
    def cost(self) -> int:
        """Cost of all matrices of compiled rates so far, in evaluations."""
        if self._slopes is None:
            return 0
        return (MADE + TANGENT * self._slopes.calls) * self._counts["jacobians"]

    def fresh(self, state: ReducedState) -> bool:
        """Whether the matrix was made at this state."""
        return self._at is not None and self._at.q is state.q

    def at(self, state: ReducedState, *, renew: bool = False) -> Array:
        """The matrix (size, size), evaluated on request or if there is none.

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        if self._at is not None and not renew:
            return self._value
        value = self._of_rates(state) if self._compiled else self._dense(state)
        self.holding = self.equations.holding
        if self.holding is not None:
            rates = slice(self.equations.nv, self.equations.nv + self.equations.n)
            value = value.copy()
            value[rates] += self.holding.slopes(state, value[rates])
        self._value, self._at = value, state
        self._counts["jacobians"] += 1
        return value

    def _of_rates(self, state: ReducedState) -> Array:
        """By tangents of the compiled rates of a tree."""
        eq = self.equations
        if self._slopes is None:
            calls, relations = once(eq.reduced, "slopes of rates", lambda: (self._calls(), _at_rest(eq)))
            self._slopes = RateSlopes(eq.engine, relations.__getitem__, calls, self.size)
        eq.load(state.t, state.q, state.r, state.heats)
        status, value = self._slopes.at(state.q, eq.vector(state))
        eq.refuse(status, eq.engine.failed)
        return value

    def _calls(self) -> list[Call]:
        eq, tables = self.equations, self.equations.reduced.tables
        warm = np.flatnonzero(tables.node != -1)  # the environment's temperature is constant
        return calls_of(directions(list(columns_of_trees(tables, eq.nv, eq.n, warm)), self.size))

    def _dense(self, state: ReducedState) -> Array:
        """By tangents of the residual, with components' own derivatives."""
        eq, linear = self.equations, self._linear or Linearised(self.equations)
        self._linear = linear
        n, nv = eq.n, eq.nv
        s, warmth = eq.heats.entropies(state.heats), eq.heats.temperatures(state.heats)
        eq.load(state.t, state.q, state.r, state.heats)
        linear.forward(state.q, state.r, s)
        columns = linear.columns(solve=True, fit=False)
        rates = np.concatenate([state.r, linear.cut_rates])
        value = np.zeros((self.size, self.size))
        value[:n, nv : nv + n] = np.eye(n)
        value[n:nv], value[nv : nv + n], value[nv + n :] = columns[n:nv], columns[:n], columns[nv:]
        heat = slice(nv + n, self.size)  # of entropies so far: ds = dE/θ, and Ė = θ ṡ
        value[:, heat] /= warmth
        value[heat] *= warmth[:, None]
        value[heat, heat] += np.diag(linear.entropy_rates * eq.heats.slopes())
        if not eq.problem.constant:
            value[nv : nv + n] += self._inputs(linear, state)
        t = eq.reduced.tables
        for i, edge in enumerate(eq.reduced.edges):
            if t.kind[i] != SPRING and t.code[i] != VECTOR:  # v̇ = dexp⁻¹(v) r turns with v: r + ½ [v, r] + …
                where = slice(int(t.r_at[i]), int(t.r_at[i] + t.dim[i]))
                value[where, where] -= 0.5 * edge.pair.manifold.ad(rates[where])
        return value

    def snapshot(self, state: ReducedState) -> Snapshot:
        """State at which the matrix was made, and whether that is ``state``."""
        return {"made": parts(self._at), "fresh": self.fresh(state)}

    def restore(self, snapshot: Snapshot, state: ReducedState) -> None:
        """Evaluate the matrix at its former state."""
        self._at, found = None, snapshot["made"]
        if found is not None:
            made = like(state, found)
            self.at(replace(made, q=state.q) if snapshot["fresh"] else made)

    def _inputs(self, linear: Linearised, state: ReducedState) -> Array:
        """(n, size) part of ∂ṙ/∂y from inputs that depend on the state."""
        eq = self.equations
        y = eq.vector(state)[: self.size]
        middle = eq.drive.copy(), eq.wrench.copy()
        changes: list[tuple[Array, Array]] = []
        for j in range(self.size):
            moved = y.copy()
            moved[j] += RELATIVE * max(1.0, abs(y[j]))
            v, r, heats = np.split(moved, [eq.nv, eq.nv + eq.n])
            eq.load(state.t, eq.advance(state.q, v), r, heats)
            by = moved[j] - y[j]
            changes.append(((eq.drive - middle[0]) / by, (eq.wrench - middle[1]) / by))
        eq.drive[:], eq.wrench[:] = middle
        linear.forward(state.q, state.r, eq.heats.entropies(state.heats))
        drive, wrench = (np.moveaxis(np.array(parts), 0, -1) for parts in zip(*changes, strict=True))
        return linear.pushed(drive, wrench)


def _recorded(equations: Equations) -> bool:
    """Whether all components that act have relations in machine code, and not Python's."""
    slots, net = equations.problem.descriptor.components, equations.reduced.attaching.network
    return (
        not net.attached
        and not net.storages
        and all(slots[number].primitive.kernel is not None for number in evaluated(equations.engine.tables))
    )


def _at_rest(equations: Equations) -> dict[int, tuple[Program, str]]:
    """Program and entry of each component's relation at rest."""
    kernels = {
        number: equations.problem.descriptor.components[number].primitive.kernel
        for number in evaluated(equations.engine.tables)
    }
    return {
        number: entry_of(kernel.relation, derivatives=False, rest=True)
        for number, kernel in kernels.items()
        if kernel is not None
    }
