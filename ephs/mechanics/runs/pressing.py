"""Pressure on a scene's shells as forces on their nodes, which follow the surface."""

from collections.abc import Callable

import numpy as np

from ephs.mechanics.elements.shell.pressure import area_of, node_area
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.shells import PRESSURES, ShellSheet
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.solve.posing.problem import Signal, State


def pressed(scene: Scene, name: str, sheet: ShellSheet, pressure: Signal) -> dict[Path, Signal]:
    """Wrenches on the nodes of a shell, in their axes, at their outer ports; of a pressure in Pa."""
    shell, start, at = sheet.shell(), sheet.start()[0], component_path("shells", name)
    welded = {node: body for body, nodes in sheet.welds().items() for node in nodes}

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

    poses = [reading(node) for node in range(len(shell.points))]

    def wrench(node: int) -> Callable[[float, State], Array]:
        near, form = node_area(node, shell.cells)

        def at_node(t: float, state: State) -> Array:
            found = np.array([poses[k](state) for k in near])
            own = quaternion_to_matrix(found[near.index(node), :4])
            force = pressure.at(t, state) * area_of(form, found[:, 4:])
            return np.concatenate([np.zeros(3), own.T @ force])

        return at_node

    ports = {node: Path([PRESSURES, *name.split("."), f"node{node}"]) for node in sheet.pushed()}
    return {port: Signal(wrench(node)) for node, port in ports.items()}
