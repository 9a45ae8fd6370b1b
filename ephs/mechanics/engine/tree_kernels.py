"""Articulated bodies on SE(3): outwards twists and loads, inwards articulated inertias, outwards accelerations.

A link's frame lies at its tree joint, the joint's axis along its z axis: a revolute joint then takes one column of the
articulated inertia. Velocities are left-trivialised and body-fixed, so joint bases are constant. 3 × 3 blocks are kept
in scalars. With the articulated inertia [[A, C], [Cᵀ, M]] of a link and the load P, both without the joint's motion,

    (angular, linear) wrench = [[A, C], [Cᵀ, M]] δa + P,

where δa is the link's acceleration beyond the one, b, that it has at ṙ = 0; gravity is in b. Featherstone, *Rigid Body
Dynamics Algorithms*, chapter 7, gives the recursion in world-independent form.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

# Columns of a link's integers.
PARENT, KIND, Q_AT, R_AT, FORWARD, DIM, DRIVEN, DENSE, CODE, Q_SIZE, COLUMNS = range(11)
REVOLUTE, SPHERICAL, GENERAL, SLIDING = range(4)
"""Kinds of joints; GENERAL ones take a constant basis of any dimension. On SE(2) there are REVOLUTE and SLIDING."""

# Columns of a link's constants: 0 pose of the joint in the parent's frame (rows of R, p), 12 mass, 13 first moments,
# 16 inertia about the frame (upper triangle).
C_MASS, CONSTANTS = 12, 22

# Columns of a link's memory: 0 R and 9 p in the parent, 12 twist, 18 b, 24 load P, 30 A (upper triangle), 36 C, 45 M
# (upper triangle), 51 the gain D⁻¹Uᵀ (of spherical joints A⁻¹C), 60 D⁻¹ (upper triangle), 66 D⁻¹(τ − SᵀP), 72 δa,
# 78 R and 87 p in the world.
MEMORY = 90

# Columns of a general joint's numbers: pose and twist of its element, basis, U, D⁻¹Uᵀ, D⁻¹ (d², row by row), L and L⁻¹
# of those that are walked backward.
G_TWIST, G_BASIS, G_U, G_GAIN, G_INVERSE, G_RATE, G_BACK, GENERAL_SIZE = 12, 18, 54, 90, 126, 162, 198, 234


@kernel
def outward(link, const, work, dense, q, r, gravity):
    """Poses in the parent, twists, accelerations at ṙ = 0 and loads of all links; inertias are set to their own.

    Elements and twists of general joints are in ``dense`` already.
    """
    for i in range(link.shape[0]):
        parent, kind, at = link[i, PARENT], link[i, KIND], link[i, R_AT]
        c0, c1, c2 = const[i, 0], const[i, 1], const[i, 2]
        c3, c4, c5 = const[i, 3], const[i, 4], const[i, 5]
        c6, c7, c8 = const[i, 6], const[i, 7], const[i, 8]
        p0, p1, p2 = const[i, 9], const[i, 10], const[i, 11]
        j0 = j1 = j2 = j3 = j4 = j5 = 0.0
        if kind == REVOLUTE:
            turn = q[link[i, Q_AT]] * link[i, FORWARD]
            s, c = math.sin(turn), math.cos(turn)
            r0, r1, r2 = c0 * c + c1 * s, c1 * c - c0 * s, c2
            r3, r4, r5 = c3 * c + c4 * s, c4 * c - c3 * s, c5
            r6, r7, r8 = c6 * c + c7 * s, c7 * c - c6 * s, c8
            j2 = r[at] * link[i, FORWARD]
        elif kind == SPHERICAL:
            k = link[i, Q_AT]
            w, x, y, z = q[k], q[k + 1], q[k + 2], q[k + 3]
            j0, j1, j2 = r[at], r[at + 1], r[at + 2]
            d0, d1, d2 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
            d3, d4, d5 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
            d6, d7, d8 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
            if link[i, FORWARD] < 0:
                j0, j1, j2 = (
                    -(d0 * j0 + d1 * j1 + d2 * j2), -(d3 * j0 + d4 * j1 + d5 * j2), -(d6 * j0 + d7 * j1 + d8 * j2)
                )  # fmt: skip
                d1, d3, d2, d6, d5, d7 = d3, d1, d6, d2, d7, d5
            r0, r1, r2 = c0 * d0 + c1 * d3 + c2 * d6, c0 * d1 + c1 * d4 + c2 * d7, c0 * d2 + c1 * d5 + c2 * d8
            r3, r4, r5 = c3 * d0 + c4 * d3 + c5 * d6, c3 * d1 + c4 * d4 + c5 * d7, c3 * d2 + c4 * d5 + c5 * d8
            r6, r7, r8 = c6 * d0 + c7 * d3 + c8 * d6, c6 * d1 + c7 * d4 + c8 * d7, c6 * d2 + c7 * d5 + c8 * d8
        else:
            k = link[i, DENSE]
            d0, d1, d2, d3, d4, d5 = dense[k, 0], dense[k, 1], dense[k, 2], dense[k, 3], dense[k, 4], dense[k, 5]
            d6, d7, d8 = dense[k, 6], dense[k, 7], dense[k, 8]
            x, y, z = dense[k, 9], dense[k, 10], dense[k, 11]
            j0, j1, j2, j3, j4, j5 = dense[k, 12], dense[k, 13], dense[k, 14], dense[k, 15], dense[k, 16], dense[k, 17]
            p0, p1, p2 = p0 + c0 * x + c1 * y + c2 * z, p1 + c3 * x + c4 * y + c5 * z, p2 + c6 * x + c7 * y + c8 * z
            r0, r1, r2 = c0 * d0 + c1 * d3 + c2 * d6, c0 * d1 + c1 * d4 + c2 * d7, c0 * d2 + c1 * d5 + c2 * d8
            r3, r4, r5 = c3 * d0 + c4 * d3 + c5 * d6, c3 * d1 + c4 * d4 + c5 * d7, c3 * d2 + c4 * d5 + c5 * d8
            r6, r7, r8 = c6 * d0 + c7 * d3 + c8 * d6, c6 * d1 + c7 * d4 + c8 * d7, c6 * d2 + c7 * d5 + c8 * d8
        work[i, 0], work[i, 1], work[i, 2] = r0, r1, r2
        work[i, 3], work[i, 4], work[i, 5] = r3, r4, r5
        work[i, 6], work[i, 7], work[i, 8] = r6, r7, r8
        work[i, 9], work[i, 10], work[i, 11] = p0, p1, p2
        if parent < 0:
            w0, w1, w2, v0, v1, v2 = j0, j1, j2, j3, j4, j5
            b0 = b1 = b2 = 0.0
            a0, a1, a2 = -gravity[0], -gravity[1], -gravity[2]
            b3, b4, b5 = r0 * a0 + r3 * a1 + r6 * a2, r1 * a0 + r4 * a1 + r7 * a2, r2 * a0 + r5 * a1 + r8 * a2
        else:
            x, y, z = work[parent, 12], work[parent, 13], work[parent, 14]
            a0 = work[parent, 15] + y * p2 - z * p1
            a1 = work[parent, 16] + z * p0 - x * p2
            a2 = work[parent, 17] + x * p1 - y * p0
            w0, w1, w2 = r0 * x + r3 * y + r6 * z + j0, r1 * x + r4 * y + r7 * z + j1, r2 * x + r5 * y + r8 * z + j2
            v0 = r0 * a0 + r3 * a1 + r6 * a2 + j3
            v1 = r1 * a0 + r4 * a1 + r7 * a2 + j4
            v2 = r2 * a0 + r5 * a1 + r8 * a2 + j5
            x, y, z = work[parent, 18], work[parent, 19], work[parent, 20]
            a0 = work[parent, 21] + y * p2 - z * p1
            a1 = work[parent, 22] + z * p0 - x * p2
            a2 = work[parent, 23] + x * p1 - y * p0
            # the parent's, carried over, and [u, S r]
            b0 = r0 * x + r3 * y + r6 * z + w1 * j2 - w2 * j1
            b1 = r1 * x + r4 * y + r7 * z + w2 * j0 - w0 * j2
            b2 = r2 * x + r5 * y + r8 * z + w0 * j1 - w1 * j0
            b3 = r0 * a0 + r3 * a1 + r6 * a2 + w1 * j5 - w2 * j4 + v1 * j2 - v2 * j1
            b4 = r1 * a0 + r4 * a1 + r7 * a2 + w2 * j3 - w0 * j5 + v2 * j0 - v0 * j2
            b5 = r2 * a0 + r5 * a1 + r8 * a2 + w0 * j4 - w1 * j3 + v0 * j1 - v1 * j0
        work[i, 12], work[i, 13], work[i, 14], work[i, 15], work[i, 16], work[i, 17] = w0, w1, w2, v0, v1, v2
        work[i, 18], work[i, 19], work[i, 20], work[i, 21], work[i, 22], work[i, 23] = b0, b1, b2, b3, b4, b5
        m, h0, h1, h2 = const[i, 12], const[i, 13], const[i, 14], const[i, 15]
        i0, i1, i2 = const[i, 16], const[i, 17], const[i, 18]
        i3, i4, i5 = const[i, 19], const[i, 20], const[i, 21]
        # momentum, and what the load is: I b − ad*_u (I u)
        n0 = i0 * w0 + i1 * w1 + i2 * w2 + h1 * v2 - h2 * v1
        n1 = i1 * w0 + i3 * w1 + i4 * w2 + h2 * v0 - h0 * v2
        n2 = i2 * w0 + i4 * w1 + i5 * w2 + h0 * v1 - h1 * v0
        f0, f1, f2 = m * v0 - h1 * w2 + h2 * w1, m * v1 - h2 * w0 + h0 * w2, m * v2 - h0 * w1 + h1 * w0
        work[i, 24] = i0 * b0 + i1 * b1 + i2 * b2 + h1 * b5 - h2 * b4 + w1 * n2 - w2 * n1 + v1 * f2 - v2 * f1
        work[i, 25] = i1 * b0 + i3 * b1 + i4 * b2 + h2 * b3 - h0 * b5 + w2 * n0 - w0 * n2 + v2 * f0 - v0 * f2
        work[i, 26] = i2 * b0 + i4 * b1 + i5 * b2 + h0 * b4 - h1 * b3 + w0 * n1 - w1 * n0 + v0 * f1 - v1 * f0
        work[i, 27] = m * b3 - h1 * b2 + h2 * b1 + w1 * f2 - w2 * f1
        work[i, 28] = m * b4 - h2 * b0 + h0 * b2 + w2 * f0 - w0 * f2
        work[i, 29] = m * b5 - h0 * b1 + h1 * b0 + w0 * f1 - w1 * f0
        work[i, 30], work[i, 31], work[i, 32], work[i, 33], work[i, 34], work[i, 35] = i0, i1, i2, i3, i4, i5
        work[i, 36], work[i, 37], work[i, 38] = 0.0, -h2, h1
        work[i, 39], work[i, 40], work[i, 41] = h2, 0.0, -h0
        work[i, 42], work[i, 43], work[i, 44] = -h1, h0, 0.0
        work[i, 45], work[i, 46], work[i, 47], work[i, 48], work[i, 49], work[i, 50] = m, 0.0, 0.0, m, 0.0, m


@kernel
def fold_load(work, i, parent, n0, n1, n2, f0, f1, f2):
    """Add a wrench on link i, in its frame, to its parent's load."""
    r0, r1, r2, r3, r4, r5 = work[i, 0], work[i, 1], work[i, 2], work[i, 3], work[i, 4], work[i, 5]
    r6, r7, r8, p0, p1, p2 = work[i, 6], work[i, 7], work[i, 8], work[i, 9], work[i, 10], work[i, 11]
    g0, g1, g2 = r0 * f0 + r1 * f1 + r2 * f2, r3 * f0 + r4 * f1 + r5 * f2, r6 * f0 + r7 * f1 + r8 * f2
    work[parent, 24] += r0 * n0 + r1 * n1 + r2 * n2 + p1 * g2 - p2 * g1
    work[parent, 25] += r3 * n0 + r4 * n1 + r5 * n2 + p2 * g0 - p0 * g2
    work[parent, 26] += r6 * n0 + r7 * n1 + r8 * n2 + p0 * g1 - p1 * g0
    work[parent, 27] += g0
    work[parent, 28] += g1
    work[parent, 29] += g2


@kernel
def fold_inertia(work, i, parent, a0, a1, a3, c0, c1, c2, c3, c4, c5, m0, m1, m2, m3, m4, m5):
    """Add an inertia on link i, whose angular part has rows x and y only, to its parent's."""
    r0, r1, r2, r3, r4, r5 = work[i, 0], work[i, 1], work[i, 2], work[i, 3], work[i, 4], work[i, 5]
    r6, r7, r8, p0, p1, p2 = work[i, 6], work[i, 7], work[i, 8], work[i, 9], work[i, 10], work[i, 11]
    # linear block: N = R M Rᵀ
    t0, t1, t2 = r0 * m0 + r1 * m1 + r2 * m2, r0 * m1 + r1 * m3 + r2 * m4, r0 * m2 + r1 * m4 + r2 * m5
    t3, t4, t5 = r3 * m0 + r4 * m1 + r5 * m2, r3 * m1 + r4 * m3 + r5 * m4, r3 * m2 + r4 * m4 + r5 * m5
    t6, t7, t8 = r6 * m0 + r7 * m1 + r8 * m2, r6 * m1 + r7 * m3 + r8 * m4, r6 * m2 + r7 * m4 + r8 * m5
    n0, n1, n2 = t0 * r0 + t1 * r1 + t2 * r2, t0 * r3 + t1 * r4 + t2 * r5, t0 * r6 + t1 * r7 + t2 * r8
    n3, n4, n5 = t3 * r3 + t4 * r4 + t5 * r5, t3 * r6 + t4 * r7 + t5 * r8, t6 * r6 + t7 * r7 + t8 * r8
    # mixed block: D = R C Rᵀ, of which C has two rows
    t0, t1, t2 = r0 * c0 + r1 * c3, r0 * c1 + r1 * c4, r0 * c2 + r1 * c5
    t3, t4, t5 = r3 * c0 + r4 * c3, r3 * c1 + r4 * c4, r3 * c2 + r4 * c5
    t6, t7, t8 = r6 * c0 + r7 * c3, r6 * c1 + r7 * c4, r6 * c2 + r7 * c5
    d0, d1, d2 = t0 * r0 + t1 * r1 + t2 * r2, t0 * r3 + t1 * r4 + t2 * r5, t0 * r6 + t1 * r7 + t2 * r8
    d3, d4, d5 = t3 * r0 + t4 * r1 + t5 * r2, t3 * r3 + t4 * r4 + t5 * r5, t3 * r6 + t4 * r7 + t5 * r8
    d6, d7, d8 = t6 * r0 + t7 * r1 + t8 * r2, t6 * r3 + t7 * r4 + t8 * r5, t6 * r6 + t7 * r7 + t8 * r8
    # E = D + p̂ N
    e0, e1, e2 = d0 + p1 * n2 - p2 * n1, d1 + p1 * n4 - p2 * n3, d2 + p1 * n5 - p2 * n4
    e3, e4, e5 = d3 + p2 * n0 - p0 * n2, d4 + p2 * n1 - p0 * n4, d5 + p2 * n2 - p0 * n5
    e6, e7, e8 = d6 + p0 * n1 - p1 * n0, d7 + p0 * n3 - p1 * n1, d8 + p0 * n4 - p1 * n2
    # angular block: R A Rᵀ + p̂ Dᵀ − E p̂
    t0, t1, t3, t4, t6, t7 = (
        r0 * a0 + r1 * a1, r0 * a1 + r1 * a3, r3 * a0 + r4 * a1, r3 * a1 + r4 * a3, r6 * a0 + r7 * a1, r6 * a1 + r7 * a3
    )  # fmt: skip
    work[parent, 30] += t0 * r0 + t1 * r1 + p1 * d2 - p2 * d1 - e1 * p2 + e2 * p1
    work[parent, 31] += t0 * r3 + t1 * r4 + p1 * d5 - p2 * d4 + e0 * p2 - e2 * p0
    work[parent, 32] += t0 * r6 + t1 * r7 + p1 * d8 - p2 * d7 - e0 * p1 + e1 * p0
    work[parent, 33] += t3 * r3 + t4 * r4 + p2 * d3 - p0 * d5 + e3 * p2 - e5 * p0
    work[parent, 34] += t3 * r6 + t4 * r7 + p2 * d6 - p0 * d8 - e3 * p1 + e4 * p0
    work[parent, 35] += t6 * r6 + t7 * r7 + p0 * d7 - p1 * d6 - e6 * p1 + e7 * p0
    work[parent, 36] += e0
    work[parent, 37] += e1
    work[parent, 38] += e2
    work[parent, 39] += e3
    work[parent, 40] += e4
    work[parent, 41] += e5
    work[parent, 42] += e6
    work[parent, 43] += e7
    work[parent, 44] += e8
    work[parent, 45] += n0
    work[parent, 46] += n1
    work[parent, 47] += n2
    work[parent, 48] += n3
    work[parent, 49] += n4
    work[parent, 50] += n5
