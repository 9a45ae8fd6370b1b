"""Loops closed in the mass metric: constraint rows, their rank, least corrections, accelerations.

Rows J r = target are turned to A = J L⁻ᵀ with the mass matrix M = L Lᵀ; a row that is a combination of those before it,
to a tolerance, is left out. So rank is decided in the mass metric, and never on the square of a matrix.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.mechanics.reduced.sweep_kernels import bracket, carry, forces, inertia_sweep, kinematics, lift, relative_twist
from ephs.mechanics.reduced.tables import CUT
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.rank import EXPLICIT, REGULAR, ROUNDED
from ephs.semantics.spaces.se3_kernels import coadjoint_apply, include, pose_compose, pose_inverse, pose_log

kernel = jit.lean_kernel


@kernel
def constraint_rows(t, w):
    """The rows of J, of prescribed rates first; returns their number."""
    w.row[:] = 0.0
    w.size[:] = 0.0
    m = 0
    for j in range(t.driven.shape[0]):
        if t.driven[j] == 1:
            w.row[m, j] = 1.0
            w.size[m] = 1.0 / w.factor[j, j]
            m += 1
    one, two, inverse = w.small[190:196], w.small[196:202], w.small[202:209]
    for i in range(t.parent.shape[0], t.kind.shape[0]):
        if t.kind[i] != CUT:
            continue
        for a in range(t.rows[i]):
            if t.second[i] >= 0:
                pose_inverse(t.offset2[i], inverse)
                coadjoint_apply(inverse, t.normal[i, a], one)
                _spread(t, w, t.second[i], one, m, 1.0)
            if t.first[i] >= 0:
                pose_inverse(w.relative[i], inverse)
                coadjoint_apply(inverse, t.normal[i, a], two)
                pose_inverse(t.offset1[i], inverse)
                coadjoint_apply(inverse, two, one)
                _spread(t, w, t.first[i], one, m, -1.0)
            m += 1
    return m


@kernel
def _spread(t, w, link, covector, row, sign):
    """A covector on a link's twist as a row on the rates r."""
    other = w.small[210:216]
    here = link
    while here >= 0:
        for j in range(t.dim[here]):
            entry = 0.0
            for k in range(6):
                entry += covector[k] * w.motion[here, j, k]
            w.row[row, t.r_at[here] + j] += sign * entry
            one, two = 0.0, 0.0
            for k in range(6):
                one += covector[k] * covector[k]
                two += w.motion[here, j, k] * w.motion[here, j, k]
            w.size[row] += math.sqrt(one * two) / w.factor[t.r_at[here] + j, t.r_at[here] + j]
        lift(w.inner[here], covector, other, w.small)
        for k in range(6):
            covector[k] = other[k]
        here = t.parent[here]


@kernel
def row_biases(t, w):
    """What the constraint rows' second derivatives are at ṙ = 0, negated, into the targets."""
    m = 0
    for j in range(t.driven.shape[0]):
        if t.driven[j] == 1:
            w.target[m] = 0.0
            m += 1
    total, one, carried, turned = w.small[220:226], w.small[226:239], w.small[239:252], w.small[252:258]
    twist = w.small[258:264]
    for i in range(t.parent.shape[0], t.kind.shape[0]):
        if t.kind[i] != CUT:
            continue
        relative_twist(t, w, i, w.bias, total)
        if t.first[i] >= 0:
            relative_twist(t, w, i, w.twist, twist)
            carry(t.offset1[i], w.twist[t.first[i]], one)
            carry(w.relative[i], one[:6], carried)
            bracket(twist, carried[:6], turned)
            for k in range(6):
                total[k] += turned[k]
        for a in range(t.rows[i]):
            w.target[m] = 0.0
            for k in range(6):
                w.target[m] -= t.normal[i, a, k] * total[k]
            m += 1


@kernel
def _remainder(w, m, j):
    """Largest remainder of the rows from the j-th chosen one on, once those before it are out, relative to the largest
    row: of the rows as they are, without masses. They are orthonormalised in w.plain."""
    n, size, largest = w.mass.shape[0], 0.0, 0.0
    for c in range(m):
        row, square = w.chosen[c], 0.0
        for i in range(n):
            w.plain[row, i] = w.row[row, i]
            square += w.plain[row, i] * w.plain[row, i]
        size = max(size, math.sqrt(square))
        for _ in range(2):
            for b in range(min(c, j)):
                base, part = w.chosen[b], 0.0
                for i in range(n):
                    part += w.plain[row, i] * w.plain[base, i]
                for i in range(n):
                    w.plain[row, i] -= part * w.plain[base, i]
        square = 0.0
        for i in range(n):
            square += w.plain[row, i] * w.plain[row, i]
        if c < j:
            for i in range(n):
                w.plain[row, i] = w.plain[row, i] / math.sqrt(square) if square > 0.0 else 0.0
        elif w.triangle[row, row] > 0.0:
            largest = max(largest, math.sqrt(square))
    return largest / size if size > 0.0 else 0.0


@kernel
def reduce_rows(w, m):
    """Orthonormalise the rows in the mass metric, largest remainder first; returns the rank.

    A row counts as repeating others where little is left of it both in the mass metric and without masses: in the first
    alone a constraint between heavy bodies looks small beside one that moves light ones.
    """
    n = w.mass.shape[0]
    for a in range(m):
        w.chosen[a] = a
        square = 0.0
        for i in range(n):  # A = J L⁻ᵀ, row by row
            entry = w.row[a, i]
            for k in range(i):
                entry -= w.factor[i, k] * w.scaled[a, k]
            w.scaled[a, i] = entry / w.factor[i, i]
            square += w.scaled[a, i] * w.scaled[a, i]
        # what cancels to rounding is no equation: the loop cannot open in this direction
        w.triangle[a, a] = math.sqrt(square) if math.sqrt(square) > ROUNDED * w.size[a] else 0.0
    largest = 0.0
    for a in range(m):
        largest = max(largest, w.triangle[a, a])
    rank = 0
    for j in range(m):
        best, most = -1, 0.0
        for a in range(j, m):
            if w.triangle[w.chosen[a], w.chosen[a]] > most:
                best, most = a, w.triangle[w.chosen[a], w.chosen[a]]
        if best < 0 or most <= REGULAR * largest or (most <= EXPLICIT * largest and _remainder(w, m, j) <= EXPLICIT):
            break
        w.chosen[j], w.chosen[best] = w.chosen[best], w.chosen[j]
        row = w.chosen[j]
        size = 0.0
        for _ in range(2):  # once more against what rounding left
            for b in range(j):
                base = w.chosen[b]
                part = 0.0
                for i in range(n):
                    part += w.scaled[row, i] * w.scaled[base, i]
                w.triangle[row, base] += part
                for i in range(n):
                    w.scaled[row, i] -= part * w.scaled[base, i]
        for i in range(n):
            size += w.scaled[row, i] * w.scaled[row, i]
        size = math.sqrt(size)
        w.triangle[row, row] = size
        for i in range(n):
            w.scaled[row, i] /= size
        for a in range(j + 1, m):
            other = w.chosen[a]
            part, square = 0.0, 0.0
            for i in range(n):
                part += w.scaled[other, i] * w.scaled[row, i]
            for i in range(n):
                w.scaled[other, i] -= part * w.scaled[row, i]
                square += w.scaled[other, i] * w.scaled[other, i]
            w.triangle[other, row] = part
            w.triangle[other, other] = math.sqrt(square)
        rank += 1
    return rank


@kernel
def correct(w, rank, target, out):
    """The least change of r in the mass metric with J·change = target on the chosen rows."""
    n = w.mass.shape[0]
    for i in range(n):
        out[i] = 0.0
    for j in range(rank):
        row = w.chosen[j]
        entry = target[row]
        for b in range(j):
            entry -= w.triangle[row, w.chosen[b]] * w.step[b]
        w.step[j] = entry / w.triangle[row, row]
        for i in range(n):
            out[i] += w.step[j] * w.scaled[row, i]
    _back(w, out)


@kernel
def _back(w, out):
    """out ← L⁻ᵀ out."""
    n = w.mass.shape[0]
    for i in range(n - 1, -1, -1):
        entry = out[i]
        for k in range(i + 1, n):
            entry -= w.factor[k, i] * out[k]
        out[i] = entry / w.factor[i, i]


@kernel
def accelerate(t, w, q, r, s, drive, wrench, scal, r_rate, s_rate, made, powers):
    """ṙ, ṡ, what each component makes, and the powers of friction and of what drives; (status, component)."""
    n = w.mass.shape[0]
    kinematics(t, w, q, r)
    status, component = forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers)
    if status != 0:
        return status, component
    still = inertia_sweep(t, w)
    if still != 0:
        return 20, still - 1
    for i in range(n):  # M⁻¹ force
        entry = w.force[i]
        for k in range(i):
            entry -= w.factor[i, k] * r_rate[k]
        r_rate[i] = entry / w.factor[i, i]
    _back(w, r_rate)
    m = constraint_rows(t, w)
    if m == 0:
        return 0, 0
    row_biases(t, w)
    for a in range(m):
        for i in range(n):
            w.target[a] -= w.row[a, i] * r_rate[i]
    rank = reduce_rows(w, m)
    change = w.force
    correct(w, rank, w.target, change)
    for i in range(n):
        r_rate[i] += change[i]
    for j in range(rank - 1, -1, -1):  # the multipliers, for the power of what is prescribed
        entry = w.step[j]
        for b in range(j + 1, rank):
            entry -= w.triangle[w.chosen[b], w.chosen[j]] * w.multiplier[w.chosen[b]]
        w.multiplier[w.chosen[j]] = entry / w.triangle[w.chosen[j], w.chosen[j]]
    for j in range(rank, m):
        w.multiplier[w.chosen[j]] = 0.0
    a = 0
    for j in range(t.driven.shape[0]):
        if t.driven[j] == 1:
            powers[1] += w.multiplier[a] * r[j]
            a += 1
    return 0, 0


@kernel
def loop_gaps(t, w, q, out):
    """Position residuals of the cut joints on the rows that `constraint_rows` gives; returns the largest."""
    m, worst = 0, 0.0
    for j in range(t.driven.shape[0]):
        if t.driven[j] == 1:
            out[m] = 0.0
            m += 1
    joint, inverse, gap, log = w.small[270:277], w.small[277:284], w.small[284:291], w.small[291:297]
    for i in range(t.parent.shape[0], t.kind.shape[0]):
        if t.kind[i] != CUT:
            continue
        include(t.code[i], t.basis[i, :, : t.dim[i]], q[t.q_at[i] : t.q_at[i] + t.q_size[i]], joint)
        pose_inverse(joint, inverse)
        pose_compose(inverse, w.relative[i], gap)
        pose_log(gap, log)
        for a in range(t.rows[i]):
            out[m] = 0.0
            for k in range(6):
                out[m] += t.normal[i, a, k] * log[k]
            worst = max(worst, abs(out[m]))
            m += 1
    return worst
