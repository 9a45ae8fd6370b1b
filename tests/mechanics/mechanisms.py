"""Two bodies and a joint with random data, and their equations written out by hand as the literature has them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ephs.mechanics import joint, mbs_pattern, rigid_body
from ephs.mechanics.elements.components import ground
from ephs.operad import Path, Pattern
from ephs.semantics import System
from ephs.semantics.spaces import PAIRS, SE3, Pair, pair
from ephs.semantics.spaces.rotations import quaternion_to_matrix, rotation_log

ON_GROUND = Pattern.from_text("g: body_momentum; p: body_momentum; ground(p=g); body(p); joint(p1=g, p2=p)")
GRAVITY = np.array([0.3, -0.2, -9.81])


def on_ground(body, link):
    """A body that a joint ties to the ground; the body's is the joint's second frame."""
    return ON_GROUND(ground=ground(), body=body, joint=link)


def kinds():
    return [name for name in PAIRS if name not in ("fixed", "free")]


def inertia(rng):
    """A physical inertia tensor: of a random cloud of points."""
    points = rng.standard_normal((8, 3))
    points -= points.mean(axis=0)
    return np.sum([(p @ p) * np.eye(3) - np.outer(p, p) for p in points], axis=0) / 8.0


@dataclass(frozen=True)
class TwoBodies:
    """Everything random: masses, inertias, offsets, friction, stiffness, a consistent state."""

    of: Pair
    masses: tuple[float, float]
    inertias: tuple[Any, Any]
    offsets: tuple[Any, Any]
    mu: Any
    stiffness: Any
    q1: Any
    x: Any
    u1: Any
    u_r: Any

    @staticmethod
    def draw(kind, seed):
        rng = np.random.default_rng(seed)
        of = pair(kind, **dict.fromkeys(PAIRS[kind].parameters, 0.3))
        factor = rng.standard_normal((of.dim, of.dim))
        stiffness = np.full(of.dim, 1.7)
        frames = tuple(SE3.exp(0.7 * rng.standard_normal(6)) for _ in range(2))
        x = of.manifold.retract(of.manifold.identity(), 0.6 * rng.standard_normal(of.dim))
        masses = tuple(rng.uniform(0.5, 2.0, 2).tolist())
        return TwoBodies(
            of, masses, (inertia(rng), inertia(rng)), frames, factor @ factor.T, stiffness,
            SE3.random(rng), x, rng.standard_normal(6), rng.standard_normal(of.dim),
        )  # fmt: skip

    @property
    def system(self) -> System:
        parts = {f"body{i + 1}": rigid_body(self.masses[i], self.inertias[i], GRAVITY) for i in range(2)}
        pitch = dict(self.of.parameters).get("pitch", 0.0)
        parts["joint"] = joint(self.of.name, self.offsets[0], self.offsets[1], self.mu, self.stiffness, pitch=pitch)
        return System.of(mbs_pattern(), parts)

    @property
    def metric(self):
        return tuple(
            np.block([[j, np.zeros((3, 3))], [np.zeros((3, 3)), m * np.eye(3)]])
            for m, j in zip(self.masses, self.inertias, strict=True)
        )

    @property
    def to_c1(self):
        """Ad_{I⁻¹}Ad_{o₁⁻¹}: a twist of body 1 in the frame C2."""
        back = SE3.adjoint(SE3.inverse(self.of.include(self.x)))
        return back @ SE3.adjoint(SE3.inverse(self.offsets[0]))

    @property
    def to_c2(self):
        return SE3.adjoint(SE3.inverse(self.offsets[1]))

    @property
    def rows(self):
        """[Ad_{I⁻¹}Ad_{o₁⁻¹}, −Ad_{o₂⁻¹}, B]."""
        return np.hstack([self.to_c1, -self.to_c2, self.of.basis])

    @property
    def q2(self):
        there = SE3.compose(SE3.compose(self.q1, self.offsets[0]), self.of.include(self.x))
        return SE3.compose(there, SE3.inverse(self.offsets[1]))

    @property
    def u2(self):
        return np.linalg.solve(self.to_c2, self.to_c1 @ self.u1 + self.of.basis @ self.u_r)

    @property
    def twists(self):
        return np.concatenate([self.u1, self.u2])

    @property
    def state(self):
        momenta = [m @ u for m, u in zip(self.metric, (self.u1, self.u2), strict=True)]
        return {
            "body1.pe.q": self.q1, "body2.pe.q": self.q2, "body1.ke.p": momenta[0], "body2.ke.p": momenta[1],
            "joint.pe.q_r": self.x, "joint.env.s": 0.0,
        }  # fmt: skip

    @property
    def efforts(self):
        return {Path.parse("joint.mf"): np.append(self.u_r, 0.0)}

    def weight(self, i):
        """T*L dV of gravity at body i."""
        q = (self.q1, self.q2)[i]
        force = -self.masses[i] * quaternion_to_matrix(q[:4]).T @ GRAVITY
        return np.concatenate([np.zeros(3), force])

    @property
    def spring(self):
        """T*L dV_r, trivialised by hand for each pair."""
        pose, name, k = self.of.include(self.x), self.of.name, 1.7
        if name == "spherical":
            return k * rotation_log(self.x)
        if name == "free":
            return k * np.concatenate([rotation_log(pose[:4]), quaternion_to_matrix(pose[:4]).T @ pose[4:]])
        if name == "planar":
            return k * np.concatenate([[self.x[0]], quaternion_to_matrix(pose[:4])[:2, :2].T @ self.x[1:]])
        return k * self.x

    @property
    def gyroscopic(self):
        """(ad*_{u₁}p₁, ad*_{u₂}p₂)."""
        return [SE3.ad(u).T @ (m @ u) for m, u in zip(self.metric, (self.u1, self.u2), strict=True)]

    def coordinates_from(self, a, b):
        """The two poses at minimal coordinates z = (a, b) about this state: q₁exp(a), then the joint at x exp(b)."""
        q1 = SE3.compose(self.q1, SE3.exp(a))
        x = self.of.manifold.retract(self.x, b)
        there = SE3.compose(SE3.compose(q1, self.offsets[0]), self.of.include(x))
        return q1, SE3.compose(there, SE3.inverse(self.offsets[1])), x
