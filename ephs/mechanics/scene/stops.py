"""Limits of joints in a scene file, and the laws of their stops."""

from dataclasses import replace

import numpy as np

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.contacts import DEEP, OVERLAP
from ephs.mechanics.scene.entries import Document
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.joints import Joint, JointEntry
from ephs.mechanics.scene.model import Scene, frozen
from ephs.mechanics.scene.state import scale_of
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw

STIFF = 1e4
"""Stiffness of stops by default, in M (L ω)² of the scene's mass, length and rate: what falls by its length presses a
stop by 1/70 rad, or of its length."""
LOSS = 0.1
"""Loss of stops by default, s/rad or s/m."""


def with_stops(document: Document, scene: Scene) -> Scene:
    """The scene with the limits of its own joints."""
    found = dict(scene.joints)
    for name, table in document.sections["joints"].items():
        entry = table.entry
        sound = table.sound("limits", "limit_stiffness", "limit_loss", "limit_restitution")
        if entry.limits is None or not sound or name not in found:
            continue
        joint = found[name]
        if joint.dim != 1 or joint.motion is not None:
            what = "a joint with a prescribed motion" if joint.motion is not None else f"a {joint.kind} joint"
            table.fault("limited joint", "limits", what)
            continue
        if (law := _stop(scene, joint, table)) is not None:
            found[name] = replace(joint, limits=frozen(entry.limits), stop=law)
    return replace(scene, joints=found)


def _stop(scene: Scene, joint: Joint, table: Checked[JointEntry]) -> ConstitutiveLaw | Impact | None:
    """The law of a joint's stops, or None and a fault."""
    entry = table.entry
    if entry.limit_restitution is not None:
        soft = [name for name in ("limit_stiffness", "limit_loss") if getattr(entry, name) is not None]
        if soft:
            table.fault("hard and soft", found=f"limit_restitution and {soft[0]}", soft=soft[0])
            return None
        return Impact(entry.limit_restitution)
    stiffness = entry.limit_stiffness or _stiffness(scene, joint)
    if not stiffness:
        table.fault("no scale", "limit_stiffness", "nothing")
        return None
    return ConstitutiveLaw(stiffness=stiffness, loss=LOSS if entry.limit_loss is None else entry.limit_loss)


def _stiffness(scene: Scene, joint: Joint) -> float:
    """Default stiffness of a joint's stops, N m/rad or N/m; 0 where the scene has no rate of its own."""
    scale = scale_of(scene)
    mass = sum(body.mass for _, body in scene.all_bodies())
    return float(STIFF * mass * scale.rate**2 * (scale.length**2 if _turns(joint) else 1.0))


def _turns(joint: Joint) -> bool:
    """Whether the coordinate of a joint with one degree of freedom is an angle."""
    return bool(np.any(coupling_of(joint).basis(joint.coordinate)[:3]))


def beyond(scene: Scene, length: float, faults: list[Fault]) -> list[Fault]:
    """Joints that start beyond stops by more than a part of a radian or of a length in m; hard ones are faults."""
    found: list[Fault] = []
    for name, joint in scene.all_joints():
        if joint.limits is None:
            continue
        at, (lower, upper) = float(joint.coordinate[0]), joint.limits.tolist()
        far, key = float(np.nanmax([lower - at, at - upper])), f"joints.{name}.limits"
        if isinstance(joint.stop, Impact) and far > OVERLAP:
            faults.append(fault("beyond stop", key, f"a start {far:.3g} beyond them"))
        elif far > (most := DEEP * (1.0 if _turns(joint) else length)):
            found.append(fault("beyond soft stop", key, f"a start {far:.3g} beyond them", most=most))
    return found
