"""World and bodies of a scene: their tables in files, and what they are when these are resolved."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, final

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.element import NON_NEGATIVE, POSE, POSITIVE, TWIST, Measured, frozen
from ephs.mechanics.scene.element import NumberForm as Measure
from ephs.mechanics.scene.errors import Fault
from ephs.mechanics.scene.inertia import mass_and_inertia, mass_and_moments
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_numbers import (
    EntryTable,
    Extents,
    Inertia,
    NonNegative,
    Positive,
    Sizes,
    Text,
    Vector,
    key,
)  # fmt: skip
from ephs.mechanics.scene.text import MESHES, file_inside
from ephs.semantics.bundles.bundle import Array

IDENTITY_POSE = frozen([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class World(Measured):
    """Gravity, and the reference environment."""

    gravity: Annotated[Array, Measure(length=1, time=-2, count=3), "gravity in the world, m/s²"] = field(
        default_factory=lambda: frozen([0.0, 0.0, -9.81])
    )
    temperature: Annotated[float, Measure(least=POSITIVE), "temperature of the reference environment, K"] = 293.15
    pressure: Annotated[
        float, Measure(energy=1, length=-3, least=POSITIVE), "pressure of the reference environment, Pa"
    ] = 101325.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Body(Measured):
    """A rigid body.

    Attributes
    ----------
    mass : kg; 0 for a frame without kinetic energy
    inertia : (3, 3) kg m², about the centre of mass, in body axes
    pose : (7,) of the centre of mass and body axes in the world
    twist : (6,) in the body frame: angular velocity, and the velocity of the centre of mass in body axes
    shape, shapes : one or several, for pictures only: ``{"box": [x, y, z]}``, ``{"sphere": r}``, ``{"cylinder":
        [radius, length]}``, ``{"mesh": file, "scale": …}``, with ``position`` and ``rotation`` in the body
    """

    name: str
    mass: Annotated[float, Measure(energy=1, length=-2, time=2, least=NON_NEGATIVE)]
    inertia: Annotated[Array, Measure(energy=1, time=2, count=3, square=True)]
    pose: Annotated[Array, POSE]
    twist: Annotated[Array, TWIST]
    shape: Mapping[str, Any] | None = None
    shapes: tuple[Mapping[str, Any], ...] = ()


class ShapeEntry(EntryTable):
    """``shape``: one of four, and its pose in the body."""

    box: Extents | None = key("edge lengths, m", None)
    sphere: Positive | None = key("radius, m", None)
    cylinder: Sizes | None = key("radius and length along z, m", None)
    mesh: Text | None = key("a mesh file (.stl .obj .ply .glb .off) in the scene file's folder, or below", None)
    scale: Vector | None = key("scale of a mesh along its axes", None)
    position: Vector | None = key("origin in the centre-of-mass frame, m", None)
    rotation: Rotation | None = key("orientation there, [w, x, y, z] or a table", None)


class BodyEntry(EntryTable):
    """``[bodies.NAME]``"""

    mass: NonNegative | None = key("kg; required unless density is given; 0 only with inertia 0", None)
    inertia: Inertia | None = key(
        "about the centre of mass, body axes: xx yy zz [xy xz yz], kg m²; default: from the shapes, homogeneous", None
    )
    density: Positive | None = key("density of the shapes, kg/m³; replaces mass and inertia", None)
    position: Vector | None = key("centre of mass in the world, m", None)
    rotation: Rotation | None = key("body to world, [w, x, y, z] or a table", None)
    velocity: Vector | None = key("of the centre of mass, world basis, m/s", None)
    angular_velocity: Vector | None = key("body basis, rad/s", None)
    shape: ShapeEntry | None = key("shape for pictures, and for the inertia where none is given", None)
    shapes: list[ShapeEntry] | None = key("list of shapes, instead of shape", None)


@final
@dataclass(frozen=True, slots=True)
class BodyStart:
    """Initial state of a body in a file: whether the pose is given; velocity (3,) in the world basis and angular
    velocity (3,) in body axes, or None where neither is given. A joint determines the rest."""

    placed: bool
    velocities: tuple[Array, Array] | None


def resolve_body(table: Checked[BodyEntry], mode: str, folder: Path, odd: list[Fault]) -> tuple[Body, BodyStart]:
    """A body with its inertia checked, at rest, and its start; deviations that ``mode`` accepts are appended to
    ``odd``."""
    entry, one = table.entry, table.entry.shape
    mass, tensor = 1.0, np.eye(3)
    if found := mass_and_moments(table):
        mass, tensor = mass_and_inertia(table, *found, mode, odd)
    shape = _shape(table.inner("shape", one), folder) if one and table.sound("shape") else None
    shapes: list[Mapping[str, Any] | None] = []
    if entry.shapes and table.sound("shapes"):
        shapes = [_shape(table.inner(f"shapes[{i}]", each), folder) for i, each in enumerate(entry.shapes)]
        if one is not None:
            table.fault("both shapes", "shape", "shape and shapes")
    placed = entry.position is not None or entry.rotation is not None
    moving = entry.velocity is not None or entry.angular_velocity is not None
    pose = frozen(values.pose(table)) if placed else IDENTITY_POSE
    given = [np.array(each or [0.0, 0.0, 0.0]) for each in (entry.velocity, entry.angular_velocity)]
    body = Body(table.name, mass, frozen(tensor), pose, frozen(np.zeros(6)), shape, tuple(filter(None, shapes)))
    return body, BodyStart(placed, (given[0], given[1]) if moving else None)


def _shape(table: Checked[ShapeEntry], folder: Path) -> Mapping[str, Any] | None:
    given: dict[str, Any] = table.entry.model_dump(exclude_none=True)
    kinds = [name for name in given if name not in ("position", "rotation", "scale")]
    if len(kinds) != 1:
        table.fault("shape", found=" and ".join(kinds) or "an empty table")
        return None
    if "scale" in given and "mesh" not in given:
        table.fault("only mesh", "scale", kind=kinds[0])
    if "rotation" in given:
        given["rotation"] = values.quaternion(table).tolist()
    if "mesh" in given:
        file = file_inside(folder / given["mesh"], folder)
        if file is None:
            table.fault("mesh", "mesh")
        elif file.suffix.lower() not in MESHES:
            table.fault("mesh kind", "mesh", known=", ".join(MESHES))
        given["mesh"] = str(file)
    return given
