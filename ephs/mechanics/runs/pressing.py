"""Pressure on a scene's shells as forces on their nodes, which follow the surface."""

from collections.abc import Callable

import numpy as np

from ephs.mechanics.elements.shell.pressure import node_areas
from ephs.mechanics.motion.batch import rotations
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.shells import ShellSheet
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.posing.problem import Signal, State


def pressed(scene: Scene, name: str, sheet: ShellSheet, pressure: Signal) -> tuple[list[str], Signal]:
    """Nodes of a shell, and the wrenches there (6 · nodes,), in nodes' axes, of a pressure in Pa."""
    cells, start, at = sheet.mesh().cells, sheet.start()[0], component_path("shells", name)
    welded = {node: body for body, nodes in sheet.welds().items() for node in nodes}
    pushed = sheet.pushed()

    def reading(node: int) -> Callable[[State], Array]:
        rest = start[node]
        if node not in welded:
            free = at / f"node{node}" / "pe" / "q"
            return lambda state: state[free]
        if welded[node] == GROUND:
            return lambda _: rest
        pose = component_path("bodies", welded[node]) / "pe" / "q"
        offset = SE3.compose(SE3.inverse(scene.body(welded[node]).pose), rest)
        return lambda state: SE3.compose(state[pose], offset)

    poses = [reading(node) for node in range(len(start))]

    def wrenches(t: float, state: State) -> Array:
        found = np.array([pose(state) for pose in poses])
        forces = (pressure.at(t, state) * node_areas(found[:, 4:], cells))[pushed]
        out = np.zeros((len(pushed), 6))
        out[:, 3:] = np.einsum("nij,ni->nj", rotations(found[pushed, :4]), forces)
        return out.ravel()

    softly = pressure.constant or pressure.timed
    return [sheet.node(node) for node in pushed], Signal(wrenches, soft=softly)
