"""Beams: their tables in scene files, elasticity of an element, nodes and elements of a rod."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, final

from pydantic import Field, create_model

from ephs.mechanics.scene.element import ENVIRONMENT, Measured, Named
from ephs.mechanics.scene.element import NumberForm as Measure
from ephs.mechanics.scene.schema_numbers import EntryTable, NonNegative, Number, Positive, Text, Vector, key
from ephs.mechanics.scene.sections import SectionEntry
from ephs.mechanics.scene.surfaces import ContactLaw
from ephs.semantics.bundles.bundle import Array


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

    length: Annotated[float, Measure(length=1)]
    stiffness: Annotated[Array, Measure(energy=1, length=-1, head=1, ahead=3, count=6)]
    rest: Annotated[Array, Measure(head=-1, ahead=3, count=6)]
    damping: Annotated[float, Measure(time=1)] = 0.0
    order: int = 2


@final
@dataclass(frozen=True, slots=True)
class Beam(Measured):
    """A rod: its nodes are the bodies ``NAME.0`` … ``NAME.n``, its elements the joints ``NAME-1`` … ``NAME-n``.

    Attributes
    ----------
    ends : what the first and the last node are welded to, ``"free"`` where to nothing
    outline : radius of a round section, or extents along axes 2 and 3 in m; for pictures
    lengths : of the elements in m, where these are spherical joints between rigid pieces
    heat : where the heat of contacts of its surface goes, or None
    """

    name: str
    elements: int
    ends: Annotated[tuple[str, str], Named("end")]
    outline: tuple[float, ...]
    lengths: tuple[float, ...] = ()
    heat: Annotated[str | None, Named("node")] = None

    @property
    def nodes(self) -> list[str]:
        """The bodies."""
        return [f"{self.name}.{i}" for i in range(self.elements + 1)]

    @property
    def joints(self) -> list[str]:
        """The joints that are its elements."""
        return [f"{self.name}-{i}" for i in range(1, self.elements + 1)]


class RodHeatEntry(EntryTable):
    """``thermal`` of a beam: a store of heat for each element, and heat conduction between neighbours."""

    capacity: Positive = key("heat capacity per length, J/(m K)")
    conduction: NonNegative = key("conductivity times area, W m/K", 0.0)
    temperature: Positive = key("initial temperature, K")
    expansion: NonNegative = key("coefficient of linear thermal expansion, 1/K", 0.0)
    reference: Positive | None = key("temperature without thermal stress, K; default: temperature", None)


class RodSurfaceEntry(ContactLaw):
    """``surface`` of a beam: a capsule along each node's piece, which meets others and the pieces further on."""

    radius: Positive | None = key("radius of the surface, m; default: that of a circle or tube", None)


_Start: TypeAlias = Vector | None
_FROM: dict[str, Any] = {"from": (_Start, key("start point, world coordinates, m", None))}
_From: Any = create_model("_From", __base__=EntryTable, **_FROM)
"""A class statement cannot have `from` as a name."""


class BeamEntry(_From):
    """``[beams.NAME]``"""

    to: Vector | None = key("end point, world coordinates, m", None)
    points: Annotated[list[Vector], Field(min_length=2)] | None = key(
        "points on a curve, instead of from and to, with a node at each, m", None
    )
    up: Vector | None = key("world direction of axis 2 of the section, made normal to the tangent", None)
    elements: Annotated[int, Field(strict=True, ge=1)] | None = key(
        "number of elements, the same between any two points; 1 there unless given", None
    )
    order: Literal[2, 4] = key(
        "order of convergence in the element length, for statics and for the motion of thin beams", 2
    )
    rod: Literal["reissner", "kirchhoff", "string"] = key(
        "kirchhoff: inextensible and without shear; string: also without bending and torsion", "reissner"
    )
    section: SectionEntry = key("stiffness and inertia per length")
    strain: Annotated[list[Number], Field(min_length=6, max_length=6)] | None = key(
        "initial strain: torsion, bending about 2, 3 in 1/m, stretch, shear along 2, 3", None
    )
    damping: NonNegative = key("Kelvin–Voigt damping time, s", 0.0)
    heat: Text = key("where the heat of damping goes: a thermal name", ENVIRONMENT)
    thermal: RodHeatEntry | None = key("instead of heat: a thermal node NAME-i for each element", None)
    ends: Annotated[list[Text], Field(max_length=2)] = key(
        'supports of the first and last node: a body to which it is welded, "ground" or "free"', []
    )
    surface: RodSurfaceEntry | None = key(
        "round surface for contact; each node NAME.i has a surface of that name", None
    )
    velocity: Vector | None = key("velocity of the first node, world basis, m/s", None)
    angular_velocity: Vector | None = key("angular velocity of the whole beam, world basis, rad/s", None)
