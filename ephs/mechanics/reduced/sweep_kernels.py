"""A mechanism in joint coordinates, outwards and inwards: twists, loads, the mass matrix by composite inertias.

Velocities are left-trivialised and body-fixed. A joint's relative pose x of a body in its parent gives
u = Ad_{x⁻¹} u_parent + S r; S is constant for joints that are walked from their body 1 to their body 2.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.tables import CHOLESKY, SPRING
from ephs.semantics.calling import call_kernel, call_staged
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.se3_kernels import (
    adjoint_apply,
    adjoint_inverse,
    coadjoint_apply,
    include,
    pose_compose,
    pose_inverse,
)

kernel = jit.lean_kernel


@kernel
def component_at(t, w, number, scal, x):
    """Call a component's kernel at states x, without increments; efforts in w.e, flows in w.f.

    ``t`` are tables with the components' addresses, ``w`` the memory of the sweeps or of the engine.
    """
    return call_kernel(  # pyright: ignore[reportCallIssue] - the typing context is numba's
        t.address[number], t.dims[number].ctypes.data, scal.ctypes.data,
        t.parameters[t.parameter_at[number] :].ctypes.data, x.ctypes.data, w.small[400:].ctypes.data,
        w.e.ctypes.data, w.small[420:].ctypes.data, w.f.ctypes.data, w.c.ctypes.data, w.jac.ctypes.data,
        w.scratch.ctypes.data,
    )  # fmt: skip


@kernel
def cross_momentum(u, p, out):
    """ad*_u p."""
    out[0] = p[1] * u[2] - p[2] * u[1] + p[4] * u[5] - p[5] * u[4]
    out[1] = p[2] * u[0] - p[0] * u[2] + p[5] * u[3] - p[3] * u[5]
    out[2] = p[0] * u[1] - p[1] * u[0] + p[3] * u[4] - p[4] * u[3]
    out[3] = p[4] * u[2] - p[5] * u[1]
    out[4] = p[5] * u[0] - p[3] * u[2]
    out[5] = p[3] * u[1] - p[4] * u[0]


@kernel
def bracket(u, v, out):
    """ad_u v."""
    out[0] = u[1] * v[2] - u[2] * v[1]
    out[1] = u[2] * v[0] - u[0] * v[2]
    out[2] = u[0] * v[1] - u[1] * v[0]
    out[3] = u[1] * v[5] - u[2] * v[4] + u[4] * v[2] - u[5] * v[1]
    out[4] = u[2] * v[3] - u[0] * v[5] + u[5] * v[0] - u[3] * v[2]
    out[5] = u[0] * v[4] - u[1] * v[3] + u[3] * v[1] - u[4] * v[0]


@kernel
def carry(pose, u, out):
    """Ad_{pose⁻¹} u."""
    inverse = out[6:13]
    pose_inverse(pose, inverse)
    adjoint_apply(inverse, u, out)


@kernel
def kinematics(t, w, q, r):
    """Poses, twists, and accelerations at ṙ = 0 of all links; relative poses and rates of cut edges and springs."""
    small = w.small
    joint, part, moved, whole = small[0:7], small[7:14], small[14:21], small[21:28]
    column, total, carried = small[28:34], small[34:40], small[40:53]
    for i in range(t.parent.shape[0]):
        code, d = t.code[i], t.dim[i]
        include(code, t.basis[i, :, :d], q[t.q_at[i] : t.q_at[i] + t.q_size[i]], joint)
        if t.forward[i] == 1:
            pose_compose(t.offset1[i], joint, part)
            pose_inverse(t.offset2[i], moved)
        else:
            pose_inverse(joint, whole)
            pose_compose(t.offset2[i], whole, part)
            pose_inverse(t.offset1[i], moved)
        pose_compose(part, moved, w.inner[i])
        total[:] = 0.0
        if t.forward[i] == 1:
            for j in range(d):
                adjoint_apply(t.offset2[i], t.basis[i, :, j], w.motion[i, j])
        else:
            pose_compose(t.offset1[i], joint, part)
            for j in range(d):
                adjoint_apply(part, t.basis[i, :, j], column)
                for k in range(6):
                    w.motion[i, j, k] = -column[k]
        for j in range(d):
            for k in range(6):
                total[k] += w.motion[i, j, k] * r[t.r_at[i] + j]
        parent = t.parent[i]
        if parent < 0:
            for k in range(7):
                w.pose[i, k] = w.inner[i, k]
            for k in range(6):
                w.twist[i, k] = total[k]
                w.bias[i, k] = 0.0
        else:
            pose_compose(w.pose[parent], w.inner[i], w.pose[i])
            carry(w.inner[i], w.twist[parent], carried)
            for k in range(6):
                w.twist[i, k] = carried[k] + total[k]
            carry(w.inner[i], w.bias[parent], carried)
            bracket(w.twist[i], total, column)
            for k in range(6):
                w.bias[i, k] = carried[k] + column[k]
    for i in range(t.parent.shape[0], t.kind.shape[0]):
        _frame(t, w, t.first[i], t.offset1[i], joint)
        _frame(t, w, t.second[i], t.offset2[i], part)
        pose_inverse(joint, moved)
        pose_compose(moved, part, w.relative[i])
        relative_twist(t, w, i, w.twist, total)
        for j in range(t.dim[i]):
            w.rate[i, j] = 0.0
            for k in range(6):
                w.rate[i, j] += t.left[i, j, k] * total[k]


@kernel
def _frame(t, w, link, offset, out):
    if link < 0:
        for k in range(7):
            out[k] = offset[k]
    else:
        pose_compose(w.pose[link], offset, out)


@kernel
def relative_twist(t, w, i, twist, out):
    """Ad_{o2⁻¹} u_2 − Ad_{y⁻¹} Ad_{o1⁻¹} u_1 of an edge, for twists or for what transforms like them."""
    one, two = w.small[60:73], w.small[73:86]
    for k in range(6):
        out[k] = 0.0
    if t.second[i] >= 0:
        carry(t.offset2[i], twist[t.second[i]], one)
        for k in range(6):
            out[k] = one[k]
    if t.first[i] >= 0:
        carry(t.offset1[i], twist[t.first[i]], one)
        carry(w.relative[i], one[:6], two)
        for k in range(6):
            out[k] -= two[k]


@kernel
def _pull(t, w, i, wrench):
    """A wrench on body 2 in the frame C2, and its reaction on body 1, into the loads (with negative sign)."""
    inverse, there, here = w.small[90:97], w.small[97:103], w.small[103:109]
    if t.second[i] >= 0:
        pose_inverse(t.offset2[i], inverse)
        coadjoint_apply(inverse, wrench, there)
        for k in range(6):
            w.load[t.second[i], k] -= there[k]
    if t.first[i] >= 0:
        pose_inverse(w.relative[i], inverse)
        coadjoint_apply(inverse, wrench, there)
        pose_inverse(t.offset1[i], inverse)
        coadjoint_apply(inverse, there, here)
        for k in range(6):
            w.load[t.first[i], k] += here[k]


@kernel
def forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers):
    """Loads on links and joints, the heat that they make; returns a component's status and the component."""
    for k in range(t.node.shape[0]):
        w.temperature[k] = 0.0
        s_rate[k] = 0.0
        if t.node[k] >= 0:
            w.small[380] = s[k]
            status = component_at(t, w, t.node[k], scal, w.small[380:])
            if status != 0:
                return status, t.node[k]
            w.temperature[k] = w.e[0]
    powers[0] = powers[1] = 0.0
    momentum, turned = w.small[110:116], w.small[116:122]
    for i in range(t.parent.shape[0]):
        for k in range(6):
            w.load[i, k] = -wrench[i, k]
            powers[1] += wrench[i, k] * w.twist[i, k]
        for k in range(6):
            momentum[k] = 0.0
            for j in range(6):
                momentum[k] += t.inertia[i, k, j] * w.twist[i, j]
                w.load[i, k] += t.inertia[i, k, j] * w.bias[i, j]
        cross_momentum(w.twist[i], momentum, turned)
        for k in range(6):
            w.load[i, k] -= turned[k]
        if t.weight[i] >= 0:
            status = component_at(t, w, t.weight[i], scal, w.pose[i])
            if status != 0:
                return status, t.weight[i]
            for k in range(6):
                w.load[i, k] += w.e[k]
    links = t.parent.shape[0]
    x, rate, pull, wide = w.small[130:140], w.small[140:146], w.small[146:152], w.small[152:158]
    for i in range(t.kind.shape[0]):
        d = t.dim[i]
        for j in range(t.q_size[i]):
            x[j] = w.relative[i, j] if t.kind[i] == SPRING else q[t.q_at[i] + j]
        for j in range(d):
            rate[j] = r[t.r_at[i] + j] if i < links else w.rate[i, j]
            pull[j] = 0.0
        if t.kind[i] != SPRING:
            for j in range(d):
                pull[j] = drive[t.r_at[i] + j]
                powers[1] += pull[j] * rate[j]
        if t.spring[i] >= 0:
            status = component_at(t, w, t.spring[i], scal, x)
            if status != 0:
                return status, t.spring[i]
            for j in range(d):
                pull[j] -= w.e[j]
        if t.friction[i] >= 0:
            for j in range(d):
                w.e[j] = rate[j]
            w.e[d] = w.temperature[t.heat[i]]
            status = component_at(t, w, t.friction[i], scal, x)
            if status != 0:
                return status, t.friction[i]
            for j in range(d):
                pull[j] -= w.f[j]
                powers[0] += w.f[j] * rate[j]
            s_rate[t.heat[i]] -= w.f[d]
            made[t.made_at[t.friction[i]]] = -w.f[d]
        if i < links:
            for j in range(d):
                w.force[t.r_at[i] + j] = pull[j]
        else:
            for k in range(6):
                wide[k] = 0.0
                for j in range(d):
                    wide[k] += t.left[i, j, k] * pull[j]
            _pull(t, w, i, wide)
    for k in range(t.conduction.shape[0]):
        number, one, two = t.conduction[k, 0], t.conduction[k, 1], t.conduction[k, 2]
        w.e[0], w.e[1] = w.temperature[one], w.temperature[two]
        status = component_at(t, w, number, scal, x)
        if status != 0:
            return status, number
        s_rate[one] -= w.f[0]
        s_rate[two] -= w.f[1]
        made[t.made_at[number]] = -w.f[0] - w.f[1]
    return 0, 0


@kernel
def inertia_sweep(t, w):
    """Mass matrix by composite inertias; loads gathered into the joints' forces; its Cholesky factor."""
    links = t.parent.shape[0]
    x, product, force, other = w.matrix, w.scratch[0:36].reshape(6, 6), w.small[160:166], w.small[166:172]
    w.mass[:] = 0.0
    for i in range(links):
        for k in range(6):
            for m in range(6):
                w.composite[i, k, m] = t.inertia[i, k, m]
    for i in range(links - 1, -1, -1):
        d, at, parent = t.dim[i], t.r_at[i], t.parent[i]
        for j in range(d):
            for k in range(6):
                w.force[at + j] -= w.motion[i, j, k] * w.load[i, k]
                force[k] = 0.0
                for m in range(6):
                    force[k] += w.composite[i, k, m] * w.motion[i, j, m]
            here = i
            while here >= 0:
                for m in range(t.dim[here]):
                    entry = 0.0
                    for k in range(6):
                        entry += w.motion[here, m, k] * force[k]
                    w.mass[at + j, t.r_at[here] + m] = w.mass[t.r_at[here] + m, at + j] = entry
                lift(w.inner[here], force, other, w.small)
                for k in range(6):
                    force[k] = other[k]
                here = t.parent[here]
        if parent >= 0:
            lift(w.inner[i], w.load[i], other, w.small)
            for k in range(6):
                w.load[parent, k] += other[k]
            adjoint_inverse(w.inner[i], x)
            for k in range(6):
                for m in range(6):
                    product[k, m] = 0.0
                    for a in range(6):
                        product[k, m] += w.composite[i, k, a] * x[a, m]
            for k in range(6):
                for m in range(6):
                    entry = 0.0
                    for a in range(6):
                        entry += x[a, k] * product[a, m]
                    w.composite[parent, k, m] += entry
    return call_staged(w.linear[CHOLESKY], (w.mass, w.factor))


@kernel
def lift(pose, wrench, out, small):
    """Ad*_{pose⁻¹} of a wrench: from a link to its parent."""
    inverse = small[180:187]
    pose_inverse(pose, inverse)
    coadjoint_apply(inverse, wrench, out)
