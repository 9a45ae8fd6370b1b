"""Tendons of a scene file as bodies and joints: straight between points of bodies, sliding freely through them.

Between two points whose bodies differ there is a telescope, its mass at the points: a universal joint at the first, a
slide, a spherical joint at the second. These six degrees of freedom hold nothing; the slide's coordinate is how much
longer the segment is than at the start. The tendon's spring and damper lie along the sum of these, as a belt's, and
what pulls it is an actuator of its name. A segment may not come to lie along the first axis of its universal joint,
which is that of a revolute joint of one of its bodies where there is one across it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.attached import Actuator, Gear
from ephs.mechanics.scene.entries import Checked, Document, shown
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.geometry import UNIVERSAL, frame_rotation
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, IDENTITY_POSE, Body, Joint, frozen
from ephs.mechanics.scene.placing import Place
from ephs.mechanics.scene.resolve import BodyDraft, JointDraft, Names
from ephs.mechanics.scene.schema_flexible import TendonEntry
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.semantics.spaces.rotations import quaternion_to_matrix

__all__ = ["TendonDraft", "resolve_tendons"]

Array = NDArray[np.float64]
ACROSS = 0.1
"""Sine of the least angle between a segment and an axis that counts as across it."""
SLIM = 0.004
"""Radius of a segment by its length at the start, for pictures."""


@final
@dataclass(frozen=True, slots=True)
class TendonDraft:
    """A tendon's frames and its joints, and what is attached to its slides; no gear where these are
    one, or where it has no spring.
    """

    bodies: tuple[BodyDraft, ...]
    joints: tuple[JointDraft, ...]
    gear: Gear | None
    actuator: Actuator


def resolve_tendons(
    document: Document, bodies: Mapping[str, Body], joints: Mapping[str, Joint], names: Names, faults: list[Fault]
) -> dict[str, TendonDraft]:
    """The tendons of a file, of bodies where they start; ``joints`` are the other ones there."""
    out: dict[str, TendonDraft] = {}
    sections, axes = document.sections, _axes(bodies, joints)
    for name, table in sections["tendons"].items():
        count = len(faults)
        _check(name, table, names, faults)
        if len(faults) > count or table.spoiled:
            continue
        found = _resolved(name, table.entry, bodies, axes, faults)
        if found is None:
            continue
        taken = [("bodies", b.name) for b in found.bodies] + [("joints", j.name) for j in found.joints]
        for section, each in (*taken, ("gears", name), ("actuators", name)):
            if each in sections[section]:
                faults.append(fault("collision", f"{section}.{each}", shown(each), other=f"the tendon {name}"))
        out[name] = found
    return out


def _check(name: str, table: Checked[TendonEntry], names: Names, faults: list[Fault]) -> None:
    entry, key = table.entry, f"tendons.{name}"
    if table.sound("heat"):
        names.check(entry.heat, f"{key}.heat", "thermal", faults)
    if not table.sound("bodies", "points"):
        return
    for i, body in enumerate(entry.bodies):
        names.check(body, f"{key}.bodies[{i}]", "body", faults)
    if len(entry.points) != len(entry.bodies):
        faults.append(fault("tendon points", f"{key}.points", len(entry.points), count=len(entry.bodies)))


def _resolved(
    name: str, entry: TendonEntry, bodies: Mapping[str, Body], axes: Sequence[tuple[str, Array]], faults: list[Fault]
) -> TendonDraft | None:
    key = f"tendons.{name}"
    spots = [_Spot.of(body, np.array(at), bodies) for body, at in zip(entry.bodies, entry.points, strict=True)]
    lengths = [float(np.linalg.norm(b.place - a.place)) for a, b in pairwise(spots)]
    moving = [i for i in range(len(lengths)) if spots[i].body != spots[i + 1].body]
    whole = sum(lengths)
    short = [i for i in moving if lengths[i] <= ASSEMBLY * whole]
    faults += [fault("same ends", f"{key}.points[{i + 1}]", "where the point before is at the start") for i in short]
    if not moving:
        faults.append(fault("tendon bodies", f"{key}.bodies", shown(entry.bodies)))
    if entry.damping and not entry.stiffness and len(moving) > 1:
        faults.append(fault("tendon damping", f"{key}.damping", entry.damping))
    if short or not moving or (entry.damping and not entry.stiffness and len(moving) > 1):
        return None
    stretch = 0.0 if entry.length is None else whole - entry.length
    slides = tuple(f"{name}-{k}" for k in range(1, len(moving) + 1))
    made = [
        _telescope(slide, spots[i], spots[i + 1], entry.mass / len(moving), _first_axis(spots[i], spots[i + 1], axes))
        for slide, i in zip(slides, moving, strict=True)
    ]
    tied = [j for _, three in made for j in three]
    gear = None
    if len(moving) == 1:
        sprung = {"stiffness": np.array([entry.stiffness]), "rest": np.array([-stretch if entry.stiffness else 0.0])}
        tied[1] = replace(tied[1], friction=np.array([[entry.damping]]), heat=entry.heat, **sprung)
    elif entry.stiffness:
        ratio = frozen(-np.ones(len(moving) - 1))
        gear = Gear(name, slides, ratio, entry.stiffness, entry.damping, 0.0, entry.heat, stretch)
    pulls = Actuator(name, slides, frozen(-np.ones(len(moving))), None)
    return TendonDraft(tuple(b for two, _ in made for b in two), tuple(tied), gear, pulls)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Spot:
    """A point of a body where the scene starts: its place and velocity (3,), the body's angular velocity, in the
    world.
    """

    body: str
    place: Array
    velocity: Array
    spin: Array

    @classmethod
    def of(cls, name: str, at: Array, bodies: Mapping[str, Body]) -> "_Spot":
        if name == GROUND:
            return cls(name, at, np.zeros(3), np.zeros(3))
        body = bodies[name]
        turn = quaternion_to_matrix(body.pose[:4])
        spin, speed = turn @ body.twist[:3], turn @ body.twist[3:]
        arm = turn @ at
        return cls(name, body.pose[4:] + arm, speed + np.cross(spin, arm), spin)


def _first_axis(one: _Spot, two: _Spot, axes: Sequence[tuple[str, Array]]) -> Array:
    """A direction across a segment: that of a revolute joint of one of its bodies, if it can be, else the world's."""
    along = (two.place - one.place) / np.linalg.norm(two.place - one.place)
    given = [axis for spot in (one, two) for body, axis in axes if body == spot.body and body != GROUND]
    world = [np.eye(3)[k] for k in np.argsort(np.abs(along))]
    across = (axis - along * (along @ axis) for axis in (*given, *world))
    found = next(each for each in across if np.linalg.norm(each) > ACROSS)
    return found / np.linalg.norm(found)


def _axes(bodies: Mapping[str, Body], joints: Mapping[str, Joint]) -> list[tuple[str, Array]]:
    """The axes (3,) of revolute joints in the world, by both of their bodies."""
    found: list[tuple[str, Array]] = []
    for joint in joints.values():
        if joint.kind == "revolute":
            carrier = IDENTITY_POSE if joint.body1 == GROUND else bodies[joint.body1].pose
            axis = quaternion_to_matrix(SE3.compose(carrier, joint.frame1)[:4])[:, 2]
            found += [(joint.body1, axis), (joint.body2, axis)]
    return found


def _telescope(
    name: str, one: _Spot, two: _Spot, mass: float, first: Array
) -> tuple[tuple[BodyDraft, ...], list[JointDraft]]:
    """Frames at two points that look at each other, and the joints between; the slide has the telescope's name."""
    length = float(np.linalg.norm(two.place - one.place))
    along = (two.place - one.place) / length
    turn: Any = frame_rotation(along, first)
    across = np.cross(along, (two.velocity - one.velocity) / length)  # the rate of its direction, but for spin along it
    spin = across + along * (along @ one.spin)
    names = f"{name}-from", f"{name}-to"
    bodies = tuple(
        _frame(each, np.concatenate([turn, spot.place]), spot.velocity, spin, side * length, 0.5 * mass)
        for each, spot, side in zip(names, (one, two), (1.0, -1.0), strict=True)
    )
    start, end = (np.concatenate([turn, spot.place]) for spot in (one, two))
    fixed: Any = frame_rotation(first)
    second: Any = frame_rotation(np.cross(along, first))
    here, there = (np.concatenate([each, one.place]) for each in (fixed, second))
    middle = SE3.compose(SE3.inverse(here), there)
    return bodies, [
        _joint(names[0], UNIVERSAL, (one.body, names[0]), Place(here, there, in_bodies=False, middle=middle), 2),
        _joint(name, "prismatic", names, Place(start, start, in_bodies=False), 1),
        _joint(names[1], "spherical", (names[1], two.body), Place(end, end, in_bodies=False), 3),
    ]


def _frame(name: str, pose: Array, velocity: Array, spin: Array, reach: float, mass: float) -> BodyDraft:
    """Half of a segment, its mass at its point, with the moments of inertia of a thin rod; drawn as one."""
    turned = quaternion_to_matrix(pose[:4]).T @ spin
    across, along = mass * (0.5 * reach) ** 2 / 3.0, 0.5 * mass * (SLIM * reach) ** 2
    inertia = np.diag([across + 0.5 * along, across + 0.5 * along, along])
    rod = {"cylinder": [SLIM * abs(reach), 0.5 * abs(reach)], "position": [0.0, 0.0, 0.25 * reach]}
    return BodyDraft(name, mass, inertia, pose, velocity, turned, rod, ())


def _joint(name: str, kind: str, bodies: tuple[str, str], place: Place, freedoms: int) -> JointDraft:
    zero = np.zeros(freedoms)
    return JointDraft(
        name=name, kind=kind, body1=bodies[0], body2=bodies[1], place=place, pitch=0.0,
        friction=np.zeros((freedoms, freedoms)), stiffness=zero, rest=zero, heat=ENVIRONMENT, drive=zero, motion=None,
        coordinates=None, rate=None,
    )  # fmt: skip
