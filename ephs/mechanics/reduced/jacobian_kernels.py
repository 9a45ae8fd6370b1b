"""The Jacobian of a mechanism's equations: columns by tree joints in the world's frame, the others by tangents."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.column_kernels import column, gather_world
from ephs.mechanics.reduced.dynamics_kernels import solve_constrained
from ephs.mechanics.reduced.slope_kernels import component_slopes
from ephs.mechanics.reduced.tangent_kernels import still, tangent
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel


@kernel
def jacobian(t, w, d, unread, q, r, s, drive, scal, m, rank, fit, solve, out):
    """All directions (dq of tree and cut joints, dr, ds) as columns; rows are ṙ or, where not solved for, the residual;
    the rates of the cut joints; ṡ. (status, component).

    ``unread`` (n,) marks freedoms of the tree whose coordinates nothing reads: their columns are zero."""
    status, number = component_slopes(t, w, d, q, r, s, drive, scal)
    if status != 0:
        return status, number
    links, n, nv = t.parent.shape[0], t.driven.shape[0], d.dq.shape[0]
    gather_world(t, w, d)
    still(d)
    for k in range(d.warmth.shape[0]):
        d.warmth[k] = 0.0
    for i in range(links):
        for j in range(t.dim[i]):
            for turning in range(2):
                if turning == 1 and unread[t.r_at[i] + j] == 1:
                    _put_nothing(out, t.r_at[i] + j)
                    continue
                column(t, w, d, i, j, turning, fit)
                _put(t, w, d, m, rank, solve, (0 if turning == 1 else nv) + t.r_at[i] + j, out)
    for k in range(n, nv):
        if fit == 1:
            _put_nothing(out, k)
        else:
            d.dq[k] = 1.0
            tangent(t, w, d, fit, 1)
            _put(t, w, d, m, rank, solve, k, out)
            d.dq[k] = 0.0
    for k in range(t.node.shape[0]):
        if t.node[k] < 0:  # the environment's temperature is what it is
            _put_nothing(out, nv + n + k)
        else:
            d.ds[k] = 1.0
            tangent(t, w, d, fit, 1)
            _put(t, w, d, m, rank, solve, nv + n + k, out)
            d.ds[k] = 0.0
    return 0, 0


@kernel
def _put(t, w, d, m, rank, solve, at, out):
    n, cut = t.driven.shape[0], d.cut.shape[0]
    if solve == 1:
        for i in range(n):
            d.force[i] = -d.force[i]
        solve_constrained(w, m, rank, d.force, d.row, d.row, d.change)
    for i in range(n):
        out[i, at] = d.force[i]
    for i in range(cut):
        out[n + i, at] = d.cut[i]
    for i in range(t.node.shape[0]):
        out[n + cut + i, at] = d.heat[i]


@kernel
def _put_nothing(out, at):
    for i in range(out.shape[0]):
        out[i, at] = 0.0
