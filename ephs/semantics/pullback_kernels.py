"""The compiled relation of a primitive that is seen through linear maps of its ports' efforts.

Signature and layout as in `ephs.semantics.kernel_table`. The scratch memory from 2048 on is used here, what lies before
it by the relation inside.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import numba as nb
import numpy as np

from ephs.semantics.calling import call_kernel
from ephs.semantics.spaces.jit import kernel

OWN = 2048
"""Where this relation's own scratch memory begins; it has as much again."""


@kernel
def _call(address, dims, scal, p, x, v, e, lam, f, c, jac, work):
    return call_kernel(  # pyright: ignore[reportCallIssue] - the typing context is numba's
        address, dims.ctypes.data, scal.ctypes.data, p.ctypes.data, x.ctypes.data, v.ctypes.data,
        e.ctypes.data, lam.ctypes.data, f.ctypes.data, c.ctypes.data, jac.ctypes.data, work.ctypes.data,
    )  # fmt: skip


def pulled(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """e' = T e, (f', c) = relation(e', λ), f = Tᵀ f'; T block by block, a block for each port of the relation inside.

    p = address, inner n, ports, (inner at, inner dim, at, dim, 1 where there is a matrix) of each, the matrices (inner
    dim, dim), then the numbers of the relation inside.
    """
    n, k, m, size = dims[0], dims[1], dims[2], dims[3]
    head = nb.carray(p, 3)
    address, inner, ports = int(head[0]), int(head[1]), int(head[2])
    layout = nb.carray(p, 3 + 5 * ports)
    entries = 0
    for port in range(ports):
        if layout[7 + 5 * port] == 1.0:
            entries += int(layout[4 + 5 * port]) * int(layout[6 + 5 * port])
    first = 3 + 5 * ports
    par = nb.carray(p, first + entries + 1)
    effort, flow = nb.carray(e, n + 1), nb.carray(f, n + 1)
    slope = nb.carray(jac, (n + k) * (n + k + m) + 1)
    mem = nb.carray(work, 4096)
    d = mem[OWN : OWN + 4].view(np.int64)
    d[0], d[1], d[2], d[3] = inner, k, m, size
    at = OWN + 4
    own_e, own_f = mem[at : at + inner + 1], mem[at + inner + 1 : at + 2 * inner + 2]
    at += 2 * inner + 2
    wide = inner + k + m
    own_j = mem[at : at + (inner + k) * wide + 1]
    place = first
    for port in range(ports):
        a, da = int(layout[3 + 5 * port]), int(layout[4 + 5 * port])
        b, db = int(layout[5 + 5 * port]), int(layout[6 + 5 * port])
        if layout[7 + 5 * port] == 1.0:
            for i in range(da):
                total = 0.0
                for j in range(db):
                    total += par[place + i * db + j] * effort[b + j]
                own_e[a + i] = total
            place += da * db
        else:
            for i in range(da):
                own_e[a + i] = effort[b + i]
    status = _call(
        address, d, nb.carray(scal, 3), par[first + entries :], nb.carray(x0, size + 1), nb.carray(v, m + 1), own_e,
        nb.carray(lam, k + 1), own_f, nb.carray(c, k + 1), own_j, mem,
    )  # fmt: skip
    if status != 0:
        return status
    # columns: J' T, in place as far as the efforts of a port are fewer or as many; then rows: Tᵀ J'
    rows, width = inner + k, n + k + m
    place = first
    for port in range(ports):
        a, da = int(layout[3 + 5 * port]), int(layout[4 + 5 * port])
        db = int(layout[6 + 5 * port])
        if layout[7 + 5 * port] == 1.0:
            line = mem[0:db]
            for i in range(rows):
                for j in range(db):
                    line[j] = 0.0
                for q in range(da):
                    entry = own_j[i * wide + a + q]
                    if entry != 0.0:
                        for j in range(db):
                            line[j] += entry * par[place + q * db + j]
                for j in range(db):
                    own_j[i * wide + a + j] = line[j]
            place += da * db
    place = first
    for port in range(ports):
        a, da = int(layout[3 + 5 * port]), int(layout[4 + 5 * port])
        b, db = int(layout[5 + 5 * port]), int(layout[6 + 5 * port])
        matrix = layout[7 + 5 * port] == 1.0
        for i in range(db):
            total = 0.0 if matrix else own_f[a + i]
            if matrix:
                for q in range(da):
                    total += par[place + q * db + i] * own_f[a + q]
            flow[b + i] = total
            row = (b + i) * width
            for other in range(ports):
                oa = int(layout[3 + 5 * other])
                ob, odb = int(layout[5 + 5 * other]), int(layout[6 + 5 * other])
                for j in range(odb):
                    total = 0.0 if matrix else own_j[(a + i) * wide + oa + j]
                    if matrix:
                        for q in range(da):
                            total += par[place + q * db + i] * own_j[(a + q) * wide + oa + j]
                    slope[row + ob + j] = total
            for j in range(k + m):
                total = 0.0 if matrix else own_j[(a + i) * wide + inner + j]
                if matrix:
                    for q in range(da):
                        total += par[place + q * db + i] * own_j[(a + q) * wide + inner + j]
                slope[row + n + j] = total
        if matrix:
            place += da * db
    for i in range(k):
        row = (n + i) * width
        for other in range(ports):
            oa = int(layout[3 + 5 * other])
            ob, odb = int(layout[5 + 5 * other]), int(layout[6 + 5 * other])
            for j in range(odb):
                slope[row + ob + j] = own_j[(inner + i) * wide + oa + j]
        for j in range(k + m):
            slope[row + n + j] = own_j[(inner + i) * wide + inner + j]
    return 0
