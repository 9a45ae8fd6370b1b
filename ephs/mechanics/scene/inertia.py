"""Physically impossible inertia tensors: refused, kept, or corrected.

Files of real robots have them: rounded, copied, left at zero. Their motion may be determined all the same.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.values import TOLERANCE
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigen, symmetric_eigenvalues

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
    principal = symmetric_eigenvalues(tensor)
    wrong = _wrong(principal)
    if strict:
        if not wrong and principal[0] <= 0.1 * TINY * principal[2]:
            wrong = "inertia singular"
        if wrong:
            table.fault(wrong, "inertia", _text(principal))
        return mass, tensor
    if wrong and mode == "nearest":
        tensor = nearest_inertia(tensor)
        odd.append(fault("inertia nearest", where, _text(principal), taken=_text(symmetric_eigenvalues(tensor))))
    mass, tensor = _regular(mass, tensor, table.key, odd)
    principal = symmetric_eigenvalues(tensor)
    if mode == "warn" and _wrong(principal):
        odd.append(fault("inertia kept", where, _text(principal)))
    return mass, tensor


def nearest_inertia(tensor: Array) -> Array:
    """The tensor (3, 3) of a distribution of mass that is nearest to a given one in its second moments.

    The second moments ∫ x xᵀ dm = ½ tr(I) − I of a distribution of mass have no negative eigenvalue; those that are
    negative become zero.
    """
    moments, axes = symmetric_eigen(0.5 * np.trace(tensor) * np.eye(3) - tensor)
    second = (axes * np.maximum(moments, 0.0)) @ axes.T
    return np.trace(second) * np.eye(3) - second


def _wrong(moments: NDArray[Any]) -> str:
    slack = TOLERANCE * float(np.abs(moments).max())
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
        odd.append(fault("inertia zero", f"{key}.inertia", _text(moments), least=least))
        tensor = (axes * np.where(small, least, moments)) @ axes.T
        tensor = 0.5 * (tensor + tensor.T)
    return mass, tensor


def _text(moments: NDArray[Any]) -> str:
    return "principal moments " + ", ".join(f"{moment:.6g}" for moment in moments)
