"""A motion of a scene as labelled arrays and in figures: bodies, joints, thermal nodes, markers."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import Joint, Scene
from ephs.mechanics.scene.own_units import mobility_of
from ephs.semantics.bundles.bundle import Array
from ephs.solve.result.dataset import DatasetVariable
from ephs.solve.result.labels import POSE, TWIST, WRENCH, Labels, freedoms
from ephs.solve.result.solution import Solution

AXIS = ("axis", ("x", "y", "z"))
UNIVERSAL = Labels("universal", ("angle 1", "angle 2"), ("rad", "rad"))


class Reading(Protocol):
    """The motion of a scene, by name."""

    def body(self, name: str) -> Any:
        """The motion of a body."""
        ...

    def joint(self, name: str) -> Any:
        """The motion of a joint."""
        ...

    def thermal(self, name: str) -> Any:
        """The temperature of a thermal node."""
        ...

    def marker(self, name: str) -> Any:
        """The motion of a marker."""
        ...


def freedoms_of(joint: Joint) -> Labels:
    """Names and units of a joint's coordinates."""
    return UNIVERSAL if joint.middle is not None else freedoms(coupling_of(joint).pair)


def variables(scene: Scene, motion: Reading, *, wrenches: bool) -> dict[str, DatasetVariable]:
    """Arrays of a motion, under ``body_position``, ``coordinate:JOINT`` and the like."""
    out: dict[str, DatasetVariable] = {}
    bodies, joints = [name for name, _ in scene.all_bodies()], [name for name, _ in scene.all_joints()]
    nodes, markers = [name for name, _ in scene.all_thermal()], [name for name, _ in scene.all_markers()]
    if bodies:
        of, read = ("body", tuple(bodies)), [motion.body(name) for name in bodies]
        four = ("quaternion", POSE.names[:4])
        turning = [body.quaternion for body in read]
        moving = [body.twist for body in read]
        out |= {
            "body_position": _stack([b.position for b in read], "m", "centre of mass in the world", of, AXIS),
            "body_quaternion": _stack(turning, "1", "body axes to world axes", of, four),
            "body_velocity": _stack([b.velocity for b in read], "m/s", "of the centre of mass, world axes", of, AXIS),
            "body_twist": _stack(moving, TWIST.unit, "velocities in body axes", of, (TWIST.dimension, TWIST.names)),
        }
    for name, joint in (*scene.all_joints(), *scene.implicit_joints()):
        labels, seen = freedoms_of(joint), motion.joint(name)
        rates = Labels(labels.dimension, labels.names, tuple(f"{unit}/s" for unit in labels.units))
        out[f"coordinate:{name}"] = DatasetVariable.of(seen.coordinate, labels, f"coordinates of {name}")
        out[f"rate:{name}"] = DatasetVariable.of(seen.rate, rates, f"twist of {name} in the axes of C2")
    if wrenches and joints:
        of, six = ("joint", tuple(joints)), (WRENCH.dimension, WRENCH.names)
        values = [motion.joint(name).wrench for name in joints]
        out["joint_wrench"] = _stack(values, WRENCH.unit, "on body 2, in the axes of C2; NaN: indeterminate", of, six)
    if nodes:
        values = [motion.thermal(name).temperature for name in nodes]
        out["temperature"] = _stack(values, "K", "of thermal nodes", ("node", tuple(nodes)))
    if markers:
        of, read = ("marker", tuple(markers)), [motion.marker(name) for name in markers]
        out["marker_position"] = _stack([m.position for m in read], "m", "in the world", of, AXIS)
        out["marker_velocity"] = _stack([m.velocity for m in read], "m/s", "in the world", of, AXIS)
    return out


def _stack(values: list[Array], units: str, says: str, *axes: tuple[str, tuple[str, ...]]) -> DatasetVariable:
    return DatasetVariable(np.stack(values, axis=1), units, says, axes)


def summary(scene: Scene, solution: Solution, motion: Any, joints: Sequence[str]) -> dict[str, Any]:
    """Values at the end, mobility, and the number of redundant constraints; ``joints`` are all, implicit ones too."""
    out: dict[str, Any] = {}
    if solution.problem is not None:
        found = mobility_of(solution.problem)
        out |= {"mobility": found.mobility, "redundant_constraints": found.redundant}
    if scene.adjusted is not None:
        out["adjusted"] = asdict(scene.adjusted)
    if not len(solution):
        return out | {"bodies": {}, "joints": {}, "thermal": {}}
    return out | {
        **ends(motion, [name for name, _ in scene.all_bodies()], joints),
        "thermal": {
            name: {"temperature": float(motion.thermal(name).temperature[-1])} for name, _ in scene.all_thermal()
        },
    }


def ends(motion: Any, bodies: Iterable[str], joints: Iterable[str]) -> dict[str, Any]:
    """Poses and velocities of bodies, coordinates and rates of joints at the end."""
    read, turning = {name: motion.body(name) for name in bodies}, {name: motion.joint(name) for name in joints}
    return {
        "bodies": {
            name: {
                "position": body.position[-1].tolist(),
                "quaternion": body.quaternion[-1].tolist(),
                "velocity": body.velocity[-1].tolist(),
                "angular_velocity": body.angular_velocity[-1].tolist(),
            }
            for name, body in read.items()
        },
        "joints": {
            name: {"coordinate": joint.coordinate[-1].tolist(), "rate": joint.rate[-1].tolist()}
            for name, joint in turning.items()
        },
    }
