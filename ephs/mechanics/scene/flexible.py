"""Resolved beams and loads: elasticity of an element, nodes and elements of a rod, forces on bodies."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.element import NON_NEGATIVE, Element, Measured, Number

__all__ = ["Beam", "Load", "Strain"]

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Strain(Measured):
    """Elasticity of a beam element: the energy of the mean strain ξ = log(exp(L ξ₀) q_r)/L.

    Its joint's frame C1 is where C2 would be without force, so that q_r is 1 there.

    Attributes
    ----------
    length : L in m
    stiffness : (6,) diagonal of K: GJ, EI2, EI3 in N m², EA, GA2, GA3 in N
    rest : (6,) ξ₀: torsion and curvatures in 1/m, stretch (1: none) and shears
    damping : Kelvin–Voigt time in s: τ K resists the rate of ξ
    order : 2, the strain is the same all along, or 4, the stress is in balance; see `elements.strain`
    """

    numbers: ClassVar[Mapping[str, Number]] = {
        "length": Number(length=1),
        "stiffness": Number(energy=1, length=-1, head=1, ahead=3, count=6),
        "rest": Number(head=-1, ahead=3, count=6),
        "damping": Number(time=1),
    }
    length: float
    stiffness: Array
    rest: Array
    damping: float = 0.0
    order: int = 2


@final
@dataclass(frozen=True, slots=True)
class Beam(Element):
    """A rod: its nodes are the bodies ``NAME.0`` … ``NAME.n``, its elements the joints ``NAME-1`` … ``NAME-n``.

    Attributes
    ----------
    ends : what the first and the last node are welded to, ``"free"`` where to nothing
    outline : radius of a round section, or extents along axes 2 and 3 in m; for pictures
    lengths : of the elements in m, where these are spherical joints between rigid pieces
    """

    names: ClassVar[Mapping[str, str]] = {"ends": "end"}
    name: str
    elements: int
    ends: tuple[str, str]
    outline: tuple[float, ...]
    lengths: tuple[float, ...] = ()

    @property
    def nodes(self) -> list[str]:
        """The bodies."""
        return [f"{self.name}.{i}" for i in range(self.elements + 1)]

    @property
    def joints(self) -> list[str]:
        """The joints that are its elements."""
        return [f"{self.name}-{i}" for i in range(1, self.elements + 1)]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Load(Element):
    """A force (3,) in N and a moment (3,) in N m on a body's centre of mass, which grow over ``ramp`` seconds.

    In world axes; those of a follower are in the axes of the body.
    """

    names: ClassVar[Mapping[str, str]] = {"body": "body"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "force": Number(energy=1, length=-1, count=3),
        "moment": Number(energy=1, count=3),
        "ramp": Number(time=1, least=NON_NEGATIVE),
    }
    name: str
    body: str
    force: Array
    moment: Array
    follower: bool = False
    ramp: float = 0.0
