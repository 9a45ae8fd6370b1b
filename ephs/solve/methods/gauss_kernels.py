"""The compiled time loop of the natural discretisation of order 4: Gauss stages, corrected component by component.

At the stages every component has its continuous relation. Over the step the stages' increments of each state make one
increment V; the kernels of order 2, evaluated at V, say by how much a storage's energy changes and whether a joint
closes. What the stages miss of that is of high order and is put in as one term a component:

    e_i = dH(x_i) + α f_i                 with Σ b_i ⟨e_i|h f_i⟩ = H(x¹) − H(x⁰)
    0 = C_i e_i + δ,  f_i = C_i*λ_i + e_i ⟨δ|Σ b_j λ_j⟩/Σ b_j ⟨e_j|e_j⟩     with δ = F − Σ b_j C_j e_j

so that storages store what flows into them, joints make no power and stay closed, and dissipation, which is left as it
is, takes place at the stages with positive weights.

There are three stages: with an even number what momenta have across the constraints would add up from step to step and
the order fall to 2 (Hairer, Lubich and Roche, *Lecture Notes in Mathematics* 1409, table 2.3: with three it is 4).
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from typing import NamedTuple

from ephs.semantics.bundle import Array
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import SE3, SO3, VECTOR, SO3xR3
from ephs.semantics.spaces.se3_kernels import dexp_left_inv, retract
from ephs.solve.methods.lu_kernels import copy, factorise, solve
from ephs.solve.methods.natural_kernels import account, evaluate, measure
from ephs.solve.methods.restraint_kernels import restrain, tighten
from ephs.solve.sparse import Index

kernel = jit.lean_kernel

_FIXED = 30


class Scheme(NamedTuple):
    """Coefficients of the collocation method on Gauss nodes."""

    a: Array  # (stages, stages)
    b: Array


class Groups(NamedTuple):
    """Efforts that are velocities on a group, of components whose relation holds on the group over a step."""

    component: Index  # (groups,)
    code: Index
    effort: Index  # (groups,): first effort
    dim: Index
    metric: Array  # (groups, 6, 6): in which the component measures it; the identity but where its frame is another
    node: Index  # (nodes, 3): storages of entropy alone: component, rate, effort among the unknowns
    slope: Index  # (nodes,): place of ∂θ/∂s in a stage's entries
    entry: Index  # (nodes, stages, stages): its places in the system of all stages


class Stages(NamedTuple):
    """Scratch memory of the stages, and of the step as a whole."""

    x: Array  # (stages, states)
    v: Array  # (stages, rates): increments from the step's start to the stages
    turn: Array  # (stages, 8): velocities in the coordinates of the increments
    outer: Array  # (stages, 8): increments of one group
    whole: Array  # (rates,): increment over the step
    mean: Array  # (unknowns,): whole/h and the efforts' exponents/h
    gradient: Array  # (rates,): discrete gradients over the step
    share: Array  # (nodes, stages): factors of the discrete gradients by the rates at the stages
    factor: Array  # (nodes,): the factors α
    end: Array  # (nodes,): temperatures at the end
    gap: Array  # (unknowns,): what the relations over the step miss, in the constraints' rows
    energy: Array  # (components,)
    residual: Array  # (stages, unknowns)
    scale: Array  # (stages, unknowns)
    data: Array  # (stages, entries): ∂g/∂z
    slope: Array  # (stages, entries): ∂g/∂x in the rates' columns
    matrix: Array  # entries of the system of all stages
    change: Array  # (stages · unknowns,)
    dense: Array
    factors: Array
    pivot: Array
    small: Array  # (200,)


@kernel
def exponents(code, h, p, w, v, whole, turn, small):
    """Increments to the stages, v_i = h Σ a_ij D(v_j) w_j with D = dexp⁻¹, and over the step, from velocities w."""
    stages, d = w.shape
    for i in range(stages):
        for j in range(d):
            turn[i, j] = w[i, j]
    for round in range(_FIXED if code != VECTOR else 1):
        change = size = 0.0
        for i in range(stages):
            for j in range(d):
                entry = 0.0
                for m in range(stages):
                    entry += h * p.a[i, m] * turn[m, j]
                change = max(change, abs(entry - v[i, j]))
                size = max(size, abs(entry))
                v[i, j] = entry
        if code == VECTOR or (round and change <= 2e-16 * size):
            break
        matrix = small[0 : d * d].reshape(d, d)
        for i in range(stages):
            dexp_left_inv(code, v[i, :d], matrix)
            for j in range(d):
                turn[i, j] = 0.0
                for m in range(d):
                    turn[i, j] += matrix[j, m] * w[i, m]
    for j in range(d):
        whole[j] = 0.0
        for i in range(stages):
            whole[j] += h * p.b[i] * turn[i, j]


@kernel
def linearise(t, g, p, dropped, x, z, scal, still, unit, inputs, m, s, fresh):
    """Residuals of the stages with their corrections, and where fresh their matrices; (status, component).

    z (stages, unknowns).
    """
    n, n_rate, n_effort, stages = t.counts[3], t.counts[0], t.counts[1], p.b.shape[0]
    h = scal[0]
    for k in range(t.states.shape[0]):
        code, at, size, rate, dim = t.states[k]
        last = rate + dim
        exponents(code, h, p, z[:, rate:last], s.v[:, rate:last], s.whole[rate:last], s.turn, s.small)
        for i in range(stages):
            retract(code, x[at : at + size], s.v[i, rate:last], s.x[i, at : at + size])
    for j in range(n):
        if j < n_rate:
            s.mean[j] = s.whole[j] / h
        else:
            s.mean[j] = 0.0
            for i in range(stages):
                s.mean[j] += p.b[i] * z[i, j]
    one = s.small[60:68]
    for k in range(g.code.shape[0]):
        if g.code[k] != VECTOR:
            first, d = n_rate + g.effort[k], g.dim[k]
            exponents(g.code[k], h, p, z[:, first : first + d], s.outer[:, :d], one[:d], s.turn, s.small)
            for j in range(d):
                s.mean[first + j] = one[j] / h
    # the step as a whole: discrete gradients, and whether joints close
    status, component = evaluate(t, x, s.mean, scal, inputs[0], m)
    if status != 0:
        return status, component
    for i in range(t.kind.shape[0]):
        s.energy[i] = m.energy[i]
        if t.kind[i] == 0:
            for j in range(t.dims[i, 0]):
                rate = t.read_w[t.read_w_at[i] + j]
                s.gradient[rate] = s.mean[n_rate + t.e_index[t.e_at[i] + j]] - m.residual[rate]
    for k in range(g.node.shape[0]):
        rate = g.node[k, 1]
        s.end[k] = s.gradient[rate] - s.whole[rate] / h * m.data[g.slope[k]]
    for j in range(n_rate + n_effort, n):
        s.gap[j] = m.residual[j]
    for i in range(stages):
        status, component = evaluate(t, s.x[i], z[i], still, inputs[i], m)
        if status != 0:
            return status, component
        copy(m.residual, s.residual[i])
        copy(m.scale, s.scale[i])
        if fresh:
            copy(m.data, s.data[i])
            for j in range(n):
                s.mean[j] = 0.0 if j < n_rate else z[i, j]
            status, component = evaluate(t, s.x[i], s.mean, unit, inputs[i], m)
            if status != 0:
                return status, component
            for j in range(s.data.shape[1]):
                s.slope[i, j] = 2.0 / unit[0] * (m.data[j] - s.data[i, j])
        _rest(t, h, s.slope[i], s.scale[i])
    if fresh:
        _bend(g, p, h, z, s)
    _correct(t, g, p, dropped, h, z, s)
    return 0, 0


@kernel
def _rest(t, h, slope, scale):
    """At rest no effort has a size of its own: what the flows change it by in a step is one."""
    n_rate = t.counts[0]
    for c in range(t.kind.shape[0]):
        if t.kind[c] == 0:
            n, e_at, w_at, j_at = t.dims[c, 0], t.e_at[c], t.read_w_at[c], t.jacobian_at[c]
            for j in range(n):
                row = t.read_w[w_at + j]
                for q in range(n):
                    place = t.jacobian[j_at + j * n + q]
                    if place >= 0:
                        scale[row] = max(scale[row], abs(h) * abs(slope[place]) * scale[n_rate + t.e_index[e_at + q]])


@kernel
def _bend(g, p, h, z, s):
    """Derivatives of the factors α of storages of entropy by the rates: their energies bend too much to leave them out.

    A small capacity warms by orders of magnitude in a step; of other storages α is of the quadrature's order.
    """
    stages = p.b.shape[0]
    for k in range(g.node.shape[0]):
        rate, effort = g.node[k, 1], g.node[k, 2]
        defect, square = s.gradient[rate] * s.whole[rate] / h, 0.0
        for i in range(stages):
            defect -= p.b[i] * (z[i, effort] - s.residual[i, rate]) * z[i, rate]
            square += p.b[i] * z[i, rate] * z[i, rate]
        s.factor[k] = 0.0
        for j in range(stages):
            s.share[k, j] = 0.0
        if square > 1e-280:
            s.factor[k] = defect / square
            for j in range(stages):
                by = p.b[j] * (s.end[k] - z[j, effort] + s.residual[j, rate])
                for i in range(stages):
                    by += h * p.b[i] * p.a[i, j] * z[i, rate] * s.slope[i, g.slope[k]]
                s.share[k, j] = (by - 2.0 * s.factor[k] * p.b[j] * z[j, rate]) / square


@kernel
def _correct(t, g, p, dropped, h, z, s):
    """Put the one-term corrections into the residuals of the stages.

    Stages are off the positions of joints by the order of the quadrature. An equation that follows from the others
    only where loops are closed (Bricard's linkage) is missed there by as much; over the step it holds, and that is its
    residual.
    """
    n_rate, stages = t.counts[0], p.b.shape[0]
    lam_at = n_rate + t.counts[1]
    for c in range(t.kind.shape[0]):
        if t.kind[c] != 0:
            continue
        defect = square = 0.0
        for j in range(t.dims[c, 0]):
            rate, effort = t.read_w[t.read_w_at[c] + j], n_rate + t.e_index[t.e_at[c] + j]
            defect += s.gradient[rate] * s.whole[rate] / h
            for i in range(stages):
                defect -= p.b[i] * (z[i, effort] - s.residual[i, rate]) * z[i, rate]
                square += p.b[i] * z[i, rate] * z[i, rate]
        if square > 1e-280:
            for j in range(t.dims[c, 0]):
                rate = t.read_w[t.read_w_at[c] + j]
                for i in range(stages):
                    s.residual[i, rate] -= defect / square * z[i, rate]
    for k in range(g.component.shape[0]):
        c = g.component[k]
        if k and g.component[k - 1] == c:
            continue
        at = lam_at + t.multiplier_at[c]
        square = power = 0.0
        last = k
        while last < g.component.shape[0] and g.component[last] == c:
            first = n_rate + g.effort[last]
            for j in range(g.dim[last]):
                for q in range(g.dim[last]):
                    if g.metric[last, j, q] != 0.0:
                        for i in range(stages):
                            square += p.b[i] * z[i, first + j] * g.metric[last, j, q] * z[i, first + q]
            last += 1
        for j in range(t.dims[c, 1]):
            delta, force = s.gap[at + j], 0.0
            for i in range(stages):
                delta -= p.b[i] * s.residual[i, at + j]
                force += p.b[i] * z[i, at + j]
            power += delta * force
            for i in range(stages):
                s.residual[i, at + j] = s.gap[at + j] if dropped[at + j] == 1 else s.residual[i, at + j] + delta
        if square > 1e-280:
            for group in range(k, last):
                first = n_rate + g.effort[group]
                for j in range(g.dim[group]):
                    for q in range(g.dim[group]):
                        share = power / square * g.metric[group, j, q]
                        if share != 0.0:
                            for i in range(stages):
                                s.residual[i, first + j] += share * z[i, first + q]


@kernel
def gauss_newton(t, g, p, o, where, x, z, scal, still, unit, inputs, m, s):
    """Solve one step in place of z, run to stagnation; returns (status, component, iterations)."""
    n, n_rate, stages = t.counts[3], t.counts[0], p.b.shape[0]
    h = scal[0]
    before, fresh, part = 1e300, True, 1.0
    right, change = s.residual.reshape(stages * n), s.change
    for iteration in range(60):
        status, component = linearise(t, g, p, o.dropped, x, z, scal, still, unit, inputs, m, s, fresh)
        if status != 0:
            return status, component, iteration
        ratio = defect = 0.0
        for i in range(stages):
            copy(s.residual[i], m.residual)
            copy(s.scale[i], m.scale)
            found = measure(t, z[i], o.dropped[:n], m)
            if found != found:
                return 1, 0, iteration
            ratio, defect = max(ratio, found), max(defect, m.defect[0])
            copy(m.residual, s.residual[i])
        if ratio <= 4e-16 or (ratio < 1e-11 and ratio > 0.7 * before):
            return (3 if defect > o.tolerance[0] else 0), 0, iteration
        if iteration > 25 and ratio > 0.9 * before and part == 1.0:
            return 1, 0, iteration
        if fresh:
            for k in range(where.shape[0]):
                i, j, source = where[k, 0], where[k, 1], where[k, 2]
                if source < 0:
                    s.matrix[k] = 1.0 if o.dropped[-source - 1] == 1 else 0.0
                    continue
                entry = s.data[i, source] if i == j else 0.0
                if t.column[source] < n_rate:
                    entry += h * p.a[i, j] * s.slope[i, source]
                s.matrix[k] = entry
            for k in range(g.node.shape[0]):
                for i in range(stages):
                    for j in range(stages):
                        s.matrix[g.entry[k, i, j]] -= z[i, g.node[k, 1]] * s.share[k, j]
                    s.matrix[g.entry[k, i, i]] -= s.factor[k]
            if not factorise(o, s.matrix, s.factors, s.dense, s.pivot):
                return 2, 0, iteration
        solve(o, s.factors, right, change, s.dense)
        part = restrain(t, z, change.reshape(stages, n))
        for i in range(stages):
            for j in range(n):
                z[i, j] -= change[i * n + j]
        # a matrix serves as long as it makes the residual fall fast
        fresh = iteration == 0 or part < 1.0 or ratio > 0.1 * before
        before = ratio
    return 1, 0, 60


@kernel
def gauss_advance(
    t, g, p, o, where, x, z, previous, scal, still, unit, parts, inputs, ahead, m, s, sums, steps, states, energies,
    ledgers
):  # fmt: skip
    """Take ``steps`` steps; arguments and results as of `natural_kernels.advance`, z and previous of all stages.

    ahead (stages, stages) continues a polynomial through the stages into the next step; parts is scal for h b_i.
    """
    n, stages = t.counts[3], p.b.shape[0]
    total = 0
    for step in range(steps):
        for j in range(n):
            for i in range(stages):
                previous[i, j] = z[i, j]
            for i in range(stages):
                z[i, j] = 0.0
                for k in range(stages):
                    z[i, j] += ahead[i, k] * previous[k, j]
        status, component, iterations = gauss_newton(t, g, p, o, where, x, z, scal, still, unit, inputs, m, s)
        total += iterations
        if status != 0:  # once more from a guess that cannot be far off: what was last, everywhere
            for i in range(stages):
                copy(previous[stages - 1], z[i])
            status, component, iterations = gauss_newton(t, g, p, o, where, x, z, scal, still, unit, inputs, m, s)
            total += iterations
        if status != 0:
            if status == 3:  # rank was decided at the start of the step, and is another on its way
                for i in range(stages):
                    copy(z[i], previous[i])
            else:
                for i in range(stages):
                    copy(previous[i], z[i])
            return status, component, step, total
        least = 0.0
        for i in range(stages):
            evaluate(t, s.x[i], z[i], still, inputs[i], m)
            least += account(t, z[i], parts[i], inputs[i], m, sums)
        for k in range(t.states.shape[0]):
            code, at, size, rate, dim = t.states[k]
            retract(code, x[at : at + size], s.whole[rate : rate + dim], x[at : at + size])
            if code in (SO3, SE3, SO3xR3):
                tighten(x[at : at + 4])
        copy(x, states[step])
        for i in range(t.kind.shape[0]):
            energies[step, i] = s.energy[i] if t.kind[i] == 0 else m.energy[i]
        for i in range(4):
            ledgers[step, i] = sums[i]
        ledgers[step, 4] = least
    return 0, 0, steps, total
