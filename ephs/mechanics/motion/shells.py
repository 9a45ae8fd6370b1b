"""Shells of a motion: poses of nodes, resultants and energies of elements, at all instants."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.mechanics.elements.shell.mesh import Indices
from ephs.mechanics.motion.batch import compose
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.model import Body, Scene, frozen
from ephs.mechanics.scene.shells import ShellSheet
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3


@final
@dataclass(frozen=True, slots=True, eq=False)
class ShellMotion:
    """A shell. Resultants are those in the middle of its elements, in their axes.

    Parameters
    ----------
    position
        (n, nodes, 3) in m.
    cells
        (elements, 4) nodes of each element.
    membrane
        (n, elements, 3) forces 11, 22, 12 in N/m.
    moment
        (n, elements, 3) bending and twisting moments 11, 22, 12 in N.
    shear
        (n, elements, 2) transverse forces 1, 2 in N/m.
    energy
        (n, elements) strain energy in J.
    """

    position: Array
    cells: Indices
    membrane: Array
    moment: Array
    shear: Array
    energy: Array


def shell_motion(
    scene: Scene, sheet: ShellSheet, node: Callable[[Path], Array], body: Callable[[str], Array]
) -> ShellMotion:
    """Read a shell's motion from the poses (n, 7) of its nodes, by the path of their boxes, and of bodies."""
    shell, welded = sheet.shell(), {i: name for name, nodes in sheet.welds().items() for i in nodes}
    ends = {name: SE3.inverse(SE3.identity() if name == GROUND else scene.body(name).pose) for name in welded.values()}
    moving = []
    for i, rest in enumerate(sheet.start()[0]):
        if i in welded:
            poses = body(welded[i])
            moving.append(compose(poses, np.broadcast_to(SE3.compose(ends[welded[i]], rest), poses.shape)))
        else:
            moving.append(node(Path([f"node{i}"])))
    poses = np.stack(moving, axis=1)
    found = np.array([shell.resultants(each) for each in poses])
    energy = np.array([shell.energy(each) for each in poses])
    return ShellMotion(poses[..., 4:], shell.cells, found[..., :3], found[..., 3:6], found[..., 6:], energy)


def with_nodes(scene: Scene) -> Scene:
    """The scene with the free nodes of its shells as bodies, for pictures."""
    parts, bodies = {name: with_nodes(part) for name, part in scene.parts.items()}, dict(scene.bodies)
    for sheet in scene.shells.values():
        shell, (poses, twists) = sheet.shell(), sheet.start()
        for i in sheet.free():
            tensor, mass = frozen(np.diag(shell.inertia[i, :3])), float(shell.inertia[i, 3])
            bodies[sheet.node(i)] = Body(sheet.node(i), mass, tensor, frozen(poses[i]), frozen(twists[i]))
    return replace(scene, bodies=bodies, parts=parts)
