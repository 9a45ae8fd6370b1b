"""A scene for other programs: a tree of joints from the ground, loops closed by points, springs, drives."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.scene.model import GROUND, Joint, Scene
from ephs.mechanics.scene.springs import Spring
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.show.charts.runs import Array, RunEnding, RunSetting

PARALLEL = 1e-9
"""Tolerance of the cosine of parallel axes."""
KINDS = ("revolute", "spherical", "free", "fixed")
CLOSING = ("revolute", "spherical")
ARM = 0.5
"""Distance in m of the second point at which a revolute joint that is not planar is closed."""


class PeerError(Exception):
    """A scene that another program does not support, or its failed run."""

    def __init__(self, text: str, ending: RunEnding = RunEnding.REFUSED) -> None:
        super().__init__(text)
        self.ending = ending


@final
@dataclass(frozen=True, slots=True, eq=False)
class PeerRun:
    """Final state of a peer's run: (b, 3) positions, (b, 3, 3) rotations, the time of integration, and counts.

    ``defect`` is that of the balance of energy at the end, relative to what was turned over.
    """

    position: Array
    rotation: Array
    seconds: float
    evaluations: int
    steps: int
    defect: float


Go = Callable[[RunSetting, float], PeerRun]
Energies = tuple[float, float]
"""Kinetic and potential, in J."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A joint of the tree, outwards: poses (7,) of its frames in the inner and the outer body.

    Parameters
    ----------
    drive
        Constant generalised force on a revolute joint, outwards, in N m.
    """

    kind: str
    inner: str
    outer: str
    inner_frame: Array
    outer_frame: Array
    drive: float


@final
@dataclass(frozen=True, slots=True, eq=False)
class PeerScene:
    """Model of a peer.

    Parameters
    ----------
    branches
        The tree, depth first.
    closures
        (body 1, body 2, point (3,) in body 1, in body 2): points that stay together.
    springs
        Without damping, or with.
    """

    scene: Scene
    branches: tuple[Branch, ...]
    closures: tuple[tuple[str, str, Array, Array], ...]
    springs: tuple[Spring, ...]

    def defect(self, before: Energies, after: Energies) -> float:
        """Change of K + V in a run, relative to the larger of both ends' K + |V − V₀|; NaN with drives or damping,
        whose work and heat other programs do not integrate."""
        if any(branch.drive for branch in self.branches) or any(spring.damping for spring in self.springs):
            return float("nan")
        lifted = after[1] - before[1]
        return abs(after[0] - before[0] + lifted) / max(before[0], after[0] + abs(lifted))


def peer_scene(scene: Scene) -> PeerScene:
    """The tree, the closures and the springs of a scene.

    Raises
    ------
    PeerError
        It has what the adaptors do not express.
    """
    joints = [joint for _, joint in (*scene.all_joints(), *scene.implicit_joints())]
    bodies = dict(scene.all_bodies())
    for joint in joints:
        if joint.kind not in KINDS:
            raise PeerError(f"joints.{joint.name}: found {joint.kind}, expected one of {', '.join(KINDS)}")
        if joint.motion is not None or any(map(np.any, (joint.friction, joint.stiffness))):
            raise PeerError(f"joints.{joint.name}: expected no friction, stiffness, motion")
        if np.any(joint.drive) and joint.kind != "revolute":
            raise PeerError(f"joints.{joint.name}: expected no drive but on revolute joints")
    if light := [name for name, body in bodies.items() if body.mass <= 0.0]:
        raise PeerError(f"bodies.{light[0]}: expected a mass above 0")
    branches, cut = _tree(joints)
    if len(branches) != len(bodies):
        raise PeerError("expected joints that reach all bodies from the ground")
    for joint in cut:
        if joint.kind not in CLOSING or np.any(joint.drive):
            raise PeerError(f"joints.{joint.name}: expected undriven {' or '.join(CLOSING)} joints to close loops")
    flat = _planar(scene, joints)
    closures = tuple(closure for joint in cut for closure in _points(joint, flat))
    return PeerScene(scene, tuple(branches), closures, tuple(spring for _, spring in scene.all_springs()))


def _tree(joints: list[Joint]) -> tuple[list[Branch], list[Joint]]:
    """A tree of shortest paths from the ground, depth first as Pinocchio requires; and the remaining joints."""
    at: dict[str, list[Joint]] = {}
    for joint in joints:
        at.setdefault(joint.body1, []).append(joint)
        at.setdefault(joint.body2, []).append(joint)
    below: dict[str, list[Branch]] = {}
    reached, kept, queue = {GROUND}, set[str](), [GROUND]
    for inner in queue:  # grows while it is read
        for joint in at.get(inner, []):
            branch = _outwards(joint, inner)
            if branch.outer not in reached:
                reached.add(branch.outer)
                kept.add(joint.name)
                queue.append(branch.outer)
                below.setdefault(inner, []).append(branch)
    found: list[Branch] = []
    stack = below.get(GROUND, [])[::-1]
    while stack:
        branch = stack.pop()
        found.append(branch)
        stack += below.get(branch.outer, [])[::-1]
    return found, [joint for joint in joints if joint.name not in kept]


def _outwards(joint: Joint, inner: str) -> Branch:
    drive = float(np.sum(joint.drive))
    if joint.body1 == inner:
        return Branch(joint.kind, joint.body1, joint.body2, joint.frame1, joint.frame2, drive)
    return Branch(joint.kind, joint.body2, joint.body1, joint.frame2, joint.frame1, -drive)


def _planar(scene: Scene, joints: list[Joint]) -> bool:
    """Whether all joints are revolute about parallel axes."""
    poses = {GROUND: SE3.identity()} | {name: body.pose for name, body in scene.all_bodies()}
    axes = [
        quaternion_to_matrix(SE3.compose(poses[joint.body1], joint.frame1)[:4])[:, 2]
        for joint in joints
        if joint.kind == "revolute"
    ]
    return len(axes) == len(joints) and all(abs(abs(float(axis @ axes[0])) - 1.0) < PARALLEL for axis in axes)


def _points(joint: Joint, flat: bool) -> Iterator[tuple[str, str, Array, Array]]:
    arms = (0.0,) if flat or joint.kind == "spherical" else (0.0, ARM)
    for arm in arms:
        ends = [
            frame[4:] + arm * quaternion_to_matrix(frame[:4])[:, 2]
            for frame in (np.asarray(joint.frame1), np.asarray(joint.frame2))
        ]
        yield joint.body1, joint.body2, ends[0], ends[1]


def start(scene: Scene, branch: Branch) -> tuple[Array, Array]:
    """Pose (7,) and twist (6,) of the outer frame in the inner one, the twist in the outer frame's axes."""
    (pose1, twist1), (pose2, twist2) = (_state(scene, name) for name in (branch.inner, branch.outer))
    inner = SE3.compose(pose1, branch.inner_frame)
    outer = SE3.compose(pose2, branch.outer_frame)
    pose = SE3.compose(SE3.inverse(inner), outer)
    own = SE3.adjoint(SE3.inverse(branch.outer_frame)) @ twist2
    carried = SE3.adjoint(SE3.inverse(SE3.compose(branch.inner_frame, pose))) @ twist1
    return pose, own - carried


def _state(scene: Scene, name: str) -> tuple[Array, Array]:
    if name == GROUND:
        return SE3.identity(), np.zeros(6)
    body = scene.body(name)
    return body.pose, body.twist
