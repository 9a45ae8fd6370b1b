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
from ephs.mechanics.tree.loops import ACROSS, ADVANCE, CHART, FIT, GAPS, MOVE, POSES, RELATIVE_RATES, VELOCITIES
from ephs.semantics.calling import call_staged
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

GAP, CLOSED, ROUNDS = 1e-15, 1e-8, 20
"""Loops are closed to GAP where rounding lets them, and a state is refused where they stay open by CLOSED."""
OPEN = 22
"""Status: loops do not close."""


@kernel
def advance(e, base, v, q):
    """q = base·exp(v), joint by joint; q is not base."""
    call_staged(e.loops[ADVANCE], (e.chart, base, v, q))


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
    call_staged(e.loops[VELOCITIES], (e.chart, e.cut, e.cut_numbers, m.relative, y, r, out))


@kernel
def close(e, m, q, r, change, moved):
    """Close the loops and put the rates on them, by the least change in the mass metric; (status, gap).

    Prescribed rates are as they should be; ``change`` (n,) and ``moved`` (size of v,) are memory.
    """
    before = gap = 1e300
    for _ in range(ROUNDS):
        move(e, m, q, r)
        call_staged(e.loops[POSES], (e.cut, e.cut_numbers, m.relative))
        call_staged(e.loops[FIT], (e.cut, e.cut_numbers, m.relative, q))
        gap = gaps(e, m, q)
        if fold(e, m, q, m.zero) != 0:
            return STILL, gap
        if nearly_dependent(e, m):
            return DEPENDENT, gap
        if gap <= GAP or gap > 0.5 * before:
            break
        before = gap
        gaps(e, m, q)
        resolve(e, m, q, change)
        _moved(e, change, moved)
        call_staged(e.loops[MOVE], (e.chart, moved, q))
    if not gap <= CLOSED:
        return OPEN, gap
    call_staged(e.loops[RELATIVE_RATES], (e.cut, e.cut_numbers, m.relative, m.row_value))
    resolve(e, m, q, change)
    for j in range(r.shape[0]):
        r[j] += change[j]
    return 0, gap


@kernel
def gaps(e, m, q):
    """Targets that close the cut joints in one step of Newton's method; returns how far they are open, in m and rad."""
    call_staged(e.loops[GAPS], (e.cut, e.cut_numbers, m.relative, q, m.row_value, m.small[0:1]))
    return m.small[0]


@kernel
def _moved(e, change, moved):
    """The tree's change as an increment of all joints, cut ones at rest."""
    for i in range(e.chart.shape[0] // CHART):
        at = CHART * i
        first, where, cut = e.chart[at + 4], e.chart[at + 5], e.chart[at + 6]
        for j in range(e.chart[at + 1]):
            moved[first + j] = change[where + j] if cut < 0 else 0.0


@kernel
def across(e, m, q, x):
    """Targets that take a change x (n,) of the tree's rates back across the constraints, at the outward sweep's q."""
    spread(e, m, q, x)
    call_staged(e.loops[ACROSS], (e.cut, e.cut_numbers, m.relative, m.change, m.row_value))
