"""Compiled discrete relations of bodies, by hand, after the plain definitions in `ephs.mechanics.components`.

Signature and layout as in `ephs.semantics.kernel_table`. Scratch memory comes from the caller.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

import numba as nb

from ephs.semantics.spaces import jit
from ephs.semantics.spaces.se3_kernels import quat_rotate_back, retract

kernel = jit.kernel


@kernel
def rotation_coefficients(square):
    """β, γ and their derivatives divided by θ, of θ²: V(ω) = 1 + β ω̃ + γ ω̃²."""
    if square < 0.04:
        beta = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (1.0 / 40320.0 - square / 3628800.0)))
        gamma = 1.0 / 6.0 - square * (
            1.0 / 120.0 - square * (1.0 / 5040.0 - square * (1.0 / 362880.0 - square / 39916800.0))
        )
        beta_slope = -1.0 / 12.0 + square * (1.0 / 180.0 - square / 6720.0)
        gamma_slope = -1.0 / 60.0 + square * (1.0 / 1260.0 - square / 60480.0)
        return beta, gamma, beta_slope, gamma_slope
    angle = math.sqrt(square)
    half = math.sin(0.5 * angle)
    alpha = math.sin(angle) / angle
    beta = 2.0 * half * half / square
    gamma = (1.0 - alpha) / square
    return beta, gamma, (alpha - 2.0 * beta) / square, (beta - 3.0 * gamma) / square


@kernel
def transposed_jacobian(omega, a, out, slope):
    """out = V(ω)ᵀ a (3,), and slope = ∂out/∂ω (3, 3)."""
    square = omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2
    beta, gamma, beta_slope, gamma_slope = rotation_coefficients(square)
    x, y, z = omega[0], omega[1], omega[2]
    first = (y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0])  # ω × a
    second = (y * first[2] - z * first[1], z * first[0] - x * first[2], x * first[1] - y * first[0])
    dot = x * a[0] + y * a[1] + z * a[2]
    for i in range(3):
        out[i] = a[i] - beta * first[i] + gamma * second[i]
    # e_k × a, and ∂(ω × (ω × a))/∂ω_k = ω_i a_k + δ_ik ⟨ω|a⟩ − 2 ω_k a_i
    for k in range(3):
        for i in range(3):
            turn = 0.0
            if i != k:
                j = 3 - i - k
                turn = a[j] if (k - i) % 3 == 1 else -a[j]
            double = omega[i] * a[k] - 2.0 * omega[k] * a[i]
            if i == k:
                double += dot
            slope[i, k] = (
                -beta * turn + gamma * double - beta_slope * omega[k] * first[i] + gamma_slope * omega[k] * second[i]
            )


def gravity(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = ⟨w|r⟩ on SE(3): the discrete gradient (0, (R⁰ V(v_ω))ᵀ w); p = w (3,), the negative weight."""
    weight, pose, step = nb.carray(p, 3), nb.carray(x0, 7), nb.carray(v, 6)
    effort, slope, energy = nb.carray(e, 6), nb.carray(f, (6, 6)), nb.carray(c, 1)
    scratch = nb.carray(work, 32)
    local, end = scratch[0:3], scratch[3:10]
    quat_rotate_back(pose[:4], weight, local)
    effort[:] = 0.0
    slope[:] = 0.0
    transposed_jacobian(step[:3], local, effort[3:], slope[3:, :3])
    retract(3, pose, step, end)
    energy[0] = weight[0] * end[4] + weight[1] * end[5] + weight[2] * end[6]
    return 0


def direct_gravity(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """E = ⟨w|r⟩ on SO(3)×ℝ³: dE = (0, w); p = w (3,)."""
    weight, pose, step = nb.carray(p, 3), nb.carray(x0, 7), nb.carray(v, 6)
    effort, slope, energy = nb.carray(e, 6), nb.carray(f, 36), nb.carray(c, 1)
    slope[:] = 0.0
    energy[0] = 0.0
    for i in range(3):
        effort[i], effort[3 + i] = 0.0, weight[i]
        energy[0] += weight[i] * (pose[4 + i] + step[3 + i])
    return 0


def lie_poisson(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """p.f = −ad*_{p.e} p.x at the mean momentum on SE(3): f_ω = ω×p_ω + υ×p_υ, f_υ = ω×p_υ."""
    momentum, step, u = nb.carray(x0, 6), nb.carray(v, 6), nb.carray(e, 6)
    flow, slope = nb.carray(f, 6), nb.carray(jac, (6, 12))
    mean = nb.carray(work, 6)
    slope[:, :] = 0.0
    for i in range(6):
        mean[i] = momentum[i] + 0.5 * step[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        # (a × b)_i = a_j b_k − a_k b_j
        flow[i] = u[j] * mean[k] - u[k] * mean[j] + u[3 + j] * mean[3 + k] - u[3 + k] * mean[3 + j]
        flow[3 + i] = u[j] * mean[3 + k] - u[k] * mean[3 + j]
        slope[i, j], slope[i, k] = mean[k], -mean[j]
        slope[i, 3 + j], slope[i, 3 + k] = mean[3 + k], -mean[3 + j]
        slope[3 + i, j], slope[3 + i, k] = mean[3 + k], -mean[3 + j]
        slope[i, 6 + k], slope[i, 6 + j] = 0.5 * u[j], -0.5 * u[k]
        slope[i, 9 + k], slope[i, 9 + j] = 0.5 * u[3 + j], -0.5 * u[3 + k]
        slope[3 + i, 9 + k], slope[3 + i, 9 + j] = 0.5 * u[j], -0.5 * u[k]
    return 0


def direct_lie_poisson(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """p.f = −ad*_{p.e} p.x at the mean momentum on SO(3)×ℝ³: f_ω = ω×p_ω, f_υ = 0."""
    momentum, step, u = nb.carray(x0, 6), nb.carray(v, 6), nb.carray(e, 6)
    flow, slope = nb.carray(f, 6), nb.carray(jac, (6, 12))
    slope[:, :] = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        mean_j, mean_k = momentum[j] + 0.5 * step[j], momentum[k] + 0.5 * step[k]
        flow[i], flow[3 + i] = u[j] * mean_k - u[k] * mean_j, 0.0
        slope[i, j], slope[i, k] = mean_k, -mean_j
        slope[i, 6 + k], slope[i, 6 + j] = 0.5 * u[j], -0.5 * u[k]
    return 0
