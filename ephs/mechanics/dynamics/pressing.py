"""Pressure on a scene's shells in joint coordinates: wrenches on links, and their exact derivatives."""

from typing import final

import numpy as np

from ephs.mechanics.elements.shell.pressure import area_slopes, node_areas
from ephs.mechanics.scene.build import wrench_port
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rotations import hat, quaternion_to_matrix


@final
class PressedSurface:
    """A shell with a pressure on it, at the places of the links in the equations' memory."""

    def __init__(self, equations: ReducedEquations, sheet: ShellSheet) -> None:
        assert sheet.pressure is not None
        self._residual, self._pressure, self._cells = equations.dense.residual, sheet.pressure, sheet.mesh().cells
        self._n, self._start, self._nodes = equations.n, sheet.start()[0][:, 4:], sheet.pushed()
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
