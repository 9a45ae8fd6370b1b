"""The tangent of explicit Runge-Kutta steps on the reduced form of a scene: the steps over dual numbers.

A step is the map of the method, loops closed at its end, with its length given. What it is evaluated from (elements,
rates, totals; masses, lengths, stiffnesses, …) comes with its derivatives by the parameters.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Never, final

import numpy as np

from ephs.mechanics.methods.explicit import Tableau
from ephs.mechanics.road.charts import TIE
from ephs.mechanics.road.cuts import Cut
from ephs.mechanics.road.records import LinkConstants
from ephs.mechanics.sensitivity.family import (
    CENTRAL,
    OUTER,
    ParameterFamily,
    Stencil,
    difference,
    relation_of,
    same_shape,
)
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.engine.tangents import DIRECTIONS, StepTangent
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import pseudoinverse
from ephs.semantics.stage import Table
from ephs.solve.march.records import Status
from ephs.solve.posing.errors import OptionError, SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.running.stepping import Row

WEIGHTS: Final = {
    "mass": np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
    **{f"inertia[{k}]": np.diag([float(k == i) for i in range(6)]) for k in range(3)},
}
"""Numbers of a body -> its spatial inertia where the number is one and the others are none."""

ROUNDING: Final = 8.0 * np.finfo(float).eps
"""Rounding of the difference of two sums of two numbers, relative to all of them."""
ACTING: Final = ("drive", "wrench", "supply")
"""Tables of what acts from outside."""
TURNED: Final = {
    "reals": (LinkConstants.real_width, slice(LinkConstants.rotation.offset, LinkConstants.rotation.offset + 9)),
    "body": (12, slice(9)),
}
"""Table -> width of its rows, and where these hold rotations: of joints in links, of bodies in links."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class StatePoint:
    """A state and its derivatives by the parameters: (p, coordinates) of elements, (p, size − nv) of rates and totals.

    Derivatives of elements are those of their numbers.
    """

    state: ReducedState
    q: Array
    y: Array

    @property
    def t(self) -> float:
        """The time in s."""
        return self.state.t


@final
class _Unread(Mapping[Path, Array]):
    """Storage for states without readers."""

    def __getitem__(self, path: Path) -> Never:
        raise _StateReadSignal

    def __iter__(self) -> Iterator[Path]:
        raise _StateReadSignal

    def __len__(self) -> int:
        raise _StateReadSignal


def _whole(of: ReducedEquations, at: ReducedState) -> Array:
    """All numbers of a state but the increments of a step."""
    return np.concatenate([at.q, of.vector(at)[of.nv :]])


class _StateReadSignal(Exception):
    """A function of time has read a state."""


@final
class ExplicitTangent:
    """Steps of a method with their tangents, for one family.

    Attributes
    ----------
    tangents
        Numbers of parameters, and steps with derivatives by these, after a start.
    """

    def __init__(self, family: ParameterFamily, t0: float, method: Tableau) -> None:
        self.family, self.t0, self.method = family, t0, method
        self.equations = ReducedEquations(family.problem, t0)
        if self.equations.prescribed.changing:
            raise OptionError("motion", "one that changes with time", "constant rates; ephs.sweep takes others")
        self._others: dict[tuple[int, float], tuple[Problem, ReducedEquations, ReducedState]] = {}
        self._stencils: dict[int, Stencil] = {}
        self.tangents: list[tuple[slice, StepTangent]] = []

    # ---- steps -------------------------------------------------------------------------------------------------

    def start(self) -> StatePoint:
        """The initial state."""
        return self._closed(self.begin())

    def begin(self) -> StatePoint:
        """The initial state, whose derivatives may open its loops."""
        eq, count = self.equations, len(self.family.parameters)
        state = eq.start(self.t0)
        if not (eq.constant or eq.held):
            self._of_time(self.t0)
        size = state.q.size + eq.vector(state).size - eq.nv
        weights = [self._weighed(j) for j in range(count)]
        slopes = np.array(
            [
                np.zeros(size) if weight is not None else self._by(j, lambda of, at: _whole(of, at))
                for j, weight in enumerate(weights)
            ]
        )
        point = StatePoint(state, slopes[:, : state.q.size], slopes[:, state.q.size :])
        for first in range(0, count, DIRECTIONS):
            which = slice(first, min(first + DIRECTIONS, count))
            relation = partial(relation_of, self.family.problem.descriptor)
            made = StepTangent(eq.engine, relation, self.method.arrays, corrected=not eq.led.counting)
            for k, j in enumerate(range(which.start, which.stop)):
                if (weight := weights[j]) is not None:
                    made.slopes["reals"][..., k] = weight
                    continue
                for name in made.slopes:
                    made.slopes[name][..., k] = self._by(j, lambda of, _, name=name: self._numbers(of, name))
            self.tangents.append((which, made))
        return point

    def step(self, point: StatePoint, h: float) -> StatePoint:
        """One step of h seconds."""
        eq, base = self.equations, point.state
        if eq.held:
            self._act(base.t, {})
        out = StatePoint(base, np.empty_like(point.q), np.empty_like(point.y))
        for which, tangent in self.tangents:
            self._put(tangent, point, which, "base", "start")
            status = tangent.step(h) if eq.constant or eq.held else self._staged(tangent, base.t, h)
            self._refuse(status)
            state = self._taken(tangent, out, which, base.t + h)
            out = replace(out, state=state)
        return out

    def _closed(self, point: StatePoint) -> StatePoint:
        out = StatePoint(point.state, np.empty_like(point.q), np.empty_like(point.y))
        for which, tangent in self.tangents:
            self._put(tangent, point, which, "q", "y")
            self._refuse(tangent.close())
            self._taken(tangent, out, which, point.t)
        return out

    def _staged(self, tangent: StepTangent, t: float, h: float) -> int:
        """One step with inputs that are functions of time: stage by stage."""
        a, c, start, y = self.method.arrays["a"], self.method.c, tangent.pairs["start"], tangent.pairs["y"]
        count = a.shape[1]
        first, rates = [array.copy() for array in start], [list[Array](), list[Array]()]
        for i in range(count + 1):
            for part in range(2):
                grown = sum((h * weight * k for weight, k in zip(a[i], rates[part], strict=False)), np.zeros(1))
                start[part][:] = first[part] + grown
            if i == count:
                break
            self._of_time(t + c[i] * h)
            if status := tangent.rates():
                return status
            for part in range(2):
                rates[part].append(tangent.stage[part].copy())
        for part in range(2):
            y[part][:], start[part][:] = start[part], first[part]
            tangent.pairs["k"][part][:count] = rates[part]
        return tangent.settle(h)

    def _of_time(self, t: float) -> None:
        """Put inputs in place that are functions of time.

        Raises
        ------
        OptionError
            One reads the state, as loads do that keep their direction while bodies turn.
        """
        try:
            self._act(t, _Unread())
        except (SolveError, _StateReadSignal) as error:
            if isinstance(error, _StateReadSignal) or isinstance(error.__cause__, _StateReadSignal):
                known = "functions of time, or constants; loads in world axes and pressures read it"
                raise OptionError("inputs", "a function that reads the state", known) from error
            raise

    def _act(self, t: float, states: Mapping[Path, Array]) -> None:
        """Put inputs in place, of the neighbours too, whose parameters may act on inputs: drives, points of forces."""
        neighbours = [of for _, of, _ in self._others.values()]
        for of in (self.equations, *neighbours):
            of.given.place(t, states)
        beside = {number for number, _ in self._others}
        for which, tangent in self.tangents:
            for k, j in enumerate(range(which.start, which.stop)):
                for name in ACTING if j in beside else ():
                    tangent.slopes[name][..., k] = self._by(j, lambda of, _, name=name: self._numbers(of, name))

    def _put(self, tangent: StepTangent, point: StatePoint, which: slice, elements: str, others: str) -> None:
        nv, q, y = self.equations.nv, tangent.pairs[elements], tangent.pairs[others]
        used = which.stop - which.start
        q[0][:], y[0][:] = point.state.q, self.equations.vector(point.state)
        q[1][:, :used], y[1][:] = point.q[which].T, 0.0
        y[1][nv:, :used] = point.y[which].T

    def _taken(self, tangent: StepTangent, out: StatePoint, which: slice, t: float) -> ReducedState:
        """The state that a step ended in; its derivatives go to a point."""
        eq, q, y = self.equations, tangent.pairs["q"], tangent.pairs["y"]
        used = which.stop - which.start
        out.q[which], out.y[which] = q[1][:, :used].T, y[1][eq.nv :, :used].T
        r, heats, totals = np.split(y[0][eq.nv :], [eq.n, eq.n + eq.ns])
        return ReducedState(t, q[0].copy(), r.copy(), heats.copy(), totals.copy())

    def _refuse(self, status: int) -> None:
        if status == Status.DEPENDENT:
            raise OptionError("method", self.method.name, "a motion whose constraints do not nearly repeat each other")
        self.equations.refuse(status, self.equations.engine.failed)

    # ---- inertia -----------------------------------------------------------------------------------------------

    def _weighed(self, number: int) -> Array | None:
        """The derivative of the links' numbers by a mass or a moment of inertia, which change nothing else that steps
        of a tree read; None for other parameters, and where loops close."""
        eq, parameter = self.equations, self.family.parameters[number]
        body, _, entry = parameter.path.rpartition(".")
        own = [i for i, name in enumerate(eq.reduced.bodies) if name is not None and f"bodies.{name}" == body]
        if entry not in WEIGHTS or len(own) != 1 or eq.engine.looped or not parameter.value > 0.0:
            return None
        tables, unit = eq.reduced.tables, WEIGHTS[entry]
        if not np.all(tables.inertia[own[0]][unit > 0.0] == parameter.value):
            return None
        changed = tables.inertia.copy()
        changed[own[0]] += parameter.value * unit
        more = links_of(replace(eq.reduced, tables=tables._replace(inertia=changed))).packed(np.zeros(3)).reals
        base = links_of(eq.reduced).packed(np.zeros(3)).reals
        return (more - base) / parameter.value if np.array_equal(base, eq.engine.tables["reals"]) else None

    # ---- neighbours --------------------------------------------------------------------------------------------

    def _by(self, number: int, function: Any) -> Array:
        """The derivative of a function of (equations, initial state) by a parameter."""
        step = self.family.parameters[number].step
        return difference(lambda e: function(*self._other(number, e)[1:]), self._stencil(number), step)

    def _stencil(self, number: int) -> Stencil:
        """Neighbours for derivatives of tables: the two outer ones where these show that the parameter is a
        coordinate of a tree, or shifts places in its links, whose inertia is of degree two in them."""
        if number not in self._stencils:
            parameter = self.family.parameters[number]
            outer = not self.equations.engine.looped and parameter.tables is CENTRAL and self._shifts(number)
            self._stencils[number] = OUTER if outer else parameter.tables
        return self._stencils[number]

    def _shifts(self, number: int) -> bool:
        """Whether a parameter is a coordinate itself, or changes places and inertia in links only, no rotations."""
        step, eq = self.family.parameters[number].step, self.equations
        (_, low, before), (_, high, after) = (self._other(number, k * step) for k, _ in OUTER)
        (first, last), apart = (_whole(low, before), _whole(high, after)), (OUTER[1][0] - OUTER[0][0]) * step
        rounding = ROUNDING * (np.abs(first).max(initial=apart) + abs(self.family.parameters[number].value))
        if np.any(np.minimum(np.abs(last - first), np.abs(last - first - apart)) > rounding):
            return False
        for name, value in eq.engine.tables.items():
            if isinstance(value, Table | np.ndarray):
                own, *others = (self._numbers(of, name) for of in (eq, low, high))
                if name in TURNED:
                    width, turned = TURNED[name]
                    own, *others = (each.reshape(-1, width)[:, turned] for each in (own, *others))
                if not all(np.array_equal(own, other) for other in others):
                    return False
        return True

    def _other(self, number: int, offset: float) -> tuple[Problem, ReducedEquations, ReducedState]:
        if (number, offset) not in self._others:
            problem = self.family.at(number, offset)
            found = ReducedEquations(problem, self.t0)
            path = self.family.parameters[number].path
            start = found.start(self.t0)
            for one, other in zip(self.equations.engine.arrays(), found.engine.arrays(), strict=False):
                same_shape(one, other, path)
            self._others[number, offset] = problem, found, start
        return self._others[number, offset]

    def _numbers(self, of: ReducedEquations, name: str) -> Array:
        """The real numbers of a table of a neighbour's engine. Rows that close loops may be any that span the same:
        taken are those that are nearest to this problem's."""
        value = of.engine.tables[name]
        numbers = np.asarray(value.arrays[1] if isinstance(value, Table) else value, dtype=float)
        if name != "cut_numbers" or of is self.equations:
            return numbers
        out, first = numbers.reshape(-1, Cut.real_width).copy(), self.equations.engine.tables[name]
        where = slice(Cut.normal.offset, Cut.normal.offset + 36)
        code = np.asarray(self.equations.engine.tables["cut"]).reshape(-1, Cut.integer_width)[:, Cut.code.offset]
        for row, own, of in zip(out, first.reshape(-1, Cut.real_width), code, strict=True):
            if of == TIE:  # its row is shared with others
                continue
            rows = row[where].reshape(6, 6)
            row[where] = (own[where].reshape(6, 6) @ pseudoinverse(rows) @ rows).ravel()
        return out.ravel()

    # ---- what is kept ------------------------------------------------------------------------------------------

    def size(self, point: StatePoint, number: int) -> float:
        """Change of the state by a unit of a parameter."""
        return float(max(np.abs(point.q[number]).max(initial=0.0), np.abs(point.y[number]).max(initial=0.0)))

    def rows(self, points: list[StatePoint]) -> list[Row]:
        """Records of states."""
        return [self.equations.row(point.state) for point in points]

    def beside(self, number: int, model: float, states: float, points: list[StatePoint]) -> tuple[Problem, list[Row]]:
        """The same of states along the tangents by an offset, and the problem of a neighbour by one."""
        problem, eq, _ = self._other(number, model)
        found: list[ReducedState] = []
        for point in points:
            state = point.state
            r, heats, totals = np.split(states * point.y[number], [eq.n, eq.n + eq.ns])
            q = self._normalised(state.q + states * point.q[number])
            found.append(replace(state, q=q, r=state.r + r, heats=state.heats + heats, totals=state.totals + totals))
        return problem, eq.booking.record_of(found, *np.zeros((2, len(found)))).rows

    def _normalised(self, q: Array) -> Array:
        """Elements, their quaternions of length one."""
        reduced, out = self.equations.reduced, q.copy()
        for i, edge in enumerate(reduced.joints):
            where = slice(int(reduced.tables.q_at[i]), int(reduced.tables.q_at[i] + reduced.tables.q_size[i]))
            out[where] = edge.pair.manifold.normalise(q[where])
        return out
