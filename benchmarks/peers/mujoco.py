"""MuJoCo: a model file made from the scene, stepped in compiled code; loops are soft constraints, as hard as can be."""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.peers.scene import Branch, Energies, Go, PeerError, PeerRun, PeerScene, peer_scene, start
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import symmetric_eigen
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix
from ephs.show.charts.runs import Array, RunEnding, RunSetting

REACHED = 1e-6
"""Allowed missing fraction of the time at the end: sums of steps round."""
IMPEDANCE = 'solimp="0.9999 0.9999 0.001 0.5 2"'
"""Largest impedance of a closed loop."""


def integrator(method: str) -> Callable[[Scene, float], Go]:
    """Runner with one of MuJoCo's integrators."""

    def build(scene: Scene, until: float) -> Go:
        mujoco: Any = import_module("mujoco")
        given = peer_scene(scene)
        names = [name for name, _ in scene.all_bodies()]
        stages = 4 if method == "RK4" else 1

        def go(setting: RunSetting, limit: float) -> PeerRun:
            mujoco.set_mju_user_warning(silent)  # otherwise it writes a log file to the working folder
            try:
                return run(setting, limit)
            finally:
                mujoco.set_mju_user_warning(None)

        def run(setting: RunSetting, limit: float) -> PeerRun:
            model, data = mujoco_model(given, method, setting.value)
            before = _energies(mujoco, model, data)
            steps, begin = round(until / setting.value), time.perf_counter()
            for done in range(0, steps, 1000):
                mujoco.mj_step(model, data, min(1000, steps - done))
                if time.perf_counter() - begin > limit:
                    raise PeerError(f"{limit:g} s of wall time were over", RunEnding.SLOW)
            seconds = time.perf_counter() - begin
            if data.time < until * (1.0 - REACHED):  # it restarts from zero when its state is not finite
                raise PeerError("the state was not finite", RunEnding.FAILED)
            after = _energies(mujoco, model, data)
            numbers = [model.body(name).id for name in names]
            position, rotation = data.xpos[numbers].copy(), data.xmat[numbers].reshape(-1, 3, 3).copy()
            return PeerRun(position, rotation, seconds, stages * steps, steps, given.defect(before, after))

        return go

    return build


def mujoco_model(given: PeerScene, method: str, step: float) -> tuple[Any, Any]:
    """MuJoCo's model and its data in the scene's initial state.

    Parameters
    ----------
    method
        Euler, implicitfast or RK4.
    step
        In s.
    """
    mujoco: Any = import_module("mujoco")
    model = mujoco.MjModel.from_xml_string(mjcf(given, method, step))
    data = mujoco.MjData(model)
    for branch in given.branches:
        if branch.kind != "fixed":
            at = int(model.jnt_dofadr[model.joint(f"to {branch.outer}").id])
            rate = _rate(given.scene, branch)
            data.qvel[at : at + len(rate)] = rate
            if branch.drive:
                data.qfrc_applied[at] = branch.drive
    return model, data


def _energies(mujoco: Any, model: Any, data: Any) -> Energies:
    """Potential and kinetic energy in J, at the state's own places, which are left in the data."""
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return float(data.energy[1]), float(data.energy[0])


def silent(_text: str) -> None:
    """Take a warning of MuJoCo, which a run's state tells as well."""


def _rate(scene: Scene, branch: Branch) -> Array:
    """Rates of a hinge and a ball in the axes of the body, whose frame is that of its centre of mass."""
    _, twist = start(scene, branch)
    turned = quaternion_to_matrix(branch.outer_frame[:4])
    if branch.kind == "revolute":
        return twist[2:3]
    if branch.kind == "spherical":
        return turned @ twist[:3]
    body = scene.body(branch.outer)
    return np.concatenate([quaternion_to_matrix(body.pose[:4]) @ body.twist[3:], body.twist[:3]])


def mjcf(given: PeerScene, method: str, step: float) -> str:
    """The scene as a model file of MuJoCo: without contacts, loops of the time constant of two steps."""
    scene = given.scene
    bodies = dict(scene.all_bodies())
    sites: dict[str, list[str]] = {}
    tendons: list[str] = []
    for number, spring in enumerate(given.springs):
        for end, (body, at) in enumerate(zip(spring.bodies, (spring.at1, spring.at2), strict=True)):
            sites.setdefault(body, []).append(f'<site name="s{number}.{end}" pos="{_text(at)}" size="0.001"/>')
        inside = "".join(f'<site site="s{number}.{end}"/>' for end in (0, 1))
        numbers = f'springlength="{spring.length!r}" stiffness="{spring.stiffness!r}" damping="{spring.damping!r}"'
        tendons.append(f"<spatial {numbers}>{inside}</spatial>")
    below: dict[str, list[str]] = {}
    for branch in reversed(given.branches):  # from the leaves inwards: subtrees are complete
        body = bodies[branch.outer]
        base = SE3.identity() if branch.inner == GROUND else bodies[branch.inner].pose
        pose = SE3.compose(SE3.inverse(base), body.pose)
        values, axes = symmetric_eigen(body.inertia)
        axes[:, 2] *= np.linalg.det(axes)
        turn = _text(matrix_to_quaternion(axes))
        own = f'<inertial pos="0 0 0" quat="{turn}" mass="{body.mass!r}" diaginertia="{_text(values)}"/>'
        inside = "".join([*sites.get(branch.outer, []), *reversed(below.get(branch.outer, []))])
        place = f'pos="{_text(pose[4:])}" quat="{_text(pose[:4])}"'
        text = f'<body name="{branch.outer}" {place}>{_joint(branch)}{own}{inside}</body>'
        below.setdefault(branch.inner, []).append(text)
    loops = "".join(_closure(closure, step) for closure in given.closures)
    unused = '<flag contact="disable"/>' if loops else '<flag contact="disable" constraint="disable"/>'
    solver = 'tolerance="1e-14" iterations="100" solver="Newton"' if loops else ""
    return (
        '<mujoco><compiler angle="radian" autolimits="false" boundmass="0" boundinertia="0" balanceinertia="false"/>'
        f'<option timestep="{step!r}" gravity="{_text(scene.world.gravity)}" integrator="{method}" {solver}>'
        f"{unused}</option><worldbody>{''.join([*sites.get(GROUND, []), *reversed(below.get(GROUND, []))])}</worldbody>"
        f"<equality>{loops}</equality><tendon>{''.join(tendons)}</tendon></mujoco>"
    )


def _joint(branch: Branch) -> str:
    name, pos = f"to {branch.outer}", _text(branch.outer_frame[4:])
    if branch.kind == "revolute":
        axis = quaternion_to_matrix(branch.outer_frame[:4])[:, 2]
        return f'<joint name="{name}" type="hinge" axis="{_text(axis)}" pos="{pos}"/>'
    if branch.kind == "spherical":
        return f'<joint name="{name}" type="ball" pos="{pos}"/>'
    return f'<freejoint name="{name}"/>' if branch.kind == "free" else ""


def _closure(closure: tuple[str, str, Array, Array], step: float) -> str:
    """A point of body 1 in which the two are connected; body 2's point coincides with it at the start."""
    one, two, point, other = closure
    if one == GROUND:
        one, two, point = two, one, other
    end = "" if two == GROUND else f'body2="{two}"'
    return f'<connect body1="{one}" {end} anchor="{_text(point)}" solref="{2.0 * step!r} 1" {IMPEDANCE}/>'


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))
