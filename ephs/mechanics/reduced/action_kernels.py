"""The Lagrangian of a mechanism in joint coordinates, and its derivatives."""

# numba infers the types of these functions, and exports what it does not list.
# pyright: basic, reportPrivateImportUsage=false

from ephs.mechanics.reduced.sweep_kernels import bracket, cross_momentum, forces, inertia_sweep, kinematics, lift
from ephs.semantics.spaces import jit

kernel = jit.kernel


@kernel
def action_derivatives(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers, momentum, force):
    """∂L/∂r, and ∂L/∂q with the forces that no potential has, left-trivialised; (status, component).

    A change δ of a joint's element moves its link by S δ, and with it all that is carried further out:
    δu = [u, S δ] for the link's twist u, without the joint's own part where S does not move with the joint.
    """
    links, n = t.parent.shape[0], w.mass.shape[0]
    kinematics(t, w, q, r)
    status, component = forces(t, w, q, r, s, drive, wrench, scal, s_rate, made, powers)
    if status != 0:
        return status, component
    own, turned = w.small[330:336], w.small[336:342]
    for i in range(links):  # loads without those of inertia
        for k in range(6):
            own[k] = 0.0
            for j in range(6):
                own[k] += t.inertia[i, k, j] * w.twist[i, j]
                w.load[i, k] -= t.inertia[i, k, j] * w.bias[i, j]
        cross_momentum(w.twist[i], own, turned)
        for k in range(6):
            w.load[i, k] += turned[k]
    still = inertia_sweep(t, w)
    if still != 0:
        return 20, still - 1
    for i in range(n):
        force[i] = w.force[i]
        momentum[i] = 0.0
        for j in range(n):
            momentum[i] += w.mass[i, j] * r[j]
    # w.load has done its work: from here on it holds the momenta of the links and what they carry
    for i in range(links):
        for k in range(6):
            w.load[i, k] = 0.0
            for j in range(6):
                w.load[i, k] += t.inertia[i, k, j] * w.twist[i, j]
    moving, other = w.small[342:348], w.small[348:354]
    for i in range(links - 1, -1, -1):
        for k in range(6):
            moving[k] = w.twist[i, k]
        if t.forward[i] == 1:
            for j in range(t.dim[i]):
                for k in range(6):
                    moving[k] -= w.motion[i, j, k] * r[t.r_at[i] + j]
        for j in range(t.dim[i]):
            bracket(moving, w.motion[i, j], own)
            for k in range(6):
                force[t.r_at[i] + j] += w.load[i, k] * own[k]
        if t.parent[i] >= 0:
            lift(w.inner[i], w.load[i], other, w.small)
            for k in range(6):
                w.load[t.parent[i], k] += other[k]
    return 0, 0
