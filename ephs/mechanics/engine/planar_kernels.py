"""Articulated bodies on SE(2): what `tree_kernels` and `inward_kernels` do, for motion parallel to a plane.

Links' frames lie at their tree joints; components are in the world's axes, of which z is the plane's normal, so that
nothing turns on the way from link to link but the first moments. Accelerations are those of the frames' origins, in the
usual sense. A link's inertia is the symmetric matrix of (α, a) with entries 00, 01, 02, 11, 12, 22.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.mechanics.engine.tree_kernels import DRIVEN, FORWARD, KIND, PARENT, Q_AT, R_AT, REVOLUTE
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

# Columns of a link's constants: 0 joint in the parent's frame (x, y, angle), 3 mass, first moments, inertia about the
# frame, 7 direction of a sliding joint in the parent's frame, 9 height over the plane.
P_CONSTANTS = 10

# Columns of a link's memory: 0 cos and sin of its angle, 2 position, 4 arm from the parent, 6 twist (ω, v),
# 9 acceleration at ṙ = 0, 11 load (N, F), 14 inertia, 20 gain D⁻¹Uᵀ, 23 D⁻¹, 24 D⁻¹(τ − SᵀP), 25 (δα, δa), 28 angle,
# 29 direction of a sliding joint, 31 height.
P_MEMORY = 32


@kernel
def planar_outward(link, const, work, q, r, gravity):
    """Poses in the world, twists, accelerations at ṙ = 0 and loads of all links; inertias are set to their own."""
    for i in range(link.shape[0]):
        parent = link[i, PARENT]
        x, rate = q[link[i, Q_AT]] * link[i, FORWARD], r[link[i, R_AT]] * link[i, FORWARD]
        if parent < 0:
            c, s, px, py, w, vx, vy, phi = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, const[i, 2]
            ax, ay = -gravity[0], -gravity[1]
        else:
            c, s, px, py = work[parent, 0], work[parent, 1], work[parent, 2], work[parent, 3]
            w, vx, vy = work[parent, 6], work[parent, 7], work[parent, 8]
            ax, ay, phi = work[parent, 9], work[parent, 10], work[parent, 28] + const[i, 2]
        lx, ly = const[i, 0], const[i, 1]
        turning = link[i, KIND] == REVOLUTE
        if not turning:
            dx, dy = c * const[i, 7] - s * const[i, 8], s * const[i, 7] + c * const[i, 8]
            work[i, 29], work[i, 30] = dx, dy
            lx, ly = lx + x * const[i, 7], ly + x * const[i, 8]
        ex, ey = c * lx - s * ly, s * lx + c * ly
        vx, vy = vx - w * ey, vy + w * ex
        ax, ay = ax - w * w * ex, ay - w * w * ey
        if turning:
            phi += x
            w += rate
        else:
            ax, ay = ax - 2.0 * w * dy * rate, ay + 2.0 * w * dx * rate
            vx, vy = vx + dx * rate, vy + dy * rate
        c, s = math.cos(phi), math.sin(phi)
        work[i, 0], work[i, 1], work[i, 2], work[i, 3] = c, s, px + ex, py + ey
        work[i, 4], work[i, 5], work[i, 6], work[i, 7], work[i, 8] = ex, ey, w, vx, vy
        work[i, 9], work[i, 10], work[i, 28], work[i, 31] = ax, ay, phi, const[i, 9]
        m, hx, hy = const[i, 3], c * const[i, 4] - s * const[i, 5], s * const[i, 4] + c * const[i, 5]
        work[i, 11], work[i, 12], work[i, 13] = hx * ay - hy * ax, m * ax - w * w * hx, m * ay - w * w * hy
        work[i, 14], work[i, 15], work[i, 16] = const[i, 6], -hy, hx
        work[i, 17], work[i, 18], work[i, 19] = m, 0.0, m


@kernel
def planar_inward(link, work, i):
    """As `inward_kernels.inward`."""
    parent = link[i, PARENT]
    j0, j1, j2 = work[i, 14], work[i, 15], work[i, 16]
    m0, m1, m2 = work[i, 17], work[i, 18], work[i, 19]
    if link[i, DRIVEN] == 0:
        if link[i, KIND] == REVOLUTE:
            u0, u1, u2, d = j0, j1, j2, j0
        else:
            x, y = work[i, 29], work[i, 30]
            u0, u1, u2 = j1 * x + j2 * y, m0 * x + m1 * y, m1 * x + m2 * y
            d = x * u1 + y * u2
        if not d > 0.0:
            return False
        inverse = 1.0 / d
        g0, g1, g2 = u0 * inverse, u1 * inverse, u2 * inverse
        work[i, 20], work[i, 21], work[i, 22], work[i, 23] = g0, g1, g2, inverse
        j0, j1, j2 = j0 - u0 * g0, j1 - u0 * g1, j2 - u0 * g2
        m0, m1, m2 = m0 - u1 * g1, m1 - u1 * g2, m2 - u2 * g2
    if parent >= 0:
        x, y = -work[i, 5], work[i, 4]
        t1, t2 = m0 * x + m1 * y, m1 * x + m2 * y
        work[parent, 14] += j0 + 2.0 * (j1 * x + j2 * y) + t1 * x + t2 * y
        work[parent, 15] += j1 + t1
        work[parent, 16] += j2 + t2
        work[parent, 17] += m0
        work[parent, 18] += m1
        work[parent, 19] += m2
    return True


@kernel
def planar_load_inward(link, work, force, i):
    """As `inward_kernels.load_inward`."""
    parent = link[i, PARENT]
    n, x, y = work[i, 11], work[i, 12], work[i, 13]
    if link[i, DRIVEN] == 0:
        u = force[link[i, R_AT]] * link[i, FORWARD]
        u -= n if link[i, KIND] == REVOLUTE else work[i, 29] * x + work[i, 30] * y
        work[i, 24] = u * work[i, 23]
        n, x, y = n + work[i, 20] * u, x + work[i, 21] * u, y + work[i, 22] * u
    if parent >= 0:
        work[parent, 11] += n + work[i, 4] * y - work[i, 5] * x
        work[parent, 12] += x
        work[parent, 13] += y


@kernel
def planar_tree(link, work, force, rate):
    """The inward and the second outward sweep where no loops are closed; 0, or 1 + a link that moves no mass."""
    for i in range(link.shape[0] - 1, -1, -1):
        if not planar_inward(link, work, i):
            return 1 + i
        planar_load_inward(link, work, force, i)
    for i in range(link.shape[0]):
        planar_accelerate_outward(link, work, rate, i)
    return 0


@kernel
def planar_accelerate_outward(link, work, rate, i):
    """As `inward_kernels.accelerate_outward`."""
    parent = link[i, PARENT]
    a0 = a1 = a2 = 0.0
    if parent >= 0:
        a0 = work[parent, 25]
        a1, a2 = work[parent, 26] - a0 * work[i, 5], work[parent, 27] + a0 * work[i, 4]
    x = 0.0
    if link[i, DRIVEN] == 0:
        x = work[i, 24] - work[i, 20] * a0 - work[i, 21] * a1 - work[i, 22] * a2
        if link[i, KIND] == REVOLUTE:
            a0 += x
        else:
            a1, a2 = a1 + work[i, 29] * x, a2 + work[i, 30] * x
    rate[link[i, R_AT]] = x * link[i, FORWARD]
    work[i, 25], work[i, 26], work[i, 27] = a0, a1, a2
