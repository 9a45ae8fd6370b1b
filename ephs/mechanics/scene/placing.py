"""Joint frames, from `at` and `axis` in the world or from a frame in each body."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.entries import Checked
from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.geometry import ROUND, UNIVERSAL, frame_rotation, unit
from ephs.mechanics.scene.schema import FrameEntry, JointEntry
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ALIGNED


@final
@dataclass(frozen=True, slots=True)
class Place:
    """A joint's frames C1 and C2, (7,): in the bodies, or in the world at zero coordinates.

    With frames in the bodies the same conventions hold as for every pair: C1 and C2 coincide at zero
    coordinates. The frame C2 of a universal joint is then already turned to have its z axis along the second
    axis, and ``middle`` (7,) is the pose between the two revolute joints.
    """

    frame1: Array
    frame2: Array
    in_bodies: bool
    middle: Array | None = None


def resolve_place(table: Checked[JointEntry], key: str, faults: list[Fault]) -> Place | None:
    """A joint's place; None, with a fault, where it is invalid."""
    entry = table.entry
    if not table.sound("at", "axis", "xaxis", "axis2", "frame1", "frame2"):
        return None
    count = len(faults)
    if entry.axis2 is not None and entry.type != UNIVERSAL:
        faults.append(fault("only universal", f"{key}.axis2", shown(entry.axis2), kind=entry.type))
    in_world, in_bodies = entry.at or entry.axis, entry.frame1 or entry.frame2
    if in_world and in_bodies:
        names = [name for name in ("at", "axis", "frame1", "frame2") if getattr(entry, name) is not None]
        faults.append(fault("both places", key, f"{', '.join(names[:-1])} and {names[-1]}"))
        return None
    place = _in_bodies(entry, key, faults) if in_bodies else _in_world(entry, key, faults)
    return place if len(faults) == count else None


def _in_world(entry: JointEntry, key: str, faults: list[Fault]) -> Place | None:
    required = {"at": entry.at, "axis": entry.axis} if entry.type not in ROUND else {"at": entry.at}
    if not any(required.values()):
        faults.append(fault("no place", key, "nothing that says where the joint is", what="at and axis"))
        return None
    for name, value in required.items():
        if value is None:
            faults.append(fault("no place", f"{key}.{name}", "nothing", what=_described(name)))
    z = _direction(entry.axis or [0.0, 0.0, 1.0], f"{key}.axis", faults)
    x = None if entry.xaxis is None else np.array(entry.xaxis)
    rotation = frame_rotation(z, x)
    if rotation is None:
        faults.append(fault("xaxis", f"{key}.xaxis", shown(entry.xaxis)))
        return None
    world1 = np.concatenate((rotation, entry.at or [0.0, 0.0, 0.0]))
    if entry.type != UNIVERSAL:
        return Place(world1, world1, in_bodies=False)
    if entry.axis2 is None:
        faults.append(
            fault("missing", f"{key}.axis2", "nothing", what="the world direction of the axis fixed in body 2")
        )
        return None
    rotation2 = _second(z, entry.axis2, f"{key}.axis2", faults)
    world2 = np.concatenate((rotation2, world1[4:]))
    return Place(world1, world2, in_bodies=False, middle=SE3.compose(SE3.inverse(world1), world2))


def _in_bodies(entry: JointEntry, key: str, faults: list[Fault]) -> Place | None:
    if entry.xaxis is not None:
        faults.append(fault("xaxis with frames", f"{key}.xaxis", shown(entry.xaxis)))
    frames = [_frame(entry, name, key, faults) for name in ("frame1", "frame2")]
    if entry.type != UNIVERSAL:
        return Place(frames[0], frames[1], in_bodies=True)
    # The second axis in the axes of C1, at zero angles; by default normal to the first.
    rotation = _second(np.array([0.0, 0.0, 1.0]), entry.axis2 or [0.0, 1.0, 0.0], f"{key}.axis2", faults)
    middle = np.concatenate((rotation, np.zeros(3)))
    return Place(frames[0], SE3.compose(frames[1], middle), in_bodies=True, middle=middle)


def _frame(entry: JointEntry, name: str, key: str, faults: list[Fault]) -> Array:
    frame: FrameEntry | None = getattr(entry, name)
    if frame is None:
        faults.append(fault("no place", f"{key}.{name}", "nothing", what="the joint frame in this body too"))
        return values.pose(None, None, key, faults)
    return values.pose(frame.position, frame.rotation, f"{key}.{name}", faults)


def _second(z: Array, axis2: list[float], key: str, faults: list[Fault]) -> Array:
    """The rotation of the frame whose z axis is the second axis of a universal joint."""
    z2 = _direction(axis2, key, faults)
    if np.linalg.norm(np.cross(z, z2)) < ALIGNED:
        faults.append(fault("parallel", key, shown(axis2), other="axis"))
    rotation: Any = frame_rotation(z2)
    return rotation


def _direction(vector: list[float], key: str, faults: list[Fault]) -> Array:
    direction = unit(np.array(vector))
    if direction is None:
        faults.append(fault("direction", key, shown(vector)))
        return np.array([0.0, 0.0, 1.0])
    return direction


def _described(name: str) -> str:
    return {
        "at": "the joint origin in world coordinates",
        "axis": "the world direction of the joint frame's z axis",
    }[name]
