"""Loops closed in the mass metric: constraint rows, accelerations.

Rank, least corrections and multipliers are those of `ephs.semantics.linear.rows`, called by address.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.mechanics.reduced.sweep_kernels import bracket, carry, forces, inertia_sweep, kinematics, lift, relative_twist
from ephs.mechanics.reduced.tables import CORRECT, CUT, MULTIPLIERS, ORTHONORMALISE, SOLVE
from ephs.semantics.calling import call_staged
from ephs.semantics.spaces import jit
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
def reduce_rows(w, m):
    """Orthonormalise the rows in the mass metric, largest remainder first; returns the rank."""
    return call_staged(
        w.linear[ORTHONORMALISE], (w.row, w.size, w.factor, w.scaled, w.plain, w.triangle, w.chosen, m)
    )  # fmt: skip


@kernel
def correct(w, rank, target, out):
    """The least change of r in the mass metric with J·change = target on the chosen rows."""
    call_staged(
        w.linear[CORRECT],
        (w.row, w.size, w.factor, w.scaled, w.plain, w.triangle, w.chosen, rank, target, w.step, out),
    )


@kernel
def multipliers(w, m, rank, out):
    """The multipliers of the change that `correct` found; zero of rows that repeat others."""
    call_staged(
        w.linear[MULTIPLIERS],
        (w.row, w.size, w.factor, w.scaled, w.plain, w.triangle, w.chosen, m, rank, w.step, out),
    )


@kernel
def without_mass(w, x):
    """x ← M⁻¹ x."""
    call_staged(w.linear[SOLVE], (w.factor, x))


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
    for i in range(n):
        r_rate[i] = w.force[i]
    without_mass(w, r_rate)
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
    multipliers(w, m, rank, w.multiplier)  # for the power of what is prescribed
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
