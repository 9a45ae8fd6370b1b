"""How bodies, joints and springs look in space."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ephs.show.errors import ShowError
from ephs.show.motion import Array, equivalent_box

Colour = tuple[int, int, int]

_INKS: tuple[Colour, ...] = (
    (86, 146, 190),
    (222, 160, 75),
    (98, 170, 140),
    (196, 124, 160),
    (205, 106, 78),
    (140, 140, 190),
)
_MUTED: Colour = (168, 174, 182)
_METAL: Colour = (70, 76, 84)
_AXIS: Colour = (198, 58, 40)
_PLACES = {"position": "position", "wxyz": "rotation"}


def ink(index: int) -> Colour:
    """Colour of the body with this number."""
    return _INKS[index % len(_INKS)]


def extent(body: Any) -> float:
    """Radius, m, of a ball about the centre of mass that holds the body's shapes (meshes: its stand-in)."""
    return max(_reach(shape, body) + _offset(shape) for shape in _shapes(body))


def _shapes(body: Any) -> Sequence[Any]:
    """The shapes of a body; None stands for one that is made up."""
    return tuple(body.shapes) or (body.shape,)


def _offset(shape: Any) -> float:
    return float(np.linalg.norm((shape or {}).get("position", (0.0, 0.0, 0.0))))


def _reach(shape: Any, body: Any) -> float:
    match shape:
        case {"box": [x, y, z]}:
            return 0.5 * math.sqrt(x * x + y * y + z * z)
        case {"sphere": radius}:
            return float(radius)
        case {"cylinder": [radius, length]}:
            return math.hypot(radius, 0.5 * length)
        case _:
            sides, _ = equivalent_box(float(body.mass), np.asarray(body.inertia, dtype=float))
            return 0.5 * float(np.linalg.norm(sides))


def add_body(server: Any, node: str, body: Any, colour: Colour, size: float, name: str) -> None:
    """Draw a body at its frame; `size` is that of the whole scene, m.

    Raises
    ------
    ShowError
        If its shape is none of those known, or its mesh file cannot be found.
    """
    for number, shape in enumerate(_shapes(body)):
        own = node if not number else f"{node} {number + 1}"
        _add_shape(server.scene, own, shape, body, colour, size, name)


def _add_shape(scene: Any, node: str, shape: Any, body: Any, colour: Colour, size: float, name: str) -> None:
    place = shape or {}
    at: dict[str, Any] = {key: place[word] for key, word in _PLACES.items() if word in place}
    match shape:
        case {"box": [x, y, z]}:
            scene.add_box(node, color=colour, dimensions=(float(x), float(y), float(z)), **at)
        case {"sphere": radius}:
            scene.add_icosphere(node, radius=float(radius), color=colour, subdivisions=4, **at)
        case {"cylinder": [radius, length]}:
            scene.add_cylinder(node, radius=float(radius), height=float(length), color=colour, **at)
        case {"mesh": file}:
            _add_mesh(scene, node, file, colour, name, shape.get("scale", (1.0, 1.0, 1.0)), at)
        case None | {}:
            sides, turn = equivalent_box(float(body.mass), np.asarray(body.inertia, dtype=float))
            if sides.max() <= 0:
                scene.add_icosphere(node, radius=0.012 * size, color=_MUTED, subdivisions=3)
                return
            scene.add_box(node, color=_MUTED, dimensions=_three(sides), wxyz=turn, opacity=0.75)
        case other:
            raise ShowError("shape", path=name, found=str(other))


def _add_mesh(
    scene: Any, node: str, file: Any, colour: Colour, name: str, scale: Sequence[float], at: dict[str, Any]
) -> None:
    import trimesh

    try:
        mesh: Any = trimesh.load_mesh(str(file))
    except (OSError, ValueError) as fault:
        raise ShowError("shape", path=name, found=f"a mesh that cannot be read ({fault})") from fault
    points = np.asarray(mesh.vertices) * np.asarray(scale, dtype=float)
    scene.add_mesh_simple(node, vertices=points, faces=np.asarray(mesh.faces), color=colour, **at)


def add_joint(server: Any, node: str, joint: Any, size: float) -> None:
    """Draw a joint at its frame on body 1, its axis along z; `size` is the radius of its symbol, m."""
    scene = server.scene
    pose = np.asarray(joint.frame1, dtype=float)
    scene.add_frame(node, show_axes=False, wxyz=pose[:4], position=pose[4:])
    match joint.kind:
        case "revolute":
            _cylinder(scene, node, size, 2.6 * size)
            _axis(scene, node, size)
        case "screw":
            _cylinder(scene, node, 0.7 * size, 4.0 * size)
            turns = np.linspace(0.0, 8 * math.pi, 97)
            thread = np.stack(
                [
                    0.85 * size * np.cos(turns),
                    0.85 * size * np.sin(turns),
                    size * (turns / (2 * math.pi) - 2),
                ],
                1,
            )
            _polyline(scene, f"{node}/thread", thread, _AXIS, 0.16 * size)
            _axis(scene, node, size)
        case "cylindrical":
            _cylinder(scene, node, 0.6 * size, 6.0 * size)
            scene.add_cylinder(f"{node}/sleeve", radius=size, height=2.0 * size, color=_METAL)
            _axis(scene, node, size)
        case "prismatic":
            scene.add_box(f"{node}/rail", color=_METAL, dimensions=(0.7 * size, 0.7 * size, 7.0 * size))
            scene.add_box(f"{node}/carriage", color=_METAL, dimensions=(1.6 * size, 1.6 * size, 2.0 * size))
            _axis(scene, node, size, half=5.0)
        case "planar":
            scene.add_box(f"{node}/plate", color=_METAL, dimensions=(5.0 * size, 5.0 * size, 0.2 * size), opacity=0.6)
            _axis(scene, node, size)
        case "spherical":
            scene.add_icosphere(f"{node}/ball", radius=1.1 * size, color=_METAL, subdivisions=3)
        case "universal":
            scene.add_icosphere(f"{node}/cross", radius=0.8 * size, color=_METAL, subdivisions=3)
            _axis(scene, node, size)
        case "fixed":
            scene.add_box(f"{node}/weld", color=_METAL, dimensions=(1.3 * size, 1.3 * size, 1.3 * size))
        case _:
            # A free joint joins nothing that could be drawn.
            pass


def add_spring(server: Any, node: str, size: float) -> Any:
    """Draw a coil of unit length along z, to be placed, turned and stretched; `size` is that of the scene, m."""
    turns = np.linspace(0.0, 16 * math.pi, 193)
    radius = 0.016 * size * np.clip(np.minimum(turns, turns[-1] - turns) / math.pi, 0.0, 1.0)
    heights = 0.08 + 0.84 * turns / turns[-1]
    coil = np.stack([radius * np.cos(turns), radius * np.sin(turns), heights], axis=1)
    line = np.concatenate([[[0.0, 0.0, 0.0]], coil, [[0.0, 0.0, 1.0]]])
    return _polyline(server.scene, node, line, _METAL, 2.0, units="screen")


def _three(sides: Array) -> tuple[float, float, float]:
    return (float(sides[0]), float(sides[1]), float(sides[2]))


def _cylinder(scene: Any, node: str, radius: float, height: float) -> None:
    scene.add_cylinder(f"{node}/pin", radius=radius, height=height, color=_METAL)


def _axis(scene: Any, node: str, size: float, half: float = 3.6) -> None:
    ends = np.array([[0.0, 0.0, -half * size], [0.0, 0.0, half * size]])
    _polyline(scene, f"{node}/axis", ends, _AXIS, 2.0, units="screen")


def _polyline(scene: Any, node: str, line: Array, colour: Colour, thickness: float, units: str = "world") -> Any:
    pieces = np.stack([line[:-1], line[1:]], axis=1)
    return scene.add_line_segments(node, points=pieces, colors=colour, thickness=thickness, thickness_units=units)
