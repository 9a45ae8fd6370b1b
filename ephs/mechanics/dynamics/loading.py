"""Loads and pressures of a scene on its links: wrenches at the links' poses, and their derivatives."""

from dataclasses import replace
from typing import final

import numpy as np

from ephs.mechanics.dynamics.links import PlacedLinks
from ephs.mechanics.dynamics.opening import HardContacts
from ephs.mechanics.dynamics.results import Derivatives
from ephs.mechanics.elements.shell.pressure import area_slopes, node_areas
from ephs.mechanics.scene.build import wrench_port
from ephs.mechanics.scene.loads import Load
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import hat, quaternion_to_matrix

# Pressure on a scene's shells in joint coordinates: wrenches on links, and their exact derivatives.


@final
class PressedSurface:
    """A shell with a pressure on it, at the places of the links in the equations' memory."""

    def __init__(self, equations: ReducedEquations, sheet: ShellSheet) -> None:
        assert sheet.pressure is not None
        self._residual, self._pressure, self._cells = equations.dense.residual, sheet.pressure, sheet.mesh().cells
        self._n, self._start, self._nodes = equations.n, sheet.start()[0][:, 4:], sheet.moving()
        frames = {one.port: one.frame for one in equations.reduced.acting}
        found = [frames[wrench_port(sheet.node(node))] for node in self._nodes]
        self._links, self._offsets = [frame.link for frame in found], np.array([frame.offset[4:] for frame in found])

    def add(self, share: float, wrench: Array) -> None:
        """Add a part of the forces to wrenches (links, 6) in the links' axes."""
        turns = self._turns()
        forces = share * self._pressure * node_areas(self._places(turns), self._cells)[self._nodes]
        for link, at, turn, force in zip(self._links, self._offsets, turns, forces, strict=True):
            here = turn.T @ force
            wrench[link, :3] += np.cross(at, here)
            wrench[link, 3:] += here

    def slopes(self) -> Array:
        """(n, n) derivatives of the forces on the tree's freedoms, beside those at fixed wrenches in links' axes."""
        turns = self._turns()
        places, moved = self._places(turns), np.zeros((*self._start.shape, self._n))
        twists = [self._residual.twists(link) for link in self._links]
        moving = [twist[3:] - hat(at) @ twist[:3] for at, twist in zip(self._offsets, twists, strict=True)]
        moved[self._nodes] = [turn @ rate for turn, rate in zip(turns, moving, strict=True)]
        forces = node_areas(places, self._cells)[self._nodes]
        changes, out = area_slopes(places, self._cells, moved)[self._nodes], np.zeros((self._n, self._n))
        for twist, rate, turn, force, change in zip(twists, moving, turns, forces, changes, strict=True):
            out += rate.T @ (turn.T @ change + hat(turn.T @ force) @ twist[:3])
        return self._pressure * out

    def _turns(self) -> list[Array]:
        return [quaternion_to_matrix(self._residual.pose(link)[:4]) for link in self._links]

    def _places(self, turns: list[Array]) -> Array:
        """(m, 3) of the nodes in the world."""
        out = self._start.copy()
        for node, link, at, turn in zip(self._nodes, self._links, self._offsets, turns, strict=True):
            out[node] = self._residual.pose(link)[4:] + turn @ at
        return out


@final
class Loading:
    """Wrenches on a scene's bodies: its loads, inputs, and the pressures on its shells.

    Attributes
    ----------
    share
        Part of the loads that acts: 1 after their ramps.
    hard
        Hard contacts and stops, which have no forces here.
    """

    def __init__(self, equations: ReducedEquations, links: PlacedLinks) -> None:
        self.share, self.hard = 1.0, HardContacts(equations)
        self._equations, self._links = equations, links
        scene: Scene | None = equations.problem.scene
        self._loads: dict[str, list[Load]] = {}
        for _, load in () if scene is None else scene.all_loads():
            self._loads.setdefault(load.body, []).append(load)
        sheets = [] if scene is None else [sheet for _, sheet in scene.all_shells() if sheet.pressure is not None]
        self._surfaces = [PressedSurface(equations, sheet) for sheet in sheets]
        self._pressed = {sheet.node(i) for sheet in sheets for i in sheet.moving()}
        self._constant, signals = equations.wrench.copy(), equations.problem.signals
        names = {name: i for i, name in enumerate(equations.reduced.bodies) if name is not None}
        ported = [name for name in names if wrench_port(name) in signals]
        turning = [name for name in ported if not signals[wrench_port(name)].constant and name not in self._pressed]
        self._turning = {name: signals[wrench_port(name)] for name in turning}
        self._pushed = {name: names[name] for name in ported if name in self._turning or name in self._loads}

    def __bool__(self) -> bool:
        return bool(self._pushed or self._surfaces)

    def place(self, q: Array, r: Array) -> None:
        """Write the wrenches at a configuration to the equations' inputs, where hard contacts are open."""
        self.hard.check_open(q, r)
        if not self:
            return
        self._links.place(q, r)
        self._equations.wrench[:] = self._constant
        for name, link in self._pushed.items():
            self._equations.wrench[link] = self._wrench(name, SE3.identity())
        for surface in self._surfaces:
            surface.add(self.share, self._equations.wrench)

    def stiffened(self, found: Derivatives, q: Array, r: Array) -> Derivatives:
        """Derivatives with those of forces whose directions keep to the world while their bodies turn."""
        if not self:
            return found
        change = self.slopes(q, r)
        by_place = found.acceleration_q + found.acceleration_force @ change
        return replace(found, acceleration_q=by_place, force_q=found.force_q - change)

    def slopes(self, q: Array, r: Array) -> Array:
        """(n, n) derivatives of these forces on the tree's freedoms by their elements, beside those at fixed
        wrenches in the links' axes."""
        n = self._equations.n
        change = np.zeros((n, n))
        self.place(q, r)
        for name in self._pushed:
            jacobian = self._links.jacobian(name, None)
            change += jacobian.T @ self._by_turn(name) @ jacobian[:3]
        for surface in self._surfaces:
            change += self.share * surface.slopes()
        return change

    def _wrench(self, name: str, by: Array) -> Array:
        """(6,) loads and inputs after ramps on a body that is displaced by a pose (7,) in its frame."""
        pose, more = SE3.compose(self._equations.dense.residual.pose(self._pushed[name]), by), self.share - 1.0
        whole = self._constant[self._pushed[name]]
        if name in self._pressed:  # whose signal is that of the surface, too
            whole, more = np.zeros(6), self.share
        if name in self._turning:
            where = self._equations.reduced.places[self._pushed[name]].pose
            whole = self._turning[name].at(np.inf, {} if where is None else {where.path: pose})
        turn = quaternion_to_matrix(pose[:4])
        return whole + sum((more * load.wrench(turn) for load in self._loads.get(name, ())), np.zeros(6))

    def _by_turn(self, name: str) -> Array:
        """(6, 3) derivatives of a body's wrench by its turns: it is linear in the entries of Rᵀ, so that half the
        difference of quarter turns is exact, exp(±½π ê) = 1 ± ê + ê².
        """
        quarters = [SE3.exp(np.append(turn, np.zeros(3))) for turn in 0.5 * np.pi * np.eye(3)]
        ends = [(self._wrench(name, by), self._wrench(name, SE3.inverse(by))) for by in quarters]
        return np.column_stack([0.5 * (one - other) for one, other in ends])
