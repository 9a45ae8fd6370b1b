"""Temperatures and quaternions of the natural discretisation, held within their domains."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.semantics.spaces import jit

kernel = jit.lean_kernel

STORING = 0
"""Kind of a component that stores energy."""


@kernel
def restrain(t, z, step):
    """Shorten a Newton step z − step (stages, unknowns) storage by storage; the least part taken of efforts and rates.

    Absolute temperatures fall by half or rise fourfold at most: small heat capacities warm by orders of magnitude in
    one step of the method, where whole Newton steps would leave what is positive. All stages take the same part, as the
    states at each depend on the rates at all.
    """
    least = 1.0
    for i in range(t.kind.shape[0]):
        if t.kind[i] != STORING:
            continue
        part = 1.0
        for j in range(t.dims[i, 0]):
            effort = t.e_index[t.e_at[i] + j]
            if t.entropy[effort] == 1.0:
                for k in range(z.shape[0]):
                    warmth, fall = z[k, t.counts[0] + effort] + t.intensive[effort], step[k, t.counts[0] + effort]
                    if warmth > 0.0:
                        if fall > 0.5 * warmth:
                            part = min(part, 0.5 * warmth / fall)
                        elif fall < -3.0 * warmth:
                            part = min(part, -3.0 * warmth / fall)
        if part < 1.0:
            least = min(least, part)
            for j in range(t.dims[i, 0]):
                for k in range(z.shape[0]):
                    step[k, t.counts[0] + t.e_index[t.e_at[i] + j]] *= part
                    step[k, t.read_w[t.read_w_at[i] + j]] *= part
    return least


@kernel
def tighten(q):
    """Bring a quaternion that is off by rounding back to unit length."""
    factor = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= factor
