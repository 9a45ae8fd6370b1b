"""States and accelerations between MuJoCo's models and the scenes imported from them, joint by joint."""

import mujoco
import numpy as np

from ephs.mechanics.imports.mjcf_names import MjcfNames
from ephs.semantics.spaces import SO3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

DIM = {"free": 6, "spherical": 3, "prismatic": 1, "revolute": 1}


def stripped(model):
    """The model without what a scene has not; returns itself."""
    disabled = mujoco.mjtDisableBit
    for bit in ("CONTACT", "LIMIT", "EQUALITY", "ACTUATION", "FRICTIONLOSS"):
        model.opt.disableflags |= int(getattr(disabled, f"mjDSBL_{bit}"))
    many = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL))
    model.dof_armature[many[model.dof_jntid]] = 0.0
    model.opt.viscosity = model.opt.density = 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))  # inertias that it keeps ready have the armature in them
    return model


def joints(model):
    """(name, kind, place in qpos, place in qvel) of the joints."""
    names = MjcfNames(model)
    rows = zip(names.joints, names.kinds, model.jnt_qposadr, model.jnt_dofadr, strict=True)
    return [(name, kind, int(q), int(v)) for name, kind, q, v in rows]


def random_state(model, rng):
    """(coordinates, rates) by joint, and what MuJoCo calls them: (qpos, qvel)."""
    qpos, qvel = model.qpos0.copy(), rng.standard_normal(model.nv)
    coordinates, rates = {}, {}
    for name, kind, at, v in joints(model):
        x = 0.7 * rng.standard_normal(DIM[kind])
        coordinates[name], rates[name] = x, qvel[v : v + DIM[kind]].copy()
        if kind == "free":  # coordinates are from where the body is at first
            before, turn = quaternion_to_matrix(model.qpos0[at + 3 : at + 7]), SO3.exp(x[:3])
            qpos[at : at + 3] += before @ x[3:]
            qpos[at + 3 : at + 7] = SO3.compose(model.qpos0[at + 3 : at + 7], turn)
            now = before @ quaternion_to_matrix(turn)
            rates[name] = np.concatenate([qvel[v + 3 : v + 6], now.T @ qvel[v : v + 3]])
        elif kind == "spherical":
            qpos[at : at + 4] = SO3.exp(x)
        else:
            qpos[at] = model.qpos0[at] + x[0]
    return coordinates, rates, qpos, qvel


def accelerations(model, data):
    """MuJoCo's accelerations by joint, as time derivatives of u_r."""
    out = {}
    for name, kind, at, v in joints(model):
        found = data.qacc[v : v + DIM[kind]].copy()
        if kind == "free":  # linear ones are of the velocity in the world
            turn, spin = quaternion_to_matrix(data.qpos[at + 3 : at + 7]), data.qvel[v + 3 : v + 6]
            found = np.concatenate([found[3:], turn.T @ found[:3] - np.cross(spin, turn.T @ data.qvel[v : v + 3])])
        out[name] = found
    return out
