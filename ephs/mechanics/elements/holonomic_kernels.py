"""The compiled discrete joint relation, after the plain definition in `ephs.mechanics.elements.components`.

Signature and layout as in `ephs.semantics.kernel_table`. Scratch memory comes from the caller.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import numba as nb

from ephs.semantics.spaces import jit
from ephs.semantics.spaces.se3_kernels import (
    ad,
    adjoint,
    adjoint_inverse,
    dexp,
    dexp_inv,
    dexp_left,
    include,
    pose_compose,
    pose_exp,
    pose_log,
    retract,
)

kernel = jit.kernel


@kernel
def _multiply(a, b, out):
    """out = a b for small dense matrices."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@kernel
def _turned_too_far(v):
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2] >= 9.8696  # π², rounded down


def holonomic(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """The joint relation on the group, palindromic: F(e) = 0 with C_h e = F(e); ports (p_j1, p_j2, p_r), reads q_r.

    p = group code of the pair, its basis B (6, d).
    """
    n, m, size = dims[0], dims[2], dims[3]
    d = n - 12
    h = nb.carray(scal, 3)[0]
    par, x, step = nb.carray(p, 1 + 6 * d), nb.carray(x0, size), nb.carray(v, m)
    effort, force = nb.carray(e, n), nb.carray(lam, 6)
    flow, condition, slope = nb.carray(f, n), nb.carray(c, 6), nb.carray(jac, (n + 6, n + 6 + m))
    mem = nb.carray(work, 1200)
    code, basis = int(par[0]), par[1:].reshape((6, d))
    half, middle, pose = mem[0:6][:d], mem[6:13][:size], mem[14:21]
    to2, c_e = mem[24:60].reshape((6, 6)), mem[60:66]
    a, b = mem[66:72], mem[72:78]
    side, mid, inner = mem[78:84], mem[84:90], mem[90:96]
    g1, g2, g3, g4, g5 = mem[100:107], mem[107:114], mem[114:121], mem[121:128], mem[128:135]
    exp_side, exp_mid, exp_inner = mem[135:142], mem[142:149], mem[149:156]
    total, residual = mem[156:162], mem[162:168]
    m1, m2 = mem[200:236].reshape((6, 6)), mem[236:272].reshape((6, 6))
    m3, m4 = mem[272:308].reshape((6, 6)), mem[308:344].reshape((6, 6))
    back = mem[344:380].reshape((6, 6))
    turn = mem[380:416].reshape((6, 6))
    zeta = mem[416:452][: 6 * d].reshape((6, d))
    left = mem[452:488][: d * d].reshape((d, d))
    rows = mem[500 : 500 + 6 * n].reshape((6, n))  # ∂F/∂e
    reads = mem[620 : 620 + 6 * d].reshape((6, d))  # ∂F/∂v
    extra = mem[660 : 660 + n]
    zeta_force, column = mem[700:706], mem[706:712]
    turned = mem[720 : 720 + 6 * d].reshape((6, d))  # ad_a ζ
    # -- the frame in the middle of the step
    for i in range(d):
        half[i] = 0.5 * step[i]
    retract(code, x, half, middle)
    include(code, basis, middle, pose)
    adjoint_inverse(pose, to2)
    for i in range(6):
        ai = bi = 0.0
        for j in range(6):
            ai += to2[i, j] * effort[j]
        for j in range(d):
            bi += basis[i, j] * effort[12 + j]
        a[i], b[i] = ai, bi
        side[i], mid[i], inner[i] = -0.5 * h * effort[6 + i], 0.5 * h * bi, h * ai
        c_e[i] = ai - effort[6 + i] + bi
    if _turned_too_far(inner) or _turned_too_far(side) or _turned_too_far(mid):
        return 1
    # -- F = log[exp(side) exp(mid) exp(inner) exp(mid) exp(side)] / h
    pose_exp(side, exp_side)
    pose_exp(mid, exp_mid)
    pose_exp(inner, exp_inner)
    g1[:] = exp_side
    pose_compose(g1, exp_mid, g2)
    pose_compose(g2, exp_inner, g3)
    pose_compose(g3, exp_mid, g4)
    pose_compose(g4, exp_side, g5)
    pose_log(g5, total)
    for i in range(6):
        residual[i] = total[i] / h if h != 0.0 else c_e[i]  # at an instant F is C e
        condition[i] = residual[i]
    # -- ∂F: right-trivialised variations of the factors, carried to the left end
    dexp_inv(total, back)
    dexp(inner, m1)
    adjoint(g2, m2)
    _multiply(m2, m1, m3)
    _multiply(back, m3, turn)  # F by the inner exponent over h
    _multiply(turn, to2, m1)
    for i in range(6):
        for j in range(6):
            rows[i, j] = m1[i, j]
    dexp(side, m1)
    adjoint(g4, m2)
    _multiply(m2, m1, m3)
    for i in range(6):
        for j in range(6):
            m3[i, j] += m1[i, j]
    _multiply(back, m3, m4)
    for i in range(6):
        for j in range(6):
            rows[i, 6 + j] = -0.5 * m4[i, j]
    dexp(mid, m1)
    adjoint(g1, m2)
    adjoint(g3, m3)
    for i in range(6):
        for j in range(6):
            m2[i, j] += m3[i, j]
    _multiply(m2, m1, m3)
    _multiply(back, m3, m4)
    for i in range(6):
        for j in range(d):
            entry = 0.0
            for k in range(6):
                entry += m4[i, k] * basis[k, j]
            rows[i, 12 + j] = 0.5 * entry
    # -- through the middle frame: δa = ad_a B δη, with δη = dexp_left(v/2) δv/2
    dexp_left(code, half, left)
    ad(a, m1)
    for i in range(6):
        for j in range(d):
            entry = 0.0
            for k in range(d):
                entry += basis[i, k] * left[k, j]
            zeta[i, j] = 0.5 * entry
    _multiply(m1, zeta, turned)
    _multiply(turn, turned, reads)
    # -- C_h = C + (F − C e) eᵀ/⟨e|e⟩
    square = 0.0
    for i in range(n):
        square += effort[i] * effort[i]
    # F − C e is of third order: for slow motions its slope is all rounding, and Newton's method does without
    steering = square * h * h > 1e-8
    s = 0.0
    if square > 1e-280:
        for i in range(6):
            s += (residual[i] - c_e[i]) * force[i]
        s /= square
    for i in range(n):
        entry = 0.0
        for k in range(6):
            if i < 6:
                ck = to2[k, i]
            elif i < 12:
                ck = -1.0 if i - 6 == k else 0.0
            else:
                ck = basis[k, i - 12]
            entry += (rows[k, i] - ck) * force[k]
        extra[i] = (entry - 2.0 * s * effort[i]) / square if steering else 0.0
    slope[:, :] = 0.0
    for i in range(n):
        value = s * effort[i]
        for k in range(6):
            if i < 6:
                ck = to2[k, i]
            elif i < 12:
                ck = -1.0 if i - 6 == k else 0.0
            else:
                ck = basis[k, i - 12]
            value += ck * force[k]
            slope[i, n + k] = ck
            if square > 1e-280:
                slope[i, n + k] += effort[i] * (residual[k] - c_e[k]) / square
        flow[i] = value
        for j in range(n):
            slope[i, j] = effort[i] * extra[j]
        if steering:
            slope[i, i] += s
    for k in range(6):
        for j in range(n):
            slope[n + k, j] = rows[k, j]
        for j in range(m):
            slope[n + k, n + 6 + j] = reads[k, j]
    # -- ∂(Cᵀλ)/∂v: −Ad_{I⁻¹}ᵀ ad_ζᵀ λ, and s through F − C e
    for j in range(m):
        for i in range(6):
            column[i] = zeta[i, j]
        ad(column, m1)
        for i in range(6):
            entry = 0.0
            for k in range(6):
                entry += m1[k, i] * force[k]
            zeta_force[i] = entry
        ds = 0.0
        if steering:
            for k in range(6):
                ds += (reads[k, j] - turned[k, j]) * force[k]
            ds /= square
        for i in range(n):
            entry = effort[i] * ds
            if i < 6:
                for k in range(6):
                    entry -= to2[k, i] * zeta_force[k]
            slope[i, n + 6 + j] = entry
    return 0
