"""Cut joints: their relative motion, the rows that close them, how far they are open."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.se3_kernels import include, pose_compose, pose_inverse, pose_log, retract

kernel = jit.lean_kernel

# Columns of a cut joint's relative motion: 0 pose of C2 in C1 as (7,), 7 R and p of C2 in body 1's link, 19 twist in
# C2; of its numbers: 0 B (6, 6) row by row, 36 (BᵀB)⁻¹Bᵀ, 72 covectors of its rows.
M_SIZE, B_SIZE = 25, 108


@kernel
def quaternion(m, at, out):
    """The unit quaternion of a rotation matrix in m[at : at + 9], row by row; by the largest of its entries."""
    a, b, c = m[at], m[at + 4], m[at + 8]
    trace = a + b + c
    if trace > 0.0:
        s = 0.5 / math.sqrt(1.0 + trace)
        out[0] = 0.25 / s
        out[1], out[2], out[3] = (
            (m[at + 7] - m[at + 5]) * s, (m[at + 2] - m[at + 6]) * s, (m[at + 3] - m[at + 1]) * s
        )  # fmt: skip
    elif a >= b and a >= c:
        s = 0.5 / math.sqrt(1.0 + a - b - c)
        out[1] = 0.25 / s
        out[0], out[2], out[3] = (
            (m[at + 7] - m[at + 5]) * s, (m[at + 1] + m[at + 3]) * s, (m[at + 2] + m[at + 6]) * s
        )  # fmt: skip
    elif b >= c:
        s = 0.5 / math.sqrt(1.0 + b - a - c)
        out[2] = 0.25 / s
        out[0], out[1], out[3] = (
            (m[at + 2] - m[at + 6]) * s, (m[at + 1] + m[at + 3]) * s, (m[at + 5] + m[at + 7]) * s
        )  # fmt: skip
    else:
        s = 0.5 / math.sqrt(1.0 + c - a - b)
        out[3] = 0.25 / s
        out[0], out[1], out[2] = (
            (m[at + 3] - m[at + 1]) * s, (m[at + 2] + m[at + 6]) * s, (m[at + 5] + m[at + 7]) * s
        )  # fmt: skip


@kernel
def arm(one, two, frame, at, out):
    """R and p of a frame, in frame[at:] relative to link two, in link one; both links as `place` gives them."""
    for j in range(3):  # columns of the frame in the world, then in link one
        x, y, z = frame[at + j], frame[at + 3 + j], frame[at + 6 + j]
        a = two[0] * x + two[1] * y + two[2] * z
        b = two[3] * x + two[4] * y + two[5] * z
        c = two[6] * x + two[7] * y + two[8] * z
        for k in range(3):
            out[3 * k + j] = one[k] * a + one[3 + k] * b + one[6 + k] * c
    x, y, z = frame[at + 9], frame[at + 10], frame[at + 11]
    a = two[9] - one[9] + two[0] * x + two[1] * y + two[2] * z
    b = two[10] - one[10] + two[3] * x + two[4] * y + two[5] * z
    c = two[11] - one[11] + two[6] * x + two[7] * y + two[8] * z
    for k in range(3):
        out[9 + k] = one[k] * a + one[3 + k] * b + one[6 + k] * c


@kernel
def seen(frame, at, u, where, out):
    """A twist u[where:] of a link as a frame of it sees it, the frame's R and p in frame[at:]."""
    a, b, c = u[where], u[where + 1], u[where + 2]
    p, q, s = frame[at + 9], frame[at + 10], frame[at + 11]
    x, y, z = u[where + 3] + b * s - c * q, u[where + 4] + c * p - a * s, u[where + 5] + a * q - b * p
    for k in range(3):
        out[k] = frame[at + k] * a + frame[at + 3 + k] * b + frame[at + 6 + k] * c
        out[3 + k] = frame[at + k] * x + frame[at + 3 + k] * y + frame[at + 6 + k] * z


@kernel
def wrench_on(frame, at, w, where, sign, out):
    """A wrench w[where:] on a frame of a link as the link sees it."""
    n0, n1, n2 = sign * w[where], sign * w[where + 1], sign * w[where + 2]
    f0, f1, f2 = sign * w[where + 3], sign * w[where + 4], sign * w[where + 5]
    for k in range(3):
        a, b, c = frame[at + 3 * k], frame[at + 3 * k + 1], frame[at + 3 * k + 2]
        out[k], out[3 + k] = a * n0 + b * n1 + c * n2, a * f0 + b * f1 + c * f2
    p, q, s = frame[at + 9], frame[at + 10], frame[at + 11]
    out[0] += q * out[5] - s * out[4]
    out[1] += s * out[3] - p * out[5]
    out[2] += p * out[4] - q * out[3]


@kernel
def relative_pose(frame, arms, out, small):
    """Pose (7,) of C2 in C1 from R and p of C2 in link one, frame = R and p of C1 there."""
    m = small
    for k in range(3):
        for j in range(3):
            m[3 * k + j] = frame[k] * arms[j] + frame[3 + k] * arms[3 + j] + frame[6 + k] * arms[6 + j]
    quaternion(m, 0, out)
    x, y, z = arms[9] - frame[9], arms[10] - frame[10], arms[11] - frame[11]
    for k in range(3):
        out[4 + k] = frame[k] * x + frame[3 + k] * y + frame[6 + k] * z


@kernel
def cut_rows(cut, frame, basis, end, place, motion, row_value, covectors, small):
    """Rows, targets and relative motions of all cut joints, at the motion that the outward sweep found."""
    rest = small[48:54]
    first, second, total, covector = small[54:60], small[60:66], small[66:72], small[72:78]
    for i in range(cut.shape[0]):
        a, b = cut[i, 0], cut[i, 1]
        one, two = place[a], place[b]  # the ground's is the last one
        relative = motion[i]
        arms = relative[7:19]
        arm(one, two, frame[i], 12, arms)
        seen(arms, 0, one, 12, first)
        seen(frame[i], 12, two, 12, second)
        for k in range(6):
            relative[19 + k] = second[k] - first[k]
        u0, u1, u2, u3, u4, u5 = relative[19], relative[20], relative[21], relative[22], relative[23], relative[24]
        # [relative twist, twist of link one], both in C2
        total[0] = u1 * first[2] - u2 * first[1]
        total[1] = u2 * first[0] - u0 * first[2]
        total[2] = u0 * first[1] - u1 * first[0]
        total[3] = u1 * first[5] - u2 * first[4] + u4 * first[2] - u5 * first[1]
        total[4] = u2 * first[3] - u0 * first[5] + u5 * first[0] - u3 * first[2]
        total[5] = u0 * first[4] - u1 * first[3] + u3 * first[1] - u4 * first[0]
        seen(arms, 0, one, 18, first)
        seen(frame[i], 12, two, 18, rest)
        for k in range(6):
            total[k] += rest[k] - first[k]
        for j in range(cut[i, 8]):
            row, at = cut[i, 7] + j, 72 + 6 * j
            value = 0.0
            for k in range(6):
                value -= basis[i, at + k] * total[k]
            row_value[row, 0] = value
            wrench_on(frame[i], 12, basis[i], at, 1.0, covector)
            for k in range(6):
                covectors[end[row, 1], k] += covector[k]
            wrench_on(arms, 0, basis[i], at, -1.0, covector)
            for k in range(6):
                covectors[end[row, 0], k] += covector[k]


@kernel
def cut_poses(e, m):
    """Poses of C2 in C1 of all cut joints, where `cut_rows` has been."""
    for i in range(e.cut.shape[0]):
        relative_pose(e.cut_frame[i], m.relative[i, 7:19], m.relative[i, 0:7], m.small[80:90])


@kernel
def cut_gaps(e, m, q):
    """Targets that close the cut joints in one step of Newton's method; returns how far they are open, in m and rad."""
    worst = 0.0
    joint, inverse, gap, log = m.small[0:7], m.small[7:14], m.small[14:21], m.small[21:27]
    for i in range(e.cut.shape[0]):
        d, at, size = e.cut[i, 3], e.cut[i, 4], e.cut[i, 5]
        include(e.cut[i, 2], e.cut_basis[i, 0:36].reshape(6, 6)[:, :d], q[at : at + size], joint)
        pose_inverse(joint, inverse)
        pose_compose(inverse, m.relative[i, 0:7], gap)
        pose_log(gap, log)
        for j in range(e.cut[i, 8]):
            row, total = e.cut[i, 7] + j, 0.0
            for k in range(6):
                total -= e.cut_basis[i, 72 + 6 * j + k] * log[k]
            m.row_value[row, 0] = total
            worst = max(worst, abs(total))
    return worst


@kernel
def fit(e, m, q):
    """Move the cut joints' elements to where their bodies put them."""
    joint, inverse, gap, log = m.small[0:7], m.small[7:14], m.small[14:21], m.small[21:27]
    change = m.small[27:33]
    for i in range(e.cut.shape[0]):
        code, d, at, size = e.cut[i, 2], e.cut[i, 3], e.cut[i, 4], e.cut[i, 5]
        for _ in range(3 if d > 1 or code != VECTOR else 2):
            include(code, e.cut_basis[i, 0:36].reshape(6, 6)[:, :d], q[at : at + size], joint)
            pose_inverse(joint, inverse)
            pose_compose(inverse, m.relative[i, 0:7], gap)
            pose_log(gap, log)
            for j in range(d):
                change[j] = 0.0
                for k in range(6):
                    change[j] += e.cut_basis[i, 36 + 6 * j + k] * log[k]
            retract(code, q[at : at + size], change[:d], q[at : at + size])
