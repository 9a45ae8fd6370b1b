"""Loops closed on the way inwards: what `closing` laid out, on SE(3) and on SE(2).

A row K of a constraint is a covector on a link's acceleration, so that K μ is the wrench with which the multiplier μ
pushes the link. Passing a joint takes the row's part along the joint out of it, which leaves Sᵀ K, couples it to the
other rows that are open, and moves its target.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.engine.tree_kernels import (
    DENSE,
    DIM,
    DRIVEN,
    G_BASIS,
    G_GAIN,
    G_INVERSE,
    KIND,
    REVOLUTE,
    SPHERICAL,
)
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

# Columns of a row's numbers: 0 target, 1 multiplier, 2 size before elimination, 3 pivot.


@kernel
def clear(entry, row_value, covector):
    """Nothing is coupled yet, no row touches a link."""
    entry[:] = 0.0
    covector[:] = 0.0
    for a in range(row_value.shape[0]):
        row_value[a, 2] = 0.0


@kernel
def eliminate(closing, entry, row_value, covector, work, i, planar):
    """Eliminate the rows that end at link i, into its inertia and what couples the others."""
    first = closing.at[i, 0]
    width = 3 if planar else 6
    for s in range(first, first + closing.at[i, 2]):
        a = closing.slot[s, 0]
        row_value[a, 3] = entry[a]
        inverse = 1.0 / entry[a]
        if i < closing.at.shape[0] - 1:
            if planar:
                k0, k1, k2 = covector[s, 0], covector[s, 1], covector[s, 2]
                work[i, 14] += k0 * k0 * inverse
                work[i, 15] += k0 * k1 * inverse
                work[i, 16] += k0 * k2 * inverse
                work[i, 17] += k1 * k1 * inverse
                work[i, 18] += k1 * k2 * inverse
                work[i, 19] += k2 * k2 * inverse
            else:
                at = 30
                for k in range(3):
                    for m in range(k, 3):
                        work[i, at] += covector[s, k] * covector[s, m] * inverse
                        work[i, at + 15] += covector[s, 3 + k] * covector[s, 3 + m] * inverse
                        at += 1
                    for m in range(3):
                        work[i, 36 + 3 * k + m] += covector[s, k] * covector[s, 3 + m] * inverse
        head, count, pair = closing.row[a, 0], closing.row[a, 1], closing.row[a, 2]
        for x in range(count):
            factor = entry[closing.flat[head + 3 * x + 2]] * inverse
            other = closing.flat[head + 3 * x + 1]
            for k in range(width):
                covector[other, k] -= factor * covector[s, k]
            for y in range(x, count):
                entry[closing.flat[pair]] -= factor * entry[closing.flat[head + 3 * y + 2]]
                pair += 1


@kernel
def eliminate_load(closing, entry, row_value, covector, work, i, planar):
    """The same for the targets and link i's load."""
    first = closing.at[i, 0]
    for s in range(first, first + closing.at[i, 2]):
        a = closing.slot[s, 0]
        push = row_value[a, 0] / row_value[a, 3]
        if i < closing.at.shape[0] - 1:
            if planar:
                for k in range(3):
                    work[i, 11 + k] -= covector[s, k] * push
            else:
                for k in range(6):
                    work[i, 24 + k] -= covector[s, k] * push
        head = closing.row[a, 0]
        for x in range(closing.row[a, 1]):
            row_value[closing.flat[head + 3 * x], 0] -= entry[closing.flat[head + 3 * x + 2]] * push


@kernel
def carry(closing, entry, row_value, covector, along, link, work, dense, i, planar):
    """Take the open rows of link i through its joint, to its parent; ``along`` keeps SᵀK and D⁻¹SᵀK."""
    first, pair = closing.at[i, 0] + closing.at[i, 2], closing.at[i, 3]
    last = closing.at[i, 0] + closing.at[i, 1]
    d = link[i, DIM] if link[i, DRIVEN] == 0 else 0
    for s in range(first, last):
        a, up = closing.slot[s, 0], closing.slot[s, 1]
        if d:
            _along(covector, along, link, work, dense, i, s, d, planar)
        if d == 1:
            x = along[s, 0]
            row_value[a, 2] += x * along[s, 6]
            for y in range(first, s + 1):
                entry[closing.flat[pair]] += x * along[y, 6]
                pair += 1
        else:
            for y in range(first, s + 1):
                total = 0.0
                for j in range(d):
                    total += along[s, j] * along[y, 6 + j]
                if y == s:
                    row_value[a, 2] += total
                entry[closing.flat[pair]] += total
                pair += 1
        if planar:
            k0, k1, k2 = covector[s, 0], covector[s, 1], covector[s, 2]
            if d:
                x = along[s, 0]
                k0, k1, k2 = k0 - work[i, 20] * x, k1 - work[i, 21] * x, k2 - work[i, 22] * x
            covector[up, 0] += k0 + work[i, 4] * k2 - work[i, 5] * k1
            covector[up, 1] += k1
            covector[up, 2] += k2
        else:
            _lift(covector, along, link, work, dense, i, s, up, d)


@kernel
def _along(covector, along, link, work, dense, i, s, d, planar):
    """SᵀK and D⁻¹SᵀK of a row at link i."""
    if planar:
        if link[i, KIND] == REVOLUTE:
            along[s, 0] = covector[s, 0]
        else:
            along[s, 0] = work[i, 29] * covector[s, 1] + work[i, 30] * covector[s, 2]
        along[s, 6] = along[s, 0] * work[i, 23]
    elif link[i, KIND] == REVOLUTE:
        along[s, 0] = covector[s, 2]
        along[s, 6] = covector[s, 2] * work[i, 60]
    elif link[i, KIND] == SPHERICAL:
        k0, k1, k2 = covector[s, 0], covector[s, 1], covector[s, 2]
        along[s, 0], along[s, 1], along[s, 2] = k0, k1, k2
        along[s, 6] = work[i, 60] * k0 + work[i, 61] * k1 + work[i, 62] * k2
        along[s, 7] = work[i, 61] * k0 + work[i, 63] * k1 + work[i, 64] * k2
        along[s, 8] = work[i, 62] * k0 + work[i, 64] * k1 + work[i, 65] * k2
    else:
        g = link[i, DENSE]
        for j in range(d):
            total = 0.0
            for k in range(6):
                total += dense[g, G_BASIS + 6 * j + k] * covector[s, k]
            along[s, j] = total
        for j in range(d):
            total = 0.0
            for m in range(d):
                total += dense[g, G_INVERSE + d * j + m] * along[s, m]
            along[s, 6 + j] = total


@kernel
def _lift(covector, along, link, work, dense, i, s, up, d):
    """A row without its part along link i's joint, added to that at the parent, on SE(3)."""
    n0, n1, n2 = covector[s, 0], covector[s, 1], covector[s, 2]
    f0, f1, f2 = covector[s, 3], covector[s, 4], covector[s, 5]
    if d and link[i, KIND] == REVOLUTE:
        x = along[s, 0]
        n0, n1, n2 = n0 - work[i, 51] * x, n1 - work[i, 52] * x, n2 - x
        f0, f1, f2 = f0 - work[i, 54] * x, f1 - work[i, 55] * x, f2 - work[i, 56] * x
    elif d and link[i, KIND] == SPHERICAL:
        x, y, z = n0, n1, n2
        n0 = n1 = n2 = 0.0
        f0 -= work[i, 51] * x + work[i, 54] * y + work[i, 57] * z
        f1 -= work[i, 52] * x + work[i, 55] * y + work[i, 58] * z
        f2 -= work[i, 53] * x + work[i, 56] * y + work[i, 59] * z
    else:
        g = link[i, DENSE]
        for j in range(d):
            x, b = along[s, j], G_GAIN + 6 * j
            n0, n1, n2 = n0 - dense[g, b] * x, n1 - dense[g, b + 1] * x, n2 - dense[g, b + 2] * x
            f0, f1, f2 = f0 - dense[g, b + 3] * x, f1 - dense[g, b + 4] * x, f2 - dense[g, b + 5] * x
    r0, r1, r2, r3, r4, r5 = work[i, 0], work[i, 1], work[i, 2], work[i, 3], work[i, 4], work[i, 5]
    r6, r7, r8, p0, p1, p2 = work[i, 6], work[i, 7], work[i, 8], work[i, 9], work[i, 10], work[i, 11]
    g0, g1, g2 = r0 * f0 + r1 * f1 + r2 * f2, r3 * f0 + r4 * f1 + r5 * f2, r6 * f0 + r7 * f1 + r8 * f2
    covector[up, 0] += r0 * n0 + r1 * n1 + r2 * n2 + p1 * g2 - p2 * g1
    covector[up, 1] += r3 * n0 + r4 * n1 + r5 * n2 + p2 * g0 - p0 * g2
    covector[up, 2] += r6 * n0 + r7 * n1 + r8 * n2 + p0 * g1 - p1 * g0
    covector[up, 3] += g0
    covector[up, 4] += g1
    covector[up, 5] += g2


@kernel
def carry_load(closing, row_value, along, link, work, i, planar):
    """What the targets of the open rows lose to the joint of link i."""
    if link[i, DRIVEN] == 1:
        return
    at = 24 if planar else 66
    first, last = closing.at[i, 0] + closing.at[i, 2], closing.at[i, 0] + closing.at[i, 1]
    for s in range(first, last):
        total = 0.0
        for j in range(link[i, DIM]):
            total += along[s, j] * work[i, at + j]
        row_value[closing.slot[s, 0], 0] -= total


@kernel
def push(closing, row_value, along, link, work, i, planar):
    """Add what the multipliers do to link i's joint."""
    if link[i, DRIVEN] == 1:
        return
    at = 24 if planar else 66
    first, last = closing.at[i, 0] + closing.at[i, 2], closing.at[i, 0] + closing.at[i, 1]
    for s in range(first, last):
        multiplier = row_value[closing.slot[s, 0], 1]
        for j in range(link[i, DIM]):
            work[i, at + j] += along[s, 6 + j] * multiplier


@kernel
def multipliers(closing, entry, row_value, covector, work, i, planar):
    """Multipliers of the rows that were eliminated at link i, whose acceleration is known."""
    first = closing.at[i, 0]
    at, width = (25, 3) if planar else (72, 6)
    if i == closing.at.shape[0] - 1:
        width = 0
    for s in range(first + closing.at[i, 2] - 1, first - 1, -1):
        a = closing.slot[s, 0]
        value = row_value[a, 0]
        for k in range(width):
            value -= covector[s, k] * work[i, at + k]
        head = closing.row[a, 0]
        for x in range(closing.row[a, 1]):
            value -= entry[closing.flat[head + 3 * x + 2]] * row_value[closing.flat[head + 3 * x], 1]
        row_value[a, 1] = value / row_value[a, 3]


@kernel
def nearly_dependent(closing, row_value, largest, limit):
    """Whether a row, once the others are out of it, is less than ``limit`` of the largest one that it is coupled to."""
    largest[:] = 0.0
    for a in range(row_value.shape[0]):
        block = closing.row[a, 3]
        largest[block] = max(largest[block], row_value[a, 2])
    found = False
    for a in range(row_value.shape[0]):
        found = found or not row_value[a, 3] > limit * largest[closing.row[a, 3]]
    return found
