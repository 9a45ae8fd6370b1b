"""A mechanism in joint coordinates: its equations of motion, the closing of its loops, and the paper's states.

What every method on the reduced form shares. A step moves q = q⁰·exp(v): the increments v and all else live in vector
spaces, v̇ = dexp⁻¹(v) r.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.build import component_path, drive_ports, wrench_port
from ephs.mechanics.reduced.loop_kernels import constraint_rows, correct, loop_gaps, reduce_rows
from ephs.mechanics.reduced.mechanism import reduce_scene
from ephs.mechanics.reduced.paper import PaperStates
from ephs.mechanics.reduced.step_kernels import advance, rates, stages
from ephs.mechanics.reduced.sweep_kernels import inertia_sweep, kinematics
from ephs.mechanics.reduced.tables import CUT, SPRING
from ephs.mechanics.scene.geometry import Coupling
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.continuous import Continuous
from ephs.mechanics.solve.control import Tolerance
from ephs.mechanics.solve.errors import Outcome, SolveError
from ephs.mechanics.solve.loop import Row
from ephs.mechanics.solve.model import compile_model
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces.codes import VECTOR

__all__ = ["Equations", "ReducedState"]

GAP = 1e-12
"""Position residuals to which loops are closed, in m and rad."""
CLOSED = 1e-10
"""Residuals above this cannot be accepted."""
ROUNDS = 12
SINGULAR = 20


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReducedState:
    """Where a mechanism is: joints' elements q, rates r of the tree, entropies s, and what was counted since the start.

    Parameters
    ----------
    books
        Heat and work in J, then the entropy that each component made in J/K.
    memory
        What a method takes along from step to step; none after a start.
    """

    t: float
    q: Array
    r: Array
    s: Array
    books: Array
    memory: tuple[Array, ...] = ()


@final
class Equations:
    """The reduced form of one problem. It keeps scratch memory: use one for each thread."""

    def __init__(self, scene: Scene, problem: Problem, t0: float) -> None:
        self.problem = problem
        self.model = model = compile_model(problem.descriptor, problem.reference, problem.inputs(t0, problem.initial))
        self.reduced = reduced = reduce_scene(scene, problem, model)
        self._continuous = Continuous(model)
        self.work = reduced.workspace()
        t = reduced.tables
        self._moving = [i for i in range(len(reduced.edges)) if t.kind[i] != SPRING]
        sizes = [int(t.dim[i]) if t.kind[i] != SPRING else 0 for i in range(len(reduced.edges))]
        self._v_at = np.cumsum([0, *sizes])[:-1].astype(np.int64)
        self._rank = 0
        self._q = np.zeros(reduced.coordinates)
        self.nv, self.n, self.ns = sum(sizes), reduced.freedoms, len(reduced.entropies)
        self.size = self.nv + self.n + self.ns + 2 + len(reduced.made)
        driven = [i for i in range(reduced.links) if t.driven[t.r_at[i] : t.r_at[i] + t.dim[i]].any()]
        self.prescribed = np.array([float(reduced.edges[i].motion or 0.0) for i in driven])
        groups = [i for i in self._moving if t.code[i] != VECTOR]
        self.curved = np.array([self._v_at[i] + j for i in groups for j in range(int(t.dim[i]))], dtype=int)
        self.counted = np.r_[np.arange(self.n), self.nv : self.nv + self.n + self.ns]
        number = {slot.path: i for i, slot in enumerate(problem.descriptor.components)}
        self._makers = np.array([number[path] for path in reduced.made], dtype=int)
        self.scal = model.scal(0.0)
        self.drive = np.zeros(self.nv)
        self.wrench = np.zeros((reduced.links, 6))
        self._ports = self._find_ports(scene)
        self._constant = problem.constant
        self._place_inputs(0.0, None)
        self._paper = PaperStates(reduced, problem, self.work)
        self.evaluations = 0

    # ---- inputs ------------------------------------------------------------------------------------------------

    def _find_ports(self, scene: Scene) -> list[tuple[Path, Any, Any]]:
        """(port, array, where) of each input that is a flow."""
        found: list[tuple[Path, Any, Any]] = []
        links = {name: i for i, name in enumerate(self.reduced.bodies) if name is not None}
        signals = self.problem.signals
        for name, _ in scene.all_bodies():
            if wrench_port(name) in signals:
                found.append((wrench_port(name), self.wrench, links[name]))
        r_at, dim = self.reduced.tables.r_at, self.reduced.tables.dim
        for name, j in scene.all_joints():
            edges = [i for i, e in enumerate(self.reduced.edges) if e.name == name and i in self._moving]
            edges.sort(key=lambda i: self.reduced.edges[i].freedoms.start)
            for (port, _), i in zip(drive_ports(j), edges, strict=True):
                if port in signals and not signals[port].effort:
                    found.append((port, self.drive, slice(int(r_at[i]), int(r_at[i] + dim[i]))))
        return found

    def _place_inputs(self, t: float, state: Mapping[Path, Array] | None) -> None:
        for port, array, where in self._ports:
            signal = self.problem.signals[port]
            array[where] = signal.at(t, state or {}) if state is not None or signal.constant else 0.0

    # ---- the equations -----------------------------------------------------------------------------------------

    def advance(self, q: Array, v: Array) -> Array:
        """q·exp(v), joint by joint."""
        out = np.array(q)
        advance(self.reduced.tables, self._v_at, q, v, out)
        return out

    def rates(self, t: float, base: Array, y: Array) -> Array:
        """ẏ of y = (v, r, s, books) at q = base·exp(v).

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        nv, n, ns = self.nv, self.n, self.ns
        self.evaluations += 1
        if not self._constant:
            v, r, s, books = np.split(y, [nv, nv + n, nv + n + ns])
            self._place_inputs(t, self.states(ReducedState(t, self.advance(base, v), r, s, books)))
        out = np.zeros(self.size)
        self.refuse(
            *rates(
                self.reduced.tables, self.work, self._v_at, base, self._q, y, self.drive, self.wrench, self.scal, out
            )
        )
        return out

    def stages(
        self, state: ReducedState, a: Array, b: Array, c: Array, h: float, y0: Array, k: Array, y1: Array
    ) -> None:
        """The rates k (stages + 1, size) at an explicit method's stages and end, k[0] known; y at the end into y1."""
        count = b.size
        if self._constant:
            self.refuse(
                *stages(
                    self.reduced.tables, self.work, self._v_at, a, b, state.q, self._q, y0, h, True, k, y1,
                    self.drive, self.wrench, self.scal,
                )
            )  # fmt: skip
            self.evaluations += count
            return
        for i in range(1, count):
            k[i] = self.rates(state.t + c[i] * h, state.q, y0 + h * (a[i, :i] @ k[:i]))
        y1[:] = y0 + h * (b @ k[:count])
        k[-1] = self.rates(state.t + h, state.q, y1)

    def load(self, t: float, q: Array, r: Array, s: Array) -> None:
        """Put what drives at a time and state into ``drive`` and ``wrench``."""
        if not self._constant:
            books = np.zeros(2 + len(self.reduced.made))
            self._place_inputs(t, self.states(ReducedState(t, q, r, s, books)))

    def prepare(self, state: ReducedState) -> None:
        """Compile what is not in the cache."""
        y = self.vector(state)
        k, a, b = np.zeros((2, self.size)), np.zeros((1, 1)), np.ones(1)
        k[0] = self.rates(state.t, state.q, y)
        self.stages(state, a, b, b, 0.0, y, k, y.copy())
        self.evaluations = 0

    def refuse(self, status: int, component: int) -> None:
        """Raise what a compiled function reported, if it did."""
        if status == SINGULAR:
            raise self._unmoved(component)
        if status:
            raise SolveError.of_component(int(status), self.model, int(component))

    def _sweep(self) -> None:
        found = inertia_sweep(self.reduced.tables, self.work)
        if found != 0:
            raise self._unmoved(int(found) - 1)

    def _unmoved(self, freedom: int) -> SolveError:
        """A freedom whose motion no inertia determines."""
        at = self.reduced.tables.r_at[: self.reduced.links]
        link = int(np.flatnonzero(at <= freedom)[-1])
        edge, body = self.reduced.edges[link], self.reduced.bodies[link]
        name = f"joint {edge.name}" if edge.name else f"body {body}"
        return SolveError(Outcome.UNDETERMINED, "", f"the rate of {name}, which moves no mass")

    def mass(self, q: Array, r: Array) -> Array:
        """(n, n) the mass matrix at q."""
        kinematics(self.reduced.tables, self.work, q, r)
        self._sweep()
        return self.work.mass.copy()

    def rows(self) -> Array:
        """(m, n) rows of prescribed joints, then of loops, on the tree's rates, where the mass matrix was made last."""
        return self.work.row[: int(constraint_rows(self.reduced.tables, self.work))].copy()

    def moved(self, q: Array, change: Array) -> Array:
        """q·exp(change), the change given for the tree's joints; cut ones stay."""
        v = np.zeros(self.nv)
        v[: self.n] = change
        return self.advance(q, v)

    def gaps(self, q: Array, r: Array) -> tuple[Array, Array]:
        """Position residuals of loops at q, zeros for prescribed joints before them; and the rows (m, n) there."""
        tables, w = self.reduced.tables, self.work
        fitted = self.fitted(q, r)
        residual = np.zeros(int(tables.rows.sum() + tables.driven.sum()))
        loop_gaps(tables, w, fitted, residual)
        self._sweep()
        return residual, self.rows()

    # ---- closing loops -----------------------------------------------------------------------------------------

    def closed(self, state: ReducedState) -> ReducedState:
        """The state with loops closed and rates on the constraints, by the least change in the mass metric.

        Raises
        ------
        SolveError
            The loops do not close near by.
        """
        tables, w = self.reduced.tables, self.work
        q, r = state.q, np.array(state.r)
        m = int(tables.rows.sum() + tables.driven.sum())
        if m == 0:
            return state
        residual, change = np.zeros(m), np.zeros(self.n)
        gap = before = np.inf
        for _ in range(ROUNDS):
            q = self.fitted(q, r)
            gap = float(loop_gaps(tables, w, q, residual))
            if gap <= GAP or gap > 0.5 * before:
                break
            before = gap
            rank = self._rows(m)
            correct(w, rank, -residual, change)
            q = self.moved(q, change)
        if not gap <= CLOSED:
            raise SolveError(Outcome.DIVERGED, "", f"loops stay open by {gap:.1e} m or rad")
        rank = self._rows(m)
        target = -w.row[:m] @ r
        target[: self.prescribed.size] += self.prescribed
        correct(w, rank, target, change)
        return ReducedState(state.t, q, r + change, state.s, state.books)

    def gap(self, state: ReducedState) -> float:
        """By how much the loops are open, in m or rad."""
        tables = self.reduced.tables
        m = int(tables.rows.sum() + tables.driven.sum())
        q = self.fitted(state.q, state.r)
        return float(loop_gaps(tables, self.work, q, np.zeros(m))) if m else 0.0

    def _rows(self, m: int) -> int:
        tables, w = self.reduced.tables, self.work
        w.load[:] = 0.0
        self._sweep()
        constraint_rows(tables, w)
        self._rank = int(reduce_rows(w, m))
        return self._rank

    def fitted(self, q: Array, r: Array) -> Array:
        """q with the cut joints' elements nearest to where their bodies put them; leaves the sweep at q."""
        tables, w = self.reduced.tables, self.work
        out = np.array(q)
        kinematics(tables, w, out, r)
        for i in self._moving:
            if tables.kind[i] == CUT:
                edge, where = self.reduced.edges[i], slice(int(tables.q_at[i]), int(tables.q_at[i] + tables.q_size[i]))
                out[where] = Coupling(edge.pair).fit(w.relative[i], out[where])
        return out

    # ---- a step ------------------------------------------------------------------------------------------------

    def vector(self, state: ReducedState) -> Array:
        """y at the state: increments zero."""
        return np.concatenate([np.zeros(self.nv), state.r, state.s, state.books])

    def state(self, base: ReducedState, y: Array, t: float) -> ReducedState:
        """The state that the vector y means, counted from ``base``; its loops are as they come."""
        nv, n, ns = self.nv, self.n, self.ns
        v, r, s, books = np.split(y, [nv, nv + n, nv + n + ns])
        return ReducedState(t, self.advance(base.q, v), r, s, books)

    def allowed(self, rtol: Tolerance, atol: Tolerance) -> tuple[Array, Array]:
        """rtol and atol of what counts in an error: the tree's increments, its rates, the entropies."""
        tree = [edge for edge in self.reduced.edges[: self.reduced.links]]
        out: list[Array] = []
        for tolerance in (rtol, atol):
            of_joints = [
                np.full(edge.pair.dim, tolerance.at(*self._named(edge.path, link))) for link, edge in enumerate(tree)
            ]
            entropies = [tolerance.at(path, "entropy") for path in self.reduced.entropies]
            out.append(np.concatenate([*of_joints, *of_joints, np.array(entropies)]))
        return out[0], out[1]

    def _named(self, path: Path | None, link: int) -> tuple[Path, str]:
        """Path and kind of the state that a tree joint's element is to a user."""
        if path is not None:
            return path / "pe" / "q_r", "relative_pose"
        return component_path("bodies", str(self.reduced.bodies[link])) / "pe" / "q", "pose"

    def sizes(self, y0: Array, y1: Array) -> Array:
        """What a relative tolerance is relative to: for increments 1 rad or m, for rates the joint's as a whole."""
        size = np.maximum(np.abs(y0), np.abs(y1))[self.counted]
        size[: self.n] = 1.0
        for i in range(self.reduced.links):
            at = self.n + int(self.reduced.tables.r_at[i])
            where = slice(at, at + int(self.reduced.tables.dim[i]))
            size[where] = size[where].max(initial=0.0)
        return size

    def along(self, estimate: Array) -> Array:
        """An estimate for (v of the tree, r, s) without its parts across the constraints.

        Closing the loops takes those out; near a singular configuration they are most of the estimate.
        """
        m = int(self.reduced.tables.rows.sum() + self.reduced.tables.driven.sum())
        if m == 0:
            return estimate
        out, change = np.array(estimate), np.zeros(self.n)
        for part in (slice(0, self.n), slice(self.n, 2 * self.n)):
            correct(self.work, self._rank, -self.work.row[:m] @ out[part], change)
            out[part] += change
        return out

    def row(self, state: ReducedState) -> Row:
        """What is kept of a state."""
        x = self.problem.descriptor.pack(self.states(state))
        energies = self._continuous.energies(x, np.zeros(self.model.unknowns), self.model.input_values())
        energies[self._makers] = state.books[2:]
        heat, work = state.books[0], state.books[1]
        return Row(x, energies, np.array([heat, work, work, state.books[2:].sum()]))

    def least(self, start: ReducedState, end: ReducedState) -> float:
        """The least entropy that a component made between two states, in J/K."""
        made = end.books[2:] - start.books[2:]
        return float(made.min()) if made.size else 0.0

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return {
            "form": "reduced",
            "evaluations": self.evaluations,
            "cut_joints": [edge.name for edge in self.reduced.cut],
            "unknowns": self.reduced.unknowns,
            "paper_unknowns": self.model.unknowns,
        }

    def states(self, state: ReducedState) -> dict[Path, Array]:
        """All states of the scene's system."""
        return self._paper.at(state.q, state.r, state.s)

    def start(self, t: float) -> ReducedState:
        """The state that the problem begins with, its loops closed.

        Raises
        ------
        SolveError
            The initial states contradict the joints.
        """
        state = self.closed(ReducedState(t, *self._paper.initial(), np.zeros(2 + len(self.reduced.made))))
        self._paper.check(state.q, state.r, state.s)
        return state
