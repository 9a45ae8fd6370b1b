"""Velocities and joint wrenches of a solution in joint coordinates, by the sweeps that the methods run.

At each kept instant the tree's rates are those nearest to the stored momenta in the mass metric, put on the loops as
the methods put them.
"""

from dataclasses import replace
from functools import cached_property
from typing import final

import numpy as np

from ephs.mechanics.impacts.reading import forces_at, pressing_at
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.motion.batch import adjoint_inverse
from ephs.mechanics.motion.general import GeneralMotion
from ephs.mechanics.motion.moving import ByPath
from ephs.mechanics.motion.transmitted import Transmission
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.equations.impulses import Impulses
from ephs.mechanics.tree.finding.frames import Unplaced, frames_of
from ephs.mechanics.tree.finding.tables import SPRING, TREE
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.posing.errors import OptionError, SolveError
from ephs.solve.posing.problem import Problem, Signal
from ephs.solve.result.solution import Solution
from ephs.solve.running.threads import in_one_thread


@final
class ReducedMotion:
    """The motion of one solution, in joint coordinates.

    Attributes
    ----------
    twists
        Path of a body -> (n, 6) in its frame; rad/s, m/s.
    """

    def __init__(self, solution: Solution, equations: ReducedEquations) -> None:
        self._solution, self._eq = solution, equations
        reduced, t = equations.reduced, equations.reduced.tables
        self._number = {edge.path: i for i, edge in enumerate(reduced.edges) if edge.path is not None}
        inside = np.array(links_of(reduced, apart=True).inside).reshape(-1, 7)
        into = adjoint_inverse(inside)
        self._momenta = into.mT
        self._transmission = Transmission(reduced, inside, into.mT @ t.inertia @ into)
        self._impulses = Impulses(equations, self._transmission.inertia)
        self._states = self._on_loops()
        self._r = np.array([state.r for state in self._states])
        twists = np.array([self._impulses.twists(s.q, s.r) for s in self._states])
        own = np.einsum("lij,nlj->nli", into, twists)
        self.twists = {link.path: own[:, i] for i, link in enumerate(reduced.places) if link.path is not None}

    @staticmethod
    @in_one_thread
    def of(solution: Solution) -> "ReducedMotion | None":
        """The motion of a solution; None if its problem or states have no form in joint coordinates."""
        if solution.problem is None or not len(solution):
            return None
        try:
            return ReducedMotion(solution, ReducedEquations(_at_rest(solution.problem), 0.0, apart=True))
        except (Unplaced, OptionError, SolveError):
            return None

    def rate(self, joint: Path) -> Array:
        """(n, d) of the joint with this box, in the axes of C2."""
        t, i = self._eq.reduced.tables, self._number[joint]
        at, dim = int(t.r_at[i]), int(t.dim[i])
        if t.kind[i] == TREE:
            return self._r[:, at : at + dim]
        return self._slips[:, self._transmission.slip_at[i]][:, :dim]

    def wrench(self, joint: Path) -> Array:
        """(n, 6) of the joint with this box: λ on body 2 in C2, NaN in components that are indeterminate."""
        i = self._number[joint]
        if self._eq.reduced.tables.kind[i] == SPRING:  # it carries neither link: the sweeps include only its force
            return self._general.wrench(joint)
        return self._wrenches[:, i]

    def pressed(self, point: Path) -> tuple[Array, list[Array]]:
        """(n, 3) force of the point of a hard contact with this box on the second body, in world axes; and at each
        instant (3, m) its share of those that balance each other."""
        return self._pressed[point]

    @cached_property
    def _slips(self) -> Array:
        """(n, joints apart from the tree, 6) their rates."""
        return np.array([self._transmission.slips(self._impulses.outward(s.q, s.r)) for s in self._states])

    @cached_property
    @in_one_thread
    def _pressed(self) -> dict[Path, tuple[Array, list[Array]]]:
        """Box of a point of hard contact -> its forces."""
        touching = Touching(self._eq)
        found = [forces_at(self._eq, touching, s, self._rates(k)) for k, s in enumerate(self._states)]
        return {
            Path.of(tuple(path)[:-1]): (np.array([forces[i] for forces, _ in found]), [free[i] for _, free in found])
            for i, path in enumerate(touching.paths)
        }

    @cached_property
    def _general(self) -> GeneralMotion:
        return GeneralMotion(self._solution, frames_of(self._eq.problem.descriptor))

    @cached_property
    @in_one_thread
    def _wrenches(self) -> Array:
        """(n, edges, 6)."""
        out = np.zeros((len(self._states), len(self._eq.reduced.edges), 6))
        work, touching = self._eq.engine.work, Touching(self._eq)
        for k in range(len(self._states)):
            rates = self._rates(k)
            places = work["work"].reshape(self._eq.reduced.links + 1, -1)[:-1]
            given = places, rates.copy(), work["pushed"].copy(), work["force"].copy(), work["pulled"].copy()
            if len(touching):
                self._press(touching, k, *given)
            places, accelerations, *forces = given
            accelerations -= self._eq.prescribed.lead  # which frames have for a bias
            out[k] = self._transmission.wrenches(places, accelerations, *forces)
        return out

    def _press(
        self, touching: Touching, k: int, places: Array, rates: Array, pushed: Array, force: Array, pulled: Array
    ) -> None:
        """Add hard contacts and stops at the k-th instant to accelerations, wrenches on links, and forces."""
        t = self._eq.reduced.tables
        found = pressing_at(self._eq, touching, self._states[k], rates.copy())
        rates += found.rates
        for i, axis, one in zip(found.which.tolist(), found.axes.tolist(), found.forces, strict=True):
            for body, push, moment in touching.acting(i, axis, one):
                pushed[body] += np.concatenate([moment - np.cross(places[body, 9:12], push), push])
            if (stop := touching.pulling(i)) is not None:
                edge = self._number[Path.of(tuple(stop[0])[:-1])]
                (force if t.kind[edge] == TREE else pulled)[int(t.r_at[edge])] += stop[1] * one[0]

    def _rates(self, k: int) -> Array:
        """(n,) accelerations of the tree at the k-th instant."""
        eq, state, inputs = self._eq, self._states[k], self._solution.inputs
        eq.given.put(lambda port: inputs[port].values[k])
        eq.prescribed.place(state.t)
        return eq.unheld(state.q, eq.vector(state))[1][eq.nv : eq.nv + eq.n]

    def _on_loops(self) -> list[ReducedState]:
        """The states at the kept instants: rates by the momenta, loops closed."""
        eq, solution, n = self._eq, self._solution, len(self._solution)
        reduced, t = eq.reduced, eq.reduced.tables
        prescribed = np.zeros((n, eq.n))
        prescribed[:, eq.driven] = [eq.prescribed.rates(time) for time in solution.t]
        q, momenta, own = np.zeros((n, reduced.coordinates)), *np.zeros((2, n, reduced.links, 6))
        for i, edge in enumerate(reduced.joints):
            if edge.state is not None:
                given = solution[edge.state].reshape(n, -1)
                if edge.path is not None and t.code[i] != VECTOR:  # relative poses are kept as coordinates
                    given = np.array([edge.pair.element(row) for row in given])
                q[:, int(t.q_at[i]) : int(t.q_at[i] + t.q_size[i])] = given
        for i, link in enumerate(reduced.places):
            if link.momentum is not None:
                own[:, i] = solution[link.momentum.path]
                momenta[:, i] = own[:, i] @ self._momenta[i].T
        s = [solution[path].reshape(n, -1) for path in reduced.entropies]
        heats = eq.heats.energies(np.hstack([np.zeros((n, 0)), *s]))
        totals = np.zeros(eq.summed)

        def rates(k: int) -> Array:
            found = self._impulses.rates(q[k], prescribed[k], momenta[k])
            return eq.dense.carrying(q[k], prescribed[k], own[k]) if found is None else found

        return [
            eq.closed(ReducedState(time, q[k], rates(k), heats[k], totals))
            for k, time in enumerate(solution.t.tolist())
        ]


def motion_of(solution: Solution) -> ByPath:
    """The motion of a solution in joint coordinates, or by the general form where it has none.

    Raises
    ------
    TypeError
        The solution has lost its problem.
    """
    if solution.problem is None:
        raise TypeError(f"{solution.name} has no problem any more, from which velocities and wrenches follow")
    return ReducedMotion.of(solution) or GeneralMotion(solution, frames_of(solution.problem.descriptor))


def _at_rest(problem: Problem) -> Problem:
    """The problem with zeros for flows that change: their values are known at the kept instants alone.

    Efforts stay, since a rate that follows a function has no form in joint coordinates.
    """
    return replace(
        problem,
        signals={
            path: one
            if one.constant or one.effort
            else Signal(np.zeros(problem.system.interface[path].quantity.space.dim), one.effort)
            for path, one in problem.signals.items()
        },
    )
