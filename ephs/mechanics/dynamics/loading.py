"""Loads and pressures of a scene on its links: wrenches at the links' poses, and their derivatives."""

from dataclasses import replace
from typing import final

import numpy as np

from ephs.mechanics.dynamics.links import PlacedLinks
from ephs.mechanics.dynamics.pressing import PressedSurface
from ephs.mechanics.dynamics.results import Derivatives
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rotations import hat, quaternion_to_matrix


@final
class Loading:
    """The loads of a scene, and the pressures on its shells.

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
        self._loads = [(numbers[load.body], load) for _, load in (() if scene is None else scene.all_loads())]
        self._surfaces = [
            PressedSurface(equations, sheet)
            for _, sheet in (() if scene is None else scene.all_shells())
            if sheet.pressure is not None
        ]
        self._constant = equations.wrench.copy()  # of inputs; loads that turn with their bodies are constant, too
        steady = (self._constant != 0.0).any(axis=1).astype(float)
        for link, load in self._loads:
            self._constant[link] -= steady[link] * load.wrench(np.eye(3))

    def __bool__(self) -> bool:
        return bool(self._loads or self._surfaces)

    def place(self, q: Array, r: Array) -> None:
        """Write the wrenches at a configuration to the equations' inputs."""
        if not self:
            return
        self._links.place(q, r)
        self._equations.wrench[:] = self._constant
        for link, load in self._loads:
            self._equations.wrench[link] += self.share * load.wrench(self._rotation(link))
        for surface in self._surfaces:
            surface.add(self.share, self._equations.wrench)

    def stiffened(self, found: Derivatives, q: Array, r: Array) -> Derivatives:
        """Derivatives with those of the loads' directions, which keep to the world while their bodies turn."""
        if not self:
            return found
        change = self.slopes(q, r)
        by_place = found.acceleration_q + found.acceleration_force @ change
        return replace(found, acceleration_q=by_place, force_q=found.force_q - change)

    def slopes(self, q: Array, r: Array) -> Array:
        """(n, n) derivatives of the loads' forces on the tree's freedoms by their elements, beside those at fixed
        wrenches in the links' axes."""
        n = self._equations.n
        change = np.zeros((n, n))
        self.place(q, r)
        for link, load in self._loads:
            if not load.follower:
                jacobian = self._links.jacobian(load.body, None)
                moment, force = np.split(load.wrench(self._rotation(link)), 2)
                turning = np.vstack([hat(moment), hat(force)])
                change += self.share * jacobian.T @ turning @ jacobian[:3]
        for surface in self._surfaces:
            change += self.share * surface.slopes()
        return change

    def _rotation(self, link: int) -> Array:
        """(3, 3) of a link to the world."""
        return quaternion_to_matrix(self._equations.dense.residual.pose(link)[:4])
