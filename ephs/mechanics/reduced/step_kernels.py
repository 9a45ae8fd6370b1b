"""The right-hand side of the reduced form and the stages of an explicit step, compiled."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.loop_kernels import accelerate
from ephs.mechanics.reduced.tables import CUT, SPRING
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.se3_kernels import dexp_left_inv, retract

kernel = jit.kernel


@kernel
def advance(t, v_at, base, v, q):
    """q = base·exp(v), joint by joint."""
    for i in range(t.kind.shape[0]):
        if t.kind[i] != SPRING:
            at, size, first = t.q_at[i], t.q_size[i], v_at[i]
            retract(t.code[i], base[at : at + size], v[first : first + t.dim[i]], q[at : at + size])


@kernel
def rates(t, w, v_at, base, q, y, drive, wrench, scal, out):
    """ẏ of y = (v, r, s, heat, work, made) at q = base·exp(v), which is left in q; (status, component)."""
    nv, n, ns = drive.shape[0], w.mass.shape[0], t.node.shape[0]
    at = nv + n + ns
    r = y[nv : nv + n]
    out[:] = 0.0
    advance(t, v_at, base, y[:nv], q)
    status, component = accelerate(
        t, w, q, r, y[nv + n : at], drive, wrench, scal,
        out[nv : nv + n], out[nv + n : at], out[at + 2 :], out[at : at + 2],
    )  # fmt: skip
    if status != 0:
        return status, component
    for i in range(t.kind.shape[0]):
        if t.kind[i] == SPRING:
            continue
        first, d = v_at[i], t.dim[i]
        for j in range(d):
            w.small[300 + j] = w.rate[i, j] if t.kind[i] == CUT else r[t.r_at[i] + j]
        if t.code[i] == VECTOR:
            for j in range(d):
                out[first + j] = w.small[300 + j]
        else:
            turn = w.scratch[0 : d * d].reshape(d, d)
            dexp_left_inv(t.code[i], y[first : first + d], turn)
            for j in range(d):
                entry = 0.0
                for m in range(d):
                    entry += turn[j, m] * w.small[300 + m]
                out[first + j] = entry
    return 0, 0


@kernel
def stages(t, w, v_at, a, b, base, q, y0, h, known, k, y1, drive, wrench, scal):
    """The rates at all stages and at the end, k[0] known or not; y at the end in y1, q there in q."""
    count = b.shape[0]
    for i in range(count + 1):
        if i == 0 and known:
            continue
        for j in range(y0.shape[0]):
            entry = 0.0
            for m in range(min(i, count)):
                entry += (a[i, m] if i < count else b[m]) * k[m, j]
            y1[j] = y0[j] + h * entry
        status, component = rates(t, w, v_at, base, q, y1, drive, wrench, scal, k[i])
        if status != 0:
            return status, component
    return 0, 0
