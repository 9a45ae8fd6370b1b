"""What tangents of a mechanism need at a point: frames as matrices, and the components' own derivatives."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.sweep_kernels import component_at
from ephs.mechanics.reduced.tables import CUT, SPRING
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.se3_kernels import pose_compose, quat_to_matrix

kernel = jit.lean_kernel


@kernel
def into(turn, place, u, out):
    """Ad_{x⁻¹}u = (Rᵀω, Rᵀ(υ − r×ω)) of the pose x = (R, r); out may not alias u."""
    a = u[3] - place[1] * u[2] + place[2] * u[1]
    b = u[4] - place[2] * u[0] + place[0] * u[2]
    c = u[5] - place[0] * u[1] + place[1] * u[0]
    for k in range(3):
        out[k] = turn[0, k] * u[0] + turn[1, k] * u[1] + turn[2, k] * u[2]
        out[3 + k] = turn[0, k] * a + turn[1, k] * b + turn[2, k] * c


@kernel
def out_of(turn, place, f, out, sign):
    """out += sign·Ad*_{x⁻¹}f = sign·(R f_ω + r×R f_υ, R f_υ)."""
    a = turn[0, 0] * f[3] + turn[0, 1] * f[4] + turn[0, 2] * f[5]
    b = turn[1, 0] * f[3] + turn[1, 1] * f[4] + turn[1, 2] * f[5]
    c = turn[2, 0] * f[3] + turn[2, 1] * f[4] + turn[2, 2] * f[5]
    out[0] += sign * (turn[0, 0] * f[0] + turn[0, 1] * f[1] + turn[0, 2] * f[2] + place[1] * c - place[2] * b)
    out[1] += sign * (turn[1, 0] * f[0] + turn[1, 1] * f[1] + turn[1, 2] * f[2] + place[2] * a - place[0] * c)
    out[2] += sign * (turn[2, 0] * f[0] + turn[2, 1] * f[1] + turn[2, 2] * f[2] + place[0] * b - place[1] * a)
    out[3] += sign * a
    out[4] += sign * b
    out[5] += sign * c


@kernel
def frame(pose, turn, place):
    """A pose as a matrix and a position."""
    quat_to_matrix(pose[:4], turn)
    for k in range(3):
        place[k] = pose[4 + k]


@kernel
def relative(t, d, i, twist, out):
    """Of an edge, what body 2 has more than body 1, in the frame C2: twists, or what transforms like them."""
    other = d.small[60:66]
    for k in range(6):
        out[k] = other[k] = 0.0
    if t.second[i] >= 0:
        into(d.end_turn[i, 1], d.end_place[i, 1], twist[t.second[i]], out)
    if t.first[i] >= 0:
        into(d.end_turn[i, 0], d.end_place[i, 0], twist[t.first[i]], other)
    for k in range(6):
        out[k] -= other[k]


@kernel
def out_of_edge(t, d, i, second, first, loads):
    """The wrench ``second`` on body 2 in the frame C2, and the reaction ``first`` on body 1, into loads, which count
    negatively."""
    if t.second[i] >= 0:
        out_of(d.end_turn[i, 1], d.end_place[i, 1], second, loads[t.second[i]], -1.0)
    if t.first[i] >= 0:
        out_of(d.end_turn[i, 0], d.end_place[i, 0], first, loads[t.first[i]], 1.0)


@kernel
def frames_of_ends(t, w, d, i):
    """The frames C2 of a cut joint or a spring in its two bodies, by way of either."""
    pose = d.small[70:77]
    pose_compose(t.offset1[i], w.relative[i], pose)
    frame(pose, d.end_turn[i, 0], d.end_place[i, 0])
    frame(t.offset2[i], d.end_turn[i, 1], d.end_place[i, 1])


@kernel
def component_slopes(t, w, d, q, r, s, drive, scal):
    """The components' own derivatives where forces were evaluated, by places, rates and temperatures; and the wrenches
    of cut joints and springs on body 2, in the frame C2. (status, component).

    Kernels give derivatives by a step, at a step of length zero: half of those by the place.
    """
    links = t.parent.shape[0]
    for k in range(t.node.shape[0]):
        d.node[k] = 0.0
        if t.node[k] >= 0:
            w.small[380] = s[k]
            status = component_at(t, w, t.node[k], scal, w.small[380:])
            if status != 0:
                return status, t.node[k]
            d.node[k] = 2.0 * w.f[0]
    for i in range(links):
        if t.weight[i] >= 0:
            status = component_at(t, w, t.weight[i], scal, w.pose[i])
            if status != 0:
                return status, t.weight[i]
            for k in range(6):
                for j in range(6):
                    d.weight[i, k, j] = 2.0 * w.f[6 * k + j]
    x, pull = w.small[130:140], d.small[80:86]
    for i in range(t.kind.shape[0]):
        dim = t.dim[i]
        for j in range(dim):
            pull[j] = drive[t.r_at[i] + j] if t.kind[i] == CUT else 0.0
        for j in range(t.q_size[i]):
            x[j] = w.relative[i, j] if t.kind[i] == SPRING else q[t.q_at[i] + j]
        if t.spring[i] >= 0:
            status = component_at(t, w, t.spring[i], scal, x)
            if status != 0:
                return status, t.spring[i]
            for j in range(dim):
                pull[j] -= w.e[j]
                for k in range(dim):
                    d.stiffness[i, j, k] = 2.0 * w.f[dim * j + k]
        else:
            for j in range(dim):
                for k in range(dim):
                    d.stiffness[i, j, k] = 0.0
        if t.friction[i] >= 0:
            number = t.friction[i]
            for j in range(dim):
                w.e[j] = r[t.r_at[i] + j] if i < links else w.rate[i, j]
            w.e[dim] = w.temperature[t.heat[i]]
            status = component_at(t, w, number, scal, x)
            if status != 0:
                return status, number
            reads = t.dims[number, 2]
            width = dim + 1 + reads
            for j in range(dim):
                pull[j] -= w.f[j]
                for k in range(dim):
                    d.damping[i, j, k] = w.jac[width * j + k]
                    if reads == dim:
                        d.stiffness[i, j, k] += 2.0 * w.jac[width * j + dim + 1 + k]
                d.softening[i, j] = w.jac[width * j + dim]
                d.made_by_rate[i, j] = w.jac[width * dim + j]
                d.made_by_place[i, j] = 2.0 * w.jac[width * dim + dim + 1 + j] if reads == dim else 0.0
            d.made_by_warmth[i] = w.jac[width * dim + dim]
        if i >= links:
            for k in range(6):
                d.wrench[i, k] = 0.0
                for j in range(dim):
                    d.wrench[i, k] += t.left[i, j, k] * pull[j]
    for k in range(t.conduction.shape[0]):
        number, one, two = t.conduction[k, 0], t.conduction[k, 1], t.conduction[k, 2]
        w.e[0], w.e[1] = w.temperature[one], w.temperature[two]
        status = component_at(t, w, number, scal, x)
        if status != 0:
            return status, number
        for a in range(2):
            for b in range(2):
                d.flow[k, a, b] = w.jac[2 * a + b]
    return 0, 0
