"""Motion of the bodies and joints of a system without scene, by the paths of their boxes."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.motion.batch import adjoint_inverse, compose, included, inverse
from ephs.mechanics.motion.gaps import Opening, largest_opening, relative_openings
from ephs.mechanics.motion.leaps import leaps
from ephs.mechanics.motion.motion import BodyMotion, JointMotion
from ephs.mechanics.motion.moving import ByPath
from ephs.mechanics.motion.readout import ends
from ephs.mechanics.motion.reduced import motion_of
from ephs.mechanics.motion.shells import LinkedShell, ShellMotion, linked_shell_motion, shells_of_links
from ephs.mechanics.scene.joints import bare_joint
from ephs.mechanics.scene.kinematics import AssemblyJoint, Hop, spanning_hops
from ephs.mechanics.scene.model import GROUND, Body, Joint, Scene, World, frozen
from ephs.mechanics.tree.finding.frames import GROUND as SOLID
from ephs.mechanics.tree.finding.frames import Frames, LinkJoint
from ephs.mechanics.tree.finding.tendons import length_errors
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.posing.errors import nearest_of
from ephs.solve.result.labels import Labels, freedoms

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

STILL = frozen(np.zeros(6))


@final
class LinkMotion:
    """The motion of links and joints, read from a solution."""

    def __init__(self, frames: Frames, joints: Sequence[AssemblyJoint], solution: "Solution") -> None:
        self._solution, self._frames, self._assembled = solution, frames, joints
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
        coordinate = self._solution[joint.state.path].reshape(len(self._solution), joint.pair.dim)
        return JointMotion(self, name, coordinate)

    def shell(self, name: str) -> ShellMotion:
        """Nodes and energies of the elements in a box, by its path; ``shell`` of those in no box.

        Raises
        ------
        KeyError
            There are none.
        """
        stored = self._solution.ledgers.storages
        return linked_shell_motion(self._shells[_known("shell", name, self._shells)], self.poses, stored.__getitem__)

    @cached_property
    def _shells(self) -> dict[str, LinkedShell]:
        return shells_of_links(self._frames)

    @property
    def freedoms(self) -> dict[str, Labels]:
        """Names and units of the coordinates of each joint, by the path of its box."""
        return {name: freedoms(joint.pair) for name, joint in self._joints.items()}

    def summary(self) -> dict[str, Any]:
        """Bodies and joints at the end."""
        return ends(LinkMotion(self._frames, self._assembled, self._solution[-1:]), self._links, self._joints)

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
        sheets: Any = self._shells
        return Scene(self._solution.name, World(), bodies, joints, shells=sheets)

    def poses(self, name: str) -> Array:
        """(n, 7) of a body, or of the ground."""
        pose = None if name == GROUND else self._links[name].pose
        return np.tile(SE3.identity(), (len(self._solution), 1)) if pose is None else self._solution[pose.path]

    def state(self, i: int) -> dict[Path, Array]:
        """The states at the i-th instant, momenta projected on the joints."""
        state = self._solution.state_at(i)
        for name, link in self._links.items():
            if link.momentum is not None:
                state[link.momentum.path] = link.inertia @ self.twists[name][i]
        return state

    @property
    def twists(self) -> dict[str, Array]:
        """(n, 6) by body."""
        return self._velocities[0]

    @property
    def rates(self) -> dict[str, Array]:
        """(n, d) by joint."""
        return self._velocities[1]

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint."""
        return self._found.wrench(self._joints[name].path)

    def leaps(self, h: float) -> Iterator[tuple[Path, int, float]]:
        """Contacts that a step of at most h s passed: path, instant after it, the step's way in thicknesses."""
        return leaps(self._solution, h)

    def length_errors(self) -> Iterator[tuple[Path, int, float]]:
        """Tendons: path, instant at which the state is farthest from the points' distances, part of the length."""
        return length_errors(self._solution)

    def velocity_error(self) -> Array:
        """(n,) largest component of the velocity residual of any joint between bodies and the ground, m/s or rad/s."""
        worst, twists, rates = np.zeros(len(self._solution)), self.twists, self.rates
        assembled = {of.name: of for of in self._assembled}
        names = {i: str(link.path) for i, link in enumerate(self._frames.links) if str(link.path) in self._links}
        for name, joint in self._joints.items():
            ends = joint.first, joint.second
            if not {end.link for end in ends} <= {SOLID, *names}:
                continue
            inside = self._inside(assembled[name], slice(None))
            frames = compose(np.broadcast_to(joint.first.offset, inside.shape), inside), joint.second.offset
            residual = -rates[name] @ joint.pair.basis.T
            for end, frame, sign in zip(ends, frames, (-1.0, 1.0), strict=True):
                if end.link != SOLID:
                    seen = adjoint_inverse(np.broadcast_to(frame, inside.shape))
                    residual = residual + sign * np.einsum("nij,nj->ni", seen, twists[names[end.link]])
            worst = np.maximum(worst, np.abs(residual).max(axis=1))
        return worst

    def constraint_error(self) -> Array:
        """(n,) largest angle or distance between where a joint's coordinates and its links put the frame C2."""
        return largest_opening(lambda at: [*self._openings(at).values()], len(self._solution), len(self._assembled))

    def gaps(self, every: int) -> dict[Path, Array]:
        """Per joint the residual of its position at every so many instants, the last one first: rad, or a part of the
        mechanism's length."""
        problem = self._solution.problem
        found = self._openings(slice(None, None, -every))
        worst = relative_openings([*found.values()], 1.0 if problem is None else problem.length)
        return {Path.of(name): row for name, row in zip(found, worst, strict=True)}

    def _openings(self, at: slice) -> dict[str, Opening]:
        """Joints between links whose poses are known; those of frames without one are where a joint puts them."""
        poses = {i: self.poses(str(of.path))[at] for i, of in enumerate(self._frames.links) if of.pose is not None}
        within = {of.name: self._inside(of, at) for of in self._assembled}
        n, placed = len(self._solution.t[at]), set[int]()
        poses[SOLID] = np.tile(SE3.identity(), (n, 1))
        for hop in self._hops:
            link = self._assembled[hop.link]
            known, here, there = link.body1, link.frame1, link.frame2
            inside = within[link.name]
            if link.body1 == hop.body:
                known, here, there, inside = link.body2, there, here, inverse(inside)
            if hop.body not in poses and known in poses:
                frame = compose(poses[known], np.broadcast_to(here, (n, 7)))
                poses[hop.body] = compose(compose(frame, inside), np.broadcast_to(SE3.inverse(there), (n, 7)))
                placed.add(hop.link)
        return {
            link.name: (poses[link.body1], link.frame1, within[link.name], poses[link.body2], link.frame2)
            for number, link in enumerate(self._assembled)
            if number not in placed and {link.body1, link.body2} <= poses.keys()
        }

    @cached_property
    def _hops(self) -> list[Hop]:
        return spanning_hops(self._assembled, len(self._frames.links), ())

    def _inside(self, joint: AssemblyJoint, at: slice) -> Array:
        """(n, 7) poses of C2 in C1 by the coordinates of a joint."""
        rows = self._solution[self._joints[joint.name].state.path].reshape(len(self._solution), joint.coupling.dim)
        return included(joint.coupling, rows[at])

    @cached_property
    def _velocities(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Twists by body and rates by joint."""
        twists = {str(path): twist for path, twist in self._found.twists.items()}
        return twists, {name: self._found.rate(joint.path) for name, joint in self._joints.items()}

    @cached_property
    def _found(self) -> ByPath:
        return motion_of(self._solution)


def _drawn(name: str, joint: LinkJoint, ends: list[tuple[str | None, Array]], element: Array) -> Joint:
    """A joint with its location only."""
    (one, at), (other, there) = ends
    rate = frozen(np.zeros(joint.pair.dim))
    return bare_joint(name, joint.pair.name, (str(one), str(other)), (at, there), frozen(element), rate)


def _known(what: str, name: str, known: Mapping[str, object]) -> str:
    if str(Path.of(name)) not in known:
        listed = ", ".join(known) or "none"
        raise KeyError(f"{name}: no such {what}; known: {listed}{nearest_of(name, known)}")
    return str(Path.of(name))
