"""Surfaces of bodies for contact, and the keys of contact laws."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self, final

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, WrapValidator
from pydantic_core import PydanticCustomError

from ephs.mechanics.scene.bodies import IDENTITY_POSE
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.errors import TEXTS, shown
from ephs.mechanics.scene.polytope import MOST_VERTICES, corners_of, vertices_of
from ephs.mechanics.scene.rotations import Rotation, turned
from ephs.mechanics.scene.rules import Told, rule
from ephs.mechanics.scene.schema_numbers import EntryTable, Extents, NonNegative, Number, Positive, Sizes, Text, Vector
from ephs.mechanics.scene.site import Site
from ephs.mechanics.scene.text import file_inside
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3

SOFT = ("stiffness", "exponent", "loss", "slip", "rolling", "spinning")
HARD = ("restitution", "tangential")
"""Keys of elastic surfaces that hard ones do not have, and of hard ones."""


class ContactLaw(EntryTable):
    """Keys of a contact's law, on a surface or on a contact."""

    stiffness: Positive | None = key(
        "stiffness k of the elastic force k dⁿ at overlap d", None, unit="N/m", shown="N/mⁿ"
    )
    exponent: Number | None = key("exponent n; 1.5 is Hertz's (default 1)", None, ge=1.0)
    loss: NonNegative | None = key("Hunt–Crossley loss α, {} (default 0)", None, unit="s/m")
    friction: NonNegative | None = key("coefficient of friction μ (default 0)", None, unit="1")
    slip: Positive | None = key("slip velocity below which friction is viscous, {} (default 1e-3)", None, unit="m/s")
    rolling: NonNegative | None = key("lever arm of rolling friction, {} (default 0)", None, unit="m")
    spinning: NonNegative | None = key("lever arm of spinning friction, {} (default 0)", None, unit="m")
    restitution: NonNegative | None = key(
        "coefficient of restitution; the contact is hard if the other surface has no stiffness", None, le=1.0
    )
    tangential: NonNegative | None = key(
        "tangential coefficient of restitution of hard surfaces (default restitution)", None, le=1.0
    )
    heat: Text | None = key("thermal node that takes up the heat", None, names="node")


class TouchingElement(ContactLaw, Element):
    """Base of surfaces and contacts: the keys and rules of a contact's law."""

    @rule(
        *SOFT, *HARD, at="", found="{hard} and {soft}", expected="stiffness or restitution",
        advice="hard contacts have no {soft}: remove one of the two",
    )  # fmt: skip
    def unmixed(self) -> Told:
        """Whether it has keys of elastic contacts only, or of hard ones."""
        hard, soft = ([name for name in names if getattr(self, name) is not None] for names in (HARD, SOFT))
        return not (hard and soft) or {"hard": hard[0], "soft": soft[0]}

    def rescaled(self, length: float, mass: float, time: float, coordinates: tuple[float, ...] = ()) -> Self:
        found = super().rescaled(length, mass, time, coordinates)
        if found.stiffness is None:
            return found
        return found.changed(stiffness=found.stiffness * length ** (1.0 - (self.exponent or 1.0)))


def _points(value: Any) -> Any:
    if isinstance(value, list) and not 4 <= len(value) <= MOST_VERTICES:
        raise PydanticCustomError("points_length", "4 to {most} points", {"most": MOST_VERTICES})
    return value


class SurfaceShape(EntryTable):
    """``shape`` of a surface: one of seven."""

    sphere: Positive | None = key("radius", None, unit="m")
    capsule: Sizes | None = key("radius, and length of its axis along z", None, unit="m")
    cylinder: Sizes | None = key("radius and length along z", None, unit="m")
    box: Extents | None = key("edge lengths", None, unit="m")
    plane: Annotated[dict[str, Number], Field(max_length=0)] | None = key("the plane z = 0, solid below", None)
    mesh: Text | None = key("STL file of a convex body; m", None)
    points: Annotated[list[Vector], BeforeValidator(_points), Field(min_length=4, max_length=MOST_VERTICES)] | None = (
        key("points of which the body is the convex hull", None, unit="m")
    )


def _shape(value: Any, _handler: Any) -> dict[str, Any] | None:
    """Shapes that a table gives, with their sizes; None of balls of a shell in a result."""
    return None if value is None else SurfaceShape.model_validate(value).model_dump(exclude_none=True)


Shape = Annotated[dict[str, Any], WrapValidator(_shape, json_schema_input_type=SurfaceShape)]


@final
class Surface(TouchingElement, section="surfaces", said="surfaces of bodies for contact"):
    """A surface on a body, on the ground, or on a shell of its file, where it is a ball at each node.

    A resolved one has one of ``{"sphere": r}``, ``{"capsule": [r, length]}``, ``{"cylinder": [r, length]}``, ``{"box":
    [x, y, z]}``, ``{"plane": {}}``, ``{"mesh": vertices}`` for its shape; m, axes along z, a plane solid below z = 0.
    One on a shell has a sphere or None.
    """

    body: Text = key('the body that has it, a shell of this file, or "ground"', names="carrier")
    shape: Shape = key(
        "sphere, capsule, cylinder, box, plane, mesh or points; of a shell a sphere, default: of half its thickness",
        None,
    )
    position: Vector | None = key("origin in the centre-of-mass frame (ground: world)", None, unit="m")
    rotation: Rotation | None = key("orientation there, [w, x, y, z] or a table", None)
    group: Text | None = key("surfaces of one group of a file are a contact only where [contacts] names them", None)
    _corners: list[list[float]] | None = PrivateAttr(None)
    turned = turned

    @rule(
        "body", "shape", "position", "rotation", at="{at}", placed=True, found="{found}", expected="{expected}",
        advice="balls at the nodes of a shell have a radius alone, other surfaces a shape",
    )  # fmt: skip
    def carried(self, site: Site) -> Told:
        """Whether it is a shape on a body or the ground, or balls on a shell."""
        if self.body not in site.scene.shells:
            what = type(self).model_fields["shape"].description
            return bool(self.shape) or {"at": "shape", "found": "nothing", "expected": what}
        if self.kind != "sphere":
            return {"at": "shape", "found": f"a {self.kind} on a shell", "expected": "a sphere, or nothing"}
        placed = next((at for at in ("position", "rotation") if getattr(self, at) is not None), None)
        return placed is None or {"at": placed, "found": shown(getattr(self, placed)), "expected": "nothing on a shell"}

    @rule(
        "shape", found="{found}", expected="one of sphere, capsule, cylinder, box, plane = {{}}, mesh, points",
        advice="a surface has exactly one shape",
    )  # fmt: skip
    def single(self) -> Told:
        """Whether it has one shape."""
        if self.shape is None:
            return True
        return len(self.shape) == 1 or {"found": " and ".join(self.shape) or "an empty table"}

    @rule("shape", at="shape.mesh", found="{found}", expected=TEXTS["mesh"][0], advice=TEXTS["mesh"][1])
    def near(self) -> Told:
        """Whether its mesh is where files may be read."""
        return self._file() is not None or {"found": shown(self.shape["mesh"])}

    @rule(
        "shape", at="shape.mesh", found="{found}", expected="an STL file of a convex body",
        advice="use its convex hull, or several convex pieces",
    )  # fmt: skip
    def convex(self) -> Told:
        """Whether its mesh bounds a convex body."""
        file = self._file()
        if not file or not file.name or len(self.shape) != 1:
            return True
        try:
            self._corners = vertices_of(file).tolist()
        except (ValueError, OSError) as error:
            return {"found": f"{file.name}, {error}"}
        return True

    @rule(
        "shape", at="shape.points", found="{found}", expected="points of a body with volume",
        advice="take a plane or a thin box for what is flat",
    )  # fmt: skip
    def thick(self) -> Told:
        """Whether its points are those of a body."""
        if "points" not in (self.shape or {}) or len(self.shape) != 1:
            return True
        try:
            self._corners = corners_of(np.array(self.shape["points"])).tolist()
        except ValueError as error:
            return {"found": str(error)}
        return True

    def _file(self) -> Path | None:
        """Its file if it is in the folder of the scene; an empty path where it has none, or is read already."""
        if not isinstance(name := (self.shape or {}).get("mesh"), str) or len(self.shape) != 1:
            return Path()
        return file_inside(self._folder / name, self._folder)

    def normalised(self) -> Self:
        q, corners = self.rotation, self._corners or (self.shape or {}).get("points")
        found = self.changed(
            rotation=None if q is None else (np.array(q) / np.linalg.norm(q)).tolist(),
            shape=self.shape if corners is None else {"mesh": corners},
        )
        found._corners = None
        return found

    @classmethod
    def _upgraded(cls, table: Mapping[str, Any]) -> dict[str, Any]:
        given = dict(table)
        if "frame" in given:
            frame = given.pop("frame")
            given |= {"rotation": frame[:4], "position": frame[4:]}
        if "mesh" in (given.get("shape") or {}):
            given["shape"] = {"points": given["shape"]["mesh"]}
        return given

    @property
    def kind(self) -> str:
        """Of its shape."""
        return next(iter(self.shape or ("sphere",)))

    @property
    def frame(self) -> Array:
        """(7,) pose in the body's centre-of-mass frame (ground: world)."""
        return np.concatenate((self.rotation or IDENTITY_POSE[:4], self.position or IDENTITY_POSE[4:]))

    def moved(self, pose: Array) -> Self:
        if self.body != GROUND:
            return self
        frame = SE3.compose(pose, self.frame)
        return self.changed(rotation=frame[:4].tolist(), position=frame[4:].tolist())

    def rescaled(self, length: float, mass: float, time: float, coordinates: tuple[float, ...] = ()) -> Self:
        shape = {kind: sizes and (np.asarray(sizes) * length).tolist() for kind, sizes in (self.shape or {}).items()}
        return super().rescaled(length, mass, time, coordinates).changed(shape=shape or None)

    def build(self, site: Site) -> None:
        """Nothing: contacts have its points."""

    def __str__(self) -> str:
        return f"{self.kind} on {self.body}"
