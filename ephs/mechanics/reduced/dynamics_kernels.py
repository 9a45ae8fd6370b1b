"""Forward and inverse dynamics that keep what tangents start from: accelerations, multipliers, loads."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.loop_kernels import (
    constraint_rows,
    correct,
    multipliers,
    reduce_rows,
    row_biases,
    without_mass,
)
from ephs.mechanics.reduced.slope_kernels import frame, frames_of_ends, into, out_of, out_of_edge, relative
from ephs.mechanics.reduced.sweep_kernels import bracket, forces, inertia_sweep, kinematics
from ephs.mechanics.reduced.tables import CUT
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def forward_dynamics(t, w, d, q, r, s, drive, wrench, scal, s_rate, made, powers):
    """ṙ and the multipliers into ``d``, and all that tangents start from; (status, component, rows, rank).

    The mass matrix and its rows stay in ``w``.
    """
    n = w.mass.shape[0]
    kinematics(t, w, q, r)
    status, component = forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers)
    if status != 0:
        return status, component, 0, 0
    _keep_loads(w, d)
    still = inertia_sweep(t, w)
    if still != 0:
        return 20, still - 1, 0, 0
    for i in range(n):
        d.rate[i] = w.force[i]
    m = constraint_rows(t, w)
    rank = 0
    if m > 0:
        row_biases(t, w)
        for a in range(m):
            d.row[a] = -w.target[a]
        rank = reduce_rows(w, m)
    solve_constrained(w, m, rank, d.rate, d.row, d.row, d.change)
    multipliers(w, m, rank, d.multiplier)
    settle(t, w, d, r)
    return 0, 0, m, rank


@kernel
def _keep_loads(w, d):
    for i in range(d.total.shape[0]):
        for k in range(6):
            d.total[i, k] = w.load[i, k]


@kernel
def solve_constrained(w, m, rank, force, row, target, change):
    """force ← M⁻¹(force + Jᵀλ), λ such that J force = −row; target and change are scratch."""
    n = w.mass.shape[0]
    without_mass(w, force)
    if rank == 0:
        return
    for a in range(m):
        entry = -row[a]
        for i in range(n):
            entry -= w.row[a, i] * force[i]
        target[a] = entry
    correct(w, rank, target, change)
    for i in range(n):
        force[i] += change[i]


@kernel
def inverse_dynamics(t, w, d, q, r, s, drive, wrench, scal, s_rate, made, powers, out):
    """The forces on the tree's freedoms beside the scene's own that make ṙ = d.rate without loops; (status, component).

    Nothing is left to multipliers: they are set to zero.
    """
    kinematics(t, w, q, r)
    status, component = forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers)
    if status != 0:
        return status, component
    _keep_loads(w, d)
    for a in range(d.multiplier.shape[0]):
        d.multiplier[a] = 0.0
    settle(t, w, d, r)
    for i in range(t.parent.shape[0]):
        for j in range(t.dim[i]):
            entry = -w.force[t.r_at[i] + j]
            for k in range(6):
                entry += w.motion[i, j, k] * d.total[i, k]
            out[t.r_at[i] + j] = entry
    return 0, 0


@kernel
def place(t, w, d, r):
    """Frames of links and of edges' ends, and what of the twists turns with each joint."""
    links = t.parent.shape[0]
    for i in range(links):
        frame(w.inner[i], d.turn[i], d.place[i])
        for k in range(6):
            d.along[i, k] = 0.0
            for j in range(t.dim[i]):
                d.along[i, k] += w.motion[i, j, k] * r[t.r_at[i] + j]
            d.moving[i, k] = w.twist[i, k] - (d.along[i, k] if t.forward[i] == 1 else 0.0)
    for i in range(links, t.kind.shape[0]):
        frames_of_ends(t, w, d, i)
        relative(t, d, i, w.twist, d.slip[i])
        if t.first[i] >= 0:
            into(d.end_turn[i, 0], d.end_place[i, 0], w.twist[t.first[i]], d.held[i])


@kernel
def gather(t, d, loads):
    """Loads of links and what they carry, inwards."""
    for i in range(t.parent.shape[0] - 1, -1, -1):
        if t.parent[i] >= 0:
            out_of(d.turn[i], d.place[i], loads[i], loads[t.parent[i]], 1.0)


@kernel
def settle(t, w, d, r):
    """What tangents start from, at ṙ = d.rate and the multipliers: frames, accelerations, and loads gathered inwards.

    Accelerations of the cut joints along their freedoms are left in d.rate, after those of the tree; the wrenches of
    what closes loops in d.closing.
    """
    links = t.parent.shape[0]
    one, two, three = d.small[0:6], d.small[6:12], d.small[12:18]
    place(t, w, d, r)
    for i in range(links):
        parent = t.parent[i]
        for k in range(6):
            one[k] = two[k] = 0.0
            for j in range(t.dim[i]):
                two[k] += w.motion[i, j, k] * d.rate[t.r_at[i] + j]
        if parent >= 0:
            into(d.turn[i], d.place[i], d.speed[parent], one)
        bracket(w.twist[i], d.along[i], three)
        for k in range(6):
            d.speed[i, k] = one[k] + three[k] + two[k]
            d.lifted[i, k] = one[k] + (two[k] if t.forward[i] == 0 else 0.0)
        for k in range(6):
            d.momentum[i, k] = 0.0
            for j in range(6):
                d.momentum[i, k] += t.inertia[i, k, j] * w.twist[i, j]
                d.total[i, k] += t.inertia[i, k, j] * (d.speed[i, j] - w.bias[i, j])
    m = 0
    for j in range(t.driven.shape[0]):
        m += t.driven[j]
    for i in range(links, t.kind.shape[0]):
        if t.first[i] >= 0:
            into(d.end_turn[i, 0], d.end_place[i, 0], d.speed[t.first[i]], d.held_rate[i])
        if t.kind[i] == CUT:
            relative(t, d, i, d.speed, one)
            bracket(d.slip[i], d.held[i], two)
            for j in range(t.dim[i]):
                entry = 0.0
                for k in range(6):
                    entry += t.left[i, j, k] * (one[k] + two[k])
                d.rate[t.r_at[i] + j] = entry
            for k in range(6):
                three[k] = 0.0
            for a in range(t.rows[i]):
                for k in range(6):
                    three[k] += t.normal[i, a, k] * d.multiplier[m + a]
            for k in range(6):
                d.closing[i, k] = three[k]
            m += t.rows[i]
            out_of_edge(t, d, i, three, three, d.total)
    gather(t, d, d.total)


@kernel
def by_force(w, d, m, rank, out):
    """∂ṙ/∂force: the mass matrix' inverse along the constraints."""
    for j in range(out.shape[1]):
        for a in range(m):
            d.row[a] = 0.0
        for i in range(out.shape[0]):
            d.force[i] = 1.0 if i == j else 0.0
        solve_constrained(w, m, rank, d.force, d.row, d.row, d.change)
        for i in range(out.shape[0]):
            out[i, j] = d.force[i]
