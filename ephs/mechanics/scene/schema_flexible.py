"""Tables of beams in scene files."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, create_model

from ephs.mechanics.scene.schema_numbers import Entry, Extents, NonNegative, Number, Positive, Sizes, Text, Vector, key
from ephs.mechanics.scene.surfaces import ContactLaw


class SectionEntry(Entry):
    """``section``: numbers, or a shape with E, nu and rho."""

    EA: Positive | None = key("axial stiffness, N", None)
    GA: Sizes | None = key("shear stiffness along axes 2 and 3, N", None)
    GJ: Positive | None = key("torsional stiffness, N m²", None)
    EI: Sizes | None = key("bending stiffness about axes 2 and 3, N m²", None)
    rhoA: Positive | None = key("mass per length, kg/m", None)
    rhoI: Extents | None = key("inertia per length about axes 1, 2, 3, kg m", None)
    circle: Positive | None = key("radius, m", None)
    tube: Sizes | None = key("outer and inner radius, m", None)
    rectangle: Sizes | None = key("width along axis 3 and height along axis 2, m", None)
    E: Positive | None = key("Young's modulus, N/m²", None)
    nu: Annotated[Number, Field(gt=-1.0, le=0.5)] | None = key("Poisson's ratio", None)
    rho: Positive | None = key("density, kg/m³", None)


class RodHeatEntry(Entry):
    """``thermal`` of a beam: a store of heat for each element, and heat conduction between neighbours."""

    capacity: Positive = key("heat capacity per length, J/(m K)")
    conduction: NonNegative = key("conductivity times area, W m/K", 0.0)
    temperature: Positive = key("initial temperature, K")
    expansion: NonNegative = key("coefficient of linear thermal expansion, 1/K", 0.0)
    reference: Positive | None = key("temperature without thermal stress, K; default: temperature", None)


class RodSurfaceEntry(ContactLaw):
    """``surface`` of a beam: a capsule along each node's piece, which meets others and the pieces further on."""

    radius: Positive | None = key("radius of the surface, m; default: that of a circle or tube", None)


_Vector: TypeAlias = Vector | None
_Points: TypeAlias = Annotated[list[Vector], Field(min_length=2)] | None
_Count: TypeAlias = Annotated[int, Field(strict=True, ge=1)] | None
_Strain: TypeAlias = Annotated[list[Number], Field(min_length=6, max_length=6)] | None
_BEAM: dict[str, Any] = {
    "from": (_Vector, key("start point, world coordinates, m", None)),
    "to": (_Vector, key("end point, world coordinates, m", None)),
    "points": (_Points, key("points on a curve, instead of from and to, with a node at each, m", None)),
    "up": (_Vector, key("world direction of axis 2 of the section, made normal to the tangent", None)),
    "elements": (_Count, key("number of elements, the same between any two points; 1 there unless given", None)),
    "order": (
        Literal[2, 4],
        key("order of convergence in the element length, for statics and for the motion of thin beams", 2),
    ),
    "rod": (
        Literal["reissner", "kirchhoff", "string"],
        key("kirchhoff: inextensible and without shear; string: also without bending and torsion", "reissner"),
    ),
    "section": (SectionEntry, key("stiffness and inertia per length")),
    "strain": (_Strain, key("initial strain: torsion, bending about 2, 3 in 1/m, stretch, shear along 2, 3", None)),
    "damping": (NonNegative, key("Kelvin–Voigt damping time, s", 0.0)),
    "heat": (Text, key("where the heat of damping goes: a thermal name", "environment")),
    "thermal": (RodHeatEntry | None, key("instead of heat: a thermal node NAME-i for each element", None)),
    "ends": (
        Annotated[list[Text], Field(max_length=2)],
        key('supports of the first and last node: a body to which it is welded, "ground" or "free"', []),
    ),
    "surface": (
        RodSurfaceEntry | None,
        key("round surface for contact; each node NAME.i has a surface of that name", None),
    ),
    "velocity": (_Vector, key("velocity of the first node, world basis, m/s", None)),
    "angular_velocity": (_Vector, key("angular velocity of the whole beam, world basis, rad/s", None)),
}
# A class cannot have `from` as a name.
BeamEntry: Any = create_model("BeamEntry", __base__=Entry, __doc__="``[beams.NAME]``", **_BEAM)
