"""Derivatives of a mechanism's momenta ∂L/∂r and forces ∂L/∂q + f: by the same tangents, with momenta for loads."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.dynamics_kernels import gather, place
from ephs.mechanics.reduced.slope_kernels import component_slopes, out_of
from ephs.mechanics.reduced.sweep_kernels import bracket, cross_momentum, forces, kinematics
from ephs.mechanics.reduced.tangent_kernels import still, tangent
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def action_slopes(t, w, d, q, r, s, drive, wrench, scal, s_rate, made, powers, momentum, force):
    """∂(p, g)/∂(q, r) into momentum and force (n, 2n), by left-trivialised changes of the tree's elements, cut ones
    following; (status, component)."""
    links, n = t.parent.shape[0], w.mass.shape[0]
    kinematics(t, w, q, r)
    status, component = forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers)
    if status != 0:
        return status, component
    status, component = component_slopes(t, w, d, q, r, s, drive, scal)
    if status != 0:
        return status, component
    place(t, w, d, r)
    one = d.small[0:6]
    for i in range(links):
        for k in range(6):
            d.momentum[i, k] = 0.0
            d.total[i, k] = w.load[i, k]
            for j in range(6):
                d.momentum[i, k] += t.inertia[i, k, j] * w.twist[i, j]
                d.total[i, k] -= t.inertia[i, k, j] * w.bias[i, j]
        cross_momentum(w.twist[i], d.momentum[i], one)
        for k in range(6):
            d.total[i, k] += one[k]
            d.lifted[i, k] = 0.0
    gather(t, d, d.total)
    gather(t, d, d.momentum)
    for i in range(d.closing.shape[0]):
        for k in range(6):
            d.closing[i, k] = 0.0
    still(d)
    for column in range(2 * n):
        if column < n:
            d.dq[column] = 1.0
        else:
            d.dr[column - n] = 1.0
        tangent(t, w, d, 1, 0)
        for i in range(n):
            force[i, column] = -d.force[i]
        _momenta(t, w, d, column, momentum, force)
        if column < n:
            d.dq[column] = 0.0
        else:
            d.dr[column - n] = 0.0
    return 0, 0


@kernel
def _momenta(t, w, d, column, momentum, force):
    """The changes of p, and of the part of g that momenta make: ⟨P|[c, S]⟩ of each joint."""
    sigma, own, moved, turned = d.small[0:6], d.small[6:12], d.small[12:18], d.small[18:24]
    links = t.parent.shape[0]
    for i in range(links):
        for k in range(6):
            d.dspeed[i, k] = 0.0
            if d.stirred[i]:
                for j in range(6):
                    d.dspeed[i, k] += t.inertia[i, k, j] * d.dtwist[i, j]
    for i in range(links - 1, -1, -1):
        at, forward = t.r_at[i], t.forward[i] == 1
        for k in range(6):
            sigma[k], own[k] = 0.0, d.dtwist[i, k]
            for j in range(t.dim[i]):
                sigma[k] += w.motion[i, j, k] * d.dq[at + j]
                if forward:
                    own[k] -= w.motion[i, j, k] * d.dr[at + j]
        cross_momentum(sigma, d.momentum[i], moved)
        for k in range(6):
            moved[k] = d.dspeed[i, k] - moved[k]
        for j in range(t.dim[i]):
            change, push = 0.0, 0.0
            bracket(d.moving[i], w.motion[i, j], turned)
            for k in range(6):
                change += w.motion[i, j, k] * (d.dspeed[i, k] if forward else moved[k])
                push += d.dspeed[i, k] * turned[k]
            bracket(own, w.motion[i, j], turned)
            for k in range(6):
                push += d.momentum[i, k] * turned[k]
            if not forward:  # the joint's own axes turn with it
                bracket(w.motion[i, j], sigma, own)
                bracket(d.moving[i], own, turned)
                for k in range(6):
                    push += d.momentum[i, k] * turned[k]
                    own[k] = d.dtwist[i, k]
            momentum[at + j, column] = change
            force[at + j, column] += push
        if t.parent[i] >= 0:
            out_of(d.turn[i], d.place[i], moved, d.dspeed[t.parent[i]], 1.0)
