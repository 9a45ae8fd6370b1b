"""Frames of springs: where they are, how they move, wrenches on them."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


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
