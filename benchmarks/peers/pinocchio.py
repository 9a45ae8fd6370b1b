"""Pinocchio with SciPy's integrators. The time loop is the user's, so times include the right-hand side in Python."""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Any, final

import numpy as np

from benchmarks.peers.scene import Energies, Go, PeerError, PeerRun, PeerScene, peer_scene, start
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.semantics.spaces import SE3, translation
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.show.charts.runs import Array, RunEnding, RunSetting

SOLVED = 1e-13
"""Accuracy to which Pinocchio solves for constraint forces."""
TIGHT, SOFT = 1e-8, 1e-2
"""Proximal parameters of closed loops: the second passes configurations in which constraints lose rank."""
GAIN = 100.0
"""Coefficient of Baumgarte's stabilisation of closed loops, in s⁻²."""
MOST = 4 * 2**30
"""Bytes of the largest array that Pinocchio makes, 48 n³ of n velocities; beyond that a scene is refused."""
FEW = 2
"""Up to so many quaternions are treated one by one, more in arrays."""


def integrator(method: str, *, proximal: float = TIGHT) -> Callable[[Scene, float], Go]:
    """Runner of Pinocchio's accelerations under a method of `scipy.integrate.solve_ivp`."""

    def build(scene: Scene, until: float) -> Go:
        from scipy.integrate import solve_ivp

        given = peer_scene(scene)
        if proximal == SOFT and not given.closures:
            raise PeerError("expected closed loops, which alone it softens")
        model = PinModel(given, proximal)

        def go(setting: RunSetting, limit: float) -> PeerRun:
            begin = time.perf_counter()

            def rates(_t: float, y: Array) -> Array:
                if time.perf_counter() - begin > limit:
                    raise PeerError(f"{limit:g} s of wall time were over", RunEnding.SLOW)
                return model.rates(y)

            # SciPy warns below 100 ε and then uses that; the tolerance is passed nevertheless
            relative = max(setting.value, 100.0 * float(np.finfo(float).eps))
            done = solve_ivp(rates, (0.0, until), model.start, method=method, rtol=relative, atol=setting.value)
            seconds = time.perf_counter() - begin
            if done.status != 0:
                raise PeerError(str(done.message), RunEnding.FAILED)
            end = done.y[:, -1]
            defect = given.defect(model.energies(model.start), model.energies(end))
            return PeerRun(*model.bodies(end), seconds, int(done.nfev), len(done.t) - 1, defect)

        return go

    return build


@final
class PinModel:
    """The scene as a model of Pinocchio; every joint's frame is the one in the outer body.

    Parameters
    ----------
    given
        The scene as a tree with closed loops.
    proximal
        Proximal parameter of the loops' constraints, which are stabilised with Baumgarte's gains.

    Raises
    ------
    PeerError
        The scene has springs, or too many freedoms.
    """

    def __init__(self, given: PeerScene, proximal: float = TIGHT) -> None:
        if given.springs:
            raise PeerError("expected no springs")
        self.pin: Any = import_module("pinocchio")
        pin, scene = self.pin, given.scene
        kinds = {"revolute": pin.JointModelRZ, "spherical": pin.JointModelSpherical, "free": pin.JointModelFreeFlyer}
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.concatenate([scene.world.gravity, np.zeros(3)]))
        bodies = dict(scene.all_bodies())
        self.names = list(bodies)
        # body -> its joint, and the pose of the joint's frame in the body
        self.at: dict[str, tuple[int, Array]] = {GROUND: (0, np.array(SE3.identity()))}
        q: list[Array] = []
        v: list[Array] = []
        drives: list[Array] = []
        places: list[tuple[int, int, int]] = []
        for branch in given.branches:
            pose, twist = start(scene, branch)
            parent, frame = self.at[branch.inner]
            placed = SE3.compose(SE3.inverse(frame), branch.inner_frame)
            if branch.kind == "fixed":
                whole = SE3.compose(SE3.compose(placed, pose), SE3.inverse(branch.outer_frame))
                number, own = parent, SE3.inverse(whole)
            else:
                name = f"to {branch.outer}"
                number = self.model.addJoint(parent, kinds[branch.kind](), self._se3(placed), name)
                own = branch.outer_frame
                q0, v0 = _coordinates(branch.kind, pose, twist)
                places.append((sum(map(len, q)), sum(map(len, v)), len(q0)))
                q.append(q0)
                v.append(v0)
                drives.append(np.full(len(v0), branch.drive))
            self.at[branch.outer] = (number, own)
            body = bodies[branch.outer]
            inertia = pin.Inertia(body.mass, np.zeros(3), np.array(body.inertia))
            self.model.appendBodyToJoint(number, inertia, self._se3(SE3.inverse(own)))
        if 48 * int(self.model.nv) ** 3 > MOST:
            raise PeerError(f"{int(self.model.nv)} velocities, expected fewer: memory grows as their cube")
        self.data = self.model.createData()
        self.nq = int(self.model.nq)
        self.start = np.concatenate([*q, *v])
        self.force = np.concatenate(drives)
        self._close(given, proximal)
        self._lay(places)

    @property
    def loops(self) -> bool:
        """Whether there are constraints."""
        return len(self.constraints) > 0

    def accelerations(self, q: Array, v: Array) -> Array:
        """v̇ at q and v; quaternions of unit length."""
        if self.loops:
            return self.pin.constraintDynamics(
                self.model, self.data, q, v, self.force, self.constraints, self.workspace, self.settings
            )
        return self.pin.aba(self.model, self.data, q, v, self.force)

    def rates(self, y: Array) -> Array:
        """Time derivatives of coordinates and velocities; quaternions are normalised before they are used."""
        q, v, out = y[: self.nq].copy(), y[self.nq :], np.empty_like(y)
        if self._plain:
            out[: self.nq] = v
        else:
            out[self._angles] = v[self._speeds]
            if len(self._quaternions) <= FEW:
                for k, w in zip(self._quaternions, self._spins, strict=True):
                    _turn(q, v, out, int(k[0]), int(w[0]))
            else:
                u = q[self._quaternions]
                q[self._quaternions] = u / np.sqrt(np.einsum("ij,ij->i", u, u))[:, None]
                u, spin = q[self._quaternions], v[self._spins]
                out[self._quaternions[:, :3]] = 0.5 * (u[:, 3:] * spin + _cross(u[:, :3], spin))
                out[self._quaternions[:, 3]] = -0.5 * np.einsum("ij,ij->i", u[:, :3], spin)
            for a, b in self._floating:
                out[a : a + 3] = quaternion_to_matrix(np.roll(q[a + 3 : a + 7], 1)) @ v[b : b + 3]
        out[self.nq :] = self.accelerations(q, v)
        return out

    def energies(self, y: Array) -> Energies:
        """Kinetic and potential energy in J."""
        q = self._unit(y)
        kinetic = self.pin.computeKineticEnergy(self.model, self.data, q, y[self.nq :])
        return float(kinetic), float(self.pin.computePotentialEnergy(self.model, self.data, q))

    def bodies(self, y: Array) -> tuple[Array, Array]:
        """(b, 3) and (b, 3, 3) of the centre-of-mass frames, in the scene's order."""
        q = self._unit(y)
        self.pin.forwardKinematics(self.model, self.data, q)
        found = [
            self.data.oMi[number] * self._se3(SE3.inverse(own))
            for number, own in (self.at[name] for name in self.names)
        ]
        return np.array([pose.translation for pose in found]), np.array([pose.rotation for pose in found])

    def _unit(self, y: Array) -> Array:
        q = y[: self.nq].copy()
        for k in self._quaternions:
            q[k] /= np.linalg.norm(q[k])
        return q

    def _close(self, given: PeerScene, proximal: float) -> None:
        pin = self.pin
        self.constraints = pin.StdVec_RigidConstraintModel()
        self.workspace = pin.StdVec_RigidConstraintData()
        for body1, body2, point1, point2 in given.closures:
            ends = []
            for body, point in ((body1, point1), (body2, point2)):
                number, own = self.at[body]
                there = translation(point)
                ends += [number, self._se3(SE3.compose(SE3.inverse(own), there))]
            made = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, self.model, *ends, pin.ReferenceFrame.LOCAL)
            gains = made.m_baumgarte_parameters
            gains.Kp, gains.Kd = GAIN, float(2.0 * np.sqrt(GAIN))
            made.setBaumgarteCorrectorParameters(gains)
            self.constraints.append(made)
            self.workspace.append(made.createData())
        self.settings = pin.ProximalSettings(SOLVED, proximal, 100)
        if self.loops:
            pin.initConstraintDynamics(self.model, self.data, self.constraints, self.workspace)

    def _lay(self, places: list[tuple[int, int, int]]) -> None:
        """Indices of angles and quaternions among the coordinates, and of their rates among the velocities."""
        self._plain = all(size == 1 for *_, size in places)
        self._angles = np.array([a for a, _, size in places if size == 1], dtype=int)
        self._speeds = np.array([b for _, b, size in places if size == 1], dtype=int)
        turning = [(a + size - 4, b + 3 * (size == 7)) for a, b, size in places if size > 1]
        self._quaternions = np.array([np.arange(a, a + 4) for a, _ in turning], dtype=int).reshape(-1, 4)
        self._spins = np.array([np.arange(b, b + 3) for _, b in turning], dtype=int).reshape(-1, 3)
        self._floating = [(a, b) for a, b, size in places if size == 7]

    def _se3(self, pose: Array) -> Any:
        return self.pin.SE3(quaternion_to_matrix(pose[:4]), np.array(pose[4:]))


def _turn(q: Array, v: Array, out: Array, k: int, w: int) -> None:
    """Normalise the quaternion at k, whose scalar is the last, and give its rate."""
    q[k : k + 4] /= np.sqrt(q[k : k + 4] @ q[k : k + 4])
    x, y, z, c = q[k : k + 4]
    wx, wy, wz = v[w : w + 3]
    out[k] = 0.5 * (c * wx + y * wz - z * wy)
    out[k + 1] = 0.5 * (c * wy + z * wx - x * wz)
    out[k + 2] = 0.5 * (c * wz + x * wy - y * wx)
    out[k + 3] = -0.5 * (x * wx + y * wy + z * wz)


def _cross(a: Array, b: Array) -> Array:
    """Row by row; NumPy's own costs several times as much."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def _coordinates(kind: str, pose: Array, twist: Array) -> tuple[Array, Array]:
    """Pinocchio's quaternions have the scalar last, its twists the linear part first."""
    quaternion = np.roll(pose[:4], -1)
    if kind == "revolute":
        return np.array([2.0 * np.arctan2(pose[3], pose[0])]), twist[2:3]
    if kind == "spherical":
        return quaternion, twist[:3]
    return np.concatenate([pose[4:], quaternion]), np.concatenate([twist[3:], twist[:3]])
