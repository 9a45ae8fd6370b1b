"""Loads of a scene on its links: wrenches at the links' poses, and their derivatives."""

from dataclasses import replace
from typing import final

import numpy as np

from ephs.mechanics.dynamics.links import PlacedLinks
from ephs.mechanics.dynamics.results import Derivatives
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rotations import hat, quaternion_to_matrix
from ephs.solve.posing.errors import OptionError


@final
class Loading:
    """The loads of a scene.

    Attributes
    ----------
    share
        Part of the loads that acts: 1 after their ramps.
    """

    def __init__(self, equations: ReducedEquations, links: PlacedLinks) -> None:
        self.share = 1.0
        self._equations, self._links = equations, links
        numbers = {name: i for i, name in enumerate(equations.reduced.bodies) if name is not None}
        scene: Scene | None = equations.problem.scene
        pressed = [] if scene is None else [name for name, of in scene.all_shells() if of.pressure is not None]
        if pressed:
            found = f"a scene with the pressure of shells.{pressed[0]}"
            raise OptionError("model", found, "one without: no derivatives of forces that follow a surface are known")
        self._loads = [(numbers[load.body], load) for _, load in (() if scene is None else scene.all_loads())]

    def __bool__(self) -> bool:
        return bool(self._loads)

    def place(self, q: Array, r: Array) -> None:
        """Write the wrenches at a configuration to the equations' inputs."""
        if not self._loads:
            return
        self._links.place(q, r)
        self._equations.wrench[:] = 0.0
        for link, load in self._loads:
            self._equations.wrench[link] += self.share * load.wrench(self._rotation(link))

    def stiffened(self, found: Derivatives, q: Array, r: Array) -> Derivatives:
        """Derivatives with those of the loads' directions, which keep to the world while their bodies turn."""
        if not self._loads:
            return found
        self.place(q, r)
        change = np.zeros_like(found.force_q)
        for link, load in self._loads:
            if not load.follower:
                jacobian = self._links.jacobian(load.body, None)
                moment, force = np.split(load.wrench(self._rotation(link)), 2)
                turning = np.vstack([hat(moment), hat(force)])
                change += self.share * jacobian.T @ turning @ jacobian[:3]
        by_place = found.acceleration_q + found.acceleration_force @ change
        return replace(found, acceleration_q=by_place, force_q=found.force_q - change)

    def _rotation(self, link: int) -> Array:
        """(3, 3) of a link to the world."""
        return quaternion_to_matrix(self._equations.dense.residual.pose(link)[:4])
