"""Tables of beams in scene files."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, create_model

from ephs.mechanics.scene.schema_numbers import Entry, NonNegative, Number, Positive, Text, Vector
from ephs.mechanics.scene.schema_touching import ContactLawEntry


class SectionEntry(Entry):
    """``section``: numbers, or a shape with E, nu and rho."""

    EA: Positive | None = Field(default=None, description="axial stiffness, N")
    GA: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="shear stiffness along axes 2 and 3, N"
    )
    GJ: Positive | None = Field(default=None, description="torsional stiffness, N m²")
    EI: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="bending stiffness about axes 2 and 3, N m²"
    )
    rhoA: Positive | None = Field(default=None, description="mass per length, kg/m")
    rhoI: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="inertia per length about axes 1, 2, 3, kg m"
    )
    circle: Positive | None = Field(default=None, description="radius, m")
    tube: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="outer and inner radius, m"
    )
    rectangle: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="width along axis 3 and height along axis 2, m"
    )
    E: Positive | None = Field(default=None, description="Young's modulus, N/m²")
    nu: Annotated[Number, Field(gt=-1.0, le=0.5)] | None = Field(default=None, description="Poisson's ratio")
    rho: Positive | None = Field(default=None, description="density, kg/m³")


class RodHeatEntry(Entry):
    """``thermal`` of a beam: a store of heat for each element, and heat conduction between neighbours."""

    capacity: Positive = Field(description="heat capacity per length, J/(m K)")
    conduction: NonNegative = Field(default=0.0, description="conductivity times area, W m/K")
    temperature: Positive = Field(description="initial temperature, K")
    expansion: NonNegative = Field(default=0.0, description="coefficient of linear thermal expansion, 1/K")
    reference: Positive | None = Field(
        default=None, description="temperature without thermal stress, K; default: temperature"
    )


class RodSurfaceEntry(ContactLawEntry):
    """``surface`` of a beam: a capsule along each node's piece, which meets others and the pieces further on."""

    radius: Positive | None = Field(
        default=None, description="radius of the surface, m; default: that of a circle or tube"
    )


_Vector: TypeAlias = Vector | None
_Points: TypeAlias = Annotated[list[Vector], Field(min_length=2)] | None
_Count: TypeAlias = Annotated[int, Field(strict=True, ge=1)] | None
_Strain: TypeAlias = Annotated[list[Number], Field(min_length=6, max_length=6)] | None
_BEAM: dict[str, Any] = {
    "from": (_Vector, Field(default=None, description="start point, world coordinates, m")),
    "to": (_Vector, Field(default=None, description="end point, world coordinates, m")),
    "points": (
        _Points,
        Field(default=None, description="points on a curve, instead of from and to, with a node at each, m"),
    ),
    "up": (
        _Vector,
        Field(default=None, description="world direction of axis 2 of the section, made normal to the tangent"),
    ),
    "elements": (
        _Count,
        Field(
            default=None,
            description="number of elements, the same between any two points; 1 there unless given",
        ),
    ),
    "order": (
        Literal[2, 4],
        Field(
            default=2,
            description="order of convergence in the element length, for statics and for the motion of thin beams",
        ),
    ),
    "rod": (
        Literal["reissner", "kirchhoff", "string"],
        Field(
            default="reissner",
            description="kirchhoff: inextensible and without shear; string: also without bending and torsion",
        ),
    ),
    "section": (SectionEntry, Field(description="stiffness and inertia per length")),
    "strain": (
        _Strain,
        Field(
            default=None, description="initial strain: torsion, bending about 2, 3 in 1/m, stretch, shear along 2, 3"
        ),
    ),
    "damping": (NonNegative, Field(default=0.0, description="Kelvin–Voigt damping time, s")),
    "heat": (Text, Field(default="environment", description="where the heat of damping goes: a thermal name")),
    "thermal": (
        RodHeatEntry | None,
        Field(default=None, description="instead of heat: a thermal node NAME-i for each element"),
    ),
    "ends": (
        Annotated[list[Text], Field(max_length=2)],
        Field(
            default=[],
            description='supports of the first and last node: a body to which it is welded, "ground" or "free"',
        ),
    ),
    "surface": (
        RodSurfaceEntry | None,
        Field(default=None, description="round surface for contact; each node NAME.i has a surface of that name"),
    ),
    "velocity": (_Vector, Field(default=None, description="velocity of the first node, world basis, m/s")),
    "angular_velocity": (
        _Vector,
        Field(default=None, description="angular velocity of the whole beam, world basis, rad/s"),
    ),
}
# a class cannot have `from` for a name
BeamEntry: Any = create_model("BeamEntry", __base__=Entry, __doc__="``[beams.NAME]``", **_BEAM)
