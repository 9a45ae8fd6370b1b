"""Models of MuJoCo as scenes: bodies, inertias and joints; no contacts, limits, actuators, armature or passive forces.

A body with several joints becomes a chain with frames without mass between them.
"""

import mujoco
import numpy as np

from ephs.mechanics.scene.model import GROUND, IDENTITY_POSE, Body, Joint, Scene, World, frozen
from ephs.semantics.spaces import SE3, SO3
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix

FREE, BALL, SLIDE, HINGE = range(4)
KINDS = {FREE: "free", BALL: "spherical", SLIDE: "prismatic", HINGE: "revolute"}
DIM = {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}


def stripped(model):
    """The model without what a scene has not; returns itself."""
    disabled = mujoco.mjtDisableBit
    for bit in ("CONTACT", "LIMIT", "EQUALITY", "ACTUATION", "FRICTIONLOSS", "SPRING", "DAMPER"):
        model.opt.disableflags |= int(getattr(disabled, f"mjDSBL_{bit}"))
    model.dof_armature[:] = 0.0
    model.opt.viscosity = model.opt.density = 0.0
    return model


def pose(position, quaternion):
    return SE3.normalise(np.concatenate([quaternion, position]))


def along(axis):
    """A rotation that takes z to the axis."""
    z = axis / np.linalg.norm(axis)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return matrix_to_quaternion(np.column_stack([x, np.cross(z, x), z]))


def scene_of(model):
    """The scene, all joints at zero."""
    inertial = {0: np.array(IDENTITY_POSE)}
    bodies, joints = {}, {}

    def add(name, mass, inertia):
        bodies[name] = Body(name, mass, frozen(inertia), IDENTITY_POSE, frozen(np.zeros(6)))

    for b in range(1, model.nbody):
        inertial[b] = pose(model.body_ipos[b], model.body_iquat[b])
        parent = int(model.body_parentid[b])
        before, at = (GROUND if parent == 0 else f"b{parent}"), SE3.inverse(inertial[parent])
        at = SE3.compose(at, pose(model.body_pos[b], model.body_quat[b]))
        numbers = range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b])
        kinds = [(f"j{k}", int(model.jnt_type[k]), k) for k in numbers] or [(f"w{b}", None, -1)]
        for i, (name, kind, k) in enumerate(kinds):
            last = i == len(kinds) - 1
            turn = along(model.jnt_axis[k]) if kind in (SLIDE, HINGE) else IDENTITY_POSE[:4]
            anchor = pose(model.jnt_pos[k] if kind in (BALL, HINGE) else np.zeros(3), turn)
            body = f"b{b}" if last else f"b{b}.{i}".replace(".", "_")
            frame2 = SE3.compose(SE3.inverse(inertial[b]), anchor) if last else anchor
            frame1 = anchor if kind == FREE else SE3.compose(at, anchor)
            joints[name] = _joint(name, "fixed" if kind is None else KINDS[kind], before, body, frame1, frame2)
            add(body, float(model.body_mass[b]) if last else 0.0, np.diag(model.body_inertia[b]) * last)
            before, at = body, np.array(IDENTITY_POSE)
    scene = Scene("model", World(gravity=frozen(model.opt.gravity)), bodies, joints)
    return scene.with_state({name: np.zeros(joint.dim) for name, joint in joints.items()})


def _joint(name, kind, body1, body2, frame1, frame2):
    d = {"free": 6, "spherical": 3, "fixed": 0}.get(kind, 1)
    zero = frozen(np.zeros(d))
    element = IDENTITY_POSE if kind == "free" else frozen([1.0, 0.0, 0.0, 0.0]) if kind == "spherical" else zero
    return Joint(
        name, kind, body1, body2, frozen(frame1), frozen(frame2), 0.0, frozen(np.zeros((d, d))), zero, zero,
        "environment", zero, None, element, zero,
    )  # fmt: skip


def random_state(model, rng):
    """(coordinates, rates) by joint, and what MuJoCo calls them: (qpos, qvel)."""
    qpos, qvel = model.qpos0.copy(), rng.standard_normal(model.nv)
    coordinates, rates = {}, {}
    for k in range(model.njnt):
        kind, at, v = int(model.jnt_type[k]), int(model.jnt_qposadr[k]), int(model.jnt_dofadr[k])
        x = 0.7 * rng.standard_normal(DIM[kind])
        coordinates[f"j{k}"], rates[f"j{k}"] = x, qvel[v : v + DIM[kind]].copy()
        if kind == FREE:
            turn = SO3.exp(x[:3])
            qpos[at : at + 7] = [*x[3:], *turn]
            rates[f"j{k}"] = np.concatenate([qvel[v + 3 : v + 6], quaternion_to_matrix(turn).T @ qvel[v : v + 3]])
        elif kind == BALL:
            qpos[at : at + 4] = SO3.exp(x)
        else:
            qpos[at] = model.qpos0[at] + x[0]
    return coordinates, rates, qpos, qvel


def accelerations(model, data):
    """MuJoCo's accelerations by joint, as time derivatives of u_r."""
    out = {}
    for k in range(model.njnt):
        kind, v = int(model.jnt_type[k]), int(model.jnt_dofadr[k])
        found = data.qacc[v : v + DIM[kind]].copy()
        if kind == FREE:  # linear ones are of the velocity in the world
            at = int(model.jnt_qposadr[k])
            turn, spin = quaternion_to_matrix(data.qpos[at + 3 : at + 7]), data.qvel[v + 3 : v + 6]
            found = np.concatenate([found[3:], turn.T @ found[:3] - np.cross(spin, turn.T @ data.qvel[v : v + 3])])
        out[f"j{k}"] = found
    return out
