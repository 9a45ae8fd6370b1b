"""Explicit Runge-Kutta methods on the reduced form: adaptive, loops projected back after each step.

A step moves q = q⁰·exp(v): the increments v and all else live in vector spaces, v̇ = dexp⁻¹(v) r. Coefficients are those
of Dormand and Prince, of orders 5(4) and 8(5, 3), as SciPy ships them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, final

import numpy as np

from ephs.mechanics.build import component_path, drive_ports, wrench_port
from ephs.mechanics.reduced.loop_kernels import constraint_rows, correct, loop_gaps, reduce_rows
from ephs.mechanics.reduced.mechanism import Reduced
from ephs.mechanics.reduced.step_kernels import advance, rates, stages
from ephs.mechanics.reduced.sweep_kernels import inertia_sweep, kinematics
from ephs.mechanics.reduced.tables import CUT, SPRING
from ephs.mechanics.scene.geometry import Coupling
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.errors import Outcome, SolveError
from ephs.mechanics.solve.model import Model
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array

__all__ = ["Explicit", "ReducedState", "Tableau", "tableau"]

GAP = 1e-12
"""Position residuals to which loops are closed, in m and rad."""
CLOSED = 1e-10
"""Residuals above this cannot be accepted."""
ROUNDS = 12
SINGULAR = 20


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coefficients of an explicit method; ``error`` and, of order 8, ``coarse`` estimate its error."""

    name: str
    order: int
    a: Array
    b: Array
    c: Array
    error: Array
    coarse: Array | None

    def estimates(self, k: Array, h: float) -> list[Array]:
        """The vectors that estimate a step's error: one, or a fine and a rough one."""
        return [h * (weights @ k) for weights in (self.error, self.coarse) if weights is not None]

    @staticmethod
    def measure(estimates: list[Array]) -> float:
        """Their size, where each is relative to what is allowed: at most 1 where a step may be accepted."""
        size = max(estimates[0].size, 1)
        squares = [float(estimate @ estimate) for estimate in estimates]
        if len(squares) == 1 or squares[0] == 0.0:
            return float(np.sqrt(squares[0] / size))
        return squares[0] / np.sqrt((squares[0] + 0.01 * squares[1]) * size)

    @property
    def exponent(self) -> float:
        """The power of the step with which the estimate falls."""
        return 8.0 if self.coarse is not None else 5.0


@cache
def tableau(name: str) -> Tableau:
    """The method rk54 or rk87."""
    from scipy.integrate import DOP853, RK45

    method: Any = DOP853 if name == "rk87" else RK45
    n = method.n_stages
    a, b, c = np.array(method.A)[:n, :n], np.array(method.B), np.array(method.C)[:n]
    if name == "rk87":
        return Tableau(name, 8, a, b, c, np.array(DOP853.E5), np.array(DOP853.E3))
    return Tableau(name, 5, a, b, c, np.array(RK45.E), None)


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReducedState:
    """Where a mechanism is: joints' elements q, rates r of the tree, entropies s, and what was counted since the start.

    Parameters
    ----------
    books
        Heat and work in J, then the entropy that each component made in J/K.
    """

    t: float
    q: Array
    r: Array
    s: Array
    books: Array


@final
class Explicit:
    """An explicit method on one mechanism. It keeps scratch memory: use one for each thread."""

    def __init__(self, reduced: Reduced, scene: Scene, problem: Problem, model: Model, method: Tableau) -> None:
        self.reduced, self.problem, self.model, self.method = reduced, problem, model, method
        self.work = reduced.workspace()
        t = reduced.tables
        self._moving = [i for i in range(len(reduced.edges)) if t.kind[i] != SPRING]
        sizes = [int(t.dim[i]) if t.kind[i] != SPRING else 0 for i in range(len(reduced.edges))]
        self._v_at = np.cumsum([0, *sizes])[:-1].astype(np.int64)
        self._tree = np.arange(sum(sizes[: reduced.links]))
        self._rank = 0
        self._q = np.zeros(reduced.coordinates)
        self.nv, self.n, self.ns = sum(sizes), reduced.freedoms, len(reduced.entropies)
        self.size = self.nv + self.n + self.ns + 2 + len(reduced.made)
        self._scal = model.scal(0.0)
        self._drive = np.zeros(self.nv)
        self._wrench = np.zeros((reduced.links, 6))
        self._ports = self._find_ports(scene)
        self._constant = problem.constant
        self._place_inputs(0.0, None)
        self._signs: dict[Path, float] = {}
        self.evaluations = 0

    # ---- inputs ------------------------------------------------------------------------------------------------

    def _find_ports(self, scene: Scene) -> list[tuple[Path, Any, Any]]:
        """(port, array, where) of each input that is a flow."""
        found: list[tuple[Path, Any, Any]] = []
        links = {name: i for i, name in enumerate(self.reduced.bodies) if name is not None}
        signals = self.problem.signals
        for name, _ in scene.all_bodies():
            if wrench_port(name) in signals:
                found.append((wrench_port(name), self._wrench, links[name]))
        r_at, dim = self.reduced.tables.r_at, self.reduced.tables.dim
        for name, j in scene.all_joints():
            edges = [i for i, e in enumerate(self.reduced.edges) if e.name == name and i in self._moving]
            edges.sort(key=lambda i: self.reduced.edges[i].freedoms.start)
            for (port, _), i in zip(drive_ports(j), edges, strict=True):
                if port in signals and not signals[port].effort:
                    found.append((port, self._drive, slice(int(r_at[i]), int(r_at[i] + dim[i]))))
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
            parts = np.split(y, [nv, nv + n, nv + n + ns])
            self._place_inputs(t, self.states(ReducedState(t, self.advance(base, parts[0]), *parts[1:])))
        out = np.zeros(self.size)
        self._refuse(
            *rates(
                self.reduced.tables, self.work, self._v_at, base, self._q, y, self._drive, self._wrench, self._scal, out
            )
        )
        return out

    def _refuse(self, status: int, component: int) -> None:
        if status == SINGULAR:
            raise SolveError(Outcome.SINGULAR, "", "the mass matrix")
        if status:
            raise SolveError.of_component(int(status), self.model, int(component))

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
            q = self._fitted(q, r)
            gap = float(loop_gaps(tables, w, q, residual))
            if gap <= GAP or gap > 0.5 * before:
                break
            before = gap
            rank = self._rows(m)
            correct(w, rank, -residual, change)
            v = np.zeros(self.nv)
            for i in self._moving:
                if i < self.reduced.links:
                    where = slice(int(tables.r_at[i]), int(tables.r_at[i] + tables.dim[i]))
                    v[self._v_at[i] : self._v_at[i] + int(tables.dim[i])] = change[where]
            q = self.advance(q, v)
        if not gap <= CLOSED:
            raise SolveError(Outcome.DIVERGED, "", f"loops stay open by {gap:.1e} m or rad")
        rank = self._rows(m)
        target = -w.row[:m] @ r
        a = 0
        for i in range(self.reduced.links):
            if tables.driven[tables.r_at[i] : tables.r_at[i] + tables.dim[i]].any():
                target[a] += float(self.reduced.edges[i].motion or 0.0)
                a += 1
        correct(w, rank, target, change)
        return ReducedState(state.t, q, r + change, state.s, state.books)

    def _rows(self, m: int) -> int:
        tables, w = self.reduced.tables, self.work
        w.load[:] = 0.0
        if inertia_sweep(tables, w) != 0:
            raise SolveError(Outcome.SINGULAR, "", "the mass matrix")
        constraint_rows(tables, w)
        self._rank = int(reduce_rows(w, m))
        return self._rank

    def _fitted(self, q: Array, r: Array) -> Array:
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

    def step(self, state: ReducedState, h: float, first: Array | None = None) -> tuple[ReducedState, Array, Array]:
        """One step without control: the state after it, the rates at its stages, y at its end."""
        method, y0 = self.method, self.vector(state)
        count = method.b.size
        k, y1 = np.zeros((count + 1, self.size)), np.empty(self.size)
        if first is not None:
            k[0] = first
        if self._constant:
            self._refuse(
                *stages(
                    self.reduced.tables, self.work, self._v_at, method.a, method.b, state.q, self._q, y0, h,
                    first is not None, k, y1, self._drive, self._wrench, self._scal,
                )
            )  # fmt: skip
            self.evaluations += count + (first is None)
        else:
            for i in range(count):
                if i or first is None:
                    k[i] = self.rates(state.t + method.c[i] * h, state.q, y0 + h * (method.a[i, :i] @ k[:i]))
            y1 = y0 + h * (method.b @ k[:count])
            k[-1] = self.rates(state.t + h, state.q, y1)
        nv, n, ns = self.nv, self.n, self.ns
        end = ReducedState(
            state.t + h, self.advance(state.q, y1[:nv]), y1[nv : nv + n], y1[nv + n : nv + n + ns], y1[nv + n + ns :]
        )
        return self.closed(end), k, y1

    def error(self, k: Array, h: float, y0: Array, y1: Array, rtol: float, atol: float) -> float:
        """The estimated error of a step relative to the tolerances: of angles and distances, rates, entropies.

        What lies across the constraints at the step's end is no error: closing the loops takes it out. Near a singular
        configuration it is most of the estimate.
        """
        counted = np.r_[self._tree, self.nv : self.nv + self.n + self.ns]
        size = np.maximum(np.abs(y0), np.abs(y1))
        size[: self.nv] = 1.0  # increments: a radian, a metre
        for i in range(self.reduced.links):  # rates: the joint's as a whole, as axes are arbitrary
            where = slice(self.nv + int(self.reduced.tables.r_at[i]), self.nv + int(self.reduced.tables.r_at[i]))
            where = slice(where.start, where.stop + int(self.reduced.tables.dim[i]))
            size[where] = size[where].max(initial=0.0)
        allowed = atol + rtol * size[counted]
        return self.method.measure([self._along(e[counted]) / allowed for e in self.method.estimates(k, h)])

    def _along(self, estimate: Array) -> Array:
        """An estimate for (v of the tree, r, s) without its parts across the constraints."""
        m = int(self.reduced.tables.rows.sum() + self.reduced.tables.driven.sum())
        if m == 0:
            return estimate
        out, change = np.array(estimate), np.zeros(self.n)
        for part in (slice(0, self.n), slice(self.n, 2 * self.n)):
            correct(self.work, self._rank, -self.work.row[:m] @ out[part], change)
            out[part] += change
        return out

    # ---- the paper's states ------------------------------------------------------------------------------------

    def states(self, state: ReducedState) -> dict[Path, Array]:
        """All states of the scene's system."""
        tables, w, reduced = self.reduced.tables, self.work, self.reduced
        kinematics(tables, w, state.q, state.r)
        out: dict[Path, Array] = {path: state.s[i : i + 1] for i, path in enumerate(reduced.entropies)}
        for link, name in enumerate(reduced.bodies):
            if name is not None:
                at = component_path("bodies", name)
                out[at / "pe" / "q"] = self._signed(at / "pe" / "q", w.pose[link])
                if np.any(tables.inertia[link]):
                    out[at / "ke" / "p"] = tables.inertia[link] @ w.twist[link]
        for i, edge in enumerate(reduced.edges):
            if edge.path is not None:
                where = slice(int(tables.q_at[i]), int(tables.q_at[i] + tables.q_size[i]))
                spring = tables.kind[i] == SPRING
                own = self._signed(edge.path / "pe" / "q_r", w.relative[i]) if spring else state.q[where].copy()
                out[edge.path / "pe" / "q_r"] = own
        return out

    def _signed(self, path: Path, pose: Array) -> Array:
        """A pose by that of its two quaternions which is continuous with the initial one."""
        sign = self._signs.setdefault(path, 1.0 if float(pose[:4] @ self.problem.initial[path][:4]) >= 0.0 else -1.0)
        return np.concatenate([sign * pose[:4], pose[4:]])

    def start(self, t: float) -> ReducedState:
        """The state that the problem begins with, its loops closed.

        Raises
        ------
        SolveError
            The initial states contradict the joints.
        """
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        q, r = np.zeros(reduced.coordinates), np.zeros(self.n)
        for i in self._moving:
            edge = reduced.edges[i]
            given = edge.coordinate if edge.path is None else initial[edge.path / "pe" / "q_r"]
            q[int(tables.q_at[i]) : int(tables.q_at[i] + tables.q_size[i])] = given
        r = self._rates_of(q)
        s = np.array([float(initial[path][0]) for path in reduced.entropies])
        state = self.closed(ReducedState(t, q, r, s, np.zeros(2 + len(reduced.made))))
        self.states(state)  # fixes the signs of quaternions
        return state

    def _rates_of(self, q: Array) -> Array:
        """The tree's rates from the bodies' momenta."""
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        heavy = [(i, name) for i, name in enumerate(reduced.bodies) if name is not None and np.any(tables.inertia[i])]
        columns = np.zeros((6 * len(heavy), self.n))
        for j, unit in enumerate(np.eye(self.n)):
            kinematics(tables, self.work, q, unit)
            columns[:, j] = np.concatenate([self.work.twist[i] for i, _ in heavy]) if heavy else 0.0
        twists = [
            np.linalg.solve(tables.inertia[i], initial[component_path("bodies", name) / "ke" / "p"])
            for i, name in heavy
        ]
        if not twists:
            return np.zeros(self.n)
        return np.asarray(np.linalg.lstsq(columns, np.concatenate(twists), rcond=None)[0], dtype=float)
