"""Articulated bodies on SE(3), second half: gains of joints, what goes to the parent, accelerations outwards."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.engine.tree_kernels import (
    DENSE,
    DIM,
    DRIVEN,
    FORWARD,
    G_BASIS,
    G_GAIN,
    G_INVERSE,
    G_U,
    KIND,
    PARENT,
    Q_AT,
    R_AT,
    REVOLUTE,
    SPHERICAL,
    fold_inertia,
    fold_load,
)
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def tree(link, work, dense, q, force, rate):
    """The inward and the second outward sweep where no loops are closed; 0, or 1 + a link that moves no mass."""
    for i in range(link.shape[0] - 1, -1, -1):
        if not inward(link, work, dense, i):
            return 1 + i
        load_inward(link, work, dense, q, force, i)
    for i in range(link.shape[0]):
        accelerate_outward(link, work, dense, q, rate, i)
    return 0


@kernel
def turned(q, k, x, y, z):
    """R(q) applied to a vector, q the unit quaternion at q[k]."""
    a, b, c, d = q[k], q[k + 1], q[k + 2], q[k + 3]
    s, t, u = 2.0 * (c * z - d * y), 2.0 * (d * x - b * z), 2.0 * (b * y - c * x)
    return x + a * s + c * u - d * t, y + a * t + d * s - b * u, z + a * u + b * t - c * s


@kernel
def inward(link, work, dense, i):
    """The gain of link i's joint; its articulated inertia, without the joint's freedoms, goes to its parent.

    Returns False where a freedom moves no mass.
    """
    parent, kind = link[i, PARENT], link[i, KIND]
    if kind == REVOLUTE:
        d = work[i, 35]
        if not d > 0.0:
            return False
        x = 1.0 / d
        a0, a1, u0, a3, u1 = work[i, 30], work[i, 31], work[i, 32], work[i, 33], work[i, 34]
        u3, u4, u5 = work[i, 42], work[i, 43], work[i, 44]
        g0, g1, g3, g4, g5 = u0 * x, u1 * x, u3 * x, u4 * x, u5 * x
        work[i, 51], work[i, 52], work[i, 53], work[i, 54], work[i, 55], work[i, 56] = g0, g1, 1.0, g3, g4, g5
        work[i, 60] = x
        if parent >= 0:
            fold_inertia(
                work, i, parent, a0 - u0 * g0, a1 - u0 * g1, a3 - u1 * g1,
                work[i, 36] - u0 * g3, work[i, 37] - u0 * g4, work[i, 38] - u0 * g5,
                work[i, 39] - u1 * g3, work[i, 40] - u1 * g4, work[i, 41] - u1 * g5,
                work[i, 45] - u3 * g3, work[i, 46] - u3 * g4, work[i, 47] - u3 * g5,
                work[i, 48] - u4 * g4, work[i, 49] - u4 * g5, work[i, 50] - u5 * g5,
            )  # fmt: skip
        return True
    if kind == SPHERICAL:
        return _inward_spherical(work, i, parent)
    return _inward_general(link, work, dense, i)


@kernel
def _inward_spherical(work, i, parent):
    a0, a1, a2, a3, a4, a5 = work[i, 30], work[i, 31], work[i, 32], work[i, 33], work[i, 34], work[i, 35]
    k0, k1, k2 = a3 * a5 - a4 * a4, a2 * a4 - a1 * a5, a1 * a4 - a2 * a3
    determinant = a0 * k0 + a1 * k1 + a2 * k2
    if not (a0 > 0.0 and determinant > 0.0):
        return False
    x = 1.0 / determinant
    k0, k1, k2 = k0 * x, k1 * x, k2 * x
    k3, k4, k5 = (a0 * a5 - a2 * a2) * x, (a1 * a2 - a0 * a4) * x, (a0 * a3 - a1 * a1) * x
    work[i, 60], work[i, 61], work[i, 62], work[i, 63], work[i, 64], work[i, 65] = k0, k1, k2, k3, k4, k5
    c0, c1, c2 = work[i, 36], work[i, 37], work[i, 38]
    c3, c4, c5 = work[i, 39], work[i, 40], work[i, 41]
    c6, c7, c8 = work[i, 42], work[i, 43], work[i, 44]
    g0, g1, g2 = k0 * c0 + k1 * c3 + k2 * c6, k0 * c1 + k1 * c4 + k2 * c7, k0 * c2 + k1 * c5 + k2 * c8
    g3, g4, g5 = k1 * c0 + k3 * c3 + k4 * c6, k1 * c1 + k3 * c4 + k4 * c7, k1 * c2 + k3 * c5 + k4 * c8
    g6, g7, g8 = k2 * c0 + k4 * c3 + k5 * c6, k2 * c1 + k4 * c4 + k5 * c7, k2 * c2 + k4 * c5 + k5 * c8
    work[i, 51], work[i, 52], work[i, 53] = g0, g1, g2
    work[i, 54], work[i, 55], work[i, 56] = g3, g4, g5
    work[i, 57], work[i, 58], work[i, 59] = g6, g7, g8
    if parent < 0:
        return True
    m0, m1 = work[i, 45] - c0 * g0 - c3 * g3 - c6 * g6, work[i, 46] - c0 * g1 - c3 * g4 - c6 * g7
    m2, m3 = work[i, 47] - c0 * g2 - c3 * g5 - c6 * g8, work[i, 48] - c1 * g1 - c4 * g4 - c7 * g7
    m4, m5 = work[i, 49] - c1 * g2 - c4 * g5 - c7 * g8, work[i, 50] - c2 * g2 - c5 * g5 - c8 * g8
    fold_inertia(work, i, parent, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, m0, m1, m2, m3, m4, m5)
    return True


@kernel
def _at(row, column):
    """Where the upper triangle of a symmetric 3 × 3 matrix keeps an entry."""
    low, high = min(row, column), max(row, column)
    return 3 * low + high - (low * (low + 1)) // 2


@kernel
def _entry(work, i, row, column):
    """An entry of link i's articulated inertia as a 6 × 6 matrix."""
    if row < 3:
        return work[i, 30 + _at(row, column)] if column < 3 else work[i, 36 + 3 * row + column - 3]
    return work[i, 36 + 3 * column + row - 3] if column < 3 else work[i, 45 + _at(row - 3, column - 3)]


@kernel
def _inward_general(link, work, dense, i):
    k, d, parent = link[i, DENSE], link[i, DIM], link[i, PARENT]
    if link[i, DRIVEN] == 0:
        for j in range(d):  # U = I S, D = Sᵀ U
            for a in range(6):
                total = 0.0
                for b in range(6):
                    total += _entry(work, i, a, b) * dense[k, G_BASIS + 6 * j + b]
                dense[k, G_U + 6 * j + a] = total
        for j in range(d):
            for m in range(d):
                total = 0.0
                for a in range(6):
                    total += dense[k, G_BASIS + 6 * j + a] * dense[k, G_U + 6 * m + a]
                dense[k, G_INVERSE + d * j + m] = total
        if not _invert(dense, k, d):
            return False
        for j in range(d):
            for a in range(6):
                total = 0.0
                for m in range(d):
                    total += dense[k, G_INVERSE + d * j + m] * dense[k, G_U + 6 * m + a]
                dense[k, G_GAIN + 6 * j + a] = total
        for a in range(6):
            for b in range(a, 6):
                total = 0.0
                for j in range(d):
                    total += dense[k, G_U + 6 * j + a] * dense[k, G_GAIN + 6 * j + b]
                if b < 3:
                    work[i, 30 + _at(a, b)] -= total
                elif a < 3:
                    work[i, 36 + 3 * a + b - 3] -= total
                else:
                    work[i, 45 + _at(a - 3, b - 3)] -= total
    if parent < 0:
        return True
    a2, a4, a5 = work[i, 32], work[i, 34], work[i, 35]
    c6, c7, c8 = work[i, 42], work[i, 43], work[i, 44]
    fold_inertia(
        work, i, parent, work[i, 30], work[i, 31], work[i, 33],
        work[i, 36], work[i, 37], work[i, 38], work[i, 39], work[i, 40], work[i, 41],
        work[i, 45], work[i, 46], work[i, 47], work[i, 48], work[i, 49], work[i, 50],
    )  # fmt: skip
    # what has the row z: e3 cᵀ in the mixed block, and the rest of the angular block
    r0, r1, r2, r3, r4, r5 = work[i, 0], work[i, 1], work[i, 2], work[i, 3], work[i, 4], work[i, 5]
    r6, r7, r8, p0, p1, p2 = work[i, 6], work[i, 7], work[i, 8], work[i, 9], work[i, 10], work[i, 11]
    y0, y1, y2 = r0 * c6 + r1 * c7 + r2 * c8, r3 * c6 + r4 * c7 + r5 * c8, r6 * c6 + r7 * c7 + r8 * c8
    z0, z1, z2 = p1 * y2 - p2 * y1, p2 * y0 - p0 * y2, p0 * y1 - p1 * y0
    z0, z1, z2 = z0 + r0 * a2 + r1 * a4, z1 + r3 * a2 + r4 * a4, z2 + r6 * a2 + r7 * a4
    work[parent, 30] += 2.0 * z0 * r2 + a5 * r2 * r2
    work[parent, 31] += z0 * r5 + z1 * r2 + a5 * r2 * r5
    work[parent, 32] += z0 * r8 + z2 * r2 + a5 * r2 * r8
    work[parent, 33] += 2.0 * z1 * r5 + a5 * r5 * r5
    work[parent, 34] += z1 * r8 + z2 * r5 + a5 * r5 * r8
    work[parent, 35] += 2.0 * z2 * r8 + a5 * r8 * r8
    work[parent, 36] += r2 * y0
    work[parent, 37] += r2 * y1
    work[parent, 38] += r2 * y2
    work[parent, 39] += r5 * y0
    work[parent, 40] += r5 * y1
    work[parent, 41] += r5 * y2
    work[parent, 42] += r8 * y0
    work[parent, 43] += r8 * y1
    work[parent, 44] += r8 * y2
    return True


@kernel
def _invert(dense, k, d):
    """D ← D⁻¹ by Gauss and Jordan, whose pivots are positive where it is; D is symmetric."""
    at = G_INVERSE
    for p in range(d):
        pivot = dense[k, at + d * p + p]
        if not pivot > 0.0:
            return False
        dense[k, at + d * p + p] = 1.0
        for m in range(d):
            dense[k, at + d * p + m] /= pivot
        for j in range(d):
            if j != p:
                factor = dense[k, at + d * j + p]
                dense[k, at + d * j + p] = 0.0
                for m in range(d):
                    dense[k, at + d * j + m] -= factor * dense[k, at + d * p + m]
    return True


@kernel
def load_inward(link, work, dense, q, force, i):
    """D⁻¹(τ − SᵀP) of link i; its load goes to its parent. ``force`` is on the rates of all joints."""
    parent, kind, at = link[i, PARENT], link[i, KIND], link[i, R_AT]
    n0, n1, n2, f0, f1, f2 = work[i, 24], work[i, 25], work[i, 26], work[i, 27], work[i, 28], work[i, 29]
    if kind == REVOLUTE:
        u = force[at] * link[i, FORWARD] - n2
        work[i, 66] = u * work[i, 60]
        if parent >= 0:
            fold_load(
                work, i, parent, n0 + work[i, 51] * u, n1 + work[i, 52] * u, n2 + u,
                f0 + work[i, 54] * u, f1 + work[i, 55] * u, f2 + work[i, 56] * u,
            )  # fmt: skip
    elif kind == SPHERICAL:
        t0, t1, t2 = force[at], force[at + 1], force[at + 2]
        if link[i, FORWARD] < 0:
            t0, t1, t2 = turned(q, link[i, Q_AT], t0, t1, t2)
            t0, t1, t2 = -t0, -t1, -t2
        u0, u1, u2 = t0 - n0, t1 - n1, t2 - n2
        work[i, 66] = work[i, 60] * u0 + work[i, 61] * u1 + work[i, 62] * u2
        work[i, 67] = work[i, 61] * u0 + work[i, 63] * u1 + work[i, 64] * u2
        work[i, 68] = work[i, 62] * u0 + work[i, 64] * u1 + work[i, 65] * u2
        if parent >= 0:
            fold_load(
                work, i, parent, t0, t1, t2,
                f0 + work[i, 51] * u0 + work[i, 54] * u1 + work[i, 57] * u2,
                f1 + work[i, 52] * u0 + work[i, 55] * u1 + work[i, 58] * u2,
                f2 + work[i, 53] * u0 + work[i, 56] * u1 + work[i, 59] * u2,
            )  # fmt: skip
    else:
        k, d = link[i, DENSE], link[i, DIM]
        if link[i, DRIVEN] == 0:
            for j in range(d):
                u = force[at + j]
                for a in range(6):
                    u -= dense[k, G_BASIS + 6 * j + a] * work[i, 24 + a]
                work[i, 66 + j] = u
                n0 += dense[k, G_GAIN + 6 * j] * u
                n1 += dense[k, G_GAIN + 6 * j + 1] * u
                n2 += dense[k, G_GAIN + 6 * j + 2] * u
                f0 += dense[k, G_GAIN + 6 * j + 3] * u
                f1 += dense[k, G_GAIN + 6 * j + 4] * u
                f2 += dense[k, G_GAIN + 6 * j + 5] * u
            _scale(work, dense, i, k, d)
        if parent >= 0:
            fold_load(work, i, parent, n0, n1, n2, f0, f1, f2)


@kernel
def _scale(work, dense, i, k, d):
    """u ← D⁻¹ u of a general joint."""
    u0, u1, u2, u3, u4, u5 = work[i, 66], work[i, 67], work[i, 68], work[i, 69], work[i, 70], work[i, 71]
    for j in range(d):
        at = G_INVERSE + d * j
        total = dense[k, at] * u0
        if d > 1:
            total += dense[k, at + 1] * u1
        if d > 2:
            total += dense[k, at + 2] * u2
        if d > 3:
            total += dense[k, at + 3] * u3
        if d > 4:
            total += dense[k, at + 4] * u4
        if d > 5:
            total += dense[k, at + 5] * u5
        work[i, 66 + j] = total


@kernel
def accelerate_outward(link, work, dense, q, rate, i):
    """ṙ of link i's joint and δa of the link, whose parent's is known; what loops push with is in D⁻¹(τ − SᵀP)."""
    parent, kind, at = link[i, PARENT], link[i, KIND], link[i, R_AT]
    if parent < 0:
        a0 = a1 = a2 = a3 = a4 = a5 = 0.0
    else:
        r0, r1, r2, r3, r4, r5 = work[i, 0], work[i, 1], work[i, 2], work[i, 3], work[i, 4], work[i, 5]
        r6, r7, r8, p0, p1, p2 = work[i, 6], work[i, 7], work[i, 8], work[i, 9], work[i, 10], work[i, 11]
        x, y, z = work[parent, 72], work[parent, 73], work[parent, 74]
        v0 = work[parent, 75] + y * p2 - z * p1
        v1 = work[parent, 76] + z * p0 - x * p2
        v2 = work[parent, 77] + x * p1 - y * p0
        a0, a1, a2 = r0 * x + r3 * y + r6 * z, r1 * x + r4 * y + r7 * z, r2 * x + r5 * y + r8 * z
        a3, a4, a5 = r0 * v0 + r3 * v1 + r6 * v2, r1 * v0 + r4 * v1 + r7 * v2, r2 * v0 + r5 * v1 + r8 * v2
    if kind == REVOLUTE:
        x = work[i, 66] - a2
        x -= work[i, 51] * a0 + work[i, 52] * a1 + work[i, 54] * a3 + work[i, 55] * a4 + work[i, 56] * a5
        rate[at] = x * link[i, FORWARD]
        a2 += x
    elif kind == SPHERICAL:
        s0 = work[i, 66] - work[i, 51] * a3 - work[i, 52] * a4 - work[i, 53] * a5
        s1 = work[i, 67] - work[i, 54] * a3 - work[i, 55] * a4 - work[i, 56] * a5
        s2 = work[i, 68] - work[i, 57] * a3 - work[i, 58] * a4 - work[i, 59] * a5
        x, y, z = s0 - a0, s1 - a1, s2 - a2
        a0, a1, a2 = s0, s1, s2
        if link[i, FORWARD] < 0:
            k = link[i, Q_AT]
            x, y, z = _turned_back(q, k, x, y, z)
            x, y, z = -x, -y, -z
        rate[at], rate[at + 1], rate[at + 2] = x, y, z
    else:
        k, d = link[i, DENSE], link[i, DIM]
        if link[i, DRIVEN] == 1:
            for j in range(d):
                rate[at + j] = 0.0
        else:
            for j in range(d):
                g = G_GAIN + 6 * j
                x = work[i, 66 + j] - dense[k, g] * a0 - dense[k, g + 1] * a1 - dense[k, g + 2] * a2
                rate[at + j] = x - dense[k, g + 3] * a3 - dense[k, g + 4] * a4 - dense[k, g + 5] * a5
            for j in range(d):
                x, b = rate[at + j], G_BASIS + 6 * j
                a0, a1, a2 = a0 + dense[k, b] * x, a1 + dense[k, b + 1] * x, a2 + dense[k, b + 2] * x
                a3, a4, a5 = a3 + dense[k, b + 3] * x, a4 + dense[k, b + 4] * x, a5 + dense[k, b + 5] * x
    work[i, 72], work[i, 73], work[i, 74], work[i, 75], work[i, 76], work[i, 77] = a0, a1, a2, a3, a4, a5


@kernel
def _turned_back(q, k, x, y, z):
    a, b, c, d = q[k], -q[k + 1], -q[k + 2], -q[k + 3]
    s, t, u = 2.0 * (c * z - d * y), 2.0 * (d * x - b * z), 2.0 * (b * y - c * x)
    return x + a * s + c * u - d * t, y + a * t + d * s - b * u, z + a * u + b * t - c * s
