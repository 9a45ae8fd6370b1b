"""The groups themselves: vector spaces, SO(3), the cover of SE(2), SE(3), SO(3) × ℝ³.

Products, with R the rotation and r the position of a pose:

========= =================== ========================= ============================
\\         SE(3)               SO(3) × ℝ³                left-trivialised velocity
========= =================== ========================= ============================
product   (R₁R₂, r₁ + R₁r₂)   (R₁R₂, r₁ + r₂)           ω = vee(RᵀṘ) in both,
inverse   (Rᵀ, −Rᵀr)          (Rᵀ, −r)                  υ = Rᵀṙ in SE(3), ṙ in SO(3) × ℝ³
========= =================== ========================= ============================

Twists are ordered (ω, υ), wrenches and momenta likewise.
"""

from dataclasses import dataclass
from math import cos, factorial, sin, sqrt
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from ephs.semantics.spaces import codes
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.manifold import Array, Manifold, register_manifold

_J = np.array([[0.0, -1.0], [1.0, 0.0]])


@final
@dataclass(frozen=True, slots=True)
class VectorSpace(Manifold):
    """ℝᵈ under addition; every dual space is one."""

    def identity(self) -> Array:
        return np.zeros(self.dim)

    def compose(self, a: Array, b: Array) -> Array:
        return a + b

    def inverse(self, a: Array) -> Array:
        return -a

    def exp(self, v: Array) -> Array:
        return np.array(v, dtype=np.float64)

    def log(self, x: Array) -> Array:
        return np.array(x, dtype=np.float64)

    def adjoint(self, x: Array) -> Array:
        return np.eye(self.dim)

    def ad(self, u: Array) -> Array:
        return np.zeros((self.dim, self.dim))

    def dexp(self, v: Array) -> Array:
        return np.eye(self.dim)

    def dexp_inv(self, v: Array) -> Array:
        return np.eye(self.dim)

    def normalise(self, x: Array) -> Array:
        return np.array(x, dtype=np.float64)

    def random(self, rng: np.random.Generator) -> Array:
        return rng.standard_normal(self.dim)


@final
@dataclass(frozen=True, slots=True)
class Rotations(Manifold):
    """SO(3), stored as unit quaternions."""

    def identity(self) -> Array:
        return np.array([1.0, 0.0, 0.0, 0.0])

    def compose(self, a: Array, b: Array) -> Array:
        return so3.matrix_to_quaternion(so3.quaternion_to_matrix(a) @ so3.quaternion_to_matrix(b))

    def inverse(self, a: Array) -> Array:
        return a * np.array([1.0, -1.0, -1.0, -1.0])

    def exp(self, v: Array) -> Array:
        return so3.rotation_exp(v)

    def log(self, x: Array) -> Array:
        return so3.rotation_log(x)

    def adjoint(self, x: Array) -> Array:
        return so3.quaternion_to_matrix(x)

    def ad(self, u: Array) -> Array:
        return so3.hat(u)

    def dexp(self, v: Array) -> Array:
        return so3.rotation_dexp(v)

    def dexp_inv(self, v: Array) -> Array:
        return so3.rotation_dexp_inv(v)

    def normalise(self, x: Array) -> Array:
        return so3.normalised(x)

    def random(self, rng: np.random.Generator) -> Array:
        return so3.random_quaternion(rng)


@final
@dataclass(frozen=True, slots=True)
class PlanarMotions(Manifold):
    """The universal cover of SE(2), stored as (φ, x, y) with the angle φ not wrapped."""

    def identity(self) -> Array:
        return np.zeros(3)

    def compose(self, a: Array, b: Array) -> Array:
        return np.concatenate(([a[0] + b[0]], a[1:] + _turn(a[0]) @ b[1:]))

    def inverse(self, a: Array) -> Array:
        return np.concatenate(([-a[0]], -_turn(-a[0]) @ a[1:]))

    def exp(self, v: Array) -> Array:
        return np.concatenate((v[:1], _planar_v(v[0]) @ v[1:]))

    def log(self, x: Array) -> Array:
        return np.concatenate((x[:1], _planar_v_inv(x[0]) @ x[1:]))

    def adjoint(self, x: Array) -> Array:
        return _planar_blocks(1.0, -_J @ x[1:], _turn(x[0]))

    def ad(self, u: Array) -> Array:
        return _planar_blocks(0.0, -_J @ u[1:], u[0] * _J)

    def dexp(self, v: Array) -> Array:
        angle = float(v[0])
        column = so3.beta(angle) * np.eye(2) + angle * so3.gamma(angle) * _J
        return _planar_blocks(1.0, -column @ _J @ v[1:], _planar_v(angle))

    def dexp_inv(self, v: Array) -> Array:
        angle = float(v[0])
        column = 0.5 * np.eye(2) - angle * so3.cotangent(angle) * _J
        return _planar_blocks(1.0, column @ _J @ v[1:], _planar_v_inv(angle))

    def normalise(self, x: Array) -> Array:
        return np.array(x, dtype=np.float64)

    def random(self, rng: np.random.Generator) -> Array:
        return rng.standard_normal(3)


def _turn(angle: float) -> Array:
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])


def _planar_v(angle: float) -> Array:
    return so3.alpha(angle) * np.eye(2) + angle * so3.beta(angle) * _J


def _planar_v_inv(angle: float) -> Array:
    return (1.0 - angle**2 * so3.cotangent(angle)) * np.eye(2) - 0.5 * angle * _J


def _planar_blocks(corner: float, column: Array, block: Array) -> Array:
    out = np.zeros((3, 3))
    out[0, 0] = corner
    out[1:, 0] = column
    out[1:, 1:] = block
    return out


@dataclass(frozen=True, slots=True)
class _Poses(Manifold):
    """Groups of poses, stored as a unit quaternion and a position."""

    @final
    def identity(self) -> Array:
        return translation(np.zeros(3))

    @final
    def normalise(self, x: Array) -> Array:
        return np.concatenate((so3.normalised(x[:4]), x[4:]))

    @final
    def random(self, rng: np.random.Generator) -> Array:
        return np.concatenate((so3.random_quaternion(rng), rng.standard_normal(3)))


@final
@dataclass(frozen=True, slots=True)
class RigidMotions(_Poses):
    """SE(3), stored as [w, x, y, z, rx, ry, rz]: rotation from body to world, position of the body."""

    def compose(self, a: Array, b: Array) -> Array:
        # numbers, not arrays: setting up a mechanism composes some twenty poses a body; of many (7, n) to the same bits
        w, x, y, z, *at = a.tolist() if a.ndim == 1 else a
        s, i, j, k, *to = b.tolist() if b.ndim == 1 else b
        a0, a1 = w * s - x * i - y * j - z * k, w * i + x * s + y * k - z * j
        a2, a3 = w * j - x * k + y * s + z * i, w * k + x * j - y * i + z * s
        square = a0 * a0 + a1 * a1 + a2 * a2 + a3 * a3
        if a.ndim == 1:
            size = sqrt(square) * (1.0 if a0 >= 0.0 else -1.0)
        else:
            size = np.sqrt(square) * np.where(a0 >= 0.0, 1.0, -1.0)
        e, f, g = y * to[2] - z * to[1], z * to[0] - x * to[2], x * to[1] - y * to[0]
        return np.array([
            a0 / size, a1 / size, a2 / size, a3 / size,
            at[0] + to[0] + 2.0 * (w * e + y * g - z * f),
            at[1] + to[1] + 2.0 * (w * f + z * e - x * g),
            at[2] + to[2] + 2.0 * (w * g + x * f - y * e),
        ])  # fmt: skip

    def inverse(self, a: Array) -> Array:
        w, x, y, z, *at = a.tolist() if a.ndim == 1 else a
        e, f, g = y * at[2] - z * at[1], z * at[0] - x * at[2], x * at[1] - y * at[0]
        return np.array([
            w, -x, -y, -z,
            2.0 * (w * e - y * g + z * f) - at[0],
            2.0 * (w * f - z * e + x * g) - at[1],
            2.0 * (w * g - x * f + y * e) - at[2],
        ])  # fmt: skip

    def exp(self, v: Array) -> Array:
        w = v[:3]
        angle = sqrt(w @ w)
        return np.concatenate((so3.rotation_exp(w), so3.sheared(w, v[3:], so3.beta(angle), so3.gamma(angle))))

    def log(self, x: Array) -> Array:
        w = so3.rotation_log(x[:4])
        return np.concatenate((w, so3.sheared(w, x[4:], -0.5, so3.cotangent(sqrt(w @ w)))))

    def adjoint(self, x: Array) -> Array:
        rotation = so3.quaternion_to_matrix(x[:4])
        return _lower(rotation, so3.hat(x[4:]) @ rotation)

    def ad(self, u: Array) -> Array:
        return _lower(so3.hat(u[:3]), so3.hat(u[3:]))

    def dexp(self, v: Array) -> Array:
        # ad satisfies (A² + θ²)² A = 0, so four powers suffice.
        a, angle = self.ad(v), float(np.linalg.norm(v[:3]))
        square = a @ a
        a1, a2, a3, a4 = _dexp_coefficients(angle)
        return np.eye(6) + a1 * a + a2 * square + a3 * square @ a + a4 * square @ square

    def dexp_inv(self, v: Array) -> Array:
        a, angle = self.ad(v), float(np.linalg.norm(v[:3]))
        square = a @ a
        b2, b4 = _dexp_inv_coefficients(angle)
        return np.eye(6) - 0.5 * a + b2 * square + b4 * square @ square


def _lower(diagonal: Array, below: Array) -> Array:
    """[[D, 0], [B, D]] of 3×3 blocks."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = diagonal
    out[3:, :3] = below
    return out


_DEXP = (
    so3.terms(lambda k: (-1) ** k * (1 - k) / factorial(2 * k + 2)),
    so3.terms(lambda k: (-1) ** k * (1 - k) / factorial(2 * k + 3)),
    so3.terms(lambda k: (-1) ** k * (1 + k) / factorial(2 * k + 4)),
    so3.terms(lambda k: (-1) ** k * (1 + k) / factorial(2 * k + 5)),
)


def _dexp_coefficients(t: float) -> tuple[float, float, float, float]:
    if t < so3.SMALL_ANGLE:
        x = t * t
        a1, a2, a3, a4 = (so3.series(each, x) for each in _DEXP)
        return a1, a2, a3, a4
    s, c = sin(t), cos(t)
    return (
        (4.0 - t * s - 4.0 * c) / (2.0 * t**2),
        (4.0 * t - 5.0 * s + t * c) / (2.0 * t**3),
        (2.0 - t * s - 2.0 * c) / (2.0 * t**4),
        (2.0 * t - 3.0 * s + t * c) / (2.0 * t**5),
    )


_DEXP_INV = (
    so3.terms(lambda k: (-1) ** k * (1 - k) * so3.bernoulli_ratio(k + 1)),
    so3.terms(lambda k: (-1) ** k * (1 + k) * so3.bernoulli_ratio(k + 2)),
)


def _dexp_inv_coefficients(t: float) -> tuple[float, float]:
    if t < so3.SMALL_ANGLE:
        x = t * t
        b2, b4 = (so3.series(each, x) for each in _DEXP_INV)
        return b2, b4
    # 1 − cos θ in a form that does not cancel.
    s, versine = sin(t), 2.0 * sin(0.5 * t) ** 2
    return (
        2.0 / t**2 - (t + 3.0 * s) / (4.0 * t * versine),
        1.0 / t**4 - (t + s) / (4.0 * t**3 * versine),
    )


@final
@dataclass(frozen=True, slots=True)
class DirectMotions(_Poses):
    """SO(3) × ℝ³, stored like SE(3): rotation and world position, a direct product."""

    def compose(self, a: Array, b: Array) -> Array:
        return np.concatenate((SO3.compose(a[:4], b[:4]), a[4:] + b[4:]))

    def inverse(self, a: Array) -> Array:
        return a * np.array([1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0])

    def exp(self, v: Array) -> Array:
        return np.concatenate((so3.rotation_exp(v[:3]), v[3:]))

    def log(self, x: Array) -> Array:
        return np.concatenate((so3.rotation_log(x[:4]), x[4:]))

    def adjoint(self, x: Array) -> Array:
        return _direct_blocks(so3.quaternion_to_matrix(x[:4]), 1.0)

    def ad(self, u: Array) -> Array:
        return _direct_blocks(so3.hat(u[:3]), 0.0)

    def dexp(self, v: Array) -> Array:
        return _direct_blocks(so3.rotation_dexp(v[:3]), 1.0)

    def dexp_inv(self, v: Array) -> Array:
        return _direct_blocks(so3.rotation_dexp_inv(v[:3]), 1.0)


def _direct_blocks(block: Array, diagonal: float) -> Array:
    out = diagonal * np.eye(6)
    out[:3, :3] = block
    return out


def vector_space(name: str, dim: int) -> VectorSpace:
    """ℝᵈ with a name."""
    return VectorSpace(name, dim, dim, codes.VECTOR)


SO3 = Rotations("SO(3)", 3, 4, codes.SO3)
SE2 = PlanarMotions("SE(2)", 3, 3, codes.SE2)


def translation(at: ArrayLike) -> Array:
    """The pose (7,) of a frame at a point (3,), without rotation."""
    return np.concatenate([[1.0, 0.0, 0.0, 0.0], np.asarray(at, dtype=float)])


SE3 = RigidMotions("SE(3)", 6, 7, codes.SE3)
SO3xR3 = DirectMotions("SO(3)xR3", 6, 7, codes.SO3xR3)

register_manifold("*", lambda space: vector_space(space.name, space.dim))
register_manifold("real", lambda space: vector_space(space.name, space.dim))
for _group in (SO3, SE2, SE3, SO3xR3):
    register_manifold(_group.name, lambda space, group=_group: group)
