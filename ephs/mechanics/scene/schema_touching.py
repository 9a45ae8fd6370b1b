"""Tables of surfaces and contacts in scene files."""

from typing import Annotated

from pydantic import Field

from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_numbers import Entry, NonNegative, Number, Pair, Positive, Sizes, Text, Vector

__all__ = ["ContactEntry", "ContactLawEntry", "SurfaceEntry", "SurfaceShapeEntry"]


class SurfaceShapeEntry(Entry):
    """``shape`` of a surface: one of six."""

    sphere: Positive | None = Field(default=None, description="radius, m")
    capsule: Sizes | None = Field(default=None, description="radius, and length of its axis along z, m")
    cylinder: Sizes | None = Field(default=None, description="radius and length along z, m")
    box: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="edge lengths, m"
    )
    plane: Annotated[dict[str, Number], Field(max_length=0)] | None = Field(
        default=None, description="the plane z = 0, solid below"
    )
    mesh: Text | None = Field(default=None, description="STL file of a convex body; m")


class ContactLawEntry(Entry):
    """Keys of a contact's law, on a surface or on a contact."""

    stiffness: Positive | None = Field(
        default=None, description="stiffness k of the elastic force k dⁿ at overlap d, N/mⁿ"
    )
    exponent: Number | None = Field(default=None, ge=1.0, description="exponent n; 1.5 is Hertz's (default 1)")
    loss: NonNegative | None = Field(default=None, description="Hunt–Crossley loss α, s/m (default 0)")
    friction: NonNegative | None = Field(default=None, description="coefficient of friction μ (default 0)")
    slip: Positive | None = Field(
        default=None, description="slip velocity below which friction is viscous, m/s (default 1e-3)"
    )
    rolling: NonNegative | None = Field(default=None, description="lever arm of rolling friction, m (default 0)")
    spinning: NonNegative | None = Field(default=None, description="lever arm of spinning friction, m (default 0)")
    restitution: NonNegative | None = Field(
        default=None,
        le=1.0,
        description="coefficient of restitution; the contact is hard if the other surface has no stiffness",
    )
    tangential: NonNegative | None = Field(
        default=None, le=1.0, description="tangential coefficient of restitution of hard surfaces (default restitution)"
    )
    heat: Text | None = Field(default=None, description="thermal node that takes up the heat")


class SurfaceEntry(ContactLawEntry):
    """``[surfaces.NAME]``"""

    body: Text = Field(description='the body that has it, or "ground"')
    shape: SurfaceShapeEntry = Field(description="sphere, capsule, cylinder, box, plane or mesh")
    position: Vector | None = Field(default=None, description="origin in the centre-of-mass frame (ground: world), m")
    rotation: Rotation | None = Field(default=None, description="orientation there, [w, x, y, z] or a table")


class ContactEntry(ContactLawEntry):
    """``[contacts.NAME]``"""

    surfaces: Pair = Field(description="names of two surfaces; the other keys of this table replace theirs")
