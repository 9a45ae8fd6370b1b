"""Between left-trivialised twists and covectors and their material form on (R, r).

A tangent vector at a pose is a pair (Ṙ, ṙ). A covector may be given as an ambient gradient (F_R, f_r), which
pairs as tr(F_Rᵀ Ṙ) + f_r·ṙ, and of which F_R counts modulo R·Sym. With A = Rᵀ F_R:

=================== ========================== ==============================
\\                   SE(3)                      SO(3) × ℝ³
=================== ========================== ==============================
(ω, υ) ↦            (R ω̂, R υ)                 (R ω̂, υ)
(F_R, f_r) ↦        (vee(A − Aᵀ), Rᵀ f_r)      (vee(A − Aᵀ), f_r)
=================== ========================== ==============================
"""

import numpy as np

from ephs.semantics.spaces import codes
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.errors import SpaceError
from ephs.semantics.spaces.manifold import Array, Manifold


def material_velocity(space: Manifold, pose: Array, twist: Array) -> tuple[Array, Array]:
    """The velocity (Ṙ, ṙ), shapes (3, 3) and (3,), of a left-trivialised twist at a pose.

    Raises
    ------
    SpaceError
        Here and below: the space is neither SE(3) nor SO(3) × ℝ³.
    """
    rotation, frame = _frames(space, pose)
    return rotation @ so3.hat(twist[:3]), frame @ twist[3:]


def twist_of_velocity(space: Manifold, pose: Array, velocity: tuple[Array, Array]) -> Array:
    """The left-trivialised twist, shape (6,), of a velocity (Ṙ, ṙ); inverse of `material_velocity`."""
    rotation, frame = _frames(space, pose)
    return np.concatenate((so3.vee(rotation.T @ velocity[0]), frame.T @ velocity[1]))


def covector_of_gradient(space: Manifold, pose: Array, gradient: tuple[Array, Array]) -> Array:
    """The left-trivialised covector, shape (6,), of an ambient gradient (F_R, f_r)."""
    rotation, frame = _frames(space, pose)
    a = rotation.T @ gradient[0]
    return np.concatenate((so3.vee(a - a.T), frame.T @ gradient[1]))


def material_covector(space: Manifold, pose: Array, covector: Array) -> tuple[Array, Array]:
    """The ambient gradient (F_R, f_r) of a left-trivialised covector, with F_R tangent to the rotations."""
    rotation, frame = _frames(space, pose)
    return 0.5 * rotation @ so3.hat(covector[:3]), frame @ covector[3:]


def _frames(space: Manifold, pose: Array) -> tuple[Array, Array]:
    """The rotation, and the axes in which the space's linear velocities are measured."""
    if space.code not in (codes.SE3, codes.SO3xR3):
        raise SpaceError("no material form", name=space.name)
    rotation = so3.quaternion_to_matrix(pose[:4])
    return rotation, rotation if space.code == codes.SE3 else np.eye(3)
