"""Explicit steps, many in one call: stages, loops closed, error, the next step's length, what is kept.

The step's length follows `ephs.mechanics.solve.control.Proportional`, the error the estimates of Dormand and Prince.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

from ephs.mechanics.engine.engine_kernels import DEPENDENT, resolve
from ephs.mechanics.engine.heat_kernels import count as counted
from ephs.mechanics.engine.rate_kernels import across, advance, close, derive
from ephs.mechanics.engine.tables import DIM, R_AT
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

# What `march` is told and tells, by its place in ``control``.
(
    C_T, C_END, C_H, C_SPAN, C_LEAST_STEP, C_MOST, C_BEFORE, C_FAILED, C_STEPS, C_REJECTED, C_EVALUATIONS, C_ROWS,
    C_SAVED, C_SHORTEST, C_LONGEST, C_LEAST, C_STIFF, C_COMPONENT, C_EXPONENT, C_SHARE, C_DAMPING, C_STRICT, C_FRESH,
    C_TRIED, C_GRID, C_ORIGIN, C_LIMIT, C_HELD, C_FREE, C_REFUSALS, C_ROUGH, C_COLUMNS,
) = range(32)  # fmt: skip
DONE, PAUSED, CAREFUL, SHORT, FULL, STIFF, REFUSED = range(7)
"""How `march` ends: at the end; after as many steps as asked; where loops are nearly dependent, and a careful step has
to be taken; where the step gets too short; where no more rows fit; where a component cannot be evaluated."""
PATIENCE = 15
"""Steps at the limit of stability, or without solution one after the other, before a stiff method is called for."""
DRIFT = 1e-2
"""Share of a step's drift off the constraints that counts as its error.

Closing the loops takes the drift out along normals at the step's end. Near a change of rank normals turn fast: there a
stage's drift has a part along the motion that the embedded formula misses. Tried on rows of one to ten four-bars: with
1e-3 errors of 100 tolerances are left at 1e-9, with 1e-1 steps become many times more.
"""


@kernel
def attempt(e, m, scheme, b, base, y0, h, k, y1, q1, drive, wrench, scal, control):
    """Stages of a step of length h from (base, y0), k[0] known; its end in y1 and q1, the rates there in the last k."""
    count = scheme.b.shape[0]
    size = y0.shape[0]
    for i in range(1, count + 1):
        for j in range(size):
            y1[j] = y0[j]
        for s in range(i):
            weight = h * (scheme.a[i, s] if i < count else scheme.b[s])
            if weight != 0.0:
                for j in range(size):
                    y1[j] += weight * k[s, j]
        if i == count - 1:
            for j in range(size):
                b[j] = y1[j]
        control[C_EVALUATIONS] += 1.0
        status, component = derive(e, m, base, q1, y1, drive, wrench, scal, k[i])
        if status != 0:
            control[C_COMPONENT] = component
            return status
    return 0


@kernel
def allowance(e, atol, rtol, y0, y1, nv, out):
    """What an error may be: of the tree's increments, its rates, the entropies, (2 n + ns,)."""
    n = 0
    for i in range(e.link.shape[0]):
        at, d, most = e.link[i, R_AT], e.link[i, DIM], 0.0
        n += d
        for j in range(d):
            most = max(most, abs(y0[nv + at + j]), abs(y1[nv + at + j]))
        for j in range(d):
            out[at + j] = most
    for j in range(n):
        most = out[j]
        out[j] = atol[j] + rtol[j]
        out[n + j] = atol[n + j] + rtol[n + j] * most
    for j in range(2 * n, atol.shape[0]):
        at = nv - n + j
        out[j] = atol[j] + rtol[j] * max(abs(y0[at]), abs(y1[at]))


@kernel
def estimate(e, m, weights, k, h, nv, q1, loops, out, change):
    """h Σ weights·k of what counts in an error; without its parts across the constraints, which closing takes out."""
    n = m.force.shape[0]
    for j in range(out.shape[0]):
        out[j] = 0.0
    for s in range(k.shape[0]):
        weight = h * weights[s]
        if weight != 0.0:
            for j in range(n):
                out[j] += weight * k[s, j]
            for j in range(n, out.shape[0]):
                out[j] += weight * k[s, nv - n + j]
    if loops:
        for part in range(2):
            across(e, m, q1, out[part * n : (part + 1) * n])
            resolve(e, m, q1, change)
            for j in range(n):
                out[part * n + j] += change[j]


@kernel
def measure(fine, coarse, allowed, of_order_8):
    """The size of the estimates relative to what is allowed, as `ephs.mechanics.reduced.explicit.Tableau.measure`."""
    size = max(allowed.shape[0], 1)
    first = second = 0.0
    for j in range(allowed.shape[0]):
        first += (fine[j] / allowed[j]) ** 2
        if of_order_8:
            second += (coarse[j] / allowed[j]) ** 2
    if not of_order_8 or first == 0.0:
        return math.sqrt(first / size)
    return first / math.sqrt((first + 0.01 * second) * size)


@kernel
def drift(open_rates, closed_rates, allowed):
    """Error that closing the loops reveals: DRIFT of the change of the rates, relative to what is allowed of them."""
    n, total = open_rates.shape[0], 0.0
    for j in range(n):
        total += ((closed_rates[j] - open_rates[j]) / allowed[n + j]) ** 2
    return DRIFT * math.sqrt(total / max(n, 1))


@kernel
def judge(control, h, error):
    """Whether a step is accepted; the length of the next one, or of the next try, goes to C_H."""
    part = (control[C_SPAN] / h) ** control[C_SHARE]
    exponent = control[C_EXPONENT] - control[C_SHARE]
    strict = error * min(part, control[C_STRICT])
    error *= part
    if not strict <= 1.0:
        control[C_FAILED] = 1.0
        shorter = max(0.2, 0.9 * strict ** (-1.0 / exponent)) if strict < 1e300 else 0.1
        control[C_H] = min(h * shorter, control[C_MOST])
        return False
    damping = control[C_DAMPING]
    factor = 0.9 * max(error, 1e-10) ** (-(1.0 - 0.75 * damping) / exponent)
    factor *= control[C_BEFORE] ** (damping / exponent)
    control[C_BEFORE] = max(error, 1e-4)
    most = 1.0 if control[C_FAILED] > 0.0 else 6.0
    control[C_FAILED] = 0.0
    wanted = h * min(most, max(0.3, factor))
    # a step that was cut for the end says nothing of longer ones
    if h == control[C_H] or wanted < control[C_H]:
        control[C_H] = max(min(wanted, control[C_MOST]), min(control[C_LEAST_STEP], h))
    return True


@kernel
def finish(e, m, base, y0, y1, q1, change, moved, drive, scal, loops):
    """From a step's end to a state: joints' elements in q1, loops closed, rates and what was made in y1; a status."""
    nv, n = drive.shape[0], m.force.shape[0]
    counted(e.forces, y0[nv + n :], y1[nv + n :], scal, m.temperature)
    advance(e, base, y1, q1)
    if not loops:
        return 0
    status, _ = close(e, m, q1, y1[nv : nv + n], change, moved)
    return status


@kernel
def stiffness(scheme, b, k, y1, h, n, nv, allowed):
    """h·|λ| of the mode that the last two stages differ in; b holds y at the last stage.

    Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
    """
    count = scheme.b.shape[0]
    rise = run = 0.0
    for j in range(allowed.shape[0]):
        at = j if j < n else nv - n + j
        rise += ((k[count, at] - k[count - 1, at]) / allowed[j]) ** 2
        run += ((y1[at] - b[at]) / allowed[j]) ** 2
    return abs(h) * math.sqrt(rise / run) if run > 0.0 else 0.0


@kernel
def held_back(control):
    """Whether stability, whose limit is C_LIMIT, has held back enough steps."""
    if control[C_STIFF] > control[C_LIMIT]:
        control[C_HELD], control[C_FREE] = control[C_HELD] + 1.0, 0.0
        return control[C_HELD] >= PATIENCE
    control[C_FREE] += 1.0
    if control[C_FREE] >= 6.0:
        control[C_HELD] = 0.0
    return False


@kernel
def keep(control, rows_t, rows_q, rows_y, time, least, q, y, nv):
    """Keep a state as the next row."""
    row = int(control[C_ROWS])
    rows_t[row, 0], rows_t[row, 1] = time, least
    for j in range(q.shape[0]):
        rows_q[row, j] = q[j]
    for j in range(y.shape[0] - nv):
        rows_y[row, j] = y[nv + j]
    control[C_ROWS] += 1.0


@kernel
def march(e, m, scheme, s, control, times, drive, wrench, scal, steps):
    """Steps from the state in (s.q, s.y) until the end, or ``steps`` of them; says how it ends.

    Times are counted from the start of the run and grow, also where it goes backward. ``times`` are those to keep where
    C_SAVED is not negative, else every step is kept.
    """
    nv, n = drive.shape[0], m.force.shape[0]
    loops = e.cut.shape[0] > 0
    sign = 1.0 if control[C_END] >= 0.0 else -1.0
    for _ in range(steps):
        now = control[C_T]
        rest = abs(control[C_END]) - now
        if rest <= 0.0:
            return DONE
        if control[C_ROWS] >= s.rows_t.shape[0]:
            return FULL
        h = control[C_H]
        grid = control[C_GRID] > 0.0
        if grid:
            h = min(control[C_GRID] * (control[C_STEPS] + 1.0) - now, rest)
            if rest - h <= 1e-9 * control[C_GRID]:
                h = rest
        elif not rest > 1.01 * h:
            h = rest if rest <= 1.0000001 * h else 0.5 * rest
        control[C_TRIED] = h
        if control[C_FRESH] == 0.0:
            control[C_EVALUATIONS] += 1.0
            status, component = derive(e, m, s.q, s.q1, s.y, drive, wrench, scal, s.k[0])
            if status == DEPENDENT:
                return CAREFUL
            if status != 0:
                control[C_COMPONENT] = component
                return REFUSED + status
            control[C_FRESH] = 1.0
        status = attempt(
            e, m, scheme, s.b, s.q, s.y, sign * h, s.k, s.y1, s.q1, drive, wrench, scal, control
        )  # fmt: skip
        accepted = False
        if status == 0:
            allowance(e, s.atol, s.rtol, s.y, s.y1, nv, s.allowed)
            control[C_STIFF] = stiffness(scheme, s.b, s.k, s.y1, h, n, nv, s.allowed)
            for j in range(n):
                s.fine[j] = s.y1[nv + j]
            status = finish(e, m, s.q, s.y, s.y1, s.q1, s.change, s.moved, drive, scal, loops)
        if status == DEPENDENT:
            return CAREFUL
        if status == 0:
            drifted = drift(s.fine[:n], s.y1[nv : nv + n], s.allowed) if control[C_ROUGH] == 0.0 else 0.0
            estimate(e, m, scheme.error, s.k, sign * h, nv, s.q1, loops, s.fine, s.change)
            if scheme.order8 == 1:
                estimate(e, m, scheme.coarse, s.k, sign * h, nv, s.q1, loops, s.coarse, s.change)
            error = max(measure(s.fine, s.coarse, s.allowed, scheme.order8 == 1), drifted)
            accepted = grid or judge(control, h, error)
        elif grid:
            return REFUSED + status
        else:
            control[C_H] = 0.25 * h
        if not accepted:
            control[C_REJECTED] += 1.0
            if status != 0 and control[C_LIMIT] > 0.0:
                control[C_REFUSALS] += 1.0
                if control[C_REFUSALS] > PATIENCE:
                    return STIFF
            latest = max(abs(control[C_ORIGIN] + sign * now), abs(control[C_ORIGIN] + control[C_END]))
            if control[C_H] < max(control[C_LEAST_STEP], 16.0 * 2.220446049250313e-16 * latest):
                return SHORT if status == 0 else REFUSED + status
            continue
        after = abs(control[C_END]) if h == rest else now + h
        if grid and h != rest:
            after = control[C_GRID] * (control[C_STEPS] + 1.0)
        least = 0.0
        for j in range(nv + n + e.forces.node.shape[0] + 2, s.y.shape[0]):
            made = s.y1[j] - s.y[j]
            least = made if j == nv + n + e.forces.node.shape[0] + 2 else min(least, made)
        if control[C_SAVED] < 0.0:
            keep(control, s.rows_t, s.rows_q, s.rows_y, after, least, s.q1, s.y1, nv)
        else:
            while control[C_SAVED] < times.shape[0] and times[int(control[C_SAVED])] <= after:
                wanted = times[int(control[C_SAVED])]
                if wanted == after:
                    keep(control, s.rows_t, s.rows_q, s.rows_y, wanted, least, s.q1, s.y1, nv)
                else:
                    for j in range(s.y.shape[0]):
                        s.k2[0, j] = s.k[0, j]
                    part = wanted - now
                    status = attempt(
                        e, m, scheme, s.b, s.q, s.y, sign * part, s.k2, s.y2, s.q2, drive, wrench, scal, control
                    )  # fmt: skip
                    if status == 0:
                        status = finish(e, m, s.q, s.y, s.y2, s.q2, s.change, s.moved, drive, scal, loops)
                    if status != 0:  # the whole step succeeded: take it again, and its part in shorter ones
                        return CAREFUL
                    keep(control, s.rows_t, s.rows_q, s.rows_y, wanted, least, s.q2, s.y2, nv)
                control[C_SAVED] += 1.0
        control[C_T] = after
        control[C_STEPS] += 1.0
        control[C_SHORTEST], control[C_LONGEST] = min(control[C_SHORTEST], h), max(control[C_LONGEST], h)
        control[C_LEAST] = min(control[C_LEAST], least)
        for j in range(s.q.shape[0]):
            s.q[j] = s.q1[j]
        for j in range(s.y.shape[0]):
            s.y[j] = 0.0 if j < nv else s.y1[j]
        control[C_FRESH] = control[C_ROUGH] = 0.0
        if not loops:  # nothing was projected: the last rates are the next first ones
            count = scheme.b.shape[0]
            for j in range(s.y.shape[0]):
                s.k[0, j] = s.k[count, j]
            for j in range(nv):
                s.k[0, j] = s.y[nv + j]
            control[C_FRESH] = 1.0
        control[C_REFUSALS] = 0.0
        if control[C_LIMIT] > 0.0 and held_back(control):
            return STIFF
    return DONE if control[C_T] >= abs(control[C_END]) else PAUSED
