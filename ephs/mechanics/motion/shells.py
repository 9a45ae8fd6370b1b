"""Shells of a motion: poses of nodes, resultants and energies of elements, at all instants."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.mechanics.elements.shell.mesh import Indices
from ephs.mechanics.elements.shell.system import SPRING
from ephs.mechanics.motion.batch import compose
from ephs.mechanics.scene.element import ENVIRONMENT, GROUND
from ephs.mechanics.scene.faces import Faces
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.tree.finding.frames import GROUND as SOLID
from ephs.mechanics.tree.finding.frames import Frame, Frames, LinkJoint
from ephs.operad import ROOT, Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3, translation


@final
@dataclass(frozen=True, slots=True, eq=False)
class ShellMotion:
    """A shell. Resultants are those in the middle of its elements, in their axes; of systems they are NaN.

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

    @property
    def bending(self) -> Array:
        """(n, elements, 3) the moments."""
        return self.moment


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinkedShell:
    """The elements side by side in a box of a system, as they are drawn.

    Parameters
    ----------
    name
        Path of the box.
    elements
        Their paths.
    of
        Their faces; their nodes are the bodies beside them.
    """

    name: str
    elements: tuple[Path, ...]
    of: Faces
    section: str = "shells"
    heat: str = ENVIRONMENT

    def lines(self, _: object) -> Iterator[Any]:
        """None: it has faces."""
        return iter(())

    def faces(self, _: object) -> Faces:
        """Those in a scene."""
        return self.of


def shells_of_links(frames: Frames) -> dict[str, LinkedShell]:
    """The shells of a system, by the path of the box that has their elements in it."""
    inside: dict[Path, dict[Path, dict[str, LinkJoint]]] = defaultdict(lambda: defaultdict(dict))
    rest: dict[Path, Array] = {}
    for joint in frames.joints:
        storage = frames.wiring.components[joint.potential]
        if storage.primitive.name == SPRING:
            at = Path(storage.path[:-1])
            inside[Path(at[:-1])][at][joint.state.path[-1]] = joint
            rest[at] = np.array(dict(storage.primitive.parameters)["rest"], dtype=float).reshape(4, 6)
    found: dict[str, LinkedShell] = {}
    for box, elements in inside.items():
        numbers: dict[tuple[str, tuple[float, ...]], int] = {}
        cells: list[list[int]] = []
        for at, joints in elements.items():
            size = float(np.abs(rest[at][:, 3:]).max())
            # the joint to corner 2 begins where that corner is without stress
            start = joints["q_2"].first
            first = Frame(start.link, SE3.compose(start.offset, SE3.inverse(SE3.exp(rest[at][0]))))
            corners = [first, *(joints[key].second for key in ("q_2", "q_3", "q_4"))]
            places = [(_name(frames, c), _rounded(c.offset[4:], size)) for c in corners]
            cells.append([numbers.setdefault(place, len(numbers)) for place in places])
        ends = tuple((body, np.array(at)) for body, at in numbers)
        beside = frozenset(body for body, _ in ends if body != GROUND and Path.parse(body)[:-1] == tuple(box))
        name = "shell" if box == ROOT else str(box)
        found[name] = LinkedShell(name, tuple(elements), Faces(ends, np.array(cells, dtype=np.int64), beside))
    return found


def linked_shell_motion(
    shell: LinkedShell, poses: Callable[[str], Array], energy: Callable[[Path], Array]
) -> ShellMotion:
    """Read a shell's motion from the poses (n, 7) of bodies, and the energies (n,) of storages."""
    places: list[Array] = []
    for body, at in shell.of.ends:
        moving = poses(body)
        places.append(compose(moving, np.broadcast_to(translation(at), moving.shape))[:, 4:])
    stored = np.stack([energy(at / "pe") for at in shell.elements], axis=1)
    unknown = np.full((*stored.shape, 3), np.nan)
    return ShellMotion(np.stack(places, axis=1), shell.of.cells, unknown, unknown, unknown[..., :2], stored)


def _name(frames: Frames, corner: Frame) -> str:
    return GROUND if corner.link == SOLID else str(frames.links[corner.link].path)


def _rounded(at: Array, size: float) -> tuple[float, ...]:
    """A place (3,) in digits of the size of an element, so that neighbours have it alike."""
    return tuple((np.round(at / size, 9) * size + 0.0).tolist())


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
        bodies |= sheet.bodies()
    return replace(scene, bodies=bodies, parts=parts)
