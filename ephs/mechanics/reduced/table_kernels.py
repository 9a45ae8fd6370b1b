"""Many states of the reduced form as rows of the paper's states, and the energies stored in them, compiled."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.sweep_kernels import kinematics
from ephs.semantics.calling import call_kernel
from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

POSE, MOMENTUM, ELEMENT, RELATIVE, ENTROPY = range(5)
"""Where a state comes from: a link's pose or momentum, a joint's element, a spring's relative pose, an entropy."""


@kernel
def paper_rows(t, w, plan, sign, q, r, s, x):
    """The paper's states x (rows, size) of the states (q, r, s), one a row.

    ``plan`` (states, 4) says for each state where it comes from, of which link, edge or entropy, its place in x and its
    size; ``sign`` which of its two quaternions a pose has.
    """
    for row in range(q.shape[0]):
        kinematics(t, w, q[row], r[row])
        for k in range(plan.shape[0]):
            source, i, at, size = plan[k, 0], plan[k, 1], plan[k, 2], plan[k, 3]
            if source in (POSE, RELATIVE):
                for j in range(7):
                    value = w.pose[i, j] if source == POSE else w.relative[i, j]
                    x[row, at + j] = sign[k] * value if j < 4 else value
            elif source == MOMENTUM:
                for j in range(6):
                    total = 0.0
                    for m in range(6):
                        total += t.inertia[i, j, m] * w.twist[i, m]
                    x[row, at + j] = total
            elif source == ELEMENT:
                for j in range(size):
                    x[row, at + j] = q[row, t.q_at[i] + j]
            else:
                x[row, at] = s[row, i]


@kernel
def stored_energies(t, scal, m, x, out):
    """Energies in J of all storages of a model with tables t at the states x (rows, size), into out (rows, components).

    Returns (status, component).
    """
    for row in range(x.shape[0]):
        for i in range(t.kind.shape[0]):
            if t.kind[i] != 0:
                continue
            at = t.read_x_at[i]
            for j in range(t.dims[i, 3]):
                m.x[j] = x[row, t.read_x[at + j]]
            for j in range(t.dims[i, 2]):
                m.v[j] = 0.0
            status = call_kernel(  # pyright: ignore[reportCallIssue] - the typing context is numba's
                t.address[i], t.dims[i].ctypes.data, scal.ctypes.data,
                t.parameters[t.parameter_at[i] :].ctypes.data, m.x.ctypes.data, m.v.ctypes.data, m.e.ctypes.data,
                m.lam.ctypes.data, m.f.ctypes.data, m.c.ctypes.data, m.jac.ctypes.data, m.work.ctypes.data,
            )  # fmt: skip
            if status != 0:
                return 10 + status, i
            out[row, i] = m.c[0]
    return 0, 0
