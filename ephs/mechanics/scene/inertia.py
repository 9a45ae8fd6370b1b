"""Mass and inertia of bodies: of homogeneous shapes, and physically impossible ones: refused, kept, or corrected.

Files of real robots have impossible ones: rounded, copied, left at zero. Their motion may be determined all the same.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.values import TOLERANCE
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigen, symmetric_eigenvalues
from ephs.semantics.spaces.rank import INERTIA
from ephs.semantics.spaces.rotations import quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.scene.bodies import BodyEntry, ShapeEntry

TINY = 1e-11
"""Kinetic energy is a function of momentum only where no principal moment is zero: one that is counts as this much of
the largest, …"""
GYRATION = 1e-20
"""… and as no less than the mass times this, in m²."""


def mass_and_inertia(
    table: Checked[Any], mass: float, moments: list[float], mode: str, odd: list[Fault]
) -> tuple[float, Array]:
    """The mass, and the inertia tensor (3, 3), of a body.

    Parameters
    ----------
    moments
        xx yy zz [xy xz yz].
    mode
        ``"strict"``: what is impossible is a fault of the table; ``"warn"``: it is kept, and appended to ``odd``;
        ``"nearest"``: the possible tensor nearest to it is taken, and both are appended to ``odd``.
    """
    xx, yy, zz, xy, xz, yz = (*moments, 0.0, 0.0, 0.0)[:6]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    strict, where = mode == "strict", f"{table.key}.inertia"
    if mass == 0.0 and strict and tensor.any():
        table.fault("massless", "inertia", shown(moments))
        return mass, tensor
    if not tensor.any() and mass == 0.0:
        return mass, tensor
    wrong = impossible(tensor)
    if strict:
        principal = symmetric_eigenvalues(tensor)
        if not wrong and principal[0] <= 0.1 * TINY * principal[2]:
            wrong = "inertia singular"
        if wrong:
            table.fault(wrong, "inertia", moments_text(tensor))
        return mass, tensor
    if wrong and mode == "nearest":
        nearest = nearest_inertia(tensor)
        odd.append(fault("inertia nearest", where, moments_text(tensor), taken=moments_text(nearest)))
        tensor = nearest
    mass, tensor = _regular(mass, tensor, table.key, odd)
    if mode == "warn" and impossible(tensor):
        odd.append(fault("inertia kept", where, moments_text(tensor)))
    return mass, tensor


def nearest_inertia(tensor: Array) -> Array:
    """The tensor (3, 3) of a distribution of mass that is nearest to a given one in its second moments.

    The second moments ∫ x xᵀ dm = ½ tr(I) − I of a distribution of mass have no negative eigenvalue; those that are
    negative become zero.
    """
    moments, axes = symmetric_eigen(0.5 * np.trace(tensor) * np.eye(3) - tensor)
    second = (axes * np.maximum(moments, 0.0)) @ axes.T
    return np.trace(second) * np.eye(3) - second


def impossible(tensor: Array) -> str:
    """Code of the fault of an inertia (3, 3) that no distribution of mass has; empty where one has it."""
    moments = symmetric_eigenvalues(tensor)
    slack = INERTIA * float(np.abs(moments).max())
    if moments[0] < -slack:
        return "inertia indefinite"
    return "inertia triangle" if moments[2] > moments[0] + moments[1] + slack else ""


def _regular(mass: float, tensor: Array, key: str, odd: list[Fault]) -> tuple[float, Array]:
    """The same with no mass and no principal moment at zero."""
    moments, axes = symmetric_eigen(tensor)
    largest = float(np.abs(moments).max())
    if mass == 0.0:
        mass = TINY * largest
        odd.append(fault("mass zero", f"{key}.mass", "0 kg", mass=mass))
    least = max(TINY * largest, GYRATION * mass)
    if moments[0] > 0.1 * TINY * largest:
        return mass, tensor
    small = np.abs(moments) < least
    if small.any():
        odd.append(fault("inertia zero", f"{key}.inertia", moments_text(tensor), least=least))
        tensor = (axes * np.where(small, least, moments)) @ axes.T
        tensor = 0.5 * (tensor + tensor.T)
    return mass, tensor


def moments_text(tensor: Array) -> str:
    """The principal moments of an inertia (3, 3) in words."""
    return "principal moments " + ", ".join(f"{moment:.6g}" for moment in symmetric_eigenvalues(tensor))


# ---- homogeneous shapes ----------------------------------------------------------------------------------------------


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


def _solid(shape: "ShapeEntry") -> tuple[float, Array] | None:
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
