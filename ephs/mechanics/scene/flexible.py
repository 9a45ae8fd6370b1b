"""Resolved beams, tendons and loads: elasticity of an element, nodes and elements of a rod, forces on bodies."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.element import NON_NEGATIVE, Element, Measured, Number

__all__ = ["Beam", "Load", "Strain", "Tendon"]

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
class Tendon(Element):
    """A tendon without mass, straight from point to point of bodies, through which it slides.

    Attributes
    ----------
    bodies : what carries its points, in their order
    points : (n, 3) in the bodies' centre-of-mass frames (ground: world), m
    stiffness, length, damping : of the whole: N/m, m without force, N s/m
    slack : whether it exerts no elastic force where it is shorter
    heat : where the heat of damping goes
    """

    names: ClassVar[Mapping[str, str]] = {"bodies": "body", "heat": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "stiffness": Number(energy=1, length=-2, least=NON_NEGATIVE),
        "length": Number(length=1, least=NON_NEGATIVE),
        "damping": Number(energy=1, time=1, length=-2, least=NON_NEGATIVE),
    }
    name: str
    bodies: tuple[str, ...]
    points: Array
    stiffness: float
    length: float
    damping: float
    slack: bool
    heat: str

    @property
    def segments(self) -> list[tuple[tuple[str, Array], tuple[str, Array]]]:
        """The (body, point) at both ends of each segment between two different bodies."""
        spots = list(zip(self.bodies, self.points, strict=True))
        return [(one, two) for one, two in pairwise(spots) if one[0] != two[0]]

    @property
    def inside(self) -> float:
        """Length of the segments within bodies, m."""
        spots = zip(self.bodies, self.points, strict=True)
        return sum(float(np.linalg.norm(q - p)) for (a, p), (b, q) in pairwise(spots) if a == b)


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
