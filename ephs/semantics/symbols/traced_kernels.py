"""The compiled discrete relations of traced primitives: one storage, one relation, around any program.

Their parameters are the program's address, the layout of the states, then the program's own numbers. The address is
exact as a float: there are 47 bits of it.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

import math

import numba as nb

from ephs.semantics.calling import call_kernel
from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.se3_kernels import dexp_left, retract

NODE, WEIGHT = 0.5 * math.sqrt(0.6), 5.0 / 18.0
"""Of Gauss' quadrature with three nodes on an interval: the outer nodes' distance from the middle, their weight."""
ROUNDING = 8.0 * 2.220446049250313e-16
"""Of a difference of energies, relative to them and to what the states' own rounding makes of the gradient."""
TINY = 1e-12
"""Up to this relative size the correction is left out of the slope: there it would be rounding."""


@kernel
def _call(address, dims, scal, p, x, e, lam, f, c, jac):
    return call_kernel(  # pyright: ignore[reportCallIssue] - the typing context is numba's
        address, dims.ctypes.data, scal.ctypes.data, p.ctypes.data, x.ctypes.data, x.ctypes.data,
        e.ctypes.data, lam.ctypes.data, f.ctypes.data, c.ctypes.data, jac.ctypes.data, x.ctypes.data,
    )  # fmt: skip


@kernel
def _along(step, h, n, first, last, weight, row):
    """row += weight · stepᵀ H over the rows of one port."""
    for j in range(n):
        for q in range(first, last):
            row[j] += weight * step[q] * h[q * n + j]


@kernel
def _turn(code, step, share, first, last, row, scratch):
    """row ← row · D on the columns of one port, with x⁻¹dx = share⁻¹ D d(share·step) for x = x⁰·exp(share·step)."""
    dim = last - first
    part, out = scratch[0:dim], scratch[16 : 16 + dim]
    for i in range(dim):
        part[i] = share * step[first + i]
        out[i] = 0.0
    matrix = scratch[32 : 32 + dim * dim].reshape(dim, dim)
    dexp_left(code, part, matrix)
    for j in range(dim):
        for q in range(dim):
            out[j] += row[first + q] * matrix[q, j]
    for j in range(dim):
        row[first + j] = out[j]


def storage(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """Port by port the gradient at the midpoint, corrected along the increment; the mean over the ports' two orders.

    The correction makes ⟨∇̄E|v⟩ the difference of energies. Over short increments that is all rounding; where the
    quadrature of Gauss with three nodes agrees with it to rounding, the quadrature serves.
    p = address, number of ports, (code, point at, size, increment at, dim) of each, for all efforts how many θ₀, then
    π₀, are taken off, and the other reference potentials; numbers.
    """
    n, points = dims[0], dims[3]
    head = nb.carray(p, 2)
    address, ports = int(head[0]), int(head[1])
    shifts = 2 + 5 * ports
    layout = nb.carray(p, shifts + 3 * n)
    numbers = nb.carray(p, shifts + 3 * n + 1)[shifts + 3 * n :]
    reference, d = nb.carray(scal, 3), nb.carray(dims, 4)
    start, step = nb.carray(x0, points), nb.carray(v, n)
    effort, slope, energy = nb.carray(e, n), nb.carray(f, n * n), nb.carray(c, 1)
    scratch = nb.carray(work, 2048)
    here, middle, there = scratch[0:16], scratch[16:32], scratch[32:48]
    g0, g, g1, node = scratch[48:64], scratch[64:80], scratch[80:96], scratch[96:112]
    row, quadrature, value, scaled = scratch[112:128], scratch[128:144], scratch[144:148], scratch[148:164]
    h, h0, spare = scratch[164:420], scratch[420:676], scratch[676:1000]
    effort[:] = 0.0
    slope[:] = 0.0
    orders = 1 if ports == 1 else 2
    weight = 1.0 / orders
    for order in range(orders):
        for i in range(points):
            here[i] = middle[i] = there[i] = start[i]
        _call(address, d, reference, numbers, here, g0, g0, g0, value, h0)
        before = value[0]
        for number in range(ports):
            port = number if order == 0 else ports - 1 - number
            code, at, size = int(layout[2 + 5 * port]), int(layout[3 + 5 * port]), int(layout[4 + 5 * port])
            first = int(layout[5 + 5 * port])
            last = first + int(layout[6 + 5 * port])
            for i in range(first, last):
                scaled[i] = 0.5 * step[i]
            retract(code, here[at : at + size], scaled[first:last], middle[at : at + size])
            retract(code, here[at : at + size], step[first:last], there[at : at + size])
            _call(address, d, reference, numbers, middle, g, g, g, value, h)
            along, square, terms, far = 0.0, 0.0, 0.0, 0.0
            for i in range(first, last):
                along += g[i] * step[i]
                square += step[i] * step[i]
                terms += abs(g[i])
            for i in range(at, at + size):
                far = max(far, abs(here[i]))
            # quadrature: what the outer nodes add to the midpoint, and its derivative by the increments
            near = 0.0
            quadrature[:] = 0.0
            for side in (-1.0, 1.0):
                share = 0.5 + side * NODE
                for i in range(first, last):
                    scaled[i] = share * step[i]
                retract(code, here[at : at + size], scaled[first:last], middle[at : at + size])
                _call(address, d, reference, numbers, middle, node, node, node, value, h0)
                row[:] = 0.0
                _along(step, h0, n, first, last, WEIGHT, row)
                for j in range(first, last):
                    row[j] *= share
                _turn(code, step, share, first, last, row, spare)
                for j in range(first, last):
                    near += WEIGHT * (node[j] - g[j]) * step[j]
                    row[j] += WEIGHT * node[j]
                for j in range(n):
                    quadrature[j] += row[j]
            _call(address, d, reference, numbers, there, g1, g1, g1, value, h0)
            after = value[0]
            row[:] = 0.0
            _along(step, h, n, first, last, -1.0, row)  # of −⟨g|step⟩, which either way is subtracted
            for j in range(first, last):
                row[j] *= 0.5
            _turn(code, step, 0.5, first, last, row, spare)
            defect = after - before - along
            if abs(near - defect) <= ROUNDING * (abs(after) + abs(before) + terms * far):
                defect = near
                for j in range(n):
                    row[j] = quadrature[j] + 2.0 * WEIGHT * row[j]
                for j in range(first, last):
                    row[j] -= 2.0 * WEIGHT * g[j]
            else:
                for j in range(first, last):
                    scaled[j] = g1[j]
                _turn(code, step, 1.0, first, last, scaled, spare)
                for j in range(n):
                    row[j] += scaled[j] - g[j] if first <= j < last else g1[j] - g0[j]
            share = defect / square if square > 0.0 else 0.0
            for i in range(first, last):
                effort[i] += weight * (g[i] + share * step[i])
                for j in range(n):
                    scaled[j] = h[i * n + j]
                for j in range(first, last):
                    scaled[j] *= 0.5
                _turn(code, step, 0.5, first, last, scaled, spare)
                for j in range(n):
                    entry = scaled[j]
                    if abs(near) > TINY * abs(along):
                        entry += step[i] * (row[j] - (2.0 * share * step[j] if first <= j < last else 0.0)) / square
                        entry += share if i == j else 0.0
                    moved = first <= j < last
                    for other in range(number):
                        begin = int(layout[5 + 5 * (other if order == 0 else ports - 1 - other)])
                        end = begin + int(layout[6 + 5 * (other if order == 0 else ports - 1 - other)])
                        moved = moved or begin <= j < end
                    if moved:
                        slope[i * n + j] += weight * entry
            before = after
            for i in range(n):
                g0[i] = g1[i]
            for i in range(at, at + size):
                here[i] = middle[i] = there[i]
        energy[0] = before
    for column in range(ports):  # a port moved earlier enters by its whole increment
        code, first = int(layout[2 + 5 * column]), int(layout[5 + 5 * column])
        last = first + int(layout[6 + 5 * column])
        for i in range(n):
            if not first <= i < last:
                _turn(code, step, 1.0, first, last, slope[i * n : i * n + n], spare)
    good = math.isfinite(energy[0])
    for i in range(n):
        hot, wide, other = layout[shifts + i], layout[shifts + n + i], layout[shifts + 2 * n + i]
        if hot > 0.0 and effort[i] <= 0.0:
            return 2
        effort[i] -= hot * reference[1] + wide * reference[2] + other
        good = good and math.isfinite(effort[i])
    return 0 if good else 5


def relation(dims, scal, p, x0, v, e, lam, f, c, jac, work):
    """The relation at the midpoint of the states that are read.

    p = address, number of read ports, number of entropy ports, (code, point at, size, increment at, dim) of each read
    port, places of the entropies, numbers.
    """
    n, k, m, points = dims[0], dims[1], dims[2], dims[3]
    head = nb.carray(p, 3)
    address, reads, hot = int(head[0]), int(head[1]), int(head[2])
    end = 3 + 5 * reads + hot
    layout = nb.carray(p, end)
    numbers = nb.carray(p, end + 1)[end:]
    reference, d = nb.carray(scal, 3), nb.carray(dims, 4)
    start, step = nb.carray(x0, points), nb.carray(v, m)
    effort, force = nb.carray(e, n), nb.carray(lam, k + 1)
    width, rows = n + k + m, n + k
    flow, condition, slope = nb.carray(f, n), nb.carray(c, k + 1), nb.carray(jac, rows * width)
    scratch = nb.carray(work, 2048)
    for i in range(hot):
        if reference[1] + effort[int(layout[3 + 5 * reads + i])] <= 0.0:
            return 2
    middle = scratch[0 : points + 1]
    for port in range(reads):
        at, size = int(layout[4 + 5 * port]), int(layout[5 + 5 * port])
        first, dim = int(layout[6 + 5 * port]), int(layout[7 + 5 * port])
        half = scratch[512 : 512 + dim]
        for i in range(dim):
            half[i] = 0.5 * step[first + i]
        retract(int(layout[3 + 5 * port]), start[at : at + size], half, middle[at : at + size])
    _call(address, d, reference, numbers, middle, effort, force, flow, condition, slope)
    for port in range(reads):
        first, dim = int(layout[6 + 5 * port]), int(layout[7 + 5 * port])
        half, row = scratch[512 : 512 + dim], scratch[528 : 528 + dim]
        for i in range(dim):
            half[i] = 0.5 * step[first + i]
        turn = scratch[544 : 544 + dim * dim].reshape(dim, dim)
        dexp_left(int(layout[3 + 5 * port]), half, turn)
        for i in range(rows):
            at = i * width + n + k + first
            for j in range(dim):
                row[j] = 0.0
                for q in range(dim):
                    row[j] += 0.5 * slope[at + q] * turn[q, j]
            for j in range(dim):
                slope[at + j] = row[j]
    good = True
    for i in range(n):
        good = good and math.isfinite(flow[i])
    for i in range(k):
        good = good and math.isfinite(condition[i])
    return 0 if good else 5
