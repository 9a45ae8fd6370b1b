"""Surfaces of bodies, and contacts between two of them, in a resolved scene."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, final

from ephs.mechanics.scene.element import POSE, Named, SceneElement
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law
from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Surface(SceneElement):
    """A surface on a body, or on the ground.

    Attributes
    ----------
    shape : one of ``{"sphere": r}``, ``{"capsule": [r, length]}``, ``{"cylinder": [r, length]}``, ``{"box": [x, y,
        z]}``, ``{"plane": {}}``, ``{"mesh": vertices}``; m, axes along z, a plane solid below z = 0
    frame : (7,) pose in the body's centre-of-mass frame (ground: world)
    """

    name: str
    body: Annotated[str, Named("body")]
    shape: Mapping[str, Any]
    frame: Annotated[Array, POSE]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Contact(SceneElement):
    """A contact between two surfaces.

    Attributes
    ----------
    surfaces : names of both
    law : of an elastic contact, or of a hard one
    heat : where the heat goes, ``"environment"`` or the name of a thermal node
    """

    name: str
    surfaces: Annotated[tuple[str, str], Named("surface")]
    law: Law | Impact
    heat: Annotated[str, Named("node")]
