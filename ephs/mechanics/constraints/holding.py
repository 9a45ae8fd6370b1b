"""Constraint wrenches of each joint about one point, and their rows on the twists.

What a joint holds are the wrenches W that do no work on its degrees of freedom, WᵀB = 0. Seen about one point and in
one set of axes, a wrench on body 2 and its reaction on body 1 make a row (−w, w).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.scene.kinematics import AssemblyJoint, elements
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.state import Snapshot
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import CONSTRAINT, TINY, rank_of
from ephs.semantics.spaces.rotations import quaternion_to_matrix


@final
@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """Constraint of a joint, or of its prescribed motion.

    Attributes
    ----------
    name, joint
        How to call it, and the joint; they differ for a motion.
    body1, body2
        By index, -1 for the ground.
    wrenches
        (6, k) on body 2 in world axes about the mechanism's centre, lengths divided by the mechanism's.
    rows
        (k, 6 n) on the spatial twists of all bodies, likewise.
    rotation, point
        The joint frame C2 in the world, and its origin as the wrenches see it.
    """

    name: str
    joint: str
    body1: int
    body2: int
    wrenches: Array
    rows: Array
    rotation: Array
    point: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class GearHold:
    """Constraint of a rigid gear.

    Attributes
    ----------
    name
        Of the gear.
    body1, body2
        Two bodies of its joints, by index.
    rows
        (1, 6 n) on the spatial twists of all bodies, of length one.
    rates
        By joint, (6 n,) its rate on these twists.
    """

    name: str
    body1: int
    body2: int
    rows: Array
    rates: Mapping[str, Array]


@final
@dataclass(frozen=True, slots=True, eq=False)
class ConfiguredMechanism:
    """A mechanism in one configuration.

    Parameters
    ----------
    joints
        Names of the joints whose wrenches are asked for.
    links
        All joints between bodies.
    poses, roots
        (n, 7) of bodies and frames, and their inverse root inertias.
    joined
        Rigid gears: name, and joint -> factor of its rate in the sum that vanishes.
    centre, length
        (3,), and the length in m by which it is measured: origins of joints and bodies are within it of the centre.
    """

    joints: tuple[str, ...]
    links: tuple[AssemblyJoint, ...]
    poses: Array
    roots: Array
    joined: tuple[tuple[str, Mapping[str, float]], ...]
    centre: Array
    length: float

    @staticmethod
    def of(scene: Scene) -> "ConfiguredMechanism":
        """The mechanism of a scene."""
        now = Snapshot.of(scene)
        ratios = {
            name: dict(zip(gear.joints, [-1.0, *np.atleast_1d(gear.ratio)], strict=True))
            for name, gear in scene.every("gears")
            if not gear.stiffness
        }
        return ConfiguredMechanism.between(
            [name for name, _ in scene.all_joints()], now.links, now.poses, now.roots(), ratios
        )

    @staticmethod
    def between(
        joints: Sequence[str],
        links: Sequence[AssemblyJoint],
        poses: Array,
        roots: Array,
        gears: Mapping[str, Mapping[str, float]],
    ) -> "ConfiguredMechanism":
        """The mechanism of links between bodies in these poses."""
        ends = [link.second(poses)[4:] for link in links]
        points = np.array([*ends, *poses[:, 4:]]).reshape(-1, 3)
        centre = points.mean(axis=0) if len(points) else np.zeros(3)
        length = float(np.linalg.norm(points - centre, axis=1).max(initial=0.0))
        return ConfiguredMechanism(
            tuple(joints), tuple(links), poses, roots, tuple(gears.items()), centre, length or 1.0
        )

    def holds(self, poses: Array, *, motions: bool = True) -> list[Hold]:
        """Constraints of all joints in a configuration, then of the prescribed motions."""
        pairs = list(zip(self.links, elements(self.links, poses), strict=True))
        out = [self._hold(link, poses, x) for link, x in pairs]
        if motions:
            out += [self._hold(link, poses, x, moved=True) for link, x in pairs if link.motion is not None]
        return [hold for hold in out if hold.wrenches.shape[1]]

    def gears(self, poses: Array) -> list[GearHold]:
        """Constraints of the rigid gears in a configuration."""
        links = {link.name: (link, x) for link, x in zip(self.links, elements(self.links, poses), strict=True)}
        out: list[GearHold] = []
        for name, ratios in self.joined:
            chosen = [links[joint] for joint in ratios]
            rates = {
                link.name: self._hold(link, poses, x, moved=True).rows[0] / self._unit(link, x) for link, x in chosen
            }
            row = np.sum([ratio * rates[joint] for joint, ratio in ratios.items()], axis=0)
            row = row / max(float(np.linalg.norm(row)), TINY)
            out.append(GearHold(name, chosen[0][0].body2, chosen[1][0].body2, row[None], rates))
        return out

    def _unit(self, link: AssemblyJoint, x: Array) -> float:
        """Length of the twist of a single degree of freedom at the rate one."""
        basis = link.coupling.basis(x).copy()
        basis[3:] /= self.length
        return float(np.linalg.norm(basis))

    def moved(self, step: Array) -> Array:
        """The poses (n, 7) after spatial twists (n, 6) about the centre, lengths divided by the mechanism's."""
        out = self.poses.copy()
        for pose, twist in zip(out, step, strict=True):
            pose[4:] -= self.centre
            pose[:] = SE3.compose(SE3.exp(np.concatenate([twist[:3], self.length * twist[3:]])), pose)
            pose[4:] += self.centre
        return out

    def _hold(self, link: AssemblyJoint, poses: Array, x: Array, *, moved: bool = False) -> Hold:
        basis = link.coupling.basis(x).copy()
        basis[3:] /= self.length
        # a single degree of freedom moves: the wrench that does work on it alone is the degree of freedom itself
        local = basis / np.linalg.norm(basis) if moved else annihilator(basis)
        rows = np.zeros((local.shape[1], poses.shape[0], 6))
        # the wrench on body 1 acts at C2 by its own frame: the same point up to the joint's residual
        for body, sign, end in (
            (link.body1, -1.0, SE3.compose(link.first(poses), link.coupling.include(x))),
            (link.body2, 1.0, link.second(poses)),
        ):
            if body >= 0:
                rows[:, body] += sign * self._lifted(local, end).T
        second = link.second(poses)
        return Hold(
            f"the motion of {link.name}" if moved else link.name,
            link.name,
            link.body1,
            link.body2,
            self._lifted(local, second),
            rows.reshape(local.shape[1], 6 * poses.shape[0]),
            quaternion_to_matrix(second[:4]),
            (second[4:] - self.centre) / self.length,
        )

    def _lifted(self, wrenches: Array, pose: Array) -> Array:
        """Wrenches in a frame, in world axes about the centre."""
        rotation, at = quaternion_to_matrix(pose[:4]), (pose[4:] - self.centre) / self.length
        force = rotation @ wrenches[3:]
        return np.vstack([rotation @ wrenches[:3] + np.cross(at, force.T).T, force])


def redundant(holds: Sequence[Hold | GearHold], tolerance: float = CONSTRAINT) -> list[Array]:
    """Of each hold, coefficients (k, r) of the combinations that lie in the span of the holds before."""
    span = np.zeros((holds[0].rows.shape[1] if holds else 0, 0))
    out: list[Array] = []
    for hold in holds:
        q, triangle = np.linalg.qr(hold.rows.T)
        rest = q - span @ (span.T @ q)
        rest -= span @ (span.T @ rest)  # twice, because small remainders lose orthogonality
        u, sigma, vt = svd(rest, full_matrices=False)
        new = sigma > tolerance
        out.append(np.linalg.solve(triangle, vt[~new].T))
        span = np.hstack([span, u[:, new]])
    return out


def annihilator(basis: Array) -> Array:
    """An orthonormal basis of the wrenches that do no work on the twists in the columns."""
    if not basis.shape[1]:
        return np.eye(6)
    u, sigma, _ = svd(basis)
    return u[:, rank_of(sigma, CONSTRAINT) :]
