"""States and accelerations of URDF robots between a scene and Pinocchio, joint by joint, by name."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

from ephs.semantics.spaces import SO3

# From Pinocchio's order of a joint's twist to that of u_r.
ORDER = {6: [3, 4, 5, 0, 1, 2], 3: [2, 0, 1]}


def frictionless(scene):
    """The scene without friction and mimicry, which Pinocchio leaves out."""
    joints = {
        name: replace(j, friction=np.zeros_like(j.friction), dry=None, motion=None) for name, j in scene.joints.items()
    }
    return replace(scene, joints=joints, gears={})


def robot(path, base):
    """Pinocchio's model of a URDF."""
    return pin.buildModelFromUrdf(str(path), *([pin.JointModelFreeFlyer()] if base == "free" else []))


def moving(scene, model):
    """(name in the scene, freedoms, Pinocchio's joint) of the joints that move."""
    known = {name.replace(".", "_"): i for i, name in enumerate(model.names)}
    return [(name, joint.dim, model.joints[known[name]]) for name, joint in scene.all_joints() if joint.dim]


def random_state(scene, model, rng):
    """(coordinates, rates) by joint, and Pinocchio's (q, v)."""
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    coordinates, rates = {}, {}
    for name, d, joint in moving(scene, model):
        x, u = 0.7 * rng.standard_normal(d), rng.standard_normal(d)
        coordinates[name], rates[name] = x, u
        at = slice(joint.idx_q, joint.idx_q + joint.nq)
        if d == 6:
            turn = SO3.exp(x[:3])
            q[at] = [*x[3:], *turn[1:], turn[0]]
        elif d == 3:  # planar
            q[at] = [*x[1:], np.cos(x[0]), np.sin(x[0])]
        elif joint.nq == 2:  # without limits: the angle on a circle
            q[at] = [np.cos(x[0]), np.sin(x[0])]
        else:
            q[at] = x
        rows = v[joint.idx_v : joint.idx_v + d]
        rows[ORDER.get(d, [0])] = u
    return coordinates, rates, q, v


def accelerations(scene, model, q, v):
    """Time derivatives of u_r by joint, and how much they may lose to rounding."""
    data = model.createData()
    found = pin.aba(model, data, q, v, np.zeros(model.nv))
    mass = pin.crba(model, data, q)
    condition = float(np.linalg.cond(np.triu(mass) + np.triu(mass, 1).T))
    out = {
        name: np.array(found[joint.idx_v : joint.idx_v + d])[ORDER.get(d, [0])]
        for name, d, joint in moving(scene, model)
    }
    return out, condition * np.finfo(float).eps


def compare(scene, model, rng, count=20):
    """Largest difference of accelerations at random states, relative to the largest, beyond what rounding explains.

    Raises
    ------
    SimulationError
        The motion is not determined.
    """
    import ephs

    dynamics, worst = ephs.dynamics(frictionless(scene)), 0.0
    for _ in range(count):
        coordinates, rates, q, v = random_state(scene, model, rng)
        expected, rounding = accelerations(scene, model, q, v)
        found = dynamics.acceleration(dynamics.state(coordinates, rates))
        largest = max(np.abs(a).max() for a in expected.values()) or 1.0
        apart = max(np.abs(found[name] - a).max() for name, a in expected.items()) / largest
        worst = max(worst, apart - 10.0 * rounding)
    return worst
