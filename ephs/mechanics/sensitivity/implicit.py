"""The tangent of natural steps, of systems and of scenes in the paper's form.

A step solves F(x⁰, z; p) = 0 for the rates, efforts and multipliers z, and leads to x¹ = x⁰·exp(h w). So its tangent
solves ∂F/∂z dz = −∂F/∂x⁰ dx⁰ − ∂F/∂p with the matrix of Newton's method, exact; the right-hand side is the derivative
of the residual along (dx⁰, dp), by differences of fourth order.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.sensitivity.family import CENTRAL, Family, difference, same_shape
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.rank import IMPLICIT
from ephs.solve.errors import OptionError, SolveError
from ephs.solve.methods.natural import Natural, NaturalState, stored_energies
from ephs.solve.methods.records import Memory
from ephs.solve.model import Evaluation, Model, compile_model
from ephs.solve.problem import Problem
from ephs.solve.stepping import Row

__all__ = ["NaturalTangent"]

SMALL = 1e-3
"""Step along a tangent, relative to states where they are large."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """A state of the method at a time, and its derivatives by the parameters: (p, rates), (p, sums)."""

    t: float
    state: NaturalState
    x: Array
    sums: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """A problem, and the evaluation of its model."""

    problem: Problem
    evaluation: Evaluation

    @staticmethod
    def of(problem: Problem, t0: float) -> "_Side":
        model = compile_model(problem.descriptor, problem.reference, problem.inputs(t0, problem.initial))
        return _Side(problem, Evaluation(model))

    @property
    def model(self) -> Model:
        """The model."""
        return self.evaluation.model

    @property
    def memory(self) -> Memory:
        """What was evaluated last."""
        return self.evaluation.memory

    def whole(self, x: Array, z: Array, h: float) -> Array:
        """The residual, then what the step adds to the ledgers."""
        status, component = self.evaluation.at(x, z, h)
        if status:
            raise SolveError.of_component(status, self.model, component)
        sums = self.evaluation.ledgers(h)
        return np.concatenate([self.memory.residual, sums])


@final
class NaturalTangent:
    """Natural steps with their tangents, for one family."""

    def __init__(self, family: Family, t0: float) -> None:
        if not family.problem.constant:
            raise OptionError("inputs", "a function", "constants, with the method natural; or rk54 or rk87, of a scene")
        self.family, self.t0 = family, t0
        self.side = _Side.of(family.problem, t0)
        self.natural = Natural(self.side.model)
        self._others: dict[tuple[int, float], _Side] = {}
        d = family.problem.descriptor
        self._groups = [(slot, manifold(slot.quantity.space)) for slot in d.states if slot.quantity.space.dim]
        self._makers = np.array([isinstance(slot.primitive, Irreversible) for slot in d.components], dtype=bool)

    def start(self) -> Point:
        """The initial state."""
        d = self.family.problem.descriptor
        x0 = d.pack(self.family.problem.initial)
        found = [
            self._by(j, lambda of, _: self._increment(x0, d.pack(of.problem.initial)))
            for j in range(len(self.family.parameters))
        ]
        state = self.natural.init(x0)
        return Point(self.t0, state, np.array(found), np.zeros((len(found), state.sums.size)))

    def step(self, point: Point, h: float) -> Point:
        """One step of h seconds."""
        after = self.natural.step(point.state, h)
        x0, z, side = point.state.x, after.z, self.side
        n = z.size
        side.whole(x0, z, h)
        t = side.model.tables
        matrix = np.zeros((n, n))
        np.add.at(matrix, (t.row, t.column), side.memory.data)
        d = self.family.problem.descriptor
        changes: list[Array] = []
        for j, tangent in enumerate(point.x):
            changes.append(
                self._change(j, tangent, lambda of, by, u=tangent: of.whole(d.advance(x0, by * u) if by else x0, z, h))
            )
        right = np.array(changes)
        dz = -self._solved(matrix, right[:, :n].T).T
        dx, dsums = np.empty_like(point.x), point.sums + right[:, n:]
        for j in range(len(point.x)):
            size = float(np.abs(dz[j]).max(initial=0.0))
            if size:
                e = SMALL * max(1.0, float(np.abs(z).max())) / size
                dsums[j] += difference(lambda k, e=e, j=j: side.whole(x0, z + k * e * dz[j], h)[n:], CENTRAL, e)
            for slot, group in self._groups:
                v = h * z[slot.rates]
                dx[j, slot.rates] = group.adjoint(group.exp(-v)) @ point.x[j, slot.rates]
                dx[j, slot.rates] += group.dexp_left(v) @ (h * dz[j, slot.rates])
        return Point(point.t + h, after, dx, dsums)

    def _solved(self, matrix: Array, right: Array) -> Array:
        """Least-norm where constraints repeat each other."""
        rows = np.maximum(np.abs(matrix).max(axis=1, initial=0.0), 1e-300)[:, None]
        if not self.natural.redundant:
            try:
                return np.asarray(np.linalg.solve(matrix / rows, right / rows), dtype=float)
            except np.linalg.LinAlgError:
                pass
        return np.asarray(np.linalg.lstsq(matrix / rows, right / rows, rcond=IMPLICIT)[0], dtype=float)

    def _change(self, number: int, dx: Array, function: Callable[[_Side, float], Array]) -> Array:
        """The derivative of a function of (model, share of the tangent) by a parameter and along the tangent: at once,
        where the parameter's neighbours move the state little enough, else one after the other."""
        size = float(np.abs(dx).max(initial=0.0))
        if self.family.parameters[number].step * size <= 2.0 * SMALL:
            return self._by(number, function)
        step = SMALL / size
        along = difference(lambda k: function(self.side, k * step), CENTRAL, step)
        return along + self._by(number, lambda of, _: function(of, 0.0))

    def _by(self, number: int, function: Callable[[_Side, float], Array]) -> Array:
        """The derivative of a function of (model, offset) by a parameter."""
        step, stencil = self.family.parameters[number].step, self.family.parameters[number].stencil
        return difference(lambda k: function(self._other(number, k * step), k * step), stencil, step)

    def _other(self, number: int, offset: float) -> _Side:
        if not offset:
            return self.side
        if (number, offset) not in self._others:
            found = _Side.of(self.family.at(number, offset), self.t0)
            same_shape(self.side.memory.residual, found.memory.residual, self.family.parameters[number].path)
            self._others[number, offset] = found
        return self._others[number, offset]

    def _increment(self, x0: Array, x1: Array) -> Array:
        out = np.zeros(self.family.problem.descriptor.rate_size)
        for slot, group in self._groups:
            out[slot.rates] = group.increment(x0[slot.point], x1[slot.point])
        return out

    # ---- what is kept ------------------------------------------------------------------------------------------

    def size(self, point: Point, number: int) -> float:
        """Change of the state by a unit of a parameter."""
        return float(np.abs(point.x[number]).max(initial=0.0))

    def row(self, point: Point) -> Row:
        """Record of a state."""
        return self._row(self.side.model, point.state.x, point.state.sums)

    def beside(self, number: int, offset: float, points: list[Point]) -> tuple[Problem, list[Row]]:
        """The same of a neighbour, by the tangents; and its problem."""
        side = self._other(number, offset)
        d = side.problem.descriptor
        rows = [
            self._row(side.model, d.advance(p.state.x, offset * p.x[number]), p.state.sums + offset * p.sums[number])
            for p in points
        ]
        return side.problem, rows

    def _row(self, model: Model, x: Array, sums: Array) -> Row:
        return Row(x, np.where(self._makers, sums[4:], stored_energies(model, x)), sums[:4])
