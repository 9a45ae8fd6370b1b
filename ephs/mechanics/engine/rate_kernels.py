"""The right-hand side of a mechanism's equations, and loops closed after a step."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.engine.engine_kernels import (
    DEPENDENT,
    STILL,
    accelerate,
    fold,
    move,
    nearly_dependent,
    resolve,
    spread,
)
from ephs.mechanics.engine.heat_kernels import entropies, heat_rates
from ephs.mechanics.engine.row_kernels import cut_gaps, cut_poses, fit, seen
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.se3_kernels import dexp_left_inv, retract

kernel = jit.lean_kernel

GAP, CLOSED, ROUNDS = 1e-15, 1e-8, 20
"""Loops are closed to GAP where rounding lets them, and a state is refused where they stay open by CLOSED."""
OPEN = 22
"""Status: loops do not close."""


@kernel
def advance(e, base, v, q):
    """q = base·exp(v), joint by joint."""
    for i in range(e.chart.shape[0]):
        code, d, at, size, first = e.chart[i, 0], e.chart[i, 1], e.chart[i, 2], e.chart[i, 3], e.chart[i, 4]
        if code == VECTOR:
            for j in range(d):
                q[at + j] = base[at + j] + v[first + j]
        else:
            retract(code, base[at : at + size], v[first : first + d], q[at : at + size])


@kernel
def derive(e, m, base, q, y, drive, wrench, scal, out):
    """ẏ of y = (v, r, heats, heat, work, flows) at q = base·exp(v), which is left in q; (status, component)."""
    nv, n, ns = drive.shape[0], m.force.shape[0], e.forces.node.shape[0]
    at = nv + n + ns
    for j in range(at, out.shape[0]):
        out[j] = 0.0
    advance(e, base, y, q)
    r = y[nv : nv + n]
    status, component = entropies(e.forces, y[nv + n : at], scal, m.entropy)
    if status != 0:
        return status, component
    status, component = accelerate(
        e, m, q, r, m.entropy, drive, wrench, scal,
        out[nv : nv + n], out[nv + n : at], out[at + 2 :], out[at : at + 2],
    )  # fmt: skip
    if status != 0:
        return status, component
    heat_rates(e.forces, m.temperature, scal, out[nv + n : at], out[at + 2 :])
    joint_rates(e, m, y, r, out)
    return 0, 0


@kernel
def joint_rates(e, m, y, r, out):
    """v̇ = dexp⁻¹(v) r of all joints, that of cut ones from the outward sweep, into out."""
    for i in range(e.chart.shape[0]):
        code, d, first, where, number = e.chart[i, 0], e.chart[i, 1], e.chart[i, 4], e.chart[i, 5], e.chart[i, 6]
        for j in range(d):
            if number < 0:
                value = r[where + j]
            else:
                value = 0.0
                for k in range(6):
                    value += e.cut_basis[number, 36 + 6 * j + k] * m.relative[number, 19 + k]
            if code == VECTOR:
                out[first + j] = value
            else:
                m.small[j] = value
        if code != VECTOR:
            turn = m.scratch[0 : d * d].reshape(d, d)
            dexp_left_inv(code, y[first : first + d], turn)
            for j in range(d):
                value = 0.0
                for k in range(d):
                    value += turn[j, k] * m.small[k]
                out[first + j] = value


@kernel
def close(e, m, q, r, change, moved):
    """Close the loops and put the rates on them, by the least change in the mass metric; (status, gap).

    Prescribed rates are as they should be; ``change`` (n,) and ``moved`` (size of v,) are memory.
    """
    before = gap = 1e300
    for _ in range(ROUNDS):
        move(e, m, q, r)
        cut_poses(e, m)
        fit(e, m, q)
        gap = cut_gaps(e, m, q)
        if fold(e, m, q, m.zero) != 0:
            return STILL, gap
        if nearly_dependent(e, m):
            return DEPENDENT, gap
        if gap <= GAP or gap > 0.5 * before:
            break
        before = gap
        cut_gaps(e, m, q)
        resolve(e, m, q, change)
        _moved(e, change, moved)
        advance(e, q, moved, q)
    if not gap <= CLOSED:
        return OPEN, gap
    relative_rates(e, m)
    resolve(e, m, q, change)
    for j in range(r.shape[0]):
        r[j] += change[j]
    return 0, gap


@kernel
def _moved(e, change, moved):
    """The tree's change as an increment of all joints, cut ones at rest."""
    for i in range(e.chart.shape[0]):
        for j in range(e.chart[i, 1]):
            moved[e.chart[i, 4] + j] = change[e.chart[i, 5] + j] if e.chart[i, 6] < 0 else 0.0


@kernel
def relative_rates(e, m):
    """Targets that take the cut joints' forbidden velocities away, where the outward sweep has been at r."""
    for i in range(e.cut.shape[0]):
        for j in range(e.cut[i, 8]):
            total = 0.0
            for k in range(6):
                total -= e.cut_basis[i, 72 + 6 * j + k] * m.relative[i, 19 + k]
            m.row_value[e.cut[i, 7] + j, 0] = total


@kernel
def across(e, m, q, x):
    """Targets that take a change x (n,) of the tree's rates back across the constraints, at the outward sweep's q."""
    spread(e, m, q, x)
    first, second = m.small[12:18], m.small[18:24]
    for i in range(e.cut.shape[0]):
        one, two = m.change[e.cut[i, 0]], m.change[e.cut[i, 1]]  # the ground's is the last one
        seen(m.relative[i], 7, one, 0, first)
        seen(e.cut_frame[i], 12, two, 0, second)
        for j in range(e.cut[i, 8]):
            total = 0.0
            for k in range(6):
                total -= e.cut_basis[i, 72 + 6 * j + k] * (second[k] - first[k])
            m.row_value[e.cut[i, 7] + j, 0] = total
