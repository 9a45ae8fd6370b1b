"""Accelerations of a mechanism: outwards, inwards with the loops closed on the way, outwards again."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.engine.closing_kernels import (
    carry,
    carry_load,
    clear,
    eliminate,
    eliminate_load,
    multipliers,
    nearly_dependent,
    push,
)
from ephs.mechanics.engine.force_kernels import act
from ephs.mechanics.engine.inward_kernels import accelerate_outward, inward, load_inward, tree
from ephs.mechanics.engine.planar_kernels import (
    planar_accelerate_outward,
    planar_inward,
    planar_load_inward,
    planar_outward,
    planar_tree,
)
from ephs.mechanics.engine.row_kernels import cut_rows, world
from ephs.mechanics.engine.tree_kernels import (
    CODE,
    DENSE,
    DIM,
    DRIVEN,
    FORWARD,
    G_BACK,
    G_BASIS,
    G_RATE,
    G_TWIST,
    GENERAL,
    KIND,
    Q_AT,
    Q_SIZE,
    R_AT,
    REVOLUTE,
    outward,
)
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.rank import SPARSE
from ephs.semantics.spaces.se3_kernels import (
    adjoint_apply,
    include,
    pose_inverse,
    quat_to_matrix,
)

kernel = jit.lean_kernel

STILL, DEPENDENT = 20, 21
"""Statuses: a freedom moves no mass; rows are nearly dependent."""


@kernel
def _elements(e, m, q, r):
    """Poses and twists of general joints; of those walked backward also what turns their rates."""
    joint = m.small[0:7]
    for i in range(e.link.shape[0]):
        if e.link[i, KIND] != GENERAL:
            continue
        k, d, at = e.link[i, DENSE], e.link[i, DIM], e.link[i, Q_AT]
        for j in range(6 * d):
            m.dense[k, G_BASIS + j] = e.basis[k, j]
        code, size, where = e.link[i, CODE], e.link[i, Q_SIZE], e.link[i, R_AT]
        include(code, e.basis[k].reshape(6, 6).T[:, :d], q[at : at + size], joint)
        for j in range(6):
            m.dense[k, G_TWIST + j] = 0.0
        if e.link[i, FORWARD] > 0:
            for j in range(d):
                for a in range(6):
                    m.dense[k, G_TWIST + a] += e.basis[k, 6 * j + a] * r[where + j]
        else:  # the element is inverted: its twist is −Ad_x B r = B (−L r), and L⁻¹ is L of the inverse
            _carried(e, m, k, d, joint, G_RATE)
            for j in range(d):
                for n in range(d):
                    for a in range(6):
                        m.dense[k, G_TWIST + a] -= e.basis[k, 6 * n + a] * m.dense[k, G_RATE + 6 * n + j] * r[where + j]
            pose_inverse(joint, m.small[20:27])
            for a in range(7):
                joint[a] = m.small[20 + a]
            _carried(e, m, k, d, joint, G_BACK)
        quat_to_matrix(joint, m.small[30:39].reshape(3, 3))
        for j in range(9):
            m.dense[k, j] = m.small[30 + j]
        for j in range(3):
            m.dense[k, 9 + j] = joint[4 + j]


@kernel
def _carried(e, m, k, d, pose, out):
    """L = B⁺ Ad B of a general joint at a pose; its basis has orthogonal columns."""
    column, image = m.small[7:13], m.small[13:19]
    for j in range(d):
        for a in range(6):
            column[a] = e.basis[k, 6 * j + a]
        adjoint_apply(pose, column, image)
        for n in range(d):
            above = below = 0.0
            for a in range(6):
                above += e.basis[k, 6 * n + a] * image[a]
                below += e.basis[k, 6 * n + a] * e.basis[k, 6 * n + a]
            m.dense[k, out + 6 * n + j] = above / below


@kernel
def _turn_forces(e, m, force):
    """Forces on the rates of general joints that are walked backward, on the rates that the sweeps use: −L⁻ᵀ τ."""
    for i in range(e.link.shape[0]):
        if e.link[i, KIND] == GENERAL and e.link[i, FORWARD] < 0:
            k, d, at = e.link[i, DENSE], e.link[i, DIM], e.link[i, R_AT]
            for j in range(d):
                m.small[j] = 0.0
                for n in range(d):
                    m.small[j] -= m.dense[k, G_BACK + 6 * n + j] * force[at + n]
            for j in range(d):
                force[at + j] = m.small[j]


@kernel
def _turn_rates(e, m, rate):
    """Rates of general joints that are walked backward: −L⁻¹ ρ."""
    for i in range(e.link.shape[0]):
        if e.link[i, KIND] == GENERAL and e.link[i, FORWARD] < 0:
            k, d, at = e.link[i, DENSE], e.link[i, DIM], e.link[i, R_AT]
            for j in range(d):
                m.small[j] = 0.0
                for n in range(d):
                    m.small[j] -= m.dense[k, G_BACK + 6 * j + n] * rate[at + n]
            for j in range(d):
                rate[at + j] = m.small[j]


@kernel
def move(e, m, q, r):
    """The outward sweep: poses, twists, loads of all links, and what closes the loops."""
    planar = e.flag[0] == 1
    if planar:
        planar_outward(e.link, e.const, m.work, q, r, e.gravity)
    else:
        if e.basis.shape[0] > 0:
            _elements(e, m, q, r)
        outward(e.link, e.const, m.work, m.dense, q, r, e.gravity)
        if e.flag[3] == 1:
            world(e.link, m.work)
    if e.cut.shape[0] > 0:
        clear(m.entry, m.row_value, m.covector)
        cut_rows(
            e.cut, e.cut_frame, e.cut_basis, e.closing.end, e.gravity, m.work, m.relative, m.row_value, m.covector,
            m.small, planar,
        )  # fmt: skip


@kernel
def fold(e, m, q, force):
    """The inward sweep; returns 0, or 1 + the link whose joint moves no mass."""
    return _fold(
        e.link, e.closing, m.work, m.dense, m.entry, m.row_value, m.covector, m.along, q, force, e.flag[0] == 1
    )


@kernel
def _fold(link, closing, work, dense, entry, row_value, covector, along, q, force, planar):
    loops, n = row_value.shape[0] > 0, link.shape[0]
    for i in range(n - 1, -1, -1):
        ending = closing.at[i, 2] if loops else 0
        rows = loops and closing.at[i, 1] > ending
        if ending:
            eliminate(closing, entry, row_value, covector, work, i, planar)
            eliminate_load(closing, entry, row_value, covector, work, i, planar)
        if planar:
            if not planar_inward(link, work, i):
                return 1 + i
            planar_load_inward(link, work, force, i)
        else:
            if not inward(link, work, dense, i):
                return 1 + i
            load_inward(link, work, dense, q, force, i)
        if rows:
            carry(closing, entry, row_value, covector, along, link, work, dense, i, planar)
            carry_load(closing, row_value, along, link, work, i, planar)
    if loops:
        eliminate(closing, entry, row_value, covector, work, n, planar)
        eliminate_load(closing, entry, row_value, covector, work, n, planar)
    return 0


@kernel
def unfold(e, m, q, rate):
    """The second outward sweep: accelerations of joints and links, multipliers."""
    _unfold(e.link, e.closing, m.work, m.dense, m.entry, m.row_value, m.covector, m.along, q, rate, e.flag[0] == 1)
    if e.basis.shape[0] > 0:
        _turn_rates(e, m, rate)


@kernel
def _unfold(link, closing, work, dense, entry, row_value, covector, along, q, rate, planar):
    loops, n = row_value.shape[0] > 0, link.shape[0]
    if loops:
        multipliers(closing, entry, row_value, covector, work, n, planar)
    for i in range(n):
        ending = closing.at[i, 2] if loops else 0
        if loops and closing.at[i, 1] > ending:
            push(closing, row_value, along, link, work, i, planar)
        if planar:
            planar_accelerate_outward(link, work, rate, i)
        else:
            accelerate_outward(link, work, dense, q, rate, i)
        if ending:
            multipliers(closing, entry, row_value, covector, work, i, planar)


@kernel
def resolve(e, m, q, rate):
    """The least change of rates, in the mass metric, that meets the targets, with the factors at hand."""
    planar = e.flag[0] == 1
    n, at, width = e.link.shape[0], 11 if e.flag[0] == 1 else 24, 3 if e.flag[0] == 1 else 6
    for i in range(n):
        for k in range(width):
            m.work[i, at + k] = 0.0
    for i in range(n - 1, -1, -1):
        eliminate_load(e.closing, m.entry, m.row_value, m.covector, m.work, i, planar)
        if planar:
            planar_load_inward(e.link, m.work, m.zero, i)
        else:
            load_inward(e.link, m.work, m.dense, q, m.zero, i)
        carry_load(e.closing, m.row_value, m.along, e.link, m.work, i, planar)
    eliminate_load(e.closing, m.entry, m.row_value, m.covector, m.work, n, planar)
    unfold(e, m, q, rate)


@kernel
def driven_power(e, m, r):
    """The power of the joints whose motion is prescribed."""
    planar, total = e.flag[0] == 1, 0.0
    wrench = m.small[0:6]
    for i in range(e.link.shape[0]):
        if e.link[i, DRIVEN] == 0:
            continue
        if planar:
            x, y, z = m.work[i, 25], m.work[i, 26], m.work[i, 27]
            j0, j1, j2 = m.work[i, 14], m.work[i, 15], m.work[i, 16]
            m0, m1, m2 = m.work[i, 17], m.work[i, 18], m.work[i, 19]
            wrench[0] = m.work[i, 11] + j0 * x + j1 * y + j2 * z
            wrench[1] = m.work[i, 12] + j1 * x + m0 * y + m1 * z
            wrench[2] = m.work[i, 13] + j2 * x + m1 * y + m2 * z
        else:
            for k in range(3):
                a = b = 0.0
                for j in range(3):
                    low, high = min(k, j), max(k, j)
                    s = 3 * low + high - (low * (low + 1)) // 2
                    a += m.work[i, 30 + s] * m.work[i, 72 + j] + m.work[i, 36 + 3 * k + j] * m.work[i, 75 + j]
                    b += m.work[i, 36 + 3 * j + k] * m.work[i, 72 + j] + m.work[i, 45 + s] * m.work[i, 75 + j]
                wrench[k], wrench[3 + k] = m.work[i, 24 + k] + a, m.work[i, 27 + k] + b
        if m.row_value.shape[0] > 0:
            for s in range(e.closing.at[i, 0] + e.closing.at[i, 2], e.closing.at[i, 0] + e.closing.at[i, 1]):
                multiplier = m.row_value[e.closing.slot[s, 0], 1]
                for k in range(3 if planar else 6):
                    wrench[k] -= m.covector[s, k] * multiplier
        along = 0.0
        if not planar:
            g = e.link[i, DENSE]
            for k in range(6):
                along += m.dense[g, G_BASIS + k] * wrench[k]
        elif e.link[i, KIND] == REVOLUTE:
            along = wrench[0]
        else:
            along = m.work[i, 29] * wrench[1] + m.work[i, 30] * wrench[2]
        at = e.link[i, R_AT]  # what friction and springs do in the joint itself, the rest has to outweigh
        total += (along * e.link[i, FORWARD] - m.force[at]) * r[at]
    return total


@kernel
def fall(e, m, q, r, force, rate):
    """Accelerations of a tree on which nothing but gravity acts; 0, or 1 + a link that moves no mass."""
    if e.flag[0] == 1:
        planar_outward(e.link, e.const, m.work, q, r, e.gravity)
        return planar_tree(e.link, m.work, force, rate)
    if e.basis.shape[0] > 0:
        _elements(e, m, q, r)
    outward(e.link, e.const, m.work, m.dense, q, r, e.gravity)
    found = tree(e.link, m.work, m.dense, q, force, rate)
    if e.basis.shape[0] > 0:
        _turn_rates(e, m, rate)
    return found


@kernel
def accelerate(e, m, q, r, s, drive, wrench, scal, r_rate, s_rate, made, powers):
    """ṙ, ṡ, what each component makes, and the powers of friction and of what drives; (status, component)."""
    if e.flag[1] + e.flag[2] + e.cut.shape[0] == 0:
        still = fall(e, m, q, r, m.zero, r_rate)
        return (0, 0) if still == 0 else (STILL, e.link[still - 1, R_AT])
    move(e, m, q, r)
    for j in range(m.force.shape[0]):
        m.force[j] = 0.0
    if e.flag[1] == 1:
        status, component = act(e, m, q, r, s, drive, wrench, scal, s_rate, made, powers)
        if status != 0:
            return status, component
        if e.basis.shape[0] > 0:
            _turn_forces(e, m, m.force)
    still = fold(e, m, q, m.force)
    if still != 0:
        return STILL, e.link[still - 1, R_AT]
    if m.row_value.shape[0] > 0 and nearly_dependent(e.closing, m.row_value, m.largest, SPARSE):
        return DEPENDENT, 0
    unfold(e, m, q, r_rate)
    if e.flag[2] == 1:
        powers[1] += driven_power(e, m, r)
    return 0, 0


@kernel
def evaluations(e, m, q, r, rates, repeats):
    """Accelerations of many states q (k, size), r (k, n) without forces, into rates (k, n); what a benchmark calls."""
    for _ in range(repeats):
        for k in range(q.shape[0]):
            if e.cut.shape[0] == 0:
                fall(e, m, q[k], r[k], m.zero, rates[k])
                continue
            move(e, m, q[k], r[k])
            if fold(e, m, q[k], m.zero) == 0:
                unfold(e, m, q[k], rates[k])
