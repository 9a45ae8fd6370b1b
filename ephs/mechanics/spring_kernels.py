"""Compiled discrete relations of springs and dampers, after the plain definitions in `ephs.mechanics.components`.

Signature and layout as in `ephs.semantics.kernel_table`. Slopes at a step of length zero are exact; along a step they
only steer Newton's method, and differences do.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

import numba as nb

from ephs.mechanics.kernels import transposed_jacobian
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import SE2, SE3, SO3
from ephs.semantics.spaces.se3_kernels import dexp_left_inv, log_quaternion, quat_rotate_back, quat_to_matrix, retract

kernel = jit.kernel
DELTA = 1e-6


def coordinate_spring(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = ½ k (coordinate − rest)² on a joint's group; p = group code, k (d,), rest (d,)."""
    d, size = dims[0], dims[3]
    par, x, step = nb.carray(p, 1 + 2 * d), nb.carray(x0, size), nb.carray(v, d)
    effort, slope, energy = nb.carray(e, d), nb.carray(f, (d, d)), nb.carray(c, 1)
    scratch = nb.carray(work, 128)
    moved, there, back = scratch[0:6][:d], scratch[6:12][:d], scratch[12:18][:d]
    code, stiffness, rest = int(par[0]), par[1 : 1 + d], par[1 + d :]
    energy[0] = _coordinate_spring(code, stiffness, rest, x, step, effort, scratch[20:])
    if _still(step):
        _coordinate_slope(code, stiffness, x, effort, slope, scratch[20:])
        return 0
    for i in range(d):
        for j in range(d):
            moved[j] = step[j]
        moved[i] = step[i] + DELTA
        _coordinate_spring(code, stiffness, rest, x, moved, there, scratch[20:])
        moved[i] = step[i] - DELTA
        _coordinate_spring(code, stiffness, rest, x, moved, back, scratch[20:])
        for j in range(d):
            slope[j, i] = (there[j] - back[j]) / (2.0 * DELTA)
    return 0


@kernel
def _still(step):
    size = 0.0
    for i in range(step.shape[0]):
        size += abs(step[i])
    return size == 0.0


@kernel
def _coordinate_slope(code, stiffness, x, effort, slope, work):
    """∂e/∂v at v = 0: half of the derivative of the effort along the group."""
    slope[:, :] = 0.0
    if code == SE2:
        c, s = math.cos(x[0]), math.sin(x[0])
        along, across = stiffness[1], stiffness[2]
        slope[0, 0] = 0.5 * stiffness[0]
        slope[1, 0], slope[2, 0] = 0.5 * effort[2], -0.5 * effort[1]
        slope[1, 1] = 0.5 * (c * c * along + s * s * across)
        slope[2, 2] = 0.5 * (s * s * along + c * c * across)
        slope[1, 2] = slope[2, 1] = 0.5 * c * s * (across - along)
    elif code in (SO3, SE3):
        omega, turn = work[0:3], work[3:12].reshape((3, 3))
        omega[0], omega[1], omega[2] = log_quaternion(x[0], x[1], x[2], x[3])
        dexp_left_inv(SO3, omega, turn)
        for i in range(3):
            for j in range(3):
                slope[i, j] = 0.5 * stiffness[0] * turn[i, j]
        if code == SE3:
            quat_to_matrix(x[:4], turn)
            for i in range(3):
                for j in range(3):
                    for k in range(3):
                        slope[3 + i, 3 + j] += 0.5 * turn[k, i] * stiffness[3 + k] * turn[k, j]
            _half_cross(effort[3:], slope)
    else:
        for i in range(slope.shape[0]):
            slope[i, i] = 0.5 * stiffness[i]


@kernel
def _half_cross(y, slope):
    """½ ỹ by the rotation, of a vector y of the world in turning axes, into rows 3 to 5."""
    slope[3, 1], slope[3, 2] = -0.5 * y[2], 0.5 * y[1]
    slope[4, 0], slope[4, 2] = 0.5 * y[2], -0.5 * y[0]
    slope[5, 0], slope[5, 1] = -0.5 * y[1], 0.5 * y[0]


@kernel
def _coordinate_spring(code, stiffness, rest, x, step, effort, work):
    end, pull, local, turn = work[0:7], work[7:10], work[10:13], work[13:22].reshape((3, 3))
    retract(code, x, step, end[: x.shape[0]])
    d = step.shape[0]
    energy = 0.0
    if code == SE2:
        energy = 0.5 * stiffness[0] * (end[0] - rest[0]) ** 2
        for i in range(2):
            energy += 0.5 * stiffness[1 + i] * (end[1 + i] - rest[1 + i]) ** 2
            pull[i] = stiffness[1 + i] * (0.5 * (x[1 + i] + end[1 + i]) - rest[1 + i])
        half = 0.5 * step[0]
        sine = math.sin(half) / half if abs(half) > 1e-8 else 1.0
        # the mean of R(φ) over the step is R(φ⁰ + v/2) sin(v/2)/(v/2)
        cos, sin = math.cos(x[0] + half), math.sin(x[0] + half)
        effort[0] = stiffness[0] * (0.5 * (x[0] + end[0]) - rest[0])
        effort[1] = sine * (cos * pull[0] + sin * pull[1])
        effort[2] = sine * (cos * pull[1] - sin * pull[0])
    elif code in (SO3, SE3):
        energy = _rotation_spring(stiffness[0], x, step, effort)
        if code == SE3:
            for i in range(3):
                energy += 0.5 * stiffness[3 + i] * (end[4 + i] - rest[3 + i]) ** 2
                pull[i] = stiffness[3 + i] * (0.5 * (x[4 + i] + end[4 + i]) - rest[3 + i])
            quat_rotate_back(x[:4], pull, local)
            transposed_jacobian(step[:3], local, effort[3:], turn)
    else:
        for i in range(d):
            energy += 0.5 * stiffness[i] * (end[i] - rest[i]) ** 2
            effort[i] = stiffness[i] * (x[i] + 0.5 * step[i] - rest[i])
    return energy


@kernel
def _rotation_spring(stiffness, x, step, effort):
    """½ k θ² of a rotation; the effort k ω at the middle, corrected along the step without cancellation."""
    square = step[0] ** 2 + step[1] ** 2 + step[2] ** 2
    length = math.sqrt(square)
    cos, sine = math.cos(0.25 * length), 0.25
    if length > 1e-8:
        sine = math.sin(0.25 * length) / length
    # the middle, from the start by half the step
    a, b, c = sine * step[0], sine * step[1], sine * step[2]
    w = cos * x[0] - a * x[1] - b * x[2] - c * x[3]
    r = cos * x[1] + x[0] * a + x[2] * c - x[3] * b
    s = cos * x[2] + x[0] * b + x[3] * a - x[1] * c
    t = cos * x[3] + x[0] * c + x[1] * b - x[2] * a
    if w < 0.0:
        w, r, s, t = -w, -r, -s, -t
    norm = math.sqrt(r * r + s * s + t * t)
    scale = 2.0 * math.atan2(norm, w) / norm if norm > 1e-150 else 2.0
    effort[0], effort[1], effort[2] = stiffness * scale * r, stiffness * scale * s, stiffness * scale * t
    # cos(θ/2) at both ends is middle ∓ change
    change = r * a + s * b + t * c
    first, last = (
        _angle(
            cos * w + change,
            cos * r - w * a - (s * c - t * b),
            cos * s - w * b - (t * a - r * c),
            cos * t - w * c - (r * b - s * a),
        ),
        _angle(
            cos * w - change,
            cos * r + w * a + (s * c - t * b),
            cos * s + w * b + (t * a - r * c),
            cos * t + w * c + (r * b - s * a),
        ),
    )
    if square > 0.0:
        if max(first, last) > math.pi:  # past half a turn it is shorter the other way
            first, last = min(first, 2.0 * math.pi - first), min(last, 2.0 * math.pi - last)
            rise = last - first
        else:
            between = math.sin(0.25 * (first + last))
            rise = 4.0 * math.asin(min(1.0, max(-1.0, change / between))) if between > 0.0 else 0.0
        along = effort[0] * step[0] + effort[1] * step[1] + effort[2] * step[2]
        defect = (0.5 * stiffness * (first + last) * rise - along) / square
        effort[0] += defect * step[0]
        effort[1] += defect * step[1]
        effort[2] += defect * step[2]
    return 0.5 * stiffness * last * last


@kernel
def _angle(w, x, y, z):
    """θ ∈ [0, 2π) of a quaternion near the principal ones: both ends lie on the sheet of the middle."""
    return 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), w)


def point_spring(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = ½ k (|r| − L)² on SE(3), between the frames' origins; p = k, L. Exact along the chord of |r|²."""
    par, pose, step = nb.carray(p, 2), nb.carray(x0, 7), nb.carray(v, 6)
    effort, slope, energy = nb.carray(e, 6), nb.carray(f, (6, 6)), nb.carray(c, 1)
    scratch = nb.carray(work, 96)
    moved, there, back = scratch[0:6], scratch[6:12], scratch[12:18]
    pull, local, end, turn = scratch[18:21], scratch[21:24], scratch[24:31], scratch[32:41].reshape((3, 3))
    energy[0], status = _point_spring(par, pose, step, effort, pull, local, end, turn)
    if status == 0 and _still(step):
        square = pose[4] ** 2 + pose[5] ** 2 + pose[6] ** 2
        tight = par[1] / math.sqrt(square) if par[1] > 0.0 else 0.0
        bent = par[0] * tight / square if par[1] > 0.0 else 0.0
        quat_rotate_back(pose[:4], pose[4:], local)
        slope[:, :] = 0.0
        for i in range(3):
            slope[3 + i, 3 + i] = 0.5 * par[0] * (1.0 - tight)
            for j in range(3):
                slope[3 + i, 3 + j] += 0.5 * bent * local[i] * local[j]
        _half_cross(effort[3:], slope)
        return 0
    for i in range(6):
        for j in range(6):
            moved[j] = step[j]
        moved[i] = step[i] + DELTA
        _point_spring(par, pose, moved, there, pull, local, end, turn)
        moved[i] = step[i] - DELTA
        _point_spring(par, pose, moved, back, pull, local, end, turn)
        for j in range(6):
            slope[j, i] = (there[j] - back[j]) / (2.0 * DELTA)
    return status


@kernel
def _point_spring(par, pose, step, effort, pull, local, end, turn):
    retract(3, pose, step, end)
    before = math.sqrt(pose[4] ** 2 + pose[5] ** 2 + pose[6] ** 2)
    after = math.sqrt(end[4] ** 2 + end[5] ** 2 + end[6] ** 2)
    if par[1] > 0.0 and not before + after > 0.0:
        return 0.0, 4
    factor = par[0] * (1.0 - 2.0 * par[1] / (before + after)) if par[1] > 0.0 else par[0]
    for i in range(3):
        pull[i] = 0.5 * factor * (pose[4 + i] + end[4 + i])
        effort[i] = 0.0
    quat_rotate_back(pose[:4], pull, local)
    transposed_jacobian(step[:3], local, effort[3:], turn)
    return 0.5 * par[0] * (after - par[1]) ** 2, 0


def point_damper(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """Dissipation with μ(q_r) = c n nᵀ, n = (0, Rᵀ r/|r|) at the midpoint; ports (p_r, s), reads q_r; p = c.

    Where r = 0 every velocity υ changes the distance by |υ|: n is along it, and μ υ = c υ.
    """
    par, pose, step, effort = nb.carray(p, 1), nb.carray(x0, 7), nb.carray(v, 6), nb.carray(e, 7)
    flow, slope = nb.carray(f, 7), nb.carray(jac, (7, 13))
    scratch = nb.carray(work, 64)
    moved, there, back = scratch[0:6], scratch[6:13], scratch[13:20]
    half, middle, axis = scratch[20:26], scratch[26:33], scratch[33:36]
    theta = nb.carray(scal, 3)[1] + effort[6]
    slope[:, :] = 0.0
    status = _damper(par[0], theta, pose, step, effort, flow, half, middle, axis)
    if status != 0 or not theta > 0.0:
        return status if status != 0 else 2
    rate = axis[0] * effort[3] + axis[1] * effort[4] + axis[2] * effort[5]
    for i in range(3):
        for j in range(3):
            slope[3 + i, 3 + j] = par[0] * axis[i] * axis[j]
        slope[6, 3 + i] = -2.0 * par[0] * rate * axis[i] / theta
    slope[6, 6] = par[0] * rate * rate / (theta * theta)
    if middle[4] == 0.0 and middle[5] == 0.0 and middle[6] == 0.0:
        return 0  # by r there is no derivative
    if _still(step):
        _damper_slope(par[0], theta, pose, effort, rate, axis, slope)
        return 0
    for i in range(6):
        for j in range(6):
            moved[j] = step[j]
        moved[i] = step[i] + DELTA
        _damper(par[0], theta, pose, moved, effort, there, half, middle, axis)
        moved[i] = step[i] - DELTA
        _damper(par[0], theta, pose, moved, effort, back, half, middle, axis)
        for j in range(7):
            slope[j, 7 + i] = (there[j] - back[j]) / (2.0 * DELTA)
    return 0


@kernel
def _damper_slope(damping, theta, pose, effort, rate, axis, slope):
    """The flow's derivative by the increment at v = 0: n changes by ½ (1 − nnᵀ)(ñω + υ/|r|)."""
    length = math.sqrt(pose[4] ** 2 + pose[5] ** 2 + pose[6] ** 2)
    for k in range(6):
        a = b = c = 0.0
        if k == 0:
            b, c = axis[2], -axis[1]
        elif k == 1:
            a, c = -axis[2], axis[0]
        elif k == 2:
            a, b = axis[1], -axis[0]
        else:
            part = axis[k - 3] / length
            a, b, c = -part * axis[0], -part * axis[1], -part * axis[2]
            if k == 3:
                a += 1.0 / length
            elif k == 4:
                b += 1.0 / length
            else:
                c += 1.0 / length
        turned = a * effort[3] + b * effort[4] + c * effort[5]
        slope[3, 7 + k] = 0.5 * damping * (turned * axis[0] + rate * a)
        slope[4, 7 + k] = 0.5 * damping * (turned * axis[1] + rate * b)
        slope[5, 7 + k] = 0.5 * damping * (turned * axis[2] + rate * c)
        slope[6, 7 + k] = -damping * rate * turned / theta


@kernel
def _damper(damping, theta, pose, step, effort, flow, half, middle, axis):
    for i in range(6):
        half[i] = 0.5 * step[i]
    retract(3, pose, half, middle)
    length = math.sqrt(middle[4] ** 2 + middle[5] ** 2 + middle[6] ** 2)
    if length > 0.0:
        quat_rotate_back(middle[:4], middle[4:], axis)
    else:
        length = math.sqrt(effort[3] ** 2 + effort[4] ** 2 + effort[5] ** 2)
        for i in range(3):
            axis[i] = effort[3 + i]
        if length == 0.0:
            length = 1.0
    rate = 0.0
    for i in range(3):
        axis[i] /= length
        rate += axis[i] * effort[3 + i]
    for i in range(3):
        flow[i] = 0.0
        flow[3 + i] = damping * rate * axis[i]
    flow[6] = -damping * rate * rate / theta
    return 0
