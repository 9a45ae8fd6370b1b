"""Mechanisms in systems without scene: their joints are found in the flat system and assembled.

A joint is a holonomic relation between two frames; frame changes lead from there to bodies, whose momentum is coupled
to a pose, or to the ground. Relative poses follow from poses and poses from relative poses where they are not given; a
joint that stays open is refused, as in scenes. Joints at frames without a pose, as inside universal joints, are left as
they are.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.motion.batch import compose, inverse
from ephs.mechanics.scene.geometry import Coupling
from ephs.mechanics.scene.kinematics import Link, extent
from ephs.mechanics.scene.tree import spanning_hops
from ephs.mechanics.tree.finding.frames import GROUND, Frames, frames_of
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.descriptor import Descriptor
from ephs.semantics.errors import AssemblyError
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.solve.result.solution import Solution


@final
@dataclass(frozen=True, slots=True, eq=False)
class FlatJoints:
    """The joints of a flat system.

    Parameters
    ----------
    links
        Each with its bodies by number, −1 for the ground.
    relative
        Paths of their relative poses.
    poses
        Paths of the bodies' poses, by number.
    frames
        Links and joints as they are found in the system.
    """

    links: tuple[Link, ...]
    relative: tuple[Path, ...]
    poses: tuple[Path, ...]
    frames: Frames

    def gaps(self, solution: Solution) -> Array:
        """(n,) largest distance in m or angle in rad between where a joint and its bodies put the frame C2."""
        n = len(solution)
        worst = np.zeros(n)
        for link, path in zip(self.links, self.relative, strict=True):
            rows = solution[path].reshape(n, link.coupling.dim)
            inside = np.array([link.coupling.include(link.coupling.element(row)) for row in rows]).reshape(n, 7)
            first, second = (self._frame(solution, body, frame) for body, frame in _ends(link))
            gap = compose(inverse(second), compose(first, inside))
            angle = 2.0 * np.linalg.norm(gap[:, 1:4], axis=1)  # of small ones, and half turns still show
            worst = np.maximum(worst, np.maximum(angle, np.linalg.norm(gap[:, 4:], axis=1)))
        return worst

    def _frame(self, solution: Solution, body: int, frame: Array) -> Array:
        n = len(solution)
        poses = np.tile(SE3.identity(), (n, 1)) if body < 0 else solution[self.poses[body]]
        return compose(poses, np.broadcast_to(frame, (n, 7)))


def _ends(link: Link) -> tuple[tuple[int, Array], tuple[int, Array]]:
    return (link.body1, link.frame1), (link.body2, link.frame2)


def flat_joints(d: Descriptor) -> FlatJoints:
    """The joints of a flat system between bodies with poses, and the ground."""
    found = frames_of(d)
    posed = [i for i, link in enumerate(found.links) if link.pose is not None]
    body = {i: number for number, i in enumerate(posed)} | {GROUND: GROUND}
    joints = [j for j in found.joints if {j.first.link, j.second.link} <= body.keys()]
    return FlatJoints(
        tuple(
            Link(
                str(j.path), body[j.first.link], body[j.second.link], j.first.offset, j.second.offset, Coupling(j.pair)
            )
            for j in joints
        ),
        tuple(j.state.path for j in joints),
        tuple(pose.path for i in posed if (pose := found.links[i].pose) is not None),
        found,
    )


def assembled(joints: FlatJoints, state: Mapping[Path, Array], given: Collection[Path]) -> dict[Path, Array]:
    """The states with poses that are not ``given`` set from relative poses, and then these from those.

    Raises
    ------
    AssemblyError
        A joint stays open by more than the tolerance of assembly; it names the joint and the gap.
    """
    out = dict(state)
    known = {body for body, path in enumerate(joints.poses) if path in given}
    named = {k.name for k, path in zip(joints.links, joints.relative, strict=True) if path in given}
    poses = np.array([out[path] for path in joints.poses]).reshape(-1, 7)
    reached = known | {-1}
    for hop in spanning_hops(joints.links, len(poses), named):
        link = joints.links[hop.link]
        if hop.body not in known and (link.body1 if hop.forward else link.body2) in reached:
            x = out[joints.relative[hop.link]]
            poses[hop.body] = link.place_second(poses, x) if hop.forward else link.place_first(poses, x)
            reached.add(hop.body)
    for path, pose in zip(joints.poses, poses, strict=True):
        out[path] = np.array(pose)
    length = extent(joints.links, poses)[1] or 1.0
    for link, path in zip(joints.links, joints.relative, strict=True):
        x = out[path] if path in given else link.coupling.fit(link.relative(poses), out[path])
        distance, angle = link.gap(poses, x)
        if distance > ASSEMBLY * length or angle > ASSEMBLY:
            raise AssemblyError("open-joint", link.name, found=f"{distance:.3g} m and {angle:.3g} rad")
        if path not in given:
            out[path] = x
    return out
