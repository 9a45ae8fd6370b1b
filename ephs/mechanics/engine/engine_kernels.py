"""Accelerations of a mechanism: calls of the staged sweeps by the addresses that an engine keeps, forces in between."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false, reportCallIssue=false

from ephs.mechanics.engine.force_kernels import act
from ephs.mechanics.engine.tables import DRIVEN, FORCED, R_AT
from ephs.mechanics.tree.loops import ROWS
from ephs.semantics.calling import call_staged
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

ACCELERATIONS, EVALUATIONS, MOVE, FOLD, UNFOLD, RESOLVE, SPREAD, POWER, SEPARATE = range(9)
"""Places of addresses, in the order of `ephs.mechanics.tree.programs.ENTRIES`."""
STILL, DEPENDENT = 20, 21
"""Statuses: a freedom moves no mass; rows are nearly dependent."""


@kernel
def move(e, m, q, r):
    """The outward sweep: poses, twists, loads of all links, and what closes the loops."""
    call_staged(e.address[MOVE], (e.link.shape[0], e.integers, e.reals, m.work, e.gravity, q, r, m.place))
    m.wrench[:] = 0.0
    if e.cut.shape[0] > 0:
        m.entry[:] = 0.0
        m.covector[:] = 0.0
        for a in range(m.row_value.shape[0]):
            m.row_value[a, 2] = 0.0
        end = e.closing.end
        call_staged(
            e.loops[ROWS],
            (e.cut, e.cut_numbers, m.place, m.relative, end.reshape(end.size), m.row_value, m.covector),
        )


@kernel
def fold(e, m, q, force):
    """The inward sweep; returns 0, or 1 + the link whose joint moves no mass."""
    c = e.closing
    return call_staged(
        e.address[FOLD],
        (
            e.link.shape[0], e.integers, e.reals, m.work, e.gravity,
            c.at.reshape(c.at.size), c.slot.reshape(c.slot.size), c.row.reshape(c.row.size), c.flat,
            m.row_value, m.entry, m.covector, m.along, q, force, m.wrench,
        ),
    )  # fmt: skip


@kernel
def unfold(e, m, q, rate):
    """The second outward sweep: accelerations of joints and links, multipliers."""
    c = e.closing
    call_staged(
        e.address[UNFOLD],
        (
            e.link.shape[0], e.integers, e.reals, m.work, e.gravity,
            c.at.reshape(c.at.size), c.slot.reshape(c.slot.size), c.row.reshape(c.row.size), c.flat,
            m.row_value, m.entry, m.covector, m.along, q, rate, m.change,
        ),
    )  # fmt: skip


@kernel
def resolve(e, m, q, rate):
    """The least change of rates, in the mass metric, that meets the targets, with the factors at hand."""
    c = e.closing
    call_staged(
        e.address[RESOLVE],
        (
            e.link.shape[0], e.integers, e.reals, m.work, e.gravity,
            c.at.reshape(c.at.size), c.slot.reshape(c.slot.size), c.row.reshape(c.row.size), c.flat,
            m.row_value, m.entry, m.covector, m.along, q, rate, m.change,
        ),
    )  # fmt: skip


@kernel
def spread(e, m, q, x):
    """The twists that rates x of the joints make, to where links keep their accelerations."""
    call_staged(e.address[SPREAD], (e.link.shape[0], e.integers, e.reals, m.work, e.gravity, q, x, m.change))


@kernel
def driven_power(e, m, q, r):
    """The power of the joints whose motion is prescribed."""
    c = e.closing
    call_staged(
        e.address[POWER],
        (
            e.link.shape[0], e.integers, e.reals, m.work, e.gravity,
            c.at.reshape(c.at.size), c.slot.reshape(c.slot.size), c.row.reshape(c.row.size), c.flat,
            m.row_value, m.entry, m.covector, m.along, q, r, m.force, m.small[0:1],
        ),
    )  # fmt: skip
    return m.small[0]


@kernel
def nearly_dependent(e, m):
    """Whether a row, once the others are out of it, is nearly nothing beside those that it is coupled to."""
    c = e.closing
    found = call_staged(
        e.address[SEPARATE],
        (
            c.at.reshape(c.at.size), c.slot.reshape(c.slot.size), c.row.reshape(c.row.size), c.flat,
            m.row_value, m.entry, m.covector, m.along, m.largest,
        ),
    )  # fmt: skip
    return found != 0


@kernel
def fall(e, m, q, r, force, rate):
    """Accelerations of a tree under gravity and forces on its rates; 0, or 1 + a link that moves no mass."""
    return call_staged(
        e.address[ACCELERATIONS], (e.link.shape[0], e.integers, e.reals, m.work, e.gravity, q, r, force, rate)
    )


@kernel
def accelerate(e, m, q, r, s, drive, wrench, scal, r_rate, s_rate, made, powers):
    """ṙ, ṡ, what each component makes, and the powers of friction and of what drives; (status, component)."""
    if e.address[ACCELERATIONS] != 0:
        still = fall(e, m, q, r, m.zero, r_rate)
        return (0, 0) if still == 0 else (STILL, e.link[still - 1, R_AT])
    move(e, m, q, r)
    for j in range(m.force.shape[0]):
        m.force[j] = 0.0
    if e.flag[FORCED] == 1:
        status, component = act(e, m, q, r, s, drive, wrench, scal, s_rate, made, powers)
        if status != 0:
            return status, component
    still = fold(e, m, q, m.force)
    if still != 0:
        return STILL, e.link[still - 1, R_AT]
    if m.row_value.shape[0] > 0 and nearly_dependent(e, m):
        return DEPENDENT, 0
    unfold(e, m, q, r_rate)
    if e.flag[DRIVEN] == 1:
        powers[1] += driven_power(e, m, q, r)
    return 0, 0


@kernel
def evaluations(e, m, q, r, rates, repeats):
    """Accelerations of many states q (k, size), r (k, n) without forces, into rates (k, n); what a benchmark calls."""
    for _ in range(repeats):
        for k in range(q.shape[0]):
            if e.address[ACCELERATIONS] != 0:
                fall(e, m, q[k], r[k], m.zero, rates[k])
                continue
            move(e, m, q[k], r[k])
            if fold(e, m, q[k], m.zero) == 0:
                unfold(e, m, q[k], rates[k])
