"""Motion of the bodies and joints of a system without scene, by the paths of their boxes."""

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.motion.motion import BodyMotion, JointMotion
from ephs.mechanics.motion.moving import ByPath
from ephs.mechanics.motion.reduced import motion_of
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, Body, Joint, Scene, World, frozen
from ephs.mechanics.tree.finding.frames import GROUND as SOLID
from ephs.mechanics.tree.finding.frames import Frames, LinkJoint
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.errors import nearest_of

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

STILL = frozen(np.zeros(6))


@final
class LinkMotion:
    """The motion of links and joints, read from a solution."""

    def __init__(self, frames: Frames, solution: "Solution") -> None:
        self._solution, self._frames = solution, frames
        self._links = {str(link.path): link for link in frames.links if link.pose is not None}
        self._joints = {str(joint.path): joint for joint in frames.joints}

    def body(self, name: str) -> BodyMotion:
        """The motion of a body by the path of its box.

        Raises
        ------
        KeyError
            There is none.
        """
        return BodyMotion(self, _known("body", name, self._links))

    def joint(self, name: str) -> JointMotion:
        """The motion of a joint by the path of its box.

        Raises
        ------
        KeyError
            There is none.
        """
        joint = self._joints[_known("joint", name, self._joints)]
        return JointMotion(self, name, self._solution[joint.state.path].reshape(-1, joint.pair.dim))

    def outline(self) -> Scene:
        """Bodies, and joints between these and the ground, as a scene to be drawn; bodies have no shapes."""
        first = {name: self.poses(name)[0] for name in self._links}
        bodies = {
            name: Body(name, float(link.inertia[5, 5]), frozen(link.inertia[:3, :3]), frozen(first[name]), STILL)
            for name, link in self._links.items()
        }
        named = dict(enumerate(str(link.path) if str(link.path) in bodies else None for link in self._frames.links))
        named[SOLID] = GROUND
        joints: dict[str, Joint] = {}
        for name, joint in self._joints.items():
            ends = [(named[frame.link], frame.offset) for frame in (joint.first, joint.second)]
            if None not in (ends[0][0], ends[1][0]):
                joints[name] = _drawn(name, joint, ends, np.array(self._solution[joint.state.path][0]))
        return Scene(self._solution.name, World(), bodies, joints)

    def poses(self, name: str) -> Array:
        """(n, 7) of a body."""
        pose = self._links[name].pose
        return np.tile(SE3.identity(), (len(self._solution), 1)) if pose is None else self._solution[pose.path]

    @property
    def twists(self) -> dict[str, Array]:
        """(n, 6) by body."""
        return {str(path): twist for path, twist in self._found.twists.items()}

    @property
    def rates(self) -> dict[str, Array]:
        """(n, d) by joint."""
        return {name: self._found.rate(joint.path) for name, joint in self._joints.items()}

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint."""
        return self._found.wrench(self._joints[name].path)

    @cached_property
    def _found(self) -> ByPath:
        return motion_of(self._solution)


def _drawn(name: str, joint: LinkJoint, ends: list[tuple[str | None, Array]], element: Array) -> Joint:
    """A joint with its location only."""
    (one, at), (other, there) = ends
    nothing = frozen(np.zeros(joint.pair.dim))
    return Joint(
        name, joint.pair.name, str(one), str(other), frozen(at), frozen(there), 0.0,
        frozen(np.zeros((joint.pair.dim,) * 2)), nothing, nothing, ENVIRONMENT, nothing, None, frozen(element), nothing,
    )  # fmt: skip


def _known(what: str, name: str, known: Mapping[str, object]) -> str:
    if str(Path.of(name)) not in known:
        listed = ", ".join(known) or "none"
        raise KeyError(f"{name}: no such {what}; known: {listed}{nearest_of(name, known)}")
    return str(Path.of(name))
