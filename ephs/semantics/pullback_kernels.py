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


@kernel
def _columns_of_six(matrix, rows, wide, a, par, place):
    """The six columns from a: times T (6, 6); loops of fixed length are unrolled."""
    for i in range(rows):
        at = i * wide + a
        x0, x1, x2 = matrix[at], matrix[at + 1], matrix[at + 2]
        x3, x4, x5 = matrix[at + 3], matrix[at + 4], matrix[at + 5]
        for j in range(6):
            p = place + j
            matrix[at + j] = (
                x0 * par[p]
                + x1 * par[p + 6]
                + x2 * par[p + 12]
                + x3 * par[p + 18]
                + x4 * par[p + 24]
                + x5 * par[p + 30]
            )


@kernel
def _rows_of_six(matrix, wide, a, par, place):
    """The six rows from a: Tᵀ times them."""
    at = a * wide
    for j in range(at, at + wide):
        x0, x1, x2 = matrix[j], matrix[j + wide], matrix[j + 2 * wide]
        x3, x4, x5 = matrix[j + 3 * wide], matrix[j + 4 * wide], matrix[j + 5 * wide]
        for i in range(6):
            p = place + i
            matrix[j + i * wide] = (
                x0 * par[p]
                + x1 * par[p + 6]
                + x2 * par[p + 12]
                + x3 * par[p + 18]
                + x4 * par[p + 24]
                + x5 * par[p + 30]
            )


@kernel
def _columns(matrix, rows, wide, a, da, db, par, place, line):
    """The da columns from a: times T (da, db)."""
    for i in range(rows):
        for j in range(db):
            line[j] = 0.0
            for q in range(da):
                line[j] += matrix[i * wide + a + q] * par[place + q * db + j]
        for j in range(db):
            matrix[i * wide + a + j] = line[j]


@kernel
def _rows(matrix, wide, a, da, db, par, place, line):
    """The da rows from a: Tᵀ (db, da) times them."""
    for j in range(wide):
        for i in range(db):
            line[i] = 0.0
            for q in range(da):
                line[i] += par[place + q * db + i] * matrix[(a + q) * wide + j]
        for i in range(db):
            matrix[(a + i) * wide + j] = line[i]


@kernel
def _gather(out, to, matrix, at, layout, ports, n, inner, rest):
    """One row: the columns of each port, then the others."""
    for port in range(ports):
        a, b, db = int(layout[3 + 5 * port]), int(layout[5 + 5 * port]), int(layout[6 + 5 * port])
        for j in range(db):
            out[to + b + j] = matrix[at + a + j]
    for j in range(rest):
        out[to + n + j] = matrix[at + inner + j]


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
    # columns: J' T, in place, as the efforts of a port are fewer or as many; then rows: Tᵀ J'
    rows, width = inner + k, n + k + m
    place = first
    for port in range(ports):
        a, da = int(layout[3 + 5 * port]), int(layout[4 + 5 * port])
        db = int(layout[6 + 5 * port])
        if layout[7 + 5 * port] == 1.0:
            if da == 6 and db == 6:
                _columns_of_six(own_j, rows, wide, a, par, place)
                _rows_of_six(own_j, wide, a, par, place)
            elif db > 0:
                _columns(own_j, rows, wide, a, da, db, par, place, mem)
                _rows(own_j, wide, a, da, db, par, place, mem)
            for i in range(db):
                total = 0.0
                for q in range(da):
                    total += par[place + q * db + i] * own_f[a + q]
                mem[i] = total
            for i in range(db):
                own_f[a + i] = mem[i]
            place += da * db
    for port in range(ports):
        a, b, db = int(layout[3 + 5 * port]), int(layout[5 + 5 * port]), int(layout[6 + 5 * port])
        for i in range(db):
            flow[b + i] = own_f[a + i]
            _gather(slope, (b + i) * width, own_j, (a + i) * wide, layout, ports, n, inner, k + m)
    for i in range(k):
        _gather(slope, (n + i) * width, own_j, (inner + i) * wide, layout, ports, n, inner, k + m)
    return 0
