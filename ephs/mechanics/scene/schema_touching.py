"""Tables of surfaces and contacts in scene files."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from ephs.mechanics.scene.polytope import MOST_VERTICES
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_numbers import (
    Entry,
    Extents,
    NonNegative,
    Number,
    Pair,
    Positive,
    Sizes,
    Text,
    Vector,
    key,
)


def _points(value: Any) -> Any:
    if isinstance(value, list) and not 4 <= len(value) <= MOST_VERTICES:
        raise PydanticCustomError("points_length", "4 to {most} points", {"most": MOST_VERTICES})
    return value


class SurfaceShapeEntry(Entry):
    """``shape`` of a surface: one of seven."""

    sphere: Positive | None = key("radius, m", None)
    capsule: Sizes | None = key("radius, and length of its axis along z, m", None)
    cylinder: Sizes | None = key("radius and length along z, m", None)
    box: Extents | None = key("edge lengths, m", None)
    plane: Annotated[dict[str, Number], Field(max_length=0)] | None = key("the plane z = 0, solid below", None)
    mesh: Text | None = key("STL file of a convex body; m", None)
    points: Annotated[list[Vector], BeforeValidator(_points), Field(min_length=4, max_length=MOST_VERTICES)] | None = (
        key("points of which the body is the convex hull, m", None)
    )


class ContactLawEntry(Entry):
    """Keys of a contact's law, on a surface or on a contact."""

    stiffness: Positive | None = key("stiffness k of the elastic force k dⁿ at overlap d, N/mⁿ", None)
    exponent: Number | None = key("exponent n; 1.5 is Hertz's (default 1)", None, ge=1.0)
    loss: NonNegative | None = key("Hunt–Crossley loss α, s/m (default 0)", None)
    friction: NonNegative | None = key("coefficient of friction μ (default 0)", None)
    slip: Positive | None = key("slip velocity below which friction is viscous, m/s (default 1e-3)", None)
    rolling: NonNegative | None = key("lever arm of rolling friction, m (default 0)", None)
    spinning: NonNegative | None = key("lever arm of spinning friction, m (default 0)", None)
    restitution: NonNegative | None = key(
        "coefficient of restitution; the contact is hard if the other surface has no stiffness", None, le=1.0
    )
    tangential: NonNegative | None = key(
        "tangential coefficient of restitution of hard surfaces (default restitution)", None, le=1.0
    )
    heat: Text | None = key("thermal node that takes up the heat", None)


class SurfaceEntry(ContactLawEntry):
    """``[surfaces.NAME]``"""

    body: Text = key('the body that has it, or "ground"')
    shape: SurfaceShapeEntry = key("sphere, capsule, cylinder, box, plane, mesh or points")
    position: Vector | None = key("origin in the centre-of-mass frame (ground: world), m", None)
    rotation: Rotation | None = key("orientation there, [w, x, y, z] or a table", None)
    group: Text | None = key("surfaces of one group of a file are a contact only where [contacts] names them", None)


class ContactEntry(ContactLawEntry):
    """``[contacts.NAME]``"""

    surfaces: Pair = key("names of two surfaces; the other keys of this table replace theirs")
