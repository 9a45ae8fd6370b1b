"""All kernels of the groups in one place, and those that choose the group by its code.

A driver that knows states only as (code, numbers) calls `retract`, `increment`, `dexp_left`, `include`.
Dimensions come from the shapes of the arrays. Nothing is allocated.
"""

import numpy as np

from ephs.semantics.spaces.codes import SE2 as SE2
from ephs.semantics.spaces.codes import SE3 as SE3
from ephs.semantics.spaces.codes import SO3 as SO3
from ephs.semantics.spaces.codes import VECTOR as VECTOR
from ephs.semantics.spaces.codes import SO3xR3 as SO3xR3
from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.manifold import Array
from ephs.semantics.spaces.planar_kernels import se2_compose as se2_compose
from ephs.semantics.spaces.planar_kernels import se2_dexp as se2_dexp
from ephs.semantics.spaces.planar_kernels import se2_dexp_inv as se2_dexp_inv
from ephs.semantics.spaces.planar_kernels import se2_dexp_left as se2_dexp_left
from ephs.semantics.spaces.planar_kernels import se2_dexp_left_inv as se2_dexp_left_inv
from ephs.semantics.spaces.planar_kernels import se2_exp as se2_exp
from ephs.semantics.spaces.planar_kernels import se2_increment as se2_increment
from ephs.semantics.spaces.planar_kernels import se2_inverse as se2_inverse
from ephs.semantics.spaces.planar_kernels import se2_log as se2_log
from ephs.semantics.spaces.planar_kernels import se2_retract as se2_retract
from ephs.semantics.spaces.rigid_kernels import ad as ad
from ephs.semantics.spaces.rigid_kernels import adjoint as adjoint
from ephs.semantics.spaces.rigid_kernels import adjoint_apply as adjoint_apply
from ephs.semantics.spaces.rigid_kernels import adjoint_inverse as adjoint_inverse
from ephs.semantics.spaces.rigid_kernels import coadjoint_apply as coadjoint_apply
from ephs.semantics.spaces.rigid_kernels import dexp as dexp
from ephs.semantics.spaces.rigid_kernels import dexp_inv as dexp_inv
from ephs.semantics.spaces.rigid_kernels import pose_between as pose_between
from ephs.semantics.spaces.rigid_kernels import pose_compose as pose_compose
from ephs.semantics.spaces.rigid_kernels import pose_dexp_left as pose_dexp_left
from ephs.semantics.spaces.rigid_kernels import pose_dexp_left_inv as pose_dexp_left_inv
from ephs.semantics.spaces.rigid_kernels import pose_exp as pose_exp
from ephs.semantics.spaces.rigid_kernels import pose_increment as pose_increment
from ephs.semantics.spaces.rigid_kernels import pose_inverse as pose_inverse
from ephs.semantics.spaces.rigid_kernels import pose_log as pose_log
from ephs.semantics.spaces.rigid_kernels import pose_normalise as pose_normalise
from ephs.semantics.spaces.rigid_kernels import pose_retract as pose_retract
from ephs.semantics.spaces.rotation_kernels import (
    exp_quaternion,
    log_quaternion,
    polynomial,
    product,
    write_block,
)
from ephs.semantics.spaces.rotation_kernels import quat_multiply as quat_multiply
from ephs.semantics.spaces.rotation_kernels import quat_rotate as quat_rotate
from ephs.semantics.spaces.rotation_kernels import quat_rotate_back as quat_rotate_back
from ephs.semantics.spaces.rotation_kernels import quat_to_matrix as quat_to_matrix
from ephs.semantics.spaces.rotation_kernels import so3_exp_quat as so3_exp_quat
from ephs.semantics.spaces.rotation_kernels import so3_left_jacobian as so3_left_jacobian
from ephs.semantics.spaces.rotation_kernels import so3_left_jacobian_inv as so3_left_jacobian_inv
from ephs.semantics.spaces.rotation_kernels import so3_log_quat as so3_log_quat
from ephs.semantics.spaces.series_kernels import beta, cot, gamma


@kernel
def retract(code: int, x0: Array, v: Array, x1: Array) -> None:
    """x1 = x0·exp(v), shapes (size,), (dim,), (size,); x0 + v in vector spaces. x1 may alias x0."""
    if code == VECTOR:
        for i in range(v.shape[0]):
            x1[i] = x0[i] + v[i]
    elif code == SE3:
        pose_retract(x0, v, x1)
    elif code == SE2:
        se2_retract(x0, v, x1)
    else:
        a, b, c, d = exp_quaternion(v[0], v[1], v[2])
        a, b, c, d = product(x0[0], x0[1], x0[2], x0[3], a, b, c, d)
        x1[0], x1[1], x1[2], x1[3] = a, b, c, d
        if code == SO3xR3:
            x1[4], x1[5], x1[6] = x0[4] + v[3], x0[5] + v[4], x0[6] + v[5]


@kernel
def increment(code: int, x0: Array, x1: Array, v: Array) -> None:
    """v = log(x0⁻¹·x1), shapes (size,), (size,), (dim,); x1 − x0 in vector spaces. Rotations come out ≤ π."""
    if code == VECTOR:
        for i in range(v.shape[0]):
            v[i] = x1[i] - x0[i]
    elif code == SE3:
        pose_increment(x0, x1, v)
    elif code == SE2:
        se2_increment(x0, x1, v)
    else:
        a, b, c, d = product(x0[0], -x0[1], -x0[2], -x0[3], x1[0], x1[1], x1[2], x1[3])
        v[0], v[1], v[2] = log_quaternion(a, b, c, d)
        if code == SO3xR3:
            v[3], v[4], v[5] = x1[4] - x0[4], x1[5] - x0[5], x1[6] - x0[6]


@kernel
def midpoint(code: int, x0: Array, x1: Array, v: Array, out: Array) -> None:
    """The point half way from x0 to x1; v, shape (dim,), is left holding half the increment."""
    increment(code, x0, x1, v)
    for i in range(v.shape[0]):
        v[i] *= 0.5
    retract(code, x0, v, out)


@kernel
def _dexp_left_rotation(v: Array, inverse: bool, out: Array) -> None:
    for i in range(3, v.shape[0]):
        for j in range(v.shape[0]):
            out[i, j] = out[j, i] = 1.0 * (i == j)
    x = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    f, g = (0.5, cot(x)) if inverse else (-beta(x), gamma(x))
    write_block(out, 0, 0, 1.0 - g * x, (f * v[0], f * v[1], f * v[2]), g, (v[0], v[1], v[2]))


@kernel
def dexp_left(code: int, v: Array, out: Array) -> None:
    """D, shape (dim, dim), with x⁻¹dx = D dv for x = x0·exp(v): dexp of −v; the identity in vector spaces."""
    if code == VECTOR:
        _write_identity(out)
    elif code == SE3:
        pose_dexp_left(v, out)
    elif code == SE2:
        se2_dexp_left(v, out)
    else:
        _dexp_left_rotation(v, False, out)


@kernel
def dexp_left_inv(code: int, v: Array, out: Array) -> None:
    """Inverse of `dexp_left`: the change of log(x0⁻¹x) = v that a left-trivialised dx makes."""
    if code == VECTOR:
        _write_identity(out)
    elif code == SE3:
        pose_dexp_left_inv(v, out)
    elif code == SE2:
        se2_dexp_left_inv(v, out)
    else:
        _dexp_left_rotation(v, True, out)


@kernel
def _write_identity(out: Array) -> None:
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 * (i == j)


@kernel
def include(code: int, basis: Array, x: Array, out: Array) -> None:
    """The inclusion of a pair's element x into SE(3).

    basis is the pair's B, shape (6, dim), used where the group is abelian; out is a pose and may not alias x.
    """
    if code == VECTOR:
        _include_abelian(basis, x, out)
    elif code == SE2:
        half = 0.5 * x[0]
        out[0], out[1], out[2], out[3] = np.cos(half), 0.0, 0.0, np.sin(half)
        out[4], out[5], out[6] = x[1], x[2], 0.0
    else:
        for i in range(4):
            out[i] = x[i]
        for i in range(4, 7):
            out[i] = x[i] if code == SE3 else 0.0


@kernel
def _row(basis: Array, x: Array, i: int) -> float:
    total = 0.0
    for j in range(x.shape[0]):
        total += basis[i, j] * x[j]
    return total


@kernel
def _include_abelian(basis: Array, x: Array, out: Array) -> None:
    a, b, c = _row(basis, x, 0), _row(basis, x, 1), _row(basis, x, 2)
    p, q, r = _row(basis, x, 3), _row(basis, x, 4), _row(basis, x, 5)
    square = a * a + b * b + c * c
    out[0], out[1], out[2], out[3] = exp_quaternion(a, b, c)
    out[4], out[5], out[6] = polynomial(a, b, c, beta(square), gamma(square), p, q, r)
