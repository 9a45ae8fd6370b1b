"""Kinematics of a mechanism's links: poses, Jacobians, bias forces, gravity."""

from typing import final

import numpy as np

from ephs.mechanics.motion.views import BodyState
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import listed
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.solve.posing.errors import OptionError
from ephs.solve.posing.problem import State as States


@final
class PlacedLinks:
    """The links of one mechanism at the poses set by `place`. It shares the equations' scratch memory."""

    def __init__(self, equations: ReducedEquations) -> None:
        self.equations = equations
        self._residual = equations.dense.residual
        self._q, self._r = np.zeros(equations.reduced.coordinates), np.zeros(equations.n)
        found = {name: i for i, name in enumerate(equations.reduced.bodies) if name is not None}
        named = {name: found[name] for name in equations.problem.names.values() if name in found}
        self._number = named or found

    def weights(self) -> dict[str, float]:
        """Body -> its weight in N."""
        places, size = self.equations.reduced.places, float(np.linalg.norm(self.equations.reduced.gravity))
        return {name: float(places[i].inertia[5, 5]) * size for name, i in self._number.items()}

    def place(self, q: Array, r: Array) -> None:
        """Poses and twists of all links, into the scratch memory."""
        self._residual.place(q, r)
        self._q, self._r = q, r

    def bodies(self) -> dict[str, BodyState]:
        """Body -> pose and twist, in the order of their names, or outwards."""
        found = self._residual
        return {name: BodyState(found.pose(i), found.twist(i)) for name, i in self._number.items()}

    def jacobian(self, body: str, point: Array | None) -> Array:
        """(6, n) to a body's twist, or (3, n) to the velocity of a point in the world."""
        if body not in self._number:
            raise OptionError("body", body, f"one of {listed(body, self._number)}")
        i = self._number[body]
        out = self._residual.twists(i)
        if point is None:
            return out
        if point.shape != (3,):
            raise OptionError("point", point.shape, "(3,)")
        turn = quaternion_to_matrix(self._residual.pose(i)[:4])
        return turn @ (out[3:] - np.cross(point, out[:3], axisb=0).T)

    def inside(self, twists: Array) -> dict[str, Array]:
        """Body -> (6, k) twists in its frame, from (links + 1, 6, k) of the links and the ground."""
        found = self._residual
        return {name: found.inside(i, twists[found.link(i)].T).T for name, i in self._number.items()}

    def bias(self) -> Array:
        """(n,) C r: inertia forces at ṙ = 0."""
        return self._residual.rigid(self._q, self._r, gravity=False)

    def momenta(self, states: States) -> Array:
        """(n,) momenta of bodies and of rotors on the tree's degrees of freedom: M r where joints are closed."""
        out, attaching = np.zeros(self.equations.n), self.equations.reduced.attaching
        for rotor in attaching.network.inertias:
            out[attaching.ports[rotor.rate]] += rotor.ratio * states[rotor.state.path][0]
        for i, link in enumerate(self.equations.reduced.places):
            if link.momentum is not None:
                out += self._residual.twists(i).T @ states[link.momentum.path]
        return out

    def gravity(self) -> Array:
        """(n,) the derivative of gravity's potential."""
        return self._residual.rigid(self._q, np.zeros_like(self._r), gravity=True)
