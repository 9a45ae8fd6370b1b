"""Mass and inertia of homogeneous shapes, from their density or their mass."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.scene.errors import shown
from ephs.mechanics.scene.values import TOLERANCE
from ephs.semantics.spaces.rotations import quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.scene.bodies import BodyEntry, ShapeEntry
    from ephs.mechanics.scene.checked import Checked
    from ephs.semantics.bundles.bundle import Array


def mass_and_moments(table: "Checked[BodyEntry]") -> tuple[float, list[float]] | None:
    """Mass, and inertia as xx yy zz [xy xz yz], of a body, specified or by its shapes; None after a fault."""
    entry = table.entry
    if not table.sound("inertia", "density", "shape", "shapes"):
        return None
    if entry.density is not None:
        twice = [name for name in ("mass", "inertia") if getattr(entry, name) is not None]
        if twice:
            table.fault("density", "density", f"density and {' and '.join(twice)}")
            return None
    elif entry.mass is None and table.sound("mass"):
        _lack(table, "mass")
        return None
    mass = entry.mass if table.sound("mass") else 1.0
    if entry.inertia is not None:
        return mass or 0.0, entry.inertia
    shapes = [entry.shape] if entry.shape is not None else entry.shapes or []
    if not shapes:
        if entry.density is None:
            _lack(table, "inertia")
        else:
            table.fault("density shape", found="no shape")
        return None
    return _homogeneous(table, shapes, mass)


def _lack(table: "Checked[BodyEntry]", name: str) -> None:
    table.fault("missing", name, "nothing", what=type(table.entry).model_fields[name].description)


def _homogeneous(
    table: "Checked[BodyEntry]", shapes: "Sequence[ShapeEntry]", mass: float | None
) -> tuple[float, list[float]] | None:
    """The same for the union of disjoint shapes, whose centre of mass must be the origin of the body's frame."""
    volumes, tensors, places = [], [], []
    for shape in shapes:
        found = _solid(shape)
        if found is None:
            table.fault("density shape", found="a mesh" if shape.mesh else "an empty shape")
            return None
        turn = quaternion_to_matrix(np.array(shape.rotation or [1.0, 0.0, 0.0, 0.0]))
        volumes.append(found[0])
        tensors.append(turn @ np.diag(found[1]) @ turn.T)
        places.append(np.array(shape.position or [0.0, 0.0, 0.0]))
    total = sum(volumes)
    density = table.entry.density
    whole = density * total if density is not None else mass or 0.0
    shares = np.array(volumes) / total
    centre = shares @ np.array(places)
    steiner = [of + (p @ p) * np.eye(3) - np.outer(p, p) for of, p in zip(tensors, places, strict=True)]
    tensor = np.tensordot(shares, np.array(steiner), 1)
    if float(np.linalg.norm(centre)) > TOLERANCE * math.sqrt(float(np.trace(tensor))):
        shift = shown([float(f"{-x:.12g}") for x in centre])
        table.fault("centre", found=f"a centre of mass at {shown(centre.tolist())}", shift=shift)
        return None
    moments = whole * tensor
    return whole, [float(moments[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _solid(shape: "ShapeEntry") -> "tuple[float, Array] | None":
    """Volume in m³, and principal moments (3,) a unit of mass in m²; None for a mesh."""
    if shape.box is not None:
        a, b, c = shape.box
        return a * b * c, np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / 12.0
    if shape.sphere is not None:
        r = shape.sphere
        return 4.0 / 3.0 * math.pi * r**3, np.full(3, 0.4 * r * r)
    if shape.cylinder is not None:
        r, length = shape.cylinder
        across = (3.0 * r * r + length * length) / 12.0
        return math.pi * r * r * length, np.array([across, across, 0.5 * r * r])
    return None
