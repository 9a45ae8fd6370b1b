"""Kinematics of a mechanism's links by NumPy: Jacobians, bias forces, gravity."""

from typing import final

import numpy as np

from ephs.mechanics.build import component_path
from ephs.mechanics.reduced.equations import Equations
from ephs.mechanics.reduced.sweep_kernels import kinematics
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.problem import State as States
from ephs.mechanics.views import BodyState
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

__all__ = ["Links"]


@final
class Links:
    """The links of one mechanism where `place` put them. It shares the equations' scratch memory."""

    def __init__(self, scene: Scene, equations: Equations) -> None:
        self.equations = equations
        self._bodies = dict(scene.all_bodies())
        self._gravity = scene.world.gravity
        self._number = {name: i for i, name in enumerate(equations.reduced.bodies) if name is not None}

    def place(self, q: Array, r: Array) -> None:
        """Poses, twists and accelerations at ṙ = 0 of all links, into the scratch memory."""
        kinematics(self.equations.reduced.tables, self.equations.work, q, r)

    def bodies(self) -> dict[str, BodyState]:
        """Body -> pose and twist, in the scene's order."""
        w = self.equations.work
        return {name: BodyState(w.pose[i].copy(), w.twist[i].copy()) for name, i in self._ordered()}

    def jacobian(self, body: str, point: Array | None) -> Array:
        """(6, n) to a body's twist, or (3, n) to the velocity of a point in the world."""
        if body not in self._number:
            raise OptionError("body", body, f"one of {', '.join(self._bodies)}")
        i = self._number[body]
        out = self._of_link(i)
        if point is None:
            return out
        if point.shape != (3,):
            raise OptionError("point", point.shape, "(3,)")
        turn = quaternion_to_matrix(self.equations.work.pose[i, :4])
        return turn @ (out[3:] - np.cross(point, out[:3], axisb=0).T)

    def bias(self) -> Array:
        """(n,) C r: inertia forces at ṙ = 0."""
        t, w = self.equations.reduced.tables, self.equations.work
        out = np.zeros(self.equations.n)
        for i in range(t.parent.size):
            inertia, u = t.inertia[i], w.twist[i]
            out += self._of_link(i).T @ (inertia @ w.bias[i] - SE3.ad(u).T @ (inertia @ u))
        return out

    def momenta(self, states: States) -> Array:
        """(n,) what the bodies' momenta are on the tree's freedoms: M r, where they are on the joints."""
        out = np.zeros(self.equations.n)
        for name, i in self._number.items():
            path = component_path("bodies", name) / "ke" / "p"
            if path in states:
                out += self._of_link(i).T @ states[path]
        return out

    def gravity(self) -> Array:
        """(n,) the derivative of gravity's potential."""
        out = np.zeros(self.equations.n)
        for name, i in self._number.items():
            weight = self._bodies[name].mass * self._gravity
            out -= self._of_link(i)[3:].T @ (quaternion_to_matrix(self.equations.work.pose[i, :4]).T @ weight)
        return out

    def _ordered(self) -> list[tuple[str, int]]:
        return [(name, self._number[name]) for name in self._bodies]

    def _of_link(self, link: int) -> Array:
        """(6, n) the link's twist from the rates."""
        t, w = self.equations.reduced.tables, self.equations.work
        out, there, here = np.zeros((6, self.equations.n)), np.eye(6), link
        while here >= 0:
            at, d = t.r_at[here], t.dim[here]
            out[:, at : at + d] = there @ w.motion[here, :d].T
            there = there @ SE3.adjoint(SE3.inverse(w.inner[here]))
            here = t.parent[here]
        return out
