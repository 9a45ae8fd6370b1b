"""States and accelerations of URDF robots between a scene and Pinocchio, joint by joint, by name."""

import numpy as np

from ephs.semantics.spaces import SO3
from ephs.semantics.spaces.rotations import quaternion_to_matrix


def dims(scene):
    """Moving joints of a scene and how many freedoms each has."""
    return {name: joint.dim for name, joint in scene.all_joints() if joint.dim}


def random_state(scene, rng, model):
    """(coordinates, rates) by joint, and Pinocchio's (q, v)."""
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    coordinates, rates = {}, {}
    for name, d in dims(scene).items():
        joint = model.joints[model.getJointId(name)]
        x, u = 0.7 * rng.standard_normal(d), rng.standard_normal(d)
        coordinates[name], rates[name] = x, u
        at = slice(joint.idx_q, joint.idx_q + joint.nq)
        if d == 6:
            turn = SO3.exp(x[:3])
            q[at] = [*x[3:], *turn[1:], turn[0]]
            u = np.concatenate([u[3:], u[:3]])
        elif joint.nq == 2:  # without limits: the angle on a circle
            q[at] = [np.cos(x[0]), np.sin(x[0])]
        else:
            q[at] = x
        v[joint.idx_v : joint.idx_v + joint.nv] = u
    return coordinates, rates, q, v


def by_joint(scene, model, vector):
    """Pinocchio's vector of rates or accelerations, as the scene's joints have it."""
    out = {}
    for name, d in dims(scene).items():
        at = model.joints[model.getJointId(name)].idx_v
        found = np.array(vector[at : at + d])
        out[name] = np.concatenate([found[3:], found[:3]]) if d == 6 else found
    return out


def place(model, data, name):
    """Rotation and position of a link's frame."""
    frame = data.oMf[model.getFrameId(name)]
    return frame.rotation, frame.translation


def turn(body):
    """The rotation matrix of a body."""
    return quaternion_to_matrix(body.pose[:4])
