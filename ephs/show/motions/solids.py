"""Bodies as surfaces: their shape, their mesh, or the box of the same mass and inertia."""

import io
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.text import MESHES
from ephs.show.motions.motion import Array, equivalent_box, rotate
from ephs.show.motions.sheets import sheets_of
from ephs.show.shared.errors import ShowError

MOST_MB = 100
"""Largest mesh that is drawn."""
FINE = 2000
"""Faces from which on a schematic takes corners together that are one dot on it."""
SIDES = 28
"""Sides of a round solid."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A closed surface in the body's frame.

    Attributes
    ----------
    vertices : (n, 3)
        In m.
    faces : tuple of (k,) integer arrays
        Corners of each face, seen from outside against the clock.
    kind : str
        ``"box"``, ``"sphere"``, ``"cylinder"``, ``"mesh"``, ``"stand-in"``, or ``"point"``: nothing is known.
    note : str
        Why it is a stand-in, where a mesh was wanted.
    shape : mapping, optional
        What it was made from.
    parts : tuple of Solid
        Of a body of several shapes, each of them.
    """

    vertices: Array
    faces: tuple[NDArray[np.int64], ...]
    kind: str
    note: str = ""
    shape: Any = None
    parts: "tuple[Solid, ...]" = ()

    @property
    def reach(self) -> float:
        """Radius in m of its bounding sphere about the centre of mass."""
        return float(np.linalg.norm(self.vertices, axis=1).max(initial=0.0))

    def stick(self, point: Array) -> tuple[Array, Array] | None:
        """From the surface's box to a point (3,) of the body that is outside of it, None where it is within."""
        inside = np.clip(point, self.vertices.min(axis=0), self.vertices.max(axis=0))
        return (inside, point) if float(np.linalg.norm(point - inside)) > 0.02 * self.reach else None

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(k, 3) corners."""
        return np.array([(f[0], f[i], f[i + 1]) for f in self.faces for i in range(1, len(f) - 1)]).reshape(-1, 3)


def coarse(solid: Solid, cell: float) -> Solid:
    """A solid with many faces, with all corners within a cell of a grid, m, at one of them; others as they are."""
    if len(solid.faces) <= FINE:
        return solid
    cells = np.floor(solid.vertices / cell).astype(np.int64)
    _, first, which = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = first[which.reshape(-1)][solid.triangles]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    turned = np.arange(3) + faces.argmin(axis=1)[:, None]
    return replace(solid, faces=tuple(np.unique(np.take_along_axis(faces, turned % 3, axis=1), axis=0)))


def box(sides: Array) -> tuple[Array, tuple[NDArray[np.int64], ...]]:
    """Vertices and faces of a box about the origin."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return 0.5 * signs * np.asarray(sides, dtype=float), tuple(np.array(face) for face in faces)


def cylinder(radius: float, length: float) -> tuple[Array, tuple[NDArray[np.int64], ...]]:
    """Vertices and faces of a cylinder about z, the caps last."""
    turns = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    ring = radius * np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    rise = np.array([0.0, 0.0, 0.5 * length])
    near, far = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    around = [np.array([i, j, j + SIDES, i + SIDES]) for i, j in zip(near, far, strict=True)]
    return np.vstack([ring - rise, ring + rise]), (*around, near[::-1], near + SIDES)


def sphere(radius: float) -> tuple[Array, tuple[NDArray[np.int64], ...]]:
    """Vertices and faces of a ball."""
    rings = SIDES // 2
    heights = np.linspace(0.0, math.pi, rings + 1)
    turns = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    up, around = np.meshgrid(heights, turns, indexing="ij")
    points = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), -np.cos(up)], axis=-1).reshape(-1, 3)
    faces = [
        np.array([i * SIDES + j, i * SIDES + (j + 1) % SIDES, (i + 1) * SIDES + (j + 1) % SIDES, (i + 1) * SIDES + j])
        for i in range(rings)
        for j in range(SIDES)
    ]
    return radius * points, tuple(faces)


def held_at(body: str, joints: Iterable[Any], springs: Iterable[Any]) -> list[Array]:
    """The points (3,) of a body, in its frame, at which joints and springs are attached."""
    out = [
        np.asarray(f, dtype=float)[4:]
        for j in joints
        for b, f in ((j.body1, j.frame1), (j.body2, j.frame2))
        if b == body
    ]
    return out + [
        np.asarray(at, dtype=float) for s in springs for b, at in ((s.body1, s.at1), (s.body2, s.at2)) if b == body
    ]


def solids_of(scene: Any) -> dict[str, Solid]:
    """The solids of a scene's bodies by name; those of their surfaces where bodies have none; no nodes of shells."""
    nodes = {node for sheet in sheets_of(scene).values() for node in sheet.nodes}
    surfaces: dict[str, list[Any]] = {}
    for _, surface in scene.all_surfaces():
        if surface.shape:  # shells are drawn as such
            surfaces.setdefault(surface.body, []).extend(_shapes_of(surface))
    found: dict[str, Solid] = {}
    for name, body in scene.all_bodies():
        if name in nodes:
            continue
        bare = body.shape is None and not body.shapes
        found[name] = solid_of(replace(body, shapes=tuple(surfaces[name])) if bare and name in surfaces else body, name)
    return found


def _shapes_of(surface: Any) -> list[dict[str, Any]]:
    """Shapes that draw a surface; a capsule is a cylinder with two balls, a plane none."""
    ((kind, sizes),) = surface.shape.items()
    at: dict[str, Any] = {"rotation": surface.frame[:4], "position": surface.frame[4:]}
    if kind != "capsule":
        return [] if kind == "plane" else [{kind: sizes, **at}]
    radius, length = sizes
    axis = rotate(np.asarray(surface.frame[:4], dtype=float), np.array([[0.0, 0.0, 0.5 * length]]))[0]
    balls = [{"sphere": radius, "position": surface.frame[4:] + side * axis} for side in (-1.0, 1.0)]
    return [{"cylinder": [radius, length], **at}, *balls]


def solid_of(body: Any, name: str) -> Solid:
    """Surface of a body; for an unreadable mesh the box of its inertia, with a note.

    Raises
    ------
    ShowError
        If a shape is none of those known.
    """
    parts = tuple(_placed(shape, body, name) for shape in body.shapes or (body.shape,))
    if len(parts) == 1:
        return parts[0]
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = tuple(face + at for part, at in zip(parts, first, strict=False) for face in part.faces)
    kind = "stand-in" if all(part.kind == "stand-in" for part in parts) else "shapes"
    note = "; ".join(filter(None, (part.note for part in parts)))
    return Solid(np.concatenate([part.vertices for part in parts]), faces, kind, note, None, parts)


def _placed(shape: Any, body: Any, name: str) -> Solid:
    """A shape where it is in the body's frame."""
    solid = _made(shape, body, name)
    if not shape or solid.kind == "stand-in":
        return solid
    turned = rotate(np.asarray(shape.get("rotation", (1.0, 0.0, 0.0, 0.0)), dtype=float), solid.vertices)
    return replace(
        solid, vertices=turned + np.asarray(shape.get("position", (0.0, 0.0, 0.0)), dtype=float), shape=shape
    )


def _made(shape: Any, body: Any, name: str) -> Solid:
    match shape:
        case {"box": [x, y, z]}:
            return Solid(*box(np.array([x, y, z], dtype=float)), "box")
        case {"sphere": radius}:
            return Solid(*sphere(float(radius)), "sphere")
        case {"cylinder": [radius, length]}:
            return Solid(*cylinder(float(radius), float(length)), "cylinder")
        case {"mesh": file}:
            return _mesh(FilePath(str(file)), shape.get("scale", (1.0, 1.0, 1.0)), body, name)
        case None | {}:
            return _stand_in(body, "")
        case other:
            raise ShowError("shape", path=name, found=str(other))


def _stand_in(body: Any, note: str) -> Solid:
    sides, turn = equivalent_box(float(body.mass), np.asarray(body.inertia, dtype=float))
    if sides.max() <= 0.0:
        return Solid(np.zeros((1, 3)), (), "point", note)
    vertices, faces = box(sides)
    return Solid(rotate(turn, vertices), faces, "stand-in", note)


def _mesh(file: FilePath, scale: Any, body: Any, name: str) -> Solid:
    if find_spec("trimesh") is None:
        return _stand_in(body, f"{name}: {file.name} needs the package trimesh")
    import trimesh

    try:
        # From bytes, and by these suffixes: neither files that it names nor archives are read.
        kind = file.suffix.lower()
        if kind not in MESHES or not file.is_file() or file.stat().st_size > MOST_MB * 1e6:
            raise ValueError(f"no file of at most {MOST_MB} MB that ends in {', '.join(MESHES)}")
        plain: dict[str, Any] = {"skip_materials": True} if kind in (".obj", ".glb") else {}
        loaded: Any = trimesh.load_scene(io.BytesIO(file.read_bytes()), file_type=kind[1:], **plain)
        mesh: Any = loaded.to_mesh()
    except Exception as fault:  # readers of foreign files raise any exception
        return _stand_in(body, f"{name}: {file.name} cannot be read ({fault or type(fault).__name__})")
    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    if not len(faces):
        return _stand_in(body, f"{name}: {file.name} holds no surface")
    if np.prod(scale) < 0.0:  # a mirror turns faces inside out
        faces = faces[:, ::-1]
    return Solid(vertices * np.asarray(scale, dtype=float), tuple(faces), "mesh")
