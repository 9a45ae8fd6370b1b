"""What acts on a mechanism besides inertia and gravity: springs, friction and its heat, conduction, given wrenches."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.engine.frame_kernels import arm, relative_pose, seen, wrench_on
from ephs.mechanics.reduced.sweep_kernels import component_at
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

ON_TREE, ON_CUT, ON_BODIES = range(3)
"""Kinds of edges that carry components."""


@kernel
def temperatures(f, m, s, s_rate, scal):
    """Efforts of all entropies; (status, component)."""
    for k in range(f.node.shape[0]):
        m.temperature[k] = 0.0
        s_rate[k] = 0.0
        if f.node[k] >= 0:
            m.small[190] = s[k]
            status = component_at(f, m, f.node[k], scal, m.small[190:])
            if status != 0:
                return status, f.node[k]
            m.temperature[k] = m.e[0]
    return 0, 0


@kernel
def act(e, m, q, r, s, drive, wrench, scal, s_rate, made, powers):
    """Forces on joints into m.force, wrenches into the loads, heat and work into powers; (status, component)."""
    f = e.forces
    status, number = temperatures(f, m, s, s_rate, scal)
    if status != 0:
        return status, number
    powers[0] = powers[1] = 0.0
    here = m.small[48:54]
    for b in range(f.body.shape[0]):
        i = f.body[b]
        if i == -1:
            continue
        wrench_on(f.body_frame[b], 0, wrench[b], 0, 1.0, here)
        if i >= 0:
            for k in range(6):
                powers[1] += here[k] * m.place[i, 12 + k]
                m.wrench[i, k] += here[k]
    rate, pull, wide, x = m.small[54:60], m.small[60:66], m.small[66:72], m.small[72:80]
    arms, first = m.small[80:92], m.small[92:98]
    for i in range(f.edge.shape[0]):
        kind, a, b, d = f.edge[i, 0], f.edge[i, 1], f.edge[i, 2], f.edge[i, 3]
        at, size, v = f.edge[i, 4], f.edge[i, 5], f.edge[i, 6]
        if kind == ON_TREE:
            for j in range(d):
                rate[j] = r[v + j]
        else:
            if kind == ON_CUT:
                twist = m.relative[f.edge[i, 7], 19:25]
                for k in range(12):
                    arms[k] = m.relative[f.edge[i, 7], 7 + k]
            else:
                one, two = m.place[a], m.place[b]  # the ground's is the last one
                arm(one, two, f.frame[i], 12, arms)
                relative_pose(f.frame[i], arms, x, m.small[100:110])
                seen(arms, 0, one, 12, first)
                seen(f.frame[i], 12, two, 12, wide)
                for k in range(6):
                    wide[k] -= first[k]
                twist = wide
            for j in range(d):
                rate[j] = 0.0
                for k in range(6):
                    rate[j] += f.left[i, 6 * j + k] * twist[k]
        if kind != ON_BODIES:
            for j in range(size):
                x[j] = q[at + j]
        for j in range(d):
            pull[j] = 0.0
            if kind != ON_BODIES:
                pull[j] = drive[v + j]
                powers[1] += pull[j] * rate[j]
        if f.part[i, 0] >= 0:
            status = component_at(f, m, f.part[i, 0], scal, x)
            if status != 0:
                return status, f.part[i, 0]
            for j in range(d):
                pull[j] -= m.e[j]
        if f.part[i, 1] >= 0:
            heat = f.part[i, 2]
            for j in range(d):
                m.e[j] = rate[j]
            m.e[d] = m.temperature[heat]
            status = component_at(f, m, f.part[i, 1], scal, x)
            if status != 0:
                return status, f.part[i, 1]
            for j in range(d):
                pull[j] -= m.f[j]
                powers[0] += m.f[j] * rate[j]
            s_rate[heat] -= m.f[d]
            made[f.made_at[f.part[i, 1]]] = -m.f[d]
        if kind == ON_TREE:
            for j in range(d):
                m.force[v + j] += pull[j]
            continue
        for k in range(6):
            wide[k] = 0.0
            for j in range(d):
                wide[k] += f.left[i, 6 * j + k] * pull[j]
        if b >= 0:
            wrench_on(f.frame[i], 12, wide, 0, 1.0, first)
            for k in range(6):
                m.wrench[b, k] += first[k]
        if a >= 0:
            wrench_on(arms, 0, wide, 0, -1.0, first)
            for k in range(6):
                m.wrench[a, k] += first[k]
    for k in range(f.conduction.shape[0]):
        number, one_end, other = f.conduction[k, 0], f.conduction[k, 1], f.conduction[k, 2]
        m.e[0], m.e[1] = m.temperature[one_end], m.temperature[other]
        status = component_at(f, m, number, scal, x)
        if status != 0:
            return status, number
        s_rate[one_end] -= m.f[0]
        s_rate[other] -= m.f[1]
        made[f.made_at[number]] = -m.f[0] - m.f[1]
    return 0, 0
