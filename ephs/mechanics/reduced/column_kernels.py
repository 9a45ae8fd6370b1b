"""The derivatives of a mechanism's equations by all joints at once, in the world's frame.

There a joint's change moves all that it carries alike: with its axis J, every link k beyond has η = J, δu = B, and
δu̇ = a + [B, v_k], so that forces beyond a joint i change by Iᶜa + DᶜB + GᶜJ with sums over the links that i carries,
D = −I ad_v − (I ad_v)ᵀ − (b ↦ ad*_b I v). An entry costs some products of 6-vectors. `tangent` says the same one
direction at a time.
"""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.slope_kernels import frame, into, out_of
from ephs.mechanics.reduced.sweep_kernels import bracket, cross_momentum
from ephs.mechanics.reduced.tables import CUT
from ephs.mechanics.reduced.tangent_kernels import change_of_edge
from ephs.semantics.spaces import jit
from ephs.semantics.spaces.se3_kernels import adjoint_apply, adjoint_inverse, pose_compose

kernel = jit.lean_kernel


@kernel
def gather_world(t, w, d):
    """Axes, velocities, loads, and the sums over what each link carries, in the world's frame."""
    links = t.parent.shape[0]
    back, left, unit, one = d.wide[0], d.wide[1], d.small[0:6], d.small[6:12]
    for i in range(links):
        adjoint_apply(w.pose[i], w.twist[i], d.velocity[i])
        adjoint_apply(w.pose[i], d.speed[i], d.surge[i])
        for j in range(t.dim[i]):
            adjoint_apply(w.pose[i], w.motion[i, j], d.axis[i, j])
        frame(w.pose[i], d.world_turn, d.world_place)
        for k in range(6):
            d.carried[i, k] = 0.0
        out_of(d.world_turn, d.world_place, d.total[i], d.carried[i], 1.0)
        for k in range(6):
            one[k] = 0.0
            for j in range(6):
                one[k] += t.inertia[i, k, j] * w.twist[i, j]
        for j in range(6):  # column j of D, in the body's frame
            for k in range(6):
                unit[k] = 1.0 if k == j else 0.0
            bracket(w.twist[i], unit, d.small[12:18])
            cross_momentum(unit, one, d.small[18:24])
            for k in range(6):
                entry = 0.0
                for m in range(6):
                    entry += t.inertia[i, k, m] * d.small[12 + m]
                left[k, j] = entry
                d.drift[i, k, j] = -d.small[18 + k]
        for j in range(6):
            for k in range(6):
                d.drift[i, k, j] -= left[k, j] + left[j, k]
        adjoint_inverse(w.pose[i], back)
        _congruent(t.inertia[i], back, left, d.heft[i])
        _congruent(d.drift[i], back, left, d.drift[i])
        if t.weight[i] >= 0:
            _congruent(d.weight[i], back, left, d.pulled[i])
        else:
            for k in range(6):
                for j in range(6):
                    d.pulled[i, k, j] = 0.0
    for i in range(links - 1, -1, -1):
        parent = t.parent[i]
        if parent >= 0:
            for k in range(6):
                for j in range(6):
                    d.heft[parent, k, j] += d.heft[i, k, j]
                    d.drift[parent, k, j] += d.drift[i, k, j]
                    d.pulled[parent, k, j] += d.pulled[i, k, j]
        for j in range(t.dim[i]):
            for m in range(6):
                a = b = c = 0.0
                for k in range(6):
                    a += d.axis[i, j, k] * d.heft[i, k, m]
                    b += d.axis[i, j, k] * d.drift[i, k, m]
                    c += d.axis[i, j, k] * d.pulled[i, k, m]
                d.by_gain[i, j, m], d.by_drift[i, j, m], d.by_place[i, j, m] = a, b, c
    pose = d.small[24:31]
    for i in range(links, t.kind.shape[0]):
        if t.second[i] >= 0:
            pose_compose(w.pose[t.second[i]], t.offset2[i], pose)
        else:
            for k in range(7):
                pose[k] = t.offset2[i, k]
        frame(pose, d.corner_turn[i], d.corner_place[i])


@kernel
def _congruent(a, back, product, out):
    """out = backᵀ a back; out may alias a."""
    for k in range(6):
        for j in range(6):
            entry = 0.0
            for m in range(6):
                entry += a[k, m] * back[m, j]
            product[k, j] = entry
    for k in range(6):
        for j in range(6):
            entry = 0.0
            for m in range(6):
                entry += back[m, k] * product[m, j]
            out[k, j] = entry


@kernel
def column(t, w, d, link, freedom, turning, fit):
    """The changes by one freedom of a tree joint: of its element (turning = 1) or of its rate (0), as `tangent` leaves
    them. Memory for changes must be zero."""
    links, n = t.parent.shape[0], t.driven.shape[0]
    axis, spun, gain, one = d.axis[link, freedom], d.small[0:6], d.small[6:12], d.small[12:18]
    two, three = d.small[18:24], d.small[24:30]
    if turning == 1:
        sigma = w.motion[link, freedom]
        bracket(d.moving[link], sigma, one)
        adjoint_apply(w.pose[link], one, spun)
        bracket(d.lifted[link], sigma, two)
        bracket(one, d.along[link], three)
        for k in range(6):
            two[k] += three[k]
        if t.forward[link] == 0:
            bracket(d.along[link], sigma, one)
            bracket(w.twist[link], one, three)
            for k in range(6):
                two[k] += three[k]
        adjoint_apply(w.pose[link], two, gain)
        bracket(spun, d.velocity[link], one)
        for k in range(6):
            gain[k] -= one[k]
    else:
        parent = t.parent[link]
        for k in range(6):
            spun[k] = axis[k]
            one[k] = d.velocity[link, k] + (d.velocity[parent, k] if parent >= 0 else 0.0)
        bracket(one, axis, gain)
    for i in range(n):
        d.force[i] = 0.0
    for i in range(links):
        d.stirred[i] = i == link or (i > link and t.parent[i] >= 0 and d.stirred[t.parent[i]])
        if d.stirred[i]:
            for j in range(t.dim[i]):
                entry = 0.0
                for k in range(6):
                    entry += d.by_gain[i, j, k] * gain[k] + d.by_drift[i, j, k] * spun[k]
                    if turning == 1:
                        entry += d.by_place[i, j, k] * axis[k]
                d.force[t.r_at[i] + j] = entry
    for k in range(6):
        entry = 0.0
        for m in range(6):
            entry += d.heft[link, k, m] * gain[m] + d.drift[link, k, m] * spun[m]
            if turning == 1:
                entry += d.pulled[link, k, m] * axis[m]
        one[k] = entry
    if turning == 1:
        cross_momentum(axis, d.carried[link], two)
        for k in range(6):
            one[k] -= two[k]
        if t.forward[link] == 0:
            for j in range(t.dim[link]):
                entry = 0.0
                for k in range(6):
                    entry -= d.axis[link, j, k] * two[k]
                d.force[t.r_at[link] + j] += entry
    if t.parent[link] >= 0:
        _pass_down(t, d, t.parent[link], one, 1.0)
    _own(t, d, link, freedom, turning)
    m = 0
    for j in range(n):
        if t.driven[j] == 1:
            d.row[m] = 0.0
            m += 1
    for i in range(links, t.kind.shape[0]):
        first = t.first[i] >= 0 and d.stirred[t.first[i]]
        second = t.second[i] >= 0 and d.stirred[t.second[i]]
        if first != second:
            _opened(t, d, i, axis, spun, gain, second, turning, fit, m)
        elif t.kind[i] == CUT:
            for j in range(t.dim[i]):
                d.cut[t.r_at[i] - n + j] = 0.0
            for a in range(t.rows[i]):
                d.row[m + a] = 0.0
        m += t.rows[i]


@kernel
def _own(t, d, link, freedom, turning):
    """What the joint's own spring and friction do."""
    for k in range(t.node.shape[0]):
        d.heat[k] = 0.0
    for j in range(t.dim[link]):
        slope = d.stiffness[link, j, freedom] if turning == 1 else d.damping[link, j, freedom]
        d.force[t.r_at[link] + j] += slope
    if t.friction[link] >= 0:
        made = d.made_by_place[link, freedom] if turning == 1 else d.made_by_rate[link, freedom]
        d.heat[t.heat[link]] -= made


@kernel
def _pass_down(t, d, link, wrench, sign):
    """A change of loads on a link, felt by the joints that carry it."""
    here = link
    while here >= 0:
        for j in range(t.dim[here]):
            entry = 0.0
            for k in range(6):
                entry += d.axis[here, j, k] * wrench[k]
            d.force[t.r_at[here] + j] += sign * entry
        here = t.parent[here]


@kernel
def _opened(t, d, i, axis, spun, gain, second, turning, fit, m):
    """A spring or a cut joint of which one body moves: its wrench, the acceleration of what closes it, its rate."""
    n, sign = t.driven.shape[0], 1.0 if second else -1.0
    one, two, three, zeta = d.small[30:36], d.small[36:42], d.small[42:48], d.small[48:54]
    slip, held = d.small[78:84], d.small[84:90]
    moved = t.second[i] if second else t.first[i]
    for k in range(6):
        zeta[k] = sign * axis[k] if turning == 1 else 0.0
        one[k] = three[k] = 0.0
        held[k] = 0.0 if second else spun[k]
        slip[k] = sign * spun[k]
    bracket(spun, d.velocity[moved], two)
    for k in range(6):
        three[k] = sign * (gain[k] + two[k])
    if t.first[i] >= 0:
        bracket(d.velocity[t.first[i]], zeta, one)
        for k in range(6):
            held[k] += one[k]
            slip[k] -= one[k]
        bracket(d.surge[t.first[i]], zeta, one)
        bracket(slip, d.velocity[t.first[i]], two)
        for k in range(6):
            three[k] += two[k] - one[k]
    for k in range(6):
        one[k] = 0.0
        if t.second[i] >= 0:
            one[k] += d.velocity[t.second[i], k]
        if t.first[i] >= 0:
            one[k] -= d.velocity[t.first[i], k]
    bracket(one, held, two)
    for k in range(6):
        three[k] += two[k]
    turn, place = d.corner_turn[i], d.corner_place[i]
    into(turn, place, three, one)
    for a in range(t.rows[i]):
        entry = 0.0
        for k in range(6):
            entry += t.normal[i, a, k] * one[k]
        d.row[m + a] = entry
    into(turn, place, zeta, two)
    into(turn, place, slip, three)
    change_of_edge(t, d, i, two, three, fit, one)
    if t.kind[i] == CUT:
        for j in range(t.dim[i]):
            d.cut[t.r_at[i] - n + j] = d.drate[j]
    for k in range(6):
        three[k] = d.wrench[i, k] + d.closing[i, k]
    cross_momentum(two, three, zeta)
    for k in range(6):
        two[k] = one[k] - zeta[k]
        slip[k] = held[k] = 0.0
    out_of(turn, place, one, slip, -1.0)
    out_of(turn, place, two, held, 1.0)
    if t.second[i] >= 0:
        _pass_down(t, d, t.second[i], slip, 1.0)
    if t.first[i] >= 0:
        _pass_down(t, d, t.first[i], held, 1.0)
