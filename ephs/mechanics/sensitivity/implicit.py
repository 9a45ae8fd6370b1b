"""The tangent of natural steps, of systems and of scenes in the paper's form.

A step solves F(x⁰, z; p) = 0 for the rates, efforts and multipliers z, and leads to x¹ = x⁰·exp(h w). So its tangent
solves ∂F/∂z dz = −∂F/∂x⁰ dx⁰ − ∂F/∂p with the matrix of Newton's method; the right-hand side, ledgers and x¹ are the
step's own functions over dual numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import final

import numpy as np

from ephs.mechanics.sensitivity.family import ParameterFamily, difference, relation_of, same_shape
from ephs.mechanics.tree.engine.tangents import DIRECTIONS
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import IMPLICIT, TINY
from ephs.semantics.stage import Entry, Evaluator, Integer, Program, Vector
from ephs.solve.equations.model import Evaluation, Model, model_of
from ephs.solve.methods.moves import move_states
from ephs.solve.methods.natural import Natural, NaturalState
from ephs.solve.methods.records import Columns, Scratch
from ephs.solve.methods.residuals import FAULTS, account, evaluated
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import OptionError, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.running.snapshot import parts
from ephs.solve.running.stepping import Row


@final
@dataclass(frozen=True, slots=True, eq=False)
class MethodPoint:
    """A state of the method at a time, and its derivatives by the parameters: (p, point_size), (p, sums)."""

    t: float
    state: NaturalState
    x: Array
    sums: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """A problem, its model, and the energies of that."""

    problem: Problem
    model: Model
    stored: StoredEnergies

    @staticmethod
    def of(problem: Problem, t0: float) -> "_Side":
        model = model_of(problem, t0)
        return _Side(problem, model, StoredEnergies(model))

    def numbers(self, name: str) -> Array:
        """Point at which the equations are evaluated."""
        if name == "scal":
            return self.model.scal(0.0)
        return self.model.input_values() if name == "inputs" else getattr(self.model.tables, name)


@cache
def tangent_program() -> Program:
    """The program of a step's equations and ledgers, and of its end, over dual numbers."""

    def whole(
        on: Evaluator, t: Columns, x: Vector, z: Vector, scal: Vector, inputs: Vector, m: Scratch, sums: Vector
    ) -> Integer:
        fault = evaluated(on, t, x, z, scal, inputs, m, scal[0])
        on.when(on.same(fault, 0), lambda: _counted(on, t, z, scal, inputs, m, sums))
        return fault

    def end(on: Evaluator, t: Columns, x: Vector, z: Vector, scal: Vector, m: Scratch) -> None:
        move_states(on, t, x, scal[0], z, m.v)

    entries = {"whole": Entry(whole), "end": Entry(end)}
    return Program("natural_along", **{name: entry.tangent(directions=DIRECTIONS) for name, entry in entries.items()})


def _counted(on: Evaluator, t: Columns, z: Vector, scal: Vector, inputs: Vector, m: Scratch, sums: Vector) -> None:
    account(on, t, z, scal[0], inputs, m, sums)


@final
class _Along:
    """The equations of one model over a step with derivatives along some directions.

    Attributes
    ----------
    slopes
        Of what the equations are evaluated from, by name: set before steps.
    """

    def __init__(self, side: _Side) -> None:
        model = side.model
        tables, memory = parts(model.tables), parts(model.memory())
        tables["address"] = tables["address"].copy()
        for number in range(tables["address"].size):
            program, entry = relation_of(model.descriptor, number)
            tables["address"][number] = program.tangent(DIRECTIONS).compiled()[entry].address
        given = {name: value for name, value in tables.items() if value.dtype == np.float64}
        given |= {"scal": model.scal(0.0), "inputs": model.input_values()}
        pairs = {name: _pair(value) for name, value in given.items()}
        self.slopes = {name: pair[1] for name, pair in pairs.items()}
        self.x, self.z = _pair(np.zeros(model.descriptor.point_size)), _pair(np.zeros(model.unknowns))
        self.sums = _pair(np.zeros(4 + model.tables.kind.size))
        self.memory = {name: _pair(value) for name, value in memory.items()}
        self._scal = pairs["scal"][0]
        calls, t = tangent_program().compiled(), {**tables, **{name: pairs[name] for name in tables if name in pairs}}
        point = t, self.x, self.z, pairs["scal"]
        self._whole = calls["whole"].bind(*point, pairs["inputs"], self.memory, self.sums)
        self._end = calls["end"].bind(*point, self.memory)

    def whole(self, h: float) -> int:
        """Evaluate the residual and what the step adds to the ledgers; a fault, 0 where there is none."""
        self._scal[0] = h
        self.sums[0][:], self.sums[1][:] = 0.0, 0.0
        return int(self._whole())

    def end(self) -> None:
        """Move the states to the end of the step."""
        self._end()


def _pair(value: Array) -> tuple[Array, Array]:
    return value, np.zeros((*value.shape, DIRECTIONS))


@final
class NaturalTangent:
    """Natural steps with their tangents, for one family."""

    def __init__(self, family: ParameterFamily, t0: float) -> None:
        if not family.problem.constant:
            raise OptionError("inputs", "a function", "constants, with the method natural; or rk54 or rk87, of a scene")
        self.family, self.t0 = family, t0
        self.side = _Side.of(family.problem, t0)
        self.natural, self._evaluation = Natural(self.side.model), Evaluation(self.side.model)
        self._others: dict[tuple[int, float], _Side] = {}
        d = family.problem.descriptor
        self._groups = [(slot, manifold(slot.quantity.space)) for slot in d.states if slot.quantity.space.dim]
        self._makers = np.array([isinstance(slot.primitive, Irreversible) for slot in d.components], dtype=bool)
        self._along: list[tuple[slice, _Along]] = []

    def start(self) -> MethodPoint:
        """The initial state."""
        d, count = self.family.problem.descriptor, len(self.family.parameters)
        found = [self._by(j, lambda of: d.pack(of.problem.initial)) for j in range(count)]
        for first in range(0, count, DIRECTIONS):
            which = slice(first, min(first + DIRECTIONS, count))
            along = _Along(self.side)
            for name, slopes in along.slopes.items():
                for k, j in enumerate(range(which.start, which.stop)):
                    slopes[:, k] = self._by(j, lambda of, name=name: of.numbers(name))
            self._along.append((which, along))
        state = self.natural.init(d.pack(self.family.problem.initial))
        return MethodPoint(self.t0, state, np.array(found), np.zeros((count, state.sums.size)))

    def step(self, point: MethodPoint, h: float) -> MethodPoint:
        """One step of h seconds."""
        after = self.natural.step(point.state, h)
        x0, z, model = point.state.x, after.z[0], self.side.model
        self._sound(*self._evaluation.at(x0, z, h))
        matrix = np.zeros((z.size, z.size))
        np.add.at(matrix, (model.tables.row, model.tables.column), self._evaluation.memory.data)
        dx, dsums = np.empty_like(point.x), np.empty_like(point.sums)
        for which, along in self._along:
            used = which.stop - which.start
            along.x[0][:], along.z[0][:], along.z[1][:] = x0, z, 0.0
            along.x[1][:, :used] = point.x[which].T
            fault = along.whole(h)
            self._sound(fault % FAULTS, fault // FAULTS)
            along.z[1][:] = -self._solved(matrix, along.memory["residual"][1])
            along.whole(h)
            dsums[which] = point.sums[which] + along.sums[1][:, :used].T
            along.end()
            dx[which] = along.x[1][:, :used].T
        return MethodPoint(point.t + h, after, dx, dsums)

    def _sound(self, status: int, component: int) -> None:
        if status:
            raise SolveError.of_component(status, self.side.model, component)

    def _solved(self, matrix: Array, right: Array) -> Array:
        """Least-norm where constraints repeat each other."""
        rows = np.maximum(np.abs(matrix).max(axis=1, initial=0.0), TINY)[:, None]
        if not self.natural.redundant:
            try:
                return np.asarray(np.linalg.solve(matrix / rows, right / rows), dtype=float)
            except np.linalg.LinAlgError:
                pass
        return np.asarray(least_squares(matrix / rows, right / rows, part=IMPLICIT), dtype=float)

    def _by(self, number: int, function: Callable[[_Side], Array]) -> Array:
        """The derivative of what a model is evaluated from by a parameter."""
        step, stencil = self.family.parameters[number].step, self.family.parameters[number].tables
        return difference(lambda e: function(self._other(number, e)), stencil, step)

    def _other(self, number: int, offset: float) -> _Side:
        if not offset:
            return self.side
        if (number, offset) not in self._others:
            found = _Side.of(self.family.at(number, offset), self.t0)
            for name in ("parameters", "row"):
                one, other = getattr(self.side.model.tables, name), getattr(found.model.tables, name)
                same_shape(one, other, self.family.parameters[number].path)
            self._others[number, offset] = found
        return self._others[number, offset]

    # ---- what is kept ------------------------------------------------------------------------------------------

    def size(self, point: MethodPoint, number: int) -> float:
        """Change of the state by a unit of a parameter."""
        return float(np.abs(point.x[number]).max(initial=0.0))

    def rows(self, points: list[MethodPoint]) -> list[Row]:
        """Records of states."""
        return self._rows(self.side, [(p.state.x, p.state.sums) for p in points])

    def beside(self, number: int, model: float, states: float, points: list[MethodPoint]) -> tuple[Problem, list[Row]]:
        """The same of states along the tangents by an offset, and the problem of a neighbour by one."""
        side = self._other(number, model)
        states_and_sums = [
            (self._moved(p.state.x + states * p.x[number]), p.state.sums + states * p.sums[number]) for p in points
        ]
        return side.problem, self._rows(side, states_and_sums)

    def _moved(self, x: Array) -> Array:
        """States, their quaternions of length one."""
        for slot, group in self._groups:
            x[slot.point] = group.normalise(x[slot.point])
        return x

    def _rows(self, side: _Side, of: list[tuple[Array, Array]]) -> list[Row]:
        return [Row(x, np.where(self._makers, sums[4:], side.stored.energies(x)), sums[:4]) for x, sums in of]
