"""Other programs on the same scenes: Pinocchio with SciPy's integrators, and MuJoCo, built from the scene.

A user of Pinocchio writes the loop himself, so its times include that of the right-hand side in Python.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.scene.model import GROUND, Joint, Scene
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix
from ephs.show.charts.runs import Array, Ending, Setting

__all__ = ["PEERS", "Peer", "PeerError", "PeerRun"]

KINDS = ("revolute", "spherical", "free", "fixed")
_NO_FORCE = "friction, stiffness, drive, motion"


class PeerError(Exception):
    """A scene that a peer cannot do, or a run of it that failed."""

    def __init__(self, text: str, ending: Ending = Ending.REFUSED) -> None:
        super().__init__(text)
        self.ending = ending


@final
@dataclass(frozen=True, slots=True, eq=False)
class PeerRun:
    """Where a peer's run ended: (b, 3) positions, (b, 3, 3) rotations, the time of integration, and counts."""

    position: Array
    rotation: Array
    seconds: float
    evaluations: int
    steps: int


Go = Callable[[Setting, float], PeerRun]


@final
@dataclass(frozen=True, slots=True)
class Peer:
    """A program with one of its integrators; `build` makes what runs a scene up to a time."""

    name: str
    adaptive: bool
    fixed: bool
    package: str
    build: Callable[[Scene, float], Go]

    def prepare(self, scene: Scene, until: float) -> Go:
        """What runs the scene with a setting and a time limit in s.

        Raises
        ------
        PeerError
            The program is not installed, or cannot do the scene.
        """
        try:
            import_module(self.package)
        except ImportError as error:
            raise PeerError(f"{self.package} is not installed") from error
        return self.build(scene, until)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Branch:
    """A joint of the tree, outwards: poses (7,) of its frames in the inner and the outer body."""

    kind: str
    inner: str
    outer: str
    inner_frame: Array
    outer_frame: Array


def _tree(scene: Scene) -> list[_Branch]:
    """The joints from the ground outwards, depth first, which Pinocchio needs."""
    joints = [joint for _, joint in (*scene.all_joints(), *scene.implicit_joints())]
    bodies = dict(scene.all_bodies())
    for joint in joints:
        if joint.kind not in KINDS:
            raise PeerError(f"joints.{joint.name}: found {joint.kind}, expected one of {', '.join(KINDS)}")
        if joint.motion is not None or any(map(np.any, (joint.friction, joint.stiffness, joint.drive))):
            raise PeerError(f"joints.{joint.name}: expected no {_NO_FORCE}")
    if any(True for _ in scene.all_springs()):
        raise PeerError("expected no springs")
    if light := [name for name, body in bodies.items() if body.mass <= 0.0]:
        raise PeerError(f"bodies.{light[0]}: expected a mass above 0")
    found: list[_Branch] = []
    reached = {GROUND}

    def grow(inner: str) -> None:
        for joint in joints:
            for branch in _directions(joint):
                if branch.inner == inner and branch.outer not in reached:
                    reached.add(branch.outer)
                    found.append(branch)
                    grow(branch.outer)

    grow(GROUND)
    if len(found) != len(joints) or len(found) != len(bodies):
        raise PeerError("expected joints that form a tree from the ground")
    return found


def _directions(joint: Joint) -> Iterator[_Branch]:
    yield _Branch(joint.kind, joint.body1, joint.body2, joint.frame1, joint.frame2)
    yield _Branch(joint.kind, joint.body2, joint.body1, joint.frame2, joint.frame1)


def _start(scene: Scene, branch: _Branch) -> tuple[Array, Array]:
    """Pose (7,) and twist (6,) of the outer frame in the inner one, the twist in the outer frame's axes."""
    still, poses, twists = np.zeros(6), {GROUND: SE3.identity()}, {GROUND: np.zeros(6)}
    for name, body in scene.all_bodies():
        poses[name], twists[name] = body.pose, body.twist
    inner = SE3.compose(poses[branch.inner], branch.inner_frame)
    outer = SE3.compose(poses[branch.outer], branch.outer_frame)
    pose = SE3.compose(SE3.inverse(inner), outer)
    own = SE3.adjoint(SE3.inverse(branch.outer_frame)) @ twists[branch.outer]
    carried = SE3.adjoint(SE3.inverse(SE3.compose(branch.inner_frame, pose))) @ twists[branch.inner]
    return pose, still + own - carried


# ---- Pinocchio ---------------------------------------------------------------------------------------------------


def _pin(integrator: str) -> Callable[[Scene, float], Go]:
    def build(scene: Scene, until: float) -> Go:
        from scipy.integrate import solve_ivp

        model = _Pin(scene)

        def go(setting: Setting, limit: float) -> PeerRun:
            begin = time.perf_counter()

            def rates(_t: float, y: Array) -> Array:
                if time.perf_counter() - begin > limit:
                    raise PeerError(f"{limit:g} s of wall time were over", Ending.SLOW)
                return model.rates(y)

            y0 = model.start
            # SciPy warns below 100 ε and then takes that; the tolerance is asked for all the same
            relative = max(setting.value, 100.0 * float(np.finfo(float).eps))
            done = solve_ivp(rates, (0.0, until), y0, method=integrator, rtol=relative, atol=setting.value)
            seconds = time.perf_counter() - begin
            if done.status != 0:
                raise PeerError(str(done.message), Ending.FAILED)
            position, rotation = model.bodies(done.y[:, -1])
            return PeerRun(position, rotation, seconds, int(done.nfev), len(done.t) - 1)

        return go

    return build


@final
class _Pin:
    """The scene as a model of Pinocchio; every joint's frame is the one in the outer body."""

    def __init__(self, scene: Scene) -> None:
        self.pin: Any = import_module("pinocchio")
        pin = self.pin
        kinds = {"revolute": pin.JointModelRZ, "spherical": pin.JointModelSpherical, "free": pin.JointModelFreeFlyer}
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.concatenate([scene.world.gravity, np.zeros(3)]))
        bodies = dict(scene.all_bodies())
        self.names = list(bodies)
        # body -> its joint, and the pose of the joint's frame in the body
        self.at: dict[str, tuple[int, Array]] = {GROUND: (0, np.array(SE3.identity()))}
        q: list[Array] = []
        v: list[Array] = []
        self.turning: list[tuple[int, int, int]] = []
        for branch in _tree(scene):
            pose, twist = _start(scene, branch)
            parent, frame = self.at[branch.inner]
            placed = SE3.compose(SE3.inverse(frame), branch.inner_frame)
            if branch.kind == "fixed":
                whole = SE3.compose(SE3.compose(placed, pose), SE3.inverse(branch.outer_frame))
                number, own = parent, SE3.inverse(whole)
            else:
                name = f"to {branch.outer}"
                number = self.model.addJoint(parent, kinds[branch.kind](), self._se3(placed), name)
                own = branch.outer_frame
                q0, v0 = _pin_coordinates(branch.kind, pose, twist)
                self.turning.append((sum(map(len, q)), sum(map(len, v)), len(q0)))
                q.append(q0)
                v.append(v0)
            self.at[branch.outer] = (number, own)
            body = bodies[branch.outer]
            inertia = pin.Inertia(body.mass, np.zeros(3), np.array(body.inertia))
            self.model.appendBodyToJoint(number, inertia, self._se3(SE3.inverse(own)))
        self.data = self.model.createData()
        self.nq = int(self.model.nq)
        self.start = np.concatenate([*q, *v])
        self.none = np.zeros(int(self.model.nv))

    def rates(self, y: Array) -> Array:
        """Time derivatives of coordinates and velocities; quaternions are normalised before they are used."""
        q, v, out = y[: self.nq].copy(), y[self.nq :], np.empty_like(y)
        for a, b, size in self.turning:
            if size == 1:
                out[a] = v[b]
                continue
            k, w = (a, b) if size == 4 else (a + 3, b + 3)
            q[k : k + 4] /= np.sqrt(q[k : k + 4] @ q[k : k + 4])
            if size == 7:
                out[a : a + 3] = quaternion_to_matrix(np.roll(q[k : k + 4], 1)) @ v[b : b + 3]
            x, y_, z, c = y[k : k + 4]
            wx, wy, wz = v[w : w + 3]
            out[k] = 0.5 * (c * wx + y_ * wz - z * wy)
            out[k + 1] = 0.5 * (c * wy + z * wx - x * wz)
            out[k + 2] = 0.5 * (c * wz + x * wy - y_ * wx)
            out[k + 3] = -0.5 * (x * wx + y_ * wy + z * wz)
        out[self.nq :] = self.pin.aba(self.model, self.data, q, v, self.none)
        return out

    def bodies(self, y: Array) -> tuple[Array, Array]:
        """(b, 3) and (b, 3, 3) of the centre-of-mass frames, in the scene's order."""
        q = y[: self.nq].copy()
        for a, _, size in self.turning:
            if size > 1:
                k = a if size == 4 else a + 3
                q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
        self.pin.forwardKinematics(self.model, self.data, q)
        found = [
            self.data.oMi[number] * self._se3(SE3.inverse(own))
            for number, own in (self.at[name] for name in self.names)
        ]
        return np.array([pose.translation for pose in found]), np.array([pose.rotation for pose in found])

    def _se3(self, pose: Array) -> Any:
        return self.pin.SE3(quaternion_to_matrix(pose[:4]), np.array(pose[4:]))


def _pin_coordinates(kind: str, pose: Array, twist: Array) -> tuple[Array, Array]:
    """Pinocchio's quaternions have the scalar last, its twists the linear part first."""
    quaternion = np.roll(pose[:4], -1)
    if kind == "revolute":
        return np.array([2.0 * np.arctan2(pose[3], pose[0])]), twist[2:3]
    if kind == "spherical":
        return quaternion, twist[:3]
    return np.concatenate([pose[4:], quaternion]), np.concatenate([twist[3:], twist[:3]])


# ---- MuJoCo ------------------------------------------------------------------------------------------------------


def _mujoco(integrator: str) -> Callable[[Scene, float], Go]:
    def build(scene: Scene, until: float) -> Go:
        mujoco: Any = import_module("mujoco")
        branches = _tree(scene)
        names = [name for name, _ in scene.all_bodies()]
        stages = 4 if integrator == "RK4" else 1

        def go(setting: Setting, limit: float) -> PeerRun:
            mujoco.set_mju_user_warning(_silent)  # else it writes a log file into the working folder
            try:
                return run(setting, limit)
            finally:
                mujoco.set_mju_user_warning(None)

        def run(setting: Setting, limit: float) -> PeerRun:
            model = mujoco.MjModel.from_xml_string(_mjcf(scene, branches, integrator, setting.value))
            data = mujoco.MjData(model)
            for branch in branches:
                if branch.kind != "fixed":
                    at = int(model.jnt_dofadr[model.joint(f"to {branch.outer}").id])
                    start = _mujoco_rate(scene, branch)
                    data.qvel[at : at + len(start)] = start
            steps, begin = round(until / setting.value), time.perf_counter()
            for done in range(0, steps, 1000):
                mujoco.mj_step(model, data, min(1000, steps - done))
                if time.perf_counter() - begin > limit:
                    raise PeerError(f"{limit:g} s of wall time were over", Ending.SLOW)
            seconds = time.perf_counter() - begin
            if data.time < until * (1.0 - 1e-6):  # it starts again from zero where its state is not finite
                raise PeerError("the state was not finite", Ending.FAILED)
            mujoco.mj_kinematics(model, data)
            numbers = [model.body(name).id for name in names]
            position, rotation = data.xpos[numbers].copy(), data.xmat[numbers].reshape(-1, 3, 3).copy()
            return PeerRun(position, rotation, seconds, stages * steps, steps)

        return go

    return build


def _silent(_text: str) -> None:
    """What a run's state tells as well."""


def _mujoco_rate(scene: Scene, branch: _Branch) -> Array:
    """Rates of a hinge and a ball in the axes of the body, whose frame is that of its centre of mass."""
    _, twist = _start(scene, branch)
    turned = quaternion_to_matrix(branch.outer_frame[:4])
    if branch.kind == "revolute":
        return twist[2:3]
    if branch.kind == "spherical":
        return turned @ twist[:3]
    body = scene.body(branch.outer)
    return np.concatenate([quaternion_to_matrix(body.pose[:4]) @ body.twist[3:], body.twist[:3]])


def _mjcf(scene: Scene, branches: list[_Branch], integrator: str, step: float) -> str:
    bodies = dict(scene.all_bodies())

    def text(values: Any) -> str:
        return " ".join(repr(float(value)) for value in np.atleast_1d(values))

    def element(branch: _Branch) -> str:
        body = bodies[branch.outer]
        base = SE3.identity() if branch.inner == GROUND else bodies[branch.inner].pose
        pose = SE3.compose(SE3.inverse(base), body.pose)
        axis = quaternion_to_matrix(branch.outer_frame[:4])[:, 2]
        pos = text(branch.outer_frame[4:])
        joint = {
            "revolute": f'<joint name="to {branch.outer}" type="hinge" axis="{text(axis)}" pos="{pos}"/>',
            "spherical": f'<joint name="to {branch.outer}" type="ball" pos="{pos}"/>',
            "free": f'<freejoint name="to {branch.outer}"/>',
            "fixed": "",
        }[branch.kind]
        values, axes = np.linalg.eigh(body.inertia)
        axes[:, 2] *= np.linalg.det(axes)
        turn = text(matrix_to_quaternion(axes))
        own = f'<inertial pos="0 0 0" quat="{turn}" mass="{body.mass!r}" diaginertia="{text(values)}"/>'
        inside = "".join(element(each) for each in branches if each.inner == branch.outer)
        place = f'pos="{text(pose[4:])}" quat="{text(pose[:4])}"'
        return f'<body name="{branch.outer}" {place}>{joint}{own}{inside}</body>'

    tree = "".join(element(branch) for branch in branches if branch.inner == GROUND)
    return (
        '<mujoco><compiler angle="radian" autolimits="false" boundmass="0" boundinertia="0" balanceinertia="false"/>'
        f'<option timestep="{step!r}" gravity="{text(scene.world.gravity)}" integrator="{integrator}">'
        '<flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{tree}</worldbody></mujoco>"
    )


PEERS = {
    peer.name: peer
    for peer in (
        Peer("pin DOP853", True, False, "pinocchio", _pin("DOP853")),
        Peer("pin Radau", True, False, "pinocchio", _pin("Radau")),
        Peer("mujoco RK4", False, True, "mujoco", _mujoco("RK4")),
        Peer("mujoco implicitfast", False, True, "mujoco", _mujoco("implicitfast")),
    )
}
