"""From validated tables to drafts: every value in its full shape, frames not yet placed.

All semantic faults of a file but those of assembly are found here.
"""

from collections.abc import Mapping, Set
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.element import Measured
from ephs.mechanics.scene.entries import Checked, Document
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, listing, shown
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.geometry import Coupling, coupling, joint_types
from ephs.mechanics.scene.homogeneous import mass_and_moments
from ephs.mechanics.scene.inertia import mass_and_inertia
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, World, frozen
from ephs.mechanics.scene.motions import law_of
from ephs.mechanics.scene.placing import Place, resolve_place
from ephs.mechanics.scene.schema import BodyEntry, JointEntry, ShapeEntry
from ephs.mechanics.scene.text import MESHES, file_inside
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.mechanics.shapes.dry import Dry
from ephs.semantics.bundles.bundle import Array
from ephs.solve.motion_law import MotionLaw


@final
@dataclass(frozen=True, slots=True)
class BodyDraft:
    """A body whose pose (7,) and velocity may still come from a joint: then they are None.

    ``velocity`` is in the world basis, ``angular_velocity`` in body axes; None both, or neither.
    """

    name: str
    mass: float
    inertia: Array
    pose: Array | None
    velocity: Array | None
    angular_velocity: Array | None
    shape: Mapping[str, Any] | None
    shapes: tuple[Mapping[str, Any], ...]


@final
@dataclass(frozen=True, slots=True)
class JointDraft:
    """A joint whose frames in the bodies may still depend on their poses; coordinates and rates are None
    where not given."""

    name: str
    kind: str
    body1: str
    body2: str
    place: Place
    pitch: float
    friction: Array
    stiffness: Array
    rest: Array
    heat: str
    drive: Array
    motion: MotionLaw | None
    coordinates: Array | None
    rate: Array | None
    strain: Strain | None = None
    dry: Dry | None = None
    armature: float = 0.0

    def coupling(self) -> Coupling:
        """Motions that the joint allows."""
        return coupling(self.kind, self.pitch, self.place.middle)


@final
@dataclass(frozen=True, slots=True)
class Names:
    """The names that references may use; ``unknown_parts`` are parts that could not be read, of which
    nothing is known."""

    bodies: Set[str]
    thermal: Set[str]
    unknown_parts: Set[str]

    def check(self, name: str, key: str, what: str, faults: list[Fault]) -> None:
        """Append a fault where a reference is unknown; ``what`` is body or thermal."""
        fixed, known = (GROUND, self.bodies) if what == "body" else (ENVIRONMENT, self.thermal)
        if name == fixed or name in known or name.split(".")[0] in self.unknown_parts:
            return
        hint = did_you_mean(name, [*known, fixed], f"there are: {listing(known)}")
        faults.append(fault(f"unknown {what}", key, f'"{name}"', hint=hint))


def resolve_world(document: Document) -> World | None:
    """The world of a file, or None where it has no [world]."""
    return None if document.world is None else World(**attributes(World, document.world))


def resolve_body(
    name: str, table: Checked[BodyEntry], mode: str, folder: Path, faults: list[Fault], odd: list[Fault]
) -> BodyDraft:
    """A body with its inertia checked; deviations that ``mode`` accepts are appended to ``odd``."""
    entry, key = table.entry, f"bodies.{name}"
    mass, tensor = 1.0, np.eye(3)
    if found := mass_and_moments(table, key, faults):
        mass, tensor = mass_and_inertia(*found, key, mode, faults, odd)
    shape = [_shape(entry.shape, f"{key}.shape", folder, faults)] if entry.shape and table.sound("shape") else [None]
    shapes: list[Mapping[str, Any] | None] = []
    if entry.shapes and table.sound("shapes"):
        shapes = [_shape(e, f"{key}.shapes[{i}]", folder, faults) for i, e in enumerate(entry.shapes)]
        if entry.shape is not None:
            faults.append(fault("both shapes", f"{key}.shape", "shape and shapes"))
    placed = entry.position is not None or entry.rotation is not None
    moving = entry.velocity is not None or entry.angular_velocity is not None
    return BodyDraft(
        name=name,
        mass=mass,
        inertia=tensor,
        pose=values.pose(entry.position, entry.rotation, key, faults) if placed else None,
        velocity=np.array(entry.velocity or [0.0, 0.0, 0.0]) if moving else None,
        angular_velocity=np.array(entry.angular_velocity or [0.0, 0.0, 0.0]) if moving else None,
        shape=shape[0],
        shapes=tuple(one for one in shapes if one is not None),
    )


def resolve_joint(name: str, table: Checked[JointEntry], names: Names, faults: list[Fault]) -> JointDraft | None:
    """A joint with everything checked but its closure; None where its type or place is not usable."""
    entry, key = table.entry, f"joints.{name}"
    _check_ends(table, key, names, faults)
    if table.sound("heat"):
        names.check(entry.heat, f"{key}.heat", "thermal", faults)
    if not table.sound("type"):
        return None
    if entry.type not in joint_types():
        hint = did_you_mean(entry.type, joint_types(), "take one of these types")
        faults.append(
            fault("unknown type", f"{key}.type", shown(entry.type), known=", ".join(joint_types()), hint=hint)
        )
        return None
    place = resolve_place(table, key, faults)
    _check_pitch(entry, key, faults)
    allowed = coupling(entry.type, entry.pitch or 0.0, None if place is None else place.middle)
    d = allowed.dim
    stiffness = values.freedoms(entry.stiffness, d, f"{key}.stiffness", faults, spread=True)
    rest = values.freedoms(entry.rest, d, f"{key}.rest", faults, spread=True)
    if rest[list(allowed.turning)].any():
        faults.append(fault("rest rotation", f"{key}.rest", shown(entry.rest)))
    drive = values.freedoms(entry.drive, d, f"{key}.drive", faults)
    motion = _motion(entry, d, drive, key, faults)
    if entry.armature and (d != 1 or entry.motion is not None):
        faults.append(fault("armature", f"{key}.armature", shown(entry.armature)))
    coordinates = None
    if entry.coordinate is not None:
        coordinates = values.freedoms(entry.coordinate, d, f"{key}.coordinate", faults)
        if (entry.at or entry.axis) and coordinates.any():
            faults.append(fault("coordinate at", f"{key}.coordinate", shown(entry.coordinate)))
    rate = None
    if motion is not None:
        rate = np.full(d, motion.rate(0.0))
    elif entry.rate is not None:
        rate = values.freedoms(entry.rate, d, f"{key}.rate", faults)
    friction = values.friction(entry.friction, d, f"{key}.friction", faults)
    if place is None:
        return None
    return JointDraft(
        name=name,
        kind=entry.type,
        body1=entry.bodies[0],
        body2=entry.bodies[1],
        place=place,
        pitch=entry.pitch or 0.0,
        friction=friction,
        stiffness=stiffness,
        rest=rest,
        heat=entry.heat,
        drive=drive,
        motion=motion,
        coordinates=coordinates,
        rate=rate,
        dry=_dry(entry, d, key, faults),
        armature=entry.armature,
    )


def _dry(entry: JointEntry, d: int, key: str, faults: list[Fault]) -> Dry | None:
    found = entry.dry
    if found is None:
        return None
    if d != 1 or entry.motion is not None:
        what = "a joint with a prescribed motion" if entry.motion is not None else f"a {entry.type} joint"
        faults.append(fault("dry joint", f"{key}.dry", what))
        return None
    if found.static is not None and found.static < found.coulomb:
        faults.append(fault("dry static", f"{key}.dry.static", shown(found.static), coulomb=found.coulomb))
        return None
    return Dry(found.coulomb, found.static, found.stribeck, found.slip)


def attributes(kind: type[Measured], entry: Any) -> dict[str, Any]:
    """The attributes of an element that are keys of its table, as it has them."""
    given: dict[str, Any] = {}
    for key in {each.name for each in fields(kind)} & set(type(entry).model_fields):  # pyright: ignore[reportArgumentType]
        value, number = getattr(entry, key), kind.numbers.get(key)
        if number is not None and number.shape(0) and value is not None:
            value = frozen(np.atleast_1d(np.asarray(value, dtype=float)))
        given[key] = tuple(value) if isinstance(value, list) else value
    return given


def resolve_thermal(document: Document) -> dict[str, ThermalNode]:
    """The thermal nodes of a file."""
    tables = document.sections["thermal"]
    return {name: ThermalNode(name=name, **attributes(ThermalNode, table.entry)) for name, table in tables.items()}


def _check_ends(table: Checked[Any], key: str, names: Names, faults: list[Fault]) -> None:
    if not table.sound("bodies"):
        return
    first, second = table.entry.bodies
    for i, name in enumerate((first, second)):
        names.check(name, f"{key}.bodies[{i}]", "body", faults)
    if first == second:
        faults.append(fault("same body", f"{key}.bodies", f'"{first}" twice'))


def _check_pitch(entry: JointEntry, key: str, faults: list[Fault]) -> None:
    if entry.pitch and entry.type != "screw":
        faults.append(fault("only screw", f"{key}.pitch", shown(entry.pitch), kind=entry.type))


def _motion(entry: JointEntry, d: int, drive: Array, key: str, faults: list[Fault]) -> MotionLaw | None:
    """The motion law that a joint is prescribed; None without."""
    if entry.motion is None:
        return None
    found = law_of(entry.motion, f"{key}.motion", faults)
    rate = found.rate(0.0)
    if d != 1:
        faults.append(fault("motion freedoms", f"{key}.motion", f"a motion of a {entry.type} joint", d=d))
    elif entry.rate is not None and np.asarray(entry.rate).ravel().tolist() not in ([rate], [0.0]):
        faults.append(fault("motion rate", f"{key}.rate", shown(entry.rate), motion=shown(rate)))
    if drive.any():
        faults.append(fault("motion and drive", key, "motion and drive"))
    return found


def _shape(entry: ShapeEntry, key: str, folder: Path, faults: list[Fault]) -> Mapping[str, Any] | None:
    given = {name: value for name, value in entry.model_dump().items() if value is not None}
    kinds = [name for name in given if name not in ("position", "rotation", "scale")]
    if len(kinds) != 1:
        faults.append(fault("shape", key, " and ".join(kinds) or "an empty table"))
        return None
    if "scale" in given and "mesh" not in given:
        faults.append(fault("only mesh", f"{key}.scale", shown(given["scale"]), kind=kinds[0]))
    if "rotation" in given:
        given["rotation"] = values.quaternion(given["rotation"], f"{key}.rotation", faults).tolist()
    if "mesh" in given:
        file = file_inside(folder / given["mesh"], folder)
        if file is None:
            faults.append(fault("mesh", f"{key}.mesh", shown(given["mesh"])))
        elif file.suffix.lower() not in MESHES:
            faults.append(fault("mesh kind", f"{key}.mesh", shown(given["mesh"]), known=", ".join(MESHES)))
        given["mesh"] = str(file)
    return given
