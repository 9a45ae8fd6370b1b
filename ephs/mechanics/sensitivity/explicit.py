"""The tangent of explicit Runge-Kutta steps on the reduced form of a scene.

A step is the map of the method, loops closed at its end, with its length given. Its tangent takes the derivative of
every stage: of the equations along the stage's own tangent, by differences of fourth order over a thousandth of the
state's size, and by the parameters, see `Family`. Increments of elements are left-trivialised.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.sensitivity.family import CENTRAL, Family, difference, same_shape
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.finding.tables import SPRING
from ephs.semantics.bundle import Array
from ephs.solve.problem import Problem
from ephs.solve.stepping import Row

__all__ = ["ExplicitTangent"]

SMALL = 1e-3
"""Step along a tangent, in rad, m, or relative to the rates."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """A state and its derivatives by the parameters: (p, nv) of elements, (p, size − nv) of rates and all else."""

    state: ReducedState
    q: Array
    y: Array

    @property
    def t(self) -> float:
        """The time in s."""
        return self.state.t


@final
class ExplicitTangent:
    """Steps of a method with their tangents, for one family."""

    def __init__(self, family: Family, t0: float, method: str) -> None:
        self.family, self.t0, self.method = family, t0, tableau(method)
        self.equations = Equations(family.problem, t0)
        self._others: dict[tuple[int, float], tuple[Problem, Equations]] = {}
        eq = self.equations
        t = eq.reduced.tables
        self._parts = [
            (
                slice(int(t.r_at[i]), int(t.r_at[i] + t.dim[i])),
                slice(int(t.q_at[i]), int(t.q_at[i] + t.q_size[i])),
                edge,
            )
            for i, edge in enumerate(eq.reduced.edges)
            if t.kind[i] != SPRING
        ]

    # ---- steps -------------------------------------------------------------------------------------------------

    def start(self) -> Point:
        """The initial state."""
        state = self.equations.start(self.t0)
        found = [
            self._by(j, lambda of, _: self._joined(state, of.start(self.t0)))
            for j in range(len(self.family.parameters))
        ]
        nv = self.equations.nv
        return Point(state, np.array([x[:nv] for x in found]), np.array([x[nv:] for x in found]))

    def step(self, point: Point, h: float) -> Point:
        """One step of h seconds."""
        eq, a, c = self.equations, self.method.arrays["a"], self.method.c
        base, count = point.state, a.shape[1]
        numbers = range(len(self.family.parameters))
        y0, books = eq.vector(base), slice(eq.nv + eq.n + eq.ns, eq.size)
        dy0 = np.hstack([np.zeros_like(point.q), point.y])
        k, dk = np.zeros((count, eq.size)), np.zeros((count, len(numbers), eq.size))
        for i in range(count):
            y = y0 + h * (a[i, :i] @ k[:i])
            dy = dy0 + h * np.einsum("s,spn->pn", a[i, :i], dk[:i])
            time = base.t + c[i] * h
            k[i] = eq.rates(time, base.q, y)
            for j in numbers:
                dk[i, j] = self._change(
                    j, point.q[j], dy[j], base.q, y, lambda of, q, v, time=time: of.rates(time, q, v)
                )
        y1, dy1 = y0 + h * (a[count] @ k), dy0 + h * np.einsum("s,spn->pn", a[count], dk)
        dy1[:, books] = [self._made(base, j, y0, dy0[j], y1, dy1[j]) for j in numbers]
        end = eq.state(base, y1, base.t + h)
        dq = np.array([self._carried(y1[: eq.nv], point.q[j], dy1[j, : eq.nv]) for j in numbers])
        return self._closed(Point(end, dq, dy1[:, eq.nv :]))

    def _made(self, base: ReducedState, number: int, y0: Array, dy0: Array, y1: Array, dy1: Array) -> Array:
        """The tangent of the books after a step, by those of (v, r, heats, books) before it and of flows in it."""
        size = y0.size

        def counted(of: Equations, _: Array, both: Array) -> Array:
            return of.settled(both[size:], both[:size])[of.nv + of.n + of.ns :]

        along, at = np.concatenate([dy1, dy0]), np.concatenate([y1, y0])
        return self._change(number, np.zeros(self.equations.nv), along, base.q, at, counted)

    def _closed(self, point: Point) -> Point:
        """The state with loops closed, and the tangent of that."""
        eq, end = self.equations, point.state
        closed = eq.closed(end)
        if closed is end:
            return point
        q, y = np.empty_like(point.q), np.array(point.y)
        moving = eq.nv + eq.n
        for j in range(len(point.q)):
            still = np.concatenate([np.zeros(eq.nv), point.y[j]])

            def shut(of: Equations, at: Array, v: Array) -> Array:
                found = of.closed(replace(end, q=at, r=v[eq.nv : moving]))
                return self._joined(closed, found)[:moving]

            change = self._change(j, point.q[j], still, end.q, eq.vector(end), shut)
            q[j], y[j, : eq.n] = change[: eq.nv], change[eq.nv :]
        return Point(closed, q, y)

    # ---- derivatives -------------------------------------------------------------------------------------------

    def _change(
        self,
        number: int,
        dq: Array,
        dy: Array,
        q: Array,
        y: Array,
        function: Callable[[Equations, Array, Array], Array],
    ) -> Array:
        """The derivative of a function of (equations, elements, y) by a parameter and along a tangent: at once, where
        the parameter's neighbours move the state little enough, else one after the other."""
        eq, parameter = self.equations, self.family.parameters[number]
        rates = slice(eq.nv, eq.nv + eq.n)
        heats = slice(rates.stop, rates.stop + eq.ns)
        fast = max(1.0, float(np.abs(y[rates]).max(initial=0.0)))
        size = max(
            float(np.abs(dq).max(initial=0.0)),
            float(np.abs(dy[: eq.nv]).max(initial=0.0)),
            float(np.abs(dy[rates]).max(initial=0.0)) / fast,
            float(np.abs(dy[heats] * eq.heats.slopes() / eq.heats.temperatures(y[heats])).max(initial=0.0)),
        )

        def beside(of: Equations, by: float) -> Array:
            return function(of, eq.advance(q, by * dq) if by else q, y + by * dy)

        if parameter.step * size <= 2.0 * SMALL:
            return self._by(number, lambda of, by: beside(of, by))
        step = SMALL / size
        return difference(lambda k: beside(eq, k * step), CENTRAL, step) + self._by(
            number, lambda of, _: beside(of, 0.0)
        )

    def _by(self, number: int, function: Callable[[Equations, float], Array]) -> Array:
        """The derivative of a function of (equations, offset) by a parameter."""
        step, stencil = self.family.parameters[number].step, self.family.parameters[number].stencil
        return difference(lambda k: function(self._other(number, k * step)[1], k * step), stencil, step)

    def _other(self, number: int, offset: float) -> tuple[Problem, Equations]:
        if not offset:
            return self.family.problem, self.equations
        if (number, offset) not in self._others:
            problem = self.family.at(number, offset)
            found = Equations(problem, self.t0)
            same_shape(self.equations._q, found._q, self.family.parameters[number].path)
            found.start(self.t0)
            self._others[number, offset] = problem, found
        return self._others[number, offset]

    def _joined(self, of: ReducedState, other: ReducedState) -> Array:
        """Another state as increments from one: of elements, then of rates, heats and books as they are."""
        v = np.zeros(self.equations.nv)
        for freedoms, elements, edge in self._parts:
            v[freedoms] = edge.pair.manifold.increment(of.q[elements], other.q[elements])
        return np.concatenate([v, other.r, other.heats, other.books])

    def _carried(self, v: Array, dq: Array, dv: Array) -> Array:
        """The tangent of q·exp(v)."""
        out = np.empty_like(dv)
        for freedoms, _, edge in self._parts:
            group, by = edge.pair.manifold, v[freedoms]
            out[freedoms] = group.adjoint(group.exp(-by)) @ dq[freedoms] + group.dexp_left(by) @ dv[freedoms]
        return out

    # ---- what is kept ------------------------------------------------------------------------------------------

    def size(self, point: Point, number: int) -> float:
        """Change of the state by a unit of a parameter."""
        return float(max(np.abs(point.q[number]).max(initial=0.0), np.abs(point.y[number]).max(initial=0.0)))

    def row(self, point: Point) -> Row:
        """Record of a state."""
        return self.equations.row(point.state)

    def beside(self, number: int, offset: float, points: list[Point]) -> tuple[Problem, list[Row]]:
        """The same of a neighbour, by the tangents; and its problem."""
        problem, eq = self._other(number, offset)
        states: list[ReducedState] = []
        for point in points:
            state, dy = point.state, offset * point.y[number]
            r, heats, books = np.split(dy, [eq.n, eq.n + eq.ns])
            q = eq.advance(state.q, offset * point.q[number])
            states.append(replace(state, q=q, r=state.r + r, heats=state.heats + heats, books=state.books + books))
        return problem, eq.rows_of(states)
