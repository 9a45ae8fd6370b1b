"""Mass and inertia of homogeneous shapes, from their density or their mass."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.scene.entries import Checked
from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.schema import BodyEntry, ShapeEntry
from ephs.mechanics.scene.values import TOLERANCE
from ephs.semantics.spaces.rotations import quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.semantics.bundles.bundle import Array


def mass_and_moments(table: Checked[BodyEntry], key: str, faults: list[Fault]) -> tuple[float, list[float]] | None:
    """Mass, and inertia as xx yy zz [xy xz yz], of a body, specified or by its shapes; None after a fault.

    Parameters
    ----------
    faults
        Faults of what is given are appended here.
    """
    entry = table.entry
    if not table.sound("inertia", "density", "shape", "shapes"):
        return None
    if entry.density is not None:
        twice = [name for name in ("mass", "inertia") if getattr(entry, name) is not None]
        if twice:
            faults.append(fault("density", f"{key}.density", f"density and {' and '.join(twice)}"))
            return None
    elif entry.mass is None and table.sound("mass"):
        faults.append(_missing(key, "mass"))
        return None
    mass = entry.mass if table.sound("mass") else 1.0
    if entry.inertia is not None:
        return mass or 0.0, entry.inertia
    shapes = [entry.shape] if entry.shape is not None else entry.shapes or []
    if not shapes:
        faults.append(_missing(key, "inertia") if entry.density is None else fault("density shape", key, "no shape"))
        return None
    return _homogeneous(shapes, entry.density, mass, key, faults)


def _missing(key: str, name: str) -> Fault:
    return fault("missing", f"{key}.{name}", "nothing", what=BodyEntry.model_fields[name].description or name)


def _homogeneous(
    shapes: Sequence[ShapeEntry], density: float | None, mass: float | None, key: str, faults: list[Fault]
) -> tuple[float, list[float]] | None:
    """The same for the union of disjoint shapes, whose centre of mass must be the origin of the body's frame."""
    volumes, tensors, places = [], [], []
    for shape in shapes:
        found = _solid(shape)
        if found is None:
            faults.append(fault("density shape", key, "a mesh" if shape.mesh else "an empty shape"))
            return None
        turn = quaternion_to_matrix(np.array(shape.rotation or [1.0, 0.0, 0.0, 0.0]))
        volumes.append(found[0])
        tensors.append(turn @ np.diag(found[1]) @ turn.T)
        places.append(np.array(shape.position or [0.0, 0.0, 0.0]))
    total = sum(volumes)
    whole = density * total if density is not None else mass or 0.0
    shares = np.array(volumes) / total
    centre = shares @ np.array(places)
    steiner = [of + (p @ p) * np.eye(3) - np.outer(p, p) for of, p in zip(tensors, places, strict=True)]
    tensor = np.tensordot(shares, np.array(steiner), 1)
    if float(np.linalg.norm(centre)) > TOLERANCE * math.sqrt(float(np.trace(tensor))):
        shift = shown([float(f"{-x:.12g}") for x in centre])
        faults.append(fault("centre", key, f"a centre of mass at {shown(centre.tolist())}", shift=shift))
        return None
    moments = whole * tensor
    return whole, [float(moments[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _solid(shape: ShapeEntry) -> "tuple[float, Array] | None":
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
