"""Shapes of bodies, joints and springs in space."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ephs.show.motions.motion import Array, between
from ephs.show.motions.solids import Solid

Colour = tuple[int, int, int]

_INKS: tuple[Colour, ...] = (
    (86, 146, 190),
    (222, 160, 75),
    (98, 170, 140),
    (196, 124, 160),
    (205, 106, 78),
    (140, 140, 190),
)
MUTED: Colour = (168, 174, 182)
METAL: Colour = (70, 76, 84)
_AXIS: Colour = (198, 58, 40)
_PLACES = {"position": "position", "wxyz": "rotation"}


JOINTS: Mapping[str, tuple[tuple[Any, ...], ...]] = {
    "revolute": (("pin", "cylinder", (1.0, 4.0)),),
    "screw": (("pin", "cylinder", (0.7, 4.0)),),
    "cylindrical": (("pin", "cylinder", (0.6, 6.0)), ("sleeve", "cylinder", (1.0, 2.0))),
    "prismatic": (("rail", "box", (0.7, 0.7, 7.0)), ("carriage", "box", (1.6, 1.6, 2.0))),
    "planar": (("plate", "box", (5.0, 5.0, 0.2), 0.6),),
    "spherical": (("ball", "sphere", (1.1,)),),
    "universal": (("cross", "sphere", (0.8,)),),
    "fixed": (("weld", "box", (1.3, 1.3, 1.3)),),
}
"""Symbol of each kind of joint about its axis z: solids with their sizes in radii of the symbol, and their opacity."""


def half_axis(kind: str) -> float:
    """Half the length of the axis that is drawn through a joint's symbol, in its radii; 0 where it has none."""
    return 0.0 if kind in ("spherical", "fixed") or kind not in JOINTS else 6.0 if kind == "prismatic" else 5.0


def ink(index: int) -> Colour:
    """Colour of the body with this number."""
    return _INKS[index % len(_INKS)]


def add_body(server: Any, node: str, solid: Solid, colour: Colour, size: float, opacity: float | None) -> list[Any]:
    """Draw a body at its frame, and give the nodes that have its colour; `size` is that of the whole scene, m."""
    return [
        _add_part(server.scene, f"{node} {number + 1}" if number else node, part, colour, size, opacity)
        for number, part in enumerate(solid.parts or (solid,))
    ]


def _add_part(scene: Any, node: str, solid: Solid, colour: Colour, size: float, opacity: float | None) -> Any:
    shape: Any = solid.shape or {}
    at: dict[str, Any] = {key: shape[word] for key, word in _PLACES.items() if word in shape}
    match solid.kind:
        case "sphere":
            radius = float(shape["sphere"])
            return scene.add_icosphere(node, radius=radius, color=colour, subdivisions=4, opacity=opacity, **at)
        case "cylinder":
            radius, height = (float(number) for number in shape["cylinder"])
            return scene.add_cylinder(node, radius=radius, height=height, color=colour, opacity=opacity, **at)
        case "point":
            return scene.add_icosphere(node, radius=0.012 * size, color=MUTED, subdivisions=3)
        case _:
            # flat faces want corners of their own, so that their edges stay sharp
            corners = solid.vertices[solid.triangles].reshape(-1, 3)
            faces = np.arange(len(corners)).reshape(-1, 3)
            tone = MUTED if solid.kind == "stand-in" else colour
            through = opacity or (0.75 if solid.kind == "stand-in" else None)
            return scene.add_mesh_simple(node, vertices=corners, faces=faces, color=tone, opacity=through)


def add_joint(server: Any, node: str, joint: Any, size: float) -> list[Any]:
    """Draw a joint at its frame on body 1, its axis along z, and give the nodes that have the colour of metal.

    `size` is the radius of its symbol, m.
    """
    scene = server.scene
    pose = np.asarray(joint.frame1, dtype=float)
    scene.add_frame(node, show_axes=False, wxyz=pose[:4], position=pose[4:])
    metal: list[Any] = []
    for name, shape, sides, *opacity in JOINTS.get(joint.kind, ()):
        lengths = tuple(size * side for side in sides)
        style: dict[str, Any] = {"color": METAL} | dict(zip(("opacity",), opacity, strict=False))
        if shape == "cylinder":
            drawn = scene.add_cylinder(f"{node}/{name}", radius=lengths[0], height=lengths[1], **style)
        elif shape == "sphere":
            drawn = scene.add_icosphere(f"{node}/{name}", radius=lengths[0], subdivisions=3, **style)
        else:
            drawn = scene.add_box(f"{node}/{name}", dimensions=lengths, **style)
        metal.append(drawn)
    if joint.kind == "screw":
        turns = np.linspace(0.0, 8 * math.pi, 97)
        thread = np.stack(
            [0.85 * size * np.cos(turns), 0.85 * size * np.sin(turns), size * (turns / (2 * math.pi) - 2)], 1
        )
        _polyline(scene, f"{node}/thread", thread, _AXIS, 0.16 * size)
    if half := half_axis(joint.kind):
        ends = np.array([[0.0, 0.0, -half * size], [0.0, 0.0, half * size]])
        _polyline(scene, f"{node}/axis", ends, _AXIS, 2.5, units="screen")
    return metal


def add_spring(server: Any, node: str, size: float) -> Any:
    """Draw a coil of unit length along z, to be placed, turned and stretched; `size` is that of the scene, m, 0 for a
    straight line."""
    turns = np.linspace(0.0, 16 * math.pi, 193)
    radius = 0.016 * size * np.clip(np.minimum(turns, turns[-1] - turns) / math.pi, 0.0, 1.0)
    heights = 0.08 + 0.84 * turns / turns[-1]
    coil = np.stack([radius * np.cos(turns), radius * np.sin(turns), heights], axis=1)
    line = np.concatenate([[[0.0, 0.0, 0.0]], coil, [[0.0, 0.0, 1.0]]])
    return _polyline(server.scene, node, line, METAL, 3.0, units="screen")


def add_stick(server: Any, node: str, ends: tuple[Array, Array], colour: Colour, radius: float) -> None:
    """Draw a thin rod from point to point, m."""
    turn, length = between(*ends)
    middle = 0.5 * (ends[0] + ends[1])
    server.scene.add_cylinder(node, radius=radius, height=length, color=colour, wxyz=turn, position=middle)


def _polyline(scene: Any, node: str, line: Array, colour: Colour, thickness: float, units: str = "world") -> Any:
    pieces = np.stack([line[:-1], line[1:]], axis=1)
    return scene.add_line_segments(node, points=pieces, colors=colour, thickness=thickness, thickness_units=units)
