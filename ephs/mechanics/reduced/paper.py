"""Between the reduced form and the paper's states: every state of the system from joints' elements, and back."""

from typing import final

import numpy as np

from ephs.mechanics.build import component_path
from ephs.mechanics.reduced.mechanism import Reduced
from ephs.mechanics.reduced.sweep_kernels import kinematics
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
        self._signs: dict[Path, float] = {}

    def at(self, q: Array, r: Array, s: Array) -> dict[Path, Array]:
        """All states of the scene's system."""
        tables, w, reduced = self.reduced.tables, self.work, self.reduced
        kinematics(tables, w, q, r)
        out: dict[Path, Array] = {path: s[i : i + 1] for i, path in enumerate(reduced.entropies)}
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
                own = self._signed(edge.path / "pe" / "q_r", w.relative[i]) if spring else q[where].copy()
                out[edge.path / "pe" / "q_r"] = own
        return out

    def _signed(self, path: Path, pose: Array) -> Array:
        """A pose by that of its two quaternions which is continuous with the initial one."""
        sign = self._signs.setdefault(path, 1.0 if float(pose[:4] @ self.problem.initial[path][:4]) >= 0.0 else -1.0)
        return np.concatenate([sign * pose[:4], pose[4:]])

    def initial(self) -> tuple[Array, Array, Array]:
        """(q, r, s) of the problem's initial states."""
        tables, reduced, initial = self.reduced.tables, self.reduced, self.problem.initial
        q = np.zeros(reduced.coordinates)
        for i, edge in enumerate(reduced.edges):
            if tables.kind[i] != SPRING:
                body = component_path("bodies", str(reduced.bodies[i])) if i < reduced.links else Path()
                # of a body that no joint holds, the element is its pose
                given = initial[body / "pe" / "q" if edge.path is None else edge.path / "pe" / "q_r"]
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
        for i, name in enumerate(reduced.bodies):
            if name is None or not np.any(tables.inertia[i]):
                continue
            momentum = initial[component_path("bodies", name) / "ke" / "p"]
            twists[i] = np.linalg.solve(tables.inertia[i], momentum)
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
            rates[freedoms] = np.linalg.lstsq(np.column_stack(columns), own, rcond=None)[0]
        return rates
