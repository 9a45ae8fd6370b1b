"""Between the reduced form and the paper's states: every state of the system from joints' elements, and back."""

from collections.abc import Iterator
from typing import final

import numpy as np

from ephs.mechanics.reduced.mechanism import Reduced
from ephs.mechanics.reduced.sweep_kernels import kinematics
from ephs.mechanics.reduced.table_kernels import ELEMENT, ENTROPY, MOMENTUM, POSE, RELATIVE, paper_rows
from ephs.mechanics.reduced.tables import SPRING, Workspace
from ephs.mechanics.solve.errors import Outcome, SolveError
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3, manifold

__all__ = ["PaperStates"]

NEAR, OFF = 1e-6, 1e-3
"""Initial positions and momenta may differ by this from what the joints make of them, relative to their size where that
is above 1: nodal momenta of some methods do differ, to their order."""


@final
class PaperStates:
    """The map of states for one problem; it shares the scratch memory of its equations."""

    def __init__(self, reduced: Reduced, problem: Problem, work: Workspace) -> None:
        self.reduced, self.problem, self.work = reduced, problem, work
        slots = {slot.path: slot for slot in problem.descriptor.states}
        self._paths: list[Path] = []
        plan: list[tuple[int, int, int, int]] = []
        for path, source, number in self._sources():
            if path in slots:
                self._paths.append(path)
                plan.append((source, number, slots[path].at, slots[path].quantity.space.size))
        self._plan = np.array(plan, dtype=np.int64).reshape(-1, 4)
        self._sign: Array | None = None
        self._rest = problem.descriptor.pack(problem.initial)

    def _sources(self) -> Iterator[tuple[Path, int, int]]:
        """(path, where it comes from, number of the link, edge or entropy) of the states."""
        for number, path in enumerate(self.reduced.entropies):
            yield path, ENTROPY, number
        for number, link in enumerate(self.reduced.places):
            if link.pose is not None:
                yield link.pose.path, POSE, number
            if link.momentum is not None:
                yield link.momentum.path, MOMENTUM, number
        for number, edge in enumerate(self.reduced.edges):
            if edge.path is not None and edge.state is not None:
                spring = self.reduced.tables.kind[number] == SPRING
                yield edge.state, RELATIVE if spring else ELEMENT, number

    def rows(self, q: Array, r: Array, s: Array) -> Array:
        """(rows, point_size) all states, of rows of joints' elements, rates and entropies."""
        out = np.tile(self._rest, (q.shape[0], 1))
        if self._sign is None and q.shape[0]:
            self._sign = np.ones(len(self._paths))
            first = self.rows(q[:1], r[:1], s[:1])[0]
            for k, (source, _, at, _) in enumerate(self._plan.tolist()):
                # a pose has two quaternions: that one which is continuous with the initial one
                if source in (POSE, RELATIVE) and float(first[at : at + 4] @ self._rest[at : at + 4]) < 0.0:
                    self._sign[k] = -1.0
        if self._sign is not None:
            paper_rows(self.reduced.tables, self.work, self._plan, self._sign, q, r, s, out)
        return out

    def at(self, q: Array, r: Array, s: Array) -> dict[Path, Array]:
        """All states of the system."""
        x = self.rows(q[None], r[None], s[None])[0]
        return {path: x[at : at + size] for path, (*_, at, size) in zip(self._paths, self._plan.tolist(), strict=True)}

    def initial(self) -> tuple[Array, Array, Array]:
        """(q, r, s) of the problem's initial states."""
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        q = np.zeros(reduced.coordinates)
        for i, edge in enumerate(reduced.edges):
            if tables.kind[i] != SPRING:
                given = edge.pair.manifold.identity() if edge.state is None else initial[edge.state]
                q[int(tables.q_at[i]) : int(tables.q_at[i] + tables.q_size[i])] = given
        s = np.array([float(initial[path][0]) for path in reduced.entropies])
        return q, self._rates_of(q), s

    def check(self, q: Array, r: Array, s: Array) -> None:
        """Hold the closed initial state against what was given.

        Raises
        ------
        SolveError
            They differ: the initial states contradict the joints.
        """
        made = self.at(q, r, s)
        for slot in self.problem.descriptor.states:
            if slot.path not in made or not slot.quantity.space.dim:
                continue
            given = self.problem.initial[slot.path]
            found = float(np.abs(manifold(slot.quantity.space).increment(made[slot.path], given)).max())
            near = OFF if slot.quantity.parity < 0 else NEAR
            if found > near * max(1.0, float(np.abs(given).max())):
                raise SolveError(Outcome.INCONSISTENT, str(slot.path), f"it is off by {found:.1e}")

    def _rates_of(self, q: Array) -> Array:
        """The tree's rates from the bodies' momenta: from each body to the nearest one with inertia before it."""
        tables, reduced, initial, w = self.reduced.tables, self.reduced, self.problem.initial, self.work
        rates = np.zeros(reduced.freedoms)
        kinematics(tables, w, q, rates)
        twists: dict[int, Array] = {-1: np.zeros(6)}
        for i, link in enumerate(reduced.places):
            if link.momentum is None:
                continue
            twists[i] = np.linalg.solve(tables.inertia[i], initial[link.momentum.path])
            columns: list[Array] = []
            freedoms: list[int] = []
            carried, here = np.eye(6), i
            while here == i or here not in twists:
                d, at = int(tables.dim[here]), int(tables.r_at[here])
                columns.append(carried @ w.motion[here, :d].T)
                freedoms += range(at, at + d)
                carried = carried @ SE3.adjoint(SE3.inverse(w.inner[here]))
                here = int(tables.parent[here])
            own = twists[i] - carried @ twists[here]
            root = _root(tables.inertia[i])  # what hardly has inertia knows little of its twist
            rates[freedoms] = np.linalg.lstsq(root @ np.column_stack(columns), root @ own, rcond=None)[0]
        return rates


def _root(inertia: Array) -> Array:
    """A symmetric root (6, 6) of an inertia, its size taken where it is negative."""
    moments, axes = np.linalg.eigh(inertia)
    return (axes * np.sqrt(np.abs(moments))) @ axes.T
