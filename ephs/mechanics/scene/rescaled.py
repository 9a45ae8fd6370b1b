"""A scene in other units of length, mass and time: the same mechanism, all its numbers changed."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ephs.mechanics.scene.element import JOINTS, POSE, SceneElement
from ephs.mechanics.scene.geometry import JointCoupling, coupling_of
from ephs.mechanics.scene.model import ELEMENTS, Joint, Scene, frozen, mapped
from ephs.semantics.bundles.bundle import Array


def rescaled(scene: Scene, length: float = 1.0, mass: float = 1.0, time: float = 1.0) -> Scene:
    """The scene with every length multiplied by ``length``, every mass and time likewise; temperatures stay.

    By powers of two nothing is rounded. Shapes for pictures stay as they are.
    """
    units = length, mass, time

    def other(path: str, x: SceneElement) -> SceneElement:
        if isinstance(x, Joint):
            return _joint(x, *units)
        tied = (scene.joint(path + name) for _, kind, name in x.references() if kind in JOINTS)
        return x.rescaled(*units, _firsts(tied, length))

    registered = {section for _, level in scene.levels() for section in level.elements}
    changes = dict.fromkeys((*ELEMENTS, *registered), other)
    pose = POSE.unit(*units, ())
    return mapped(scene, changes, scene.world.rescaled(*units), origin=lambda there: frozen(there * pose))


def _firsts(joints: Iterable[Joint], length: float) -> tuple[float, ...]:
    """The unit of the first coordinate of each joint; of none the length."""
    found = [freedom_units(coupling_of(j), j.coordinate, length) for j in joints]
    return tuple(float(unit[0]) if unit.size else 1.0 for unit in found) or (length,)


def _joint(j: Joint, length: float, mass: float, time: float) -> Joint:
    unit = freedom_units(coupling_of(j), j.coordinate, length)
    inertia = mass * length**2
    force = inertia / time**2 / unit
    return replace(
        j.rescaled(length, mass, time, tuple(unit.tolist())),
        motion=None if j.motion is None else j.motion.rescaled(float(unit[0]), time),
        coordinate=frozen(j.coordinate * element_units(j.coordinate.size, unit, length)),
        limits=None if j.limits is None else frozen(j.limits * unit[0]),
        stop=None if j.stop is None else j.stop.rescaled(float(unit[0]), inertia / unit[0] ** 2, time),
        dry=None if j.dry is None else j.dry.rescaled(float(force[0]), float(unit[0] / time)),
        strain=None if j.strain is None else j.strain.rescaled(length, mass, time),
    )


def freedom_units(of: JointCoupling, x: Array, length: float) -> Array:
    """(d,) the unit of each coordinate of a joint at its element x: 1 for angles, of screws too, else the length."""
    return np.where(np.any(of.basis(x)[:3], axis=0), 1.0, length)


def element_units(size: int, unit: Array, length: float) -> Array:
    """(size,) units of a joint's element: of its coordinates, or of a quaternion and a position."""
    return unit if size == unit.size else np.array([1.0] * 4 + [length] * 3)[:size]
