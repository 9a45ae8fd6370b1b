"""Motion of the bodies and joints of a system that no scene was made into, by the paths of their boxes."""

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.motion.batch import adjoint_inverse, compose, included
from ephs.mechanics.motion.motion import BodyMotion, JointMotion
from ephs.mechanics.motion.projection import Held, project
from ephs.mechanics.scene.geometry import Coupling
from ephs.mechanics.tree.finding.frames import GROUND, Frames, Link, LinkJoint
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.solve.errors import nearest_of
from ephs.solve.instant import instant
from ephs.solve.threads import in_one_thread

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

__all__ = ["LinkMotion"]


@final
class LinkMotion:
    """The motion of links and joints, read from a solution.

    Velocities are the stored momenta projected on the joints in the mass metric; they need the momentum of each link.
    """

    def __init__(self, frames: Frames, solution: "Solution") -> None:
        self._frames, self._solution = frames, solution
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
        coordinates = [joint.pair.coordinates(row) for row in self._elements(name)]
        return JointMotion(self, name, np.array(coordinates).reshape(len(self._solution), joint.pair.dim))

    def poses(self, name: str) -> Array:
        """(n, 7) of a body."""
        pose = self._links[name].pose
        return np.tile(SE3.identity(), (len(self._solution), 1)) if pose is None else self._solution[pose.path]

    @property
    def twists(self) -> dict[str, Array]:
        """(n, 6) by body."""
        return self._projected[0]

    @property
    def rates(self) -> dict[str, Array]:
        """(n, d) by joint."""
        return self._projected[1]

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint: the multiplier of its relation in the whole descriptor form, instant by instant."""
        problem, number = self._solution.problem, self._joints[name].relation
        out = np.full((len(self._solution), 6), np.nan)
        if problem is None:
            return out
        momenta = [
            (link.momentum.path, self.twists[str(link.path)] @ link.inertia)
            for link in self._frames.links
            if link.momentum is not None
        ]
        for i, t in enumerate(self._solution.t.tolist()):
            state = self._solution.state_at(i) | {path: rows[i] for path, rows in momenta}
            found = instant(
                problem.descriptor, problem.reference, problem.descriptor.pack(state), problem.inputs(t, state)
            )
            out[i] = found.multiplier(self._frames.wiring.components[number].path)
        return out

    def _elements(self, name: str) -> Array:
        joint = self._joints[name]
        return self._solution[joint.state.path].reshape(len(self._solution), joint.pair.size)

    @cached_property
    @in_one_thread
    def _projected(self) -> tuple[dict[str, Array], dict[str, Array]]:
        links, n = self._frames.links, len(self._solution)
        given = np.zeros((n, len(links), 6))
        for i, link in enumerate(links):
            given[:, i] = self._velocities(link)
        held: list[Held] = []
        for name, joint in self._joints.items():
            inclusion = included(Coupling(joint.pair), self._elements(name))
            before = compose(np.broadcast_to(joint.first.offset, (n, 7)), inclusion)
            after = np.broadcast_to(SE3.adjoint(SE3.inverse(joint.second.offset)), (n, 6, 6))
            ends = ((joint.first.link, adjoint_inverse(before)), (joint.second.link, -after))
            held.append(
                Held({link: rows for link, rows in ends if link != GROUND}, joint.pair.basis, self._prescribed(joint))
            )
        roots = np.array([_root(link.inertia) for link in links]).reshape(-1, 6, 6)
        found, turned = project(held, roots, given)
        twists = {str(link.path): found[:, i] for i, link in enumerate(links)}
        return twists, dict(zip(self._joints, turned, strict=True))

    def _prescribed(self, joint: LinkJoint) -> float | None:
        """The constant rate at a joint's port, None where none is prescribed."""
        problem, port = self._solution.problem, self._frames.wiring.outer.get(joint.rate)
        if problem is None or port is None or joint.pair.dim != 1:
            return None
        signal = problem.signals[port]
        return float(signal.at(0.0, {})[0]) if signal.effort and signal.constant else None

    def _velocities(self, link: Link) -> Array:
        """(n, 6) twists of the stored momenta of a link.

        Raises
        ------
        TypeError
            It stores none: velocities of frames without mass are not read back.
        """
        if link.momentum is None:
            raise TypeError(f"{link.path or 'a frame between joints'} has no momentum, by which velocities are known")
        twists = np.linalg.solve(link.inertia, self._solution[link.momentum.path].T).T
        return np.asarray(twists, dtype=float)


def _known(what: str, name: str, known: Mapping[str, object]) -> str:
    if str(Path.of(name)) not in known:
        listed = ", ".join(known) or "none"
        raise KeyError(f"{name}: no such {what}; known: {listed}{nearest_of(name, known)}")
    return str(Path.of(name))


def _root(inertia: Array) -> Array:
    """(6, 6) symmetric root of the inverse of an inertia."""
    moments, axes = np.linalg.eigh(inertia)
    return np.asarray((axes / np.sqrt(np.abs(moments))) @ axes.T, dtype=float)
