"""Derivatives of a mechanism's equations by forward tangents: exact, in one sweep out and in for each direction.

A joint's change δq, left-trivialised, turns with its link's frame: with σ = S δq, δ(Ad_{x⁻¹}u) = Ad_{x⁻¹}δu +
[Ad_{x⁻¹}u, σ] and δ(Ad*_{x⁻¹}f) = Ad*_{x⁻¹}(δf − ad*_σ f); of joints that are walked backward, δS w = [S w, σ]. The
residual is M ṙ + … − forces − Jᵀλ; multipliers are held while it is differentiated.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.dynamics_kernels import solve_constrained
from ephs.mechanics.reduced.slope_kernels import into, out_of, out_of_edge, relative
from ephs.mechanics.reduced.sweep_kernels import bracket, cross_momentum
from ephs.mechanics.reduced.tables import CUT, SPRING
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def tangent(t, w, d, fit, inert):
    """One direction: from d.dq, dr, da, ds, ddrive, dwrench to the changes of the residual d.force, of the constraints'
    accelerations d.row, of the cut joints' rates d.cut, of the entropies' rates d.heat.

    Parameters
    ----------
    fit
        1: the cut joints' elements follow those of the tree; 0: they change as d.dq says.
    inert
        0: without the forces of inertia, and without what is said of accelerations.
    """
    links = t.parent.shape[0]
    sigma, spin, one, two = d.small[0:6], d.small[6:12], d.small[12:18], d.small[18:24]
    three, four = d.small[24:30], d.small[30:36]
    warm = pushed = False
    for k in range(d.ddrive.shape[0]):
        pushed = pushed or d.ddrive[k] != 0.0
    for k in range(t.node.shape[0]):
        d.warmth[k] = d.node[k] * d.ds[k]
        d.heat[k] = 0.0
        warm = warm or d.warmth[k] != 0.0
    for i in range(links):
        parent, at = t.parent[i], t.r_at[i]
        here = False
        for j in range(t.dim[i]):
            here = here or d.dq[at + j] != 0.0 or d.dr[at + j] != 0.0 or d.da[at + j] != 0.0
        d.stirred[i] = here or (parent >= 0 and d.stirred[parent])
        for k in range(6):
            d.dtotal[i, k] = -d.dwrench[i, k]
            d.eta[i, k] = d.dtwist[i, k] = d.dspeed[i, k] = 0.0
        if not d.stirred[i]:
            continue
        if parent >= 0 and d.stirred[parent]:
            into(d.turn[i], d.place[i], d.eta[parent], d.eta[i])
            into(d.turn[i], d.place[i], d.dtwist[parent], d.dtwist[i])
            into(d.turn[i], d.place[i], d.dspeed[parent], d.dspeed[i])
        if here:
            for k in range(6):
                sigma[k] = spin[k] = 0.0
                for j in range(t.dim[i]):
                    sigma[k] += w.motion[i, j, k] * d.dq[at + j]
                    spin[k] += w.motion[i, j, k] * d.dr[at + j]
                    d.dspeed[i, k] += w.motion[i, j, k] * d.da[at + j]
                d.eta[i, k] += sigma[k]
            bracket(d.moving[i], sigma, one)
            bracket(d.lifted[i], sigma, two)
            for k in range(6):
                d.dtwist[i, k] += spin[k] + one[k]
                d.dspeed[i, k] += two[k]
            if t.forward[i] == 0:  # the joint's own axes turn with it
                bracket(d.along[i], sigma, one)
                for k in range(6):
                    spin[k] += one[k]
            bracket(w.twist[i], spin, one)
            for k in range(6):
                d.dspeed[i, k] += one[k]
        for k in range(6):
            for j in range(6):
                d.dtotal[i, k] += d.weight[i, k, j] * d.eta[i, j]
        if inert == 0:
            continue
        bracket(d.dtwist[i], d.along[i], one)
        for k in range(6):
            d.dspeed[i, k] += one[k]
        for k in range(6):
            two[k] = 0.0
            for j in range(6):
                two[k] += t.inertia[i, k, j] * d.dtwist[i, j]
                d.dtotal[i, k] += t.inertia[i, k, j] * d.dspeed[i, j]
        cross_momentum(d.dtwist[i], d.momentum[i], one)
        cross_momentum(w.twist[i], two, three)
        for k in range(6):
            d.dtotal[i, k] -= one[k] + three[k]
    m = 0
    for j in range(t.driven.shape[0]):
        if t.driven[j] == 1:
            d.row[m] = d.da[j]
            m += 1
    n = t.driven.shape[0]
    for i in range(links, t.kind.shape[0]):
        first = t.first[i] >= 0 and d.stirred[t.first[i]]
        second = t.second[i] >= 0 and d.stirred[t.second[i]]
        own = False
        if t.kind[i] == CUT:
            for j in range(t.dim[i]):
                own = own or d.dq[t.r_at[i] + j] != 0.0
                d.cut[t.r_at[i] - n + j] = 0.0
            for a in range(t.rows[i]):
                d.row[m + a] = 0.0
        if not (first or second or own or warm or pushed):
            m += t.rows[i]
            continue
        if first or second:
            relative(t, d, i, d.eta, sigma)
            relative(t, d, i, d.dtwist, one)
            bracket(d.held[i], sigma, two)
            for k in range(6):
                spin[k] = one[k] - two[k]
        else:
            for k in range(6):
                sigma[k] = spin[k] = two[k] = 0.0
        change_of_edge(t, d, i, sigma, spin, fit, one)
        if t.kind[i] == CUT:
            for j in range(t.dim[i]):
                d.cut[t.r_at[i] - n + j] = d.drate[j]
            for k in range(6):
                four[k] = 0.0
            if first or second:
                if first:
                    into(d.end_turn[i, 0], d.end_place[i, 0], d.dtwist[t.first[i]], three)
                    for k in range(6):
                        two[k] += three[k]
                relative(t, d, i, d.dspeed, four)
                bracket(d.held_rate[i], sigma, three)
                for k in range(6):
                    four[k] -= three[k]
                bracket(spin, d.held[i], three)
                for k in range(6):
                    four[k] += three[k]
                bracket(d.slip[i], two, three)
                for k in range(6):
                    four[k] += three[k]
            for a in range(t.rows[i]):
                entry = 0.0
                for k in range(6):
                    entry += t.normal[i, a, k] * four[k]
                d.row[m + a] = entry
            m += t.rows[i]
        for k in range(6):
            three[k] = d.wrench[i, k] + d.closing[i, k]
        cross_momentum(sigma, three, two)
        for k in range(6):
            two[k] = one[k] - two[k]
        out_of_edge(t, d, i, one, two, d.dtotal)
    for i in range(links - 1, -1, -1):
        at = t.r_at[i]
        for k in range(6):
            sigma[k] = 0.0
            for j in range(t.dim[i]):
                sigma[k] += w.motion[i, j, k] * d.dq[at + j]
        cross_momentum(sigma, d.total[i], one)
        for k in range(6):
            one[k] = d.dtotal[i, k] - one[k]
        for j in range(t.dim[i]):
            d.dpull[j] = 0.0
        if d.stirred[i] or warm or pushed:
            change_of_edge(t, d, i, sigma, spin, fit, two)
        for j in range(t.dim[i]):
            entry = -d.dpull[j]
            for k in range(6):
                entry += w.motion[i, j, k] * (d.dtotal[i, k] if t.forward[i] == 1 else one[k])
            d.force[at + j] = entry
        if t.parent[i] >= 0:
            out_of(d.turn[i], d.place[i], one, d.dtotal[t.parent[i]], 1.0)
    if warm:
        for k in range(t.conduction.shape[0]):
            a, b = t.conduction[k, 1], t.conduction[k, 2]
            d.heat[a] -= d.flow[k, 0, 0] * d.warmth[a] + d.flow[k, 0, 1] * d.warmth[b]
            d.heat[b] -= d.flow[k, 1, 0] * d.warmth[a] + d.flow[k, 1, 1] * d.warmth[b]


@kernel
def change_of_edge(t, d, i, sigma, spin, fit, wide):
    """The change of an edge's own force, d.dpull (and as a wrench, wide, where the edge is not of the tree), and of the
    entropy that its friction makes, from the changes of its relative pose and of its relative twist."""
    dim, at, links = t.dim[i], t.r_at[i], t.parent.shape[0]
    for j in range(dim):
        d.dx[j] = d.dq[at + j] if t.kind[i] != SPRING and (fit == 0 or i < links) else 0.0
        d.drate[j] = d.dr[at + j] if i < links else 0.0
        if i >= links:
            for k in range(6):
                d.drate[j] += t.left[i, j, k] * spin[k]
                if fit == 1 or t.kind[i] == SPRING:
                    d.dx[j] += t.left[i, j, k] * sigma[k]
    for j in range(dim):
        entry = d.ddrive[at + j] if t.kind[i] != SPRING else 0.0
        for k in range(dim):
            entry -= d.stiffness[i, j, k] * d.dx[k] + d.damping[i, j, k] * d.drate[k]
        d.dpull[j] = entry
    if t.friction[i] >= 0:
        sink = t.heat[i]
        entry = d.made_by_warmth[i] * d.warmth[sink]
        for j in range(dim):
            d.dpull[j] -= d.softening[i, j] * d.warmth[sink]
            entry += d.made_by_place[i, j] * d.dx[j] + d.made_by_rate[i, j] * d.drate[j]
        d.heat[sink] -= entry
    if i >= links:
        for k in range(6):
            wide[k] = 0.0
            for j in range(dim):
                wide[k] += t.left[i, j, k] * d.dpull[j]


@kernel
def still(d):
    """No changes."""
    for values in (d.dq, d.dr, d.da, d.ds):
        for k in range(values.shape[0]):
            values[k] = 0.0


@kernel
def by_push(t, w, d, m, rank, out):
    """The change of ṙ by d.ddrive and d.dwrench."""
    still(d)
    tangent(t, w, d, 0, 1)
    for i in range(out.shape[0]):
        out[i] = -d.force[i]
    solve_constrained(w, m, rank, out, d.row, d.row, d.change)
