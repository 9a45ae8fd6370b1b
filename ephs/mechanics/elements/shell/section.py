"""Sections of shells: resultants of the strains of the reference surface, integrated through the thickness.

Membrane forces n = A ε + B κ and moments m = B ε + D κ, with ε = (ε₁₁, ε₂₂, 2ε₁₂) and κ alike; transverse forces
q = S γ. Layers are orthotropic and in plane stress, which stays linear, so A, B, D are moments of their stiffness.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError

SHEARED = 5.0 / 6.0
"""Part of a section that carries the transverse force, where its stress is a parabola."""
ROUNDED = 1e-14
"""Couplings below this part of what they couple are rounding of layers that are alike above and below."""


@final
@dataclass(frozen=True, slots=True)
class Ply:
    """A layer of a laminate.

    Attributes
    ----------
    thickness
        In m.
    E1, E2, G12, G13, G23
        Moduli along and across the fibres in Pa, and of shear; G13 and G23 are G12 where None.
    nu12
        Contraction across the fibres of a pull along them.
    angle
        From the element's first axis to the fibres about the normal, rad.
    rho
        Density in kg/m³.
    """

    thickness: float
    E1: float
    E2: float
    G12: float
    nu12: float = 0.0
    angle: float = 0.0
    rho: float = 0.0
    G13: float | None = None
    G23: float | None = None

    def stiffness(self) -> tuple[Array, Array]:
        """(3, 3) of plane stress and (2, 2) of transverse shear, in the element's axes, Pa."""
        across = self.nu12 * self.E2 / self.E1
        fibres = np.zeros((3, 3))
        fibres[:2, :2] = np.array([[self.E1, across * self.E1], [across * self.E1, self.E2]])
        fibres /= 1.0 - self.nu12 * across
        fibres[2, 2] = self.G12
        c, s = np.cos(self.angle), np.sin(self.angle)
        turn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2.0 * c * s, 2.0 * c * s, c * c - s * s]])
        way = np.array([[c, s], [-s, c]])
        slips = [self.G12 if given is None else given for given in (self.G13, self.G23)]
        return turn.T @ fibres @ turn, way.T @ np.diag(slips) @ way

    def check(self, where: str) -> None:
        """Raise a StructureError where a number is out of range."""
        for key in ("thickness", "E1", "E2", "G12", "G13", "G23", "rho"):
            found = getattr(self, key)
            low = found is not None and (found < 0.0 if key == "rho" else found <= 0.0)
            if low or (found is not None and not np.isfinite(found)):
                _refuse(f"{where}{key}", found, "a number ≥ 0" if key == "rho" else "a number > 0")
        if not abs(self.nu12) * np.sqrt(self.E2 / self.E1) < 1.0:
            _refuse(f"{where}nu12", self.nu12, f"a number of size < √(E1/E2) = {np.sqrt(self.E1 / self.E2):g}")
        if not np.isfinite(self.angle):
            _refuse(f"{where}angle", self.angle, "a finite number")


@final
@dataclass(frozen=True, slots=True, eq=False)
class ShellSection:
    """Stiffness and mass of a unit of area.

    Attributes
    ----------
    thickness
        h in m.
    plane
        (6, 6) [[A, B], [B, D]] of membrane strains and curvatures; N/m, N, N m.
    shear
        (2, 2) S in N/m.
    mass
        Of the area, kg/m².
    """

    thickness: float
    plane: Array
    shear: Array
    mass: float

    @classmethod
    def isotropic(cls, thickness: float, E: float, nu: float = 0.0, rho: float = 0.0) -> Self:
        """One material: modulus E in Pa, contraction −1 < nu ≤ ½, density rho in kg/m³, thickness in m.

        Raises
        ------
        StructureError
            A number is out of range.
        """
        if not -1.0 < nu <= 0.5:
            _refuse("nu", nu, "a number in (−1, 0.5]")
        slip = 0.5 * E / (1.0 + nu)
        return cls.laminate([Ply(thickness, E, E, slip, nu, 0.0, rho)], named="")

    @classmethod
    def laminate(cls, plies: Sequence[Ply], *, named: str = "plies") -> Self:
        """Layers from the lower side to the upper one; the reference surface is in the middle.

        The transverse shear takes 5/6 of the layers' sum.

        Parameters
        ----------
        named
            Name of the list of layers in messages; empty for a section of one material.

        Raises
        ------
        StructureError
            There is no layer, or a number of one is out of range.
        """
        if not plies:
            _refuse("plies", "empty", "at least one layer")
        for i, ply in enumerate(plies):
            ply.check(f"{named}[{i}]." if named else "")
        plane, shear, low = np.zeros((6, 6)), np.zeros((2, 2)), -0.5 * sum(ply.thickness for ply in plies)
        for ply in plies:
            high = low + ply.thickness
            zeroth, first, second = ((high**k - low**k) / k for k in (1, 2, 3))
            q, slip = ply.stiffness()
            plane += np.kron([[zeroth, first], [first, second]], q)
            shear += SHEARED * ply.thickness * slip
            low = high
        plane[np.abs(plane) <= ROUNDED * np.sqrt(np.outer(np.diag(plane), np.diag(plane)))] = 0.0
        return cls(2.0 * low, plane, shear, sum(ply.thickness * ply.rho for ply in plies))

    @property
    def sheared(self) -> float:
        """Stiffness of membrane shear, N/m: its mean over all directions of the axes."""
        a = self.plane
        return float(a[0, 0] + a[1, 1] - 2.0 * a[0, 1] + 4.0 * a[2, 2]) / 8.0

    def bending(self, along: Array) -> Array:
        """(…,) modulus of bending along vectors (…, 2): the moment of a unit of curvature, N m."""
        unit = along / np.linalg.norm(along, axis=-1, keepdims=True)
        x, y = unit[..., 0], unit[..., 1]
        way = np.stack([x * x, y * y, 2.0 * x * y], axis=-1)
        return np.einsum("...i,ij,...j->...", way, self.plane[3:, 3:], way)


def _refuse(key: str, found: object, expected: str) -> None:
    raise StructureError("parameter", "shell section", key=key, found=found, expected=expected)
