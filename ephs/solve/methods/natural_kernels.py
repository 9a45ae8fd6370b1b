"""The compiled time loop of the natural discretisation: evaluate, Newton, advance."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from typing import NamedTuple

from ephs.semantics.bundle import Array
from ephs.semantics.calling import call_kernel
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import SE3, SO3, SO3xR3
from ephs.semantics.spaces.se3_kernels import retract
from ephs.solve.methods.lu_kernels import copy, factorise, solve
from ephs.solve.methods.restraint_kernels import restrain, tighten
from ephs.solve.sparse import Index

kernel = jit.lean_kernel

DONE, DIVERGED, PIVOT, INCONSISTENT, COMPONENT = 0, 1, 2, 3, 10
"""What `advance` returns: COMPONENT + what a component's kernel returned (see `ephs.semantics.kernel_table`)."""

STORING, REVERSIBLE, IRREVERSIBLE = 0, 1, 2
SPREAD = 1e-3
"""A block's scale is at least this fraction of the largest of its kind: e = 0 alone has no scale of its own."""

TAKES_PART = 1e-3
"""The least coefficient, relative to the largest, with which an effort takes part in a constraint; less is rounding."""


class Tables(NamedTuple):
    """The model as arrays. Unknowns: rates, efforts, multipliers, outer flows; rows in the same order."""

    counts: Index  # rates, efforts, multipliers, unknowns
    kind: Index  # of each component
    address: Index
    dims: Index  # (components, 4): n, k, dim of read states, size of read states
    parameters: Array
    parameter_at: Index
    e_index: Index  # effort of each local effort; same offsets for flows
    e_at: Index
    multiplier_at: Index
    read_x: Index  # state entry of each local x⁰
    read_x_at: Index
    read_w: Index  # rate of each local v
    read_w_at: Index
    jacobian: Index  # place in data of each local Jacobian entry, −1: structurally zero
    jacobian_at: Index
    states: Index  # (states, 5): code, at, size, rate, dim
    intensive: Array  # (efforts,): what turns an exergetic effort into the energy effort
    entropy: Array  # (efforts,): 1 on entropy
    row: Index  # of each entry of data
    column: Index
    template: Array  # constant part of data
    block: Index  # (rows,): residuals are measured block by block
    group: Index  # (blocks,): blocks of one kind, whose scales do not differ beyond reason
    outer: Index  # (outer ports, 4): effort at, dim, 1 if the effort is prescribed, flow unknown at
    input_at: Index


class Order(NamedTuple):
    """`sparse.Elimination` as arrays, and which constraint rows are left out."""

    rows: Index
    columns: Index
    start: Index
    entry: Index
    diagonal: Index
    place: Index
    dropped: Index  # (rows,) 1 where the equation is replaced by "this multiplier is zero"
    floor: Array  # (rows,): the least |pivot|/|largest of its row| that this order accepts
    tolerance: Array  # [0]: the relative residual that dropped equations may keep
    lu: Index  # addresses of factorise and solve, as `ephs.solve.sparse.lu_addresses` gives them


class Memory(NamedTuple):
    """All scratch memory of the loop, allocated once."""

    e: Array
    lam: Array
    v: Array
    x: Array
    f: Array
    c: Array
    jac: Array
    work: Array
    data: Array
    factors: Array
    residual: Array
    scale: Array
    block: Array
    group: Array
    step: Array
    dense: Array
    flows: Array
    energy: Array
    defect: Array  # [0]: largest relative residual of a dropped equation
    pivot: Array  # (rows,): |pivot|/|largest of its row| of the last factorisation


@kernel
def reach(t, m):
    """The flows that there could be at each effort, into m.dense, were the efforts as large as what they are known by.

    The rate of a joint at rest is a difference of its bodies' twists, and so is known to the rounding of those.
    """
    n_rate, n_effort = t.counts[0], t.counts[1]
    flow, whole, largest = m.dense, m.step, m.pivot
    for i in range(n_effort):
        flow[i] = m.scale[n_rate + i]
        whole[i] = 0.0
    for i in range(m.block.shape[0]):
        m.block[i] = 0.0
    for i in range(largest.shape[0]):
        largest[i] = 0.0
        m.block[t.block[i]] = max(m.block[t.block[i]], m.scale[i])
    for k in range(t.row.shape[0]):
        if 0 <= t.column[k] - n_rate < n_effort:
            largest[t.row[k]] = max(largest[t.row[k]], abs(m.data[k]))
    for k in range(t.row.shape[0]):
        row, effort, entry = t.row[k], t.column[k] - n_rate, abs(m.data[k])
        if row >= n_rate + n_effort and 0 <= effort < n_effort and entry > TAKES_PART * largest[row]:
            whole[effort] = max(whole[effort], m.block[t.block[row]] / entry)
    for k in range(t.row.shape[0]):
        at, effort = t.row[k] - n_rate, t.column[k] - n_rate
        if 0 <= at < n_effort and 0 <= effort < n_effort:
            flow[at] = max(flow[at], abs(m.data[k]) * whole[effort])


@kernel
def weigh(t, m):
    """Measure the effort of each storage, too, by the balances that it takes part in.

    One that is zero, of a joint without stiffness, is known to the rounding of those, which is all its own size.
    """
    n_rate, n_effort, least = t.counts[0], t.counts[1], m.dense
    for i in range(n_effort):
        least[i] = 1e300
    for k in range(t.row.shape[0]):
        row, effort, entry = t.row[k], t.column[k] - n_rate, abs(m.data[k])
        if row >= n_rate and 0 <= effort < n_effort and entry > 0.0:
            least[effort] = min(least[effort], m.scale[row] / entry)
    for i in range(t.kind.shape[0]):
        if t.kind[i] == 0:
            for j in range(t.dims[i, 0]):
                row, effort = t.read_w[t.read_w_at[i] + j], t.e_index[t.e_at[i] + j]
                if least[effort] < 1e300:
                    m.scale[row] = max(m.scale[row], least[effort])


@kernel
def evaluate(t, x, z, scal, inputs, m):
    """Residual, its scale, and the matrix at z; returns (status, component)."""
    n_rate, n_effort = t.counts[0], t.counts[1]
    lam_at = n_rate + n_effort
    h = scal[0]
    copy(t.template, m.data)
    m.residual[:] = 0.0
    m.scale[:] = 0.0
    for i in range(t.kind.shape[0]):
        n, k, nv, nx = t.dims[i, 0], t.dims[i, 1], t.dims[i, 2], t.dims[i, 3]
        e_at, w_at, x_at, j_at = t.e_at[i], t.read_w_at[i], t.read_x_at[i], t.jacobian_at[i]
        first = lam_at + t.multiplier_at[i]
        for j in range(n):
            m.e[j] = z[n_rate + t.e_index[e_at + j]]
        for j in range(k):
            m.lam[j] = z[first + j]
        for j in range(nv):
            m.v[j] = h * z[t.read_w[w_at + j]]
        for j in range(nx):
            m.x[j] = x[t.read_x[x_at + j]]
        status = call_kernel(  # pyright: ignore[reportCallIssue] - the typing context is numba's
            t.address[i],
            t.dims[i].ctypes.data,
            scal.ctypes.data,
            t.parameters[t.parameter_at[i] :].ctypes.data,
            m.x.ctypes.data,
            m.v.ctypes.data,
            m.e.ctypes.data,
            m.lam.ctypes.data,
            m.f.ctypes.data,
            m.c.ctypes.data,
            m.jac.ctypes.data,
            m.work.ctypes.data,
        )
        if status != 0:
            return 10 + status, i
        if t.kind[i] == 0:
            m.energy[i] = m.c[0]
            for j in range(n):
                effort, rate = t.e_index[e_at + j], t.read_w[w_at + j]
                m.residual[rate] = z[n_rate + effort] - m.e[j]
                m.scale[rate] = abs(z[n_rate + effort]) + abs(m.e[j])
                m.residual[n_rate + effort] += z[rate]
                m.scale[n_rate + effort] += abs(z[rate])
                for q in range(n):
                    place = t.jacobian[j_at + j * n + q]
                    if place >= 0:
                        m.data[place] -= h * m.f[j * n + q]
            continue
        width = n + k + nv
        for j in range(n + k):
            for q in range(width):
                place = t.jacobian[j_at + j * width + q]
                if place >= 0:
                    entry = m.jac[j * width + q]
                    m.data[place] += entry if q < n + k else h * entry
        force = 0.0
        for j in range(k):
            force = max(force, abs(m.lam[j]))
        for j in range(n):
            row = n_rate + t.e_index[e_at + j]
            m.residual[row] += m.f[j]
            # a balance of one term, Bᵀλ = 0, would be measured by itself: the largest multiplier counts
            m.scale[row] += abs(m.f[j])
            for q in range(k):
                m.scale[row] = max(m.scale[row], abs(m.jac[j * width + n + q]) * force)
            if t.kind[i] == 2:
                # near equilibrium a flow is a difference of large terms: temperatures, not their differences
                for q in range(n):
                    effort = t.e_index[e_at + q]
                    whole = abs(z[n_rate + effort] + t.intensive[effort])
                    m.scale[row] = max(m.scale[row], abs(m.jac[j * width + q]) * whole)
            m.flows[e_at + j] = m.f[j]
        for j in range(k):
            m.residual[first + j] += m.c[j]
            for q in range(n):
                m.scale[first + j] += abs(m.jac[(n + j) * width + q] * m.e[q])
    for i in range(t.outer.shape[0]):
        at, dim, prescribed, unknown = t.outer[i, 0], t.outer[i, 1], t.outer[i, 2], t.outer[i, 3]
        for j in range(dim):
            given = inputs[t.input_at[i] + j]
            row = n_rate + at + j
            flow = given
            if prescribed == 1:
                flow = z[unknown + j]
                m.residual[unknown + j] = z[row] - given
                m.scale[unknown + j] = abs(z[row]) + abs(given)
            m.residual[row] -= flow
            m.scale[row] += abs(flow)
    reach(t, m)
    # at rest no effort has a size of its own: what the flows change it by in a step is one
    for i in range(t.kind.shape[0]):
        if t.kind[i] == 2:
            # nor has entropy production, the square of a rate which is all rounding: what the forces there could make
            n, e_at, power = t.dims[i, 0], t.e_at[i], 0.0
            for j in range(n):
                effort = t.e_index[e_at + j]
                if t.entropy[effort] == 0.0:
                    power += m.dense[effort] * abs(z[n_rate + effort])
            for j in range(n):
                effort = t.e_index[e_at + j]
                if t.entropy[effort] == 1.0 and power > 0.0:
                    row = n_rate + effort
                    m.scale[row] = max(m.scale[row], power / abs(z[row] + t.intensive[effort]))
        if t.kind[i] == 0:
            n, e_at, w_at, j_at = t.dims[i, 0], t.e_at[i], t.read_w_at[i], t.jacobian_at[i]
            for j in range(n):
                row = t.read_w[w_at + j]
                for q in range(n):
                    place = t.jacobian[j_at + j * n + q]
                    if place >= 0:
                        flow = m.scale[n_rate + t.e_index[e_at + q]]
                        m.scale[row] = max(m.scale[row], abs(m.data[place]) * flow)
    weigh(t, m)
    return 0, 0


@kernel
def measure(t, z, dropped, m):
    """Largest residual, each relative to the scale of its block; a dropped row becomes "this multiplier is zero"."""
    m.block[:] = 0.0
    m.group[:] = 0.0
    worst = defect = 0.0
    for i in range(m.residual.shape[0]):
        b = t.block[i]
        m.block[b] = max(m.block[b], m.scale[i])
        m.group[t.group[b]] = max(m.group[t.group[b]], m.scale[i])
    for i in range(m.residual.shape[0]):
        b = t.block[i]
        scale = max(m.block[b], SPREAD * m.group[t.group[b]])
        ratio = abs(m.residual[i]) / scale if scale > 1e-200 else 0.0
        if ratio != ratio:
            return ratio
        if dropped[i] == 1:
            m.residual[i] = z[i]
            defect = max(defect, ratio)
        else:
            worst = max(worst, ratio)
    m.defect[0] = defect
    return worst


@kernel
def newton(t, o, x, z, scal, inputs, m):
    """Solve one step in place of z, run to stagnation; returns (status, component, iterations).

    A matrix whose pivots have shrunk below the order's floor asks for another order.
    """
    before, part = 1e300, 1.0
    for iteration in range(80):
        status, component = evaluate(t, x, z, scal, inputs, m)
        if status != 0:
            return status, component, iteration
        ratio = measure(t, z, o.dropped, m)
        if ratio != ratio:
            return 1, 0, iteration
        if ratio <= 4e-16 or (ratio < 1e-11 and ratio > 0.7 * before):
            return (3 if m.defect[0] > o.tolerance[0] else 0), 0, iteration
        if iteration > 12 and ratio > 0.9 * before and part == 1.0:
            return 1, 0, iteration
        before = ratio
        for i in range(o.dropped.shape[0]):
            if o.dropped[i] == 1:
                m.data[m.data.shape[0] - o.dropped.shape[0] + i] = 1.0
        if not factorise(o, m.data, m.factors, m.dense, m.pivot):
            return 2, 0, iteration
        solve(o, m.factors, m.residual, m.step, m.dense)
        part = restrain(t, z.reshape(1, z.shape[0]), m.step.reshape(1, z.shape[0]))
        for i in range(z.shape[0]):
            z[i] -= m.step[i]
    return 1, 0, 80


@kernel
def account(t, z, scal, inputs, m, sums):
    """Ledgers of the step just solved: adds to sums = heat, supplied energy, supplied exergy, entropy made, and the
    entropy made by each component; returns the least entropy production of a component in this step."""
    n_rate = t.counts[0]
    h = scal[0]
    least = 1e300
    for i in range(t.kind.shape[0]):
        if t.kind[i] == 2:
            heat = made = 0.0
            for j in range(t.dims[i, 0]):
                effort, flow = t.e_index[t.e_at[i] + j], m.flows[t.e_at[i] + j]
                if t.entropy[effort] == 1.0:
                    made -= flow
                else:
                    heat += (z[n_rate + effort] + t.intensive[effort]) * flow
            sums[0] += h * heat
            sums[3] += h * made
            sums[4 + i] += h * made
            m.energy[i] = sums[4 + i]
            least = min(least, h * made)
    for i in range(t.outer.shape[0]):
        at, dim, prescribed, unknown = t.outer[i, 0], t.outer[i, 1], t.outer[i, 2], t.outer[i, 3]
        for j in range(dim):
            flow = z[unknown + j] if prescribed == 1 else inputs[t.input_at[i] + j]
            effort = z[n_rate + at + j]
            sums[1] += h * (effort + t.intensive[at + j]) * flow
            sums[2] += h * effort * flow
    return 0.0 if least == 1e300 else least


@kernel
def advance(t, o, x, z, previous, scal, inputs, m, sums, steps, states, energies, ledgers):
    """Take ``steps`` steps of h = scal[0]; fill one row a step; returns (status, component, steps done, iterations).

    x, z, previous and sums are the state of the method; a step that fails leaves x and sums as they were, and z as the
    next guess. A row of energies holds the energy of each storage, the entropy made so far of each irreversible
    component; a row of ledgers the heat, energy, exergy supplied, the entropy made, and the step's least production.
    """
    total = 0
    guess = m.step
    for step in range(steps):
        for i in range(z.shape[0]):
            last = z[i]
            guess[i] = 2.0 * last - previous[i]
            previous[i] = last
            z[i] = guess[i]
            guess[i] = last - z[i]
        if restrain(t, previous.reshape(1, z.shape[0]), guess.reshape(1, z.shape[0])) < 1.0:
            copy(previous, z)
        status, component, iterations = newton(t, o, x, z, scal, inputs, m)
        total += iterations
        if status >= COMPONENT or status == DIVERGED:  # once more from what was last, which cannot be far off
            copy(previous, z)
            status, component, iterations = newton(t, o, x, z, scal, inputs, m)
            total += iterations
        if status != 0:
            for i in range(z.shape[0]):
                if status == 3:  # rank was decided at the start of the step, and is another on its way
                    previous[i] = z[i]
                else:
                    z[i] = previous[i]
            return status, component, step, total
        for i in range(t.states.shape[0]):
            code, at, size, rate, dim = t.states[i]
            for j in range(dim):
                m.v[j] = scal[0] * z[rate + j]
            retract(code, x[at : at + size], m.v[:dim], x[at : at + size])
            if code in (SO3, SE3, SO3xR3):
                tighten(x[at : at + 4])
        least = account(t, z, scal, inputs, m, sums)
        copy(x, states[step])
        copy(m.energy, energies[step])
        for i in range(4):
            ledgers[step, i] = sums[i]
        ledgers[step, 4] = least
    return 0, 0, steps, total
