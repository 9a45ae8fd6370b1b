"""Coupling of two frames by a joint: the pairs and the universal joint behind one small interface, and poses
from axes.

Poses are 7-vectors ``[w, x, y, z, rx, ry, rz]``; every twist is left-trivialised.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.scene.bodies import IDENTITY_POSE
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import PAIRS, SE3, Pair, pair
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.codes import SE3 as SE3_CODE
from ephs.semantics.spaces.codes import SO3 as SO3_CODE
from ephs.semantics.spaces.decompositions import pseudoinverse
from ephs.semantics.spaces.pairs import left_inverse
from ephs.semantics.spaces.rank import ALIGNED, DIRECTION

if TYPE_CHECKING:
    from ephs.mechanics.scene.joints import Joint

UNIVERSAL = "universal"
# Pairs whose degrees of freedom do not depend on the direction of the joint axes.
ROUND = frozenset({"spherical", "free", "fixed"})


@final
@dataclass(frozen=True, slots=True)
class JointCoupling:
    """The possible poses I(x) of the joint frame C2 in C1, and the twists B(x) u_r that they allow.

    ``pair`` for a lower pair; for a universal joint the revolute pair, and ``middle`` between its two copies.
    """

    pair: Pair
    middle: Array | None = None

    @property
    def dim(self) -> int:
        """The number of freedoms."""
        return self.pair.dim if self.middle is None else 2

    @property
    def size(self) -> int:
        """Number of reals that store an element."""
        return self.pair.size if self.middle is None else 2

    @property
    def turning(self) -> range:
        """Coordinates that form a rotation vector."""
        return range(3) if self.middle is None and self.pair.code in (SO3_CODE, SE3_CODE) else range(0)

    def identity(self) -> Array:
        """The element whose coordinates are zero."""
        return self.pair.manifold.identity() if self.middle is None else np.zeros(2)

    def include(self, x: Array) -> Array:
        """The pose (7,) of C2 in C1."""
        if self.middle is None:
            return self.pair.include(x)
        first, second = self.pair.include(x[:1]), self.pair.include(x[1:])
        return SE3.compose(SE3.compose(first, self.middle), second)

    def basis(self, x: Array) -> Array:
        """B (6, d): the twist of C2 relative to C1, in the axes of C2, of each degree of freedom."""
        if self.middle is None:
            return self.pair.basis
        after = SE3.compose(self.middle, self.pair.include(x[1:]))
        return np.column_stack((SE3.adjoint(SE3.inverse(after)) @ self.pair.basis[:, 0], self.pair.basis[:, 0]))

    def left_inverse(self, basis: Array) -> Array:
        """(d, 6) of least norm with B⁺ B = 1, of a basis (6, d) that `basis` gave."""
        return left_inverse(self.pair) if self.middle is None else np.asarray(pseudoinverse(basis), dtype=float)

    def coordinates(self, x: Array) -> Array:
        """The coordinates (d,) of an element."""
        return self.pair.coordinates(x) if self.middle is None else np.array(x)

    def element(self, coordinates: Array) -> Array:
        """The element (size,) of coordinates (d,)."""
        return self.pair.element(coordinates) if self.middle is None else np.array(coordinates)

    def fit(self, relative: Array, near: Array | None = None) -> Array:
        """The element whose inclusion is nearest to a pose; of several, one close to ``near``."""
        if self.middle is not None:
            return self._fit_universal(relative, near)
        return self.pair.fit(relative, near)

    def _fit_universal(self, relative: Array, near: Array | None) -> Array:
        middle = so3.quaternion_to_matrix(np.asarray(self.middle)[:4])
        whole = so3.quaternion_to_matrix(relative[:4])
        before, after = middle[:, 2], whole[:, 2]
        first = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
        rest = middle.T @ _about_z(first).T @ whole
        found = np.array([first, np.arctan2(rest[1, 0] - rest[0, 1], rest[0, 0] + rest[1, 1])])
        about = np.zeros(2) if near is None else near
        return found - 2.0 * np.pi * np.round((found - about) / (2.0 * np.pi))


def coupling(kind: str, pitch: float = 0.0, middle: Array | None = None) -> JointCoupling:
    """The coupling of a joint type; ``pitch`` is for screws, ``middle`` for universal joints."""
    if kind == UNIVERSAL:
        return JointCoupling(pair("revolute"), np.array(IDENTITY_POSE if middle is None else middle))
    return JointCoupling(pair(kind, pitch=pitch) if "pitch" in PAIRS[kind].parameters else pair(kind))


def coupling_of(joint: "Joint") -> JointCoupling:
    """The coupling of a joint."""
    return coupling(joint.kind, joint.pitch, joint.middle)


def joint_types() -> list[str]:
    """Every joint type that a scene file may name."""
    return [name for name, entry in PAIRS.items() if set(entry.parameters) <= {"pitch"}] + [UNIVERSAL]


def unit(vector: Array) -> Array | None:
    """The direction of a vector, or None for zero."""
    size = float(np.linalg.norm(vector))
    return vector / size if size > DIRECTION else None


def frame_rotation(z: Array, x: Array | None = None) -> Array | None:
    """The quaternion of a frame with this (unit) z axis, and an x axis as near as may be to ``x``.

    The default x is the world's, or the world's y where the z axis is nearly along the world's x. None
    where ``x`` is along z.
    """
    hint = x if x is not None else np.array([1.0, 0.0, 0.0]) if abs(z[0]) <= 0.9 else np.array([0.0, 1.0, 0.0])
    normal = unit(hint)
    if normal is None:
        return None
    normal = normal - z * (z @ normal)
    if np.linalg.norm(normal) < ALIGNED:
        return None
    normal = normal / np.linalg.norm(normal)
    return so3.matrix_to_quaternion(np.column_stack((normal, so3.hat(z) @ normal, z)))


def body_twist(pose: Array, velocity: Array, angular_velocity: Array) -> Array:
    """The body-frame twist (6,) of a velocity in the world basis and an angular velocity in body axes."""
    return np.concatenate((angular_velocity, so3.quaternion_to_matrix(pose[:4]).T @ velocity))


def _about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
