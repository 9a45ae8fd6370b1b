"""What acts on the bodies and joints of a motion beside the joints' own wrenches: at all instants, in closed form."""

from collections.abc import Iterator, Mapping
from typing import Protocol

import numpy as np

from ephs.mechanics.elements.beam import element_force
from ephs.mechanics.elements.limit import stop_force
from ephs.mechanics.motion.batch import rotations, turned
from ephs.mechanics.scene.build import drive_ports, wrench_port
from ephs.mechanics.scene.model import GROUND, Joint, Scene, Spring
from ephs.operad import Path
from ephs.semantics.bundle import Array

__all__ = ["Inputs", "Read", "body_loads", "joint_load"]

Inputs = Mapping[Path, Array]
"""(n, dim) of what is prescribed at each outer port."""


class Read(Protocol):
    """Poses (n, 7) and twists (n, 6) of a motion, by body."""

    @property
    def twists(self) -> Mapping[str, Array]:
        """(n, 6) by body."""
        ...

    def poses(self, name: str) -> Array:
        """(n, 7) of a body, or of the ground."""
        ...


def body_loads(scene: Scene, inputs: Inputs, read: Read) -> dict[str, Array]:
    """(n, 6) wrench on each body in its own frame: weight, springs, inputs, and the inertial −ad* of its momentum."""
    out: dict[str, Array] = {}
    for name, body in scene.all_bodies():
        pose = read.poses(name)
        angular, linear = read.twists[name][:, :3], read.twists[name][:, 3:]
        total = np.zeros_like(read.twists[name])
        total[:, :3] = np.cross(angular @ body.inertia, angular)
        weight = _back(pose, np.broadcast_to(scene.world.gravity, angular.shape))
        total[:, 3:] = body.mass * (weight + np.cross(linear, angular))
        if (port := wrench_port(name)) in inputs:
            total += inputs[port]
        out[name] = total
    for _, spring in scene.all_springs():
        for name, wrench in _pulls(spring, read):
            out[name] += wrench
    return out


def joint_load(joint: Joint, inputs: Inputs, coordinate: Array, rate: Array, relative: Array) -> Array:
    """(n, d) generalised force on u_r: drive and inputs, friction, stiffness.

    Parameters
    ----------
    coordinate, rate
        (n, d) of the joint.
    relative
        (n, 7) the pose of C2 in C1.
    """
    if (s := joint.strain) is not None:
        return element_force(s.length, s.stiffness, s.rest, s.damping, relative, rate)
    pull = -joint.stiffness * (coordinate - joint.rest)
    # coordinates are in the axes of C1, rates in those of C2
    if joint.kind == "planar":
        pull[:, 1:] = _back(relative, np.column_stack([pull[:, 1:], np.zeros(len(pull))]))[:, :2]
    elif joint.kind == "free":
        pull[:, 3:] = _back(relative, pull[:, 3:])
    pull -= rate @ joint.friction
    if joint.limits is not None and joint.stop is not None:
        pull += stop_force(joint.limits, joint.stop, coordinate, rate)
    if joint.motion is None:
        for port, where in drive_ports(joint):
            if port in inputs:
                pull[:, where] += inputs[port]
    return pull


def _back(poses: Array, vectors: Array) -> Array:
    """(n, 3) vectors in the axes that poses turn."""
    return np.einsum("nji,nj->ni", rotations(poses[:, :4]), vectors)


def _pulls(spring: Spring, read: Read) -> Iterator[tuple[str, Array]]:
    """The wrench (n, 6) of a spring-damper on each of its bodies."""
    ends = ((spring.body1, spring.at1), (spring.body2, spring.at2))
    places, speeds = [], []
    for name, at in ends:
        pose = read.poses(name)
        arm = np.broadcast_to(at, (len(pose), 3))
        places.append(pose[:, 4:] + turned(pose, arm))
        twist = read.twists[name] if name != GROUND else np.zeros((len(pose), 6))
        speeds.append(turned(pose, twist[:, 3:] + np.cross(twist[:, :3], arm)))
    way = places[1] - places[0]
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    along = way / np.where(distance > 0.0, distance, 1.0)
    closing = np.sum(along * (speeds[1] - speeds[0]), axis=1, keepdims=True)
    tension = (spring.stiffness * (distance - spring.length) + spring.damping * closing) * along
    for (name, at), force in zip(ends, (tension, -tension), strict=True):
        if name != GROUND:
            own = _back(read.poses(name), force)
            yield name, np.column_stack([np.cross(np.broadcast_to(at, own.shape), own), own])
