"""Collision geometry of models as surfaces, and the numbers of contacts that the formats do not have.

No format has all numbers of the scene's law. The default stiffness of a model is its mass by the square of `SINKING`,
so that its weight on one contact sinks by g τ², 4 mm on earth.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.scene.polytope import (
    MOST_BYTES,
    MOST_VERTICES,
    depth_inside,
    faces_and_edges,
    largest_hull,
    triangles_of,
)
from ephs.semantics.bundles.bundle import Array

LOSS, SLIP, FRICTION, SINKING = 1.0, 1e-2, 1.0, 0.02
"""Loss in s/m, slip velocity in m/s, coefficient of friction, and time constant τ in s."""
STOP_LOSS = 10.0
"""Loss of the stops of joints in s/rad or s/m: none rebounds at more than its inverse, 0.1 rad/s or m/s."""
SOLIDS = ("sphere", "box", "cylinder", "capsule", "plane")
CORNERS = {"capsule": 1, "cylinder": 2, "box": 8}
"""Corners of the shapes that meet meshes in pairs of edges."""
MOST_FACETS = 64
"""Faces and edges of an imported mesh that meets others than planes: more take minutes to compile, for each mesh."""
FEW_CORNERS, FINENESS = 64, 0.01
"""Corners that hulls keep in any case, and the share of its extent by which others may be outside: each corner is a
point of contact."""
NO_CORNERS = np.zeros((0, 3))


def default_law(draft: Draft) -> dict[str, float]:
    """Law of a surface of a model whose links are all known, for what its file does not say."""
    stiffness = {"stiffness": draft.mass / SINKING**2} if draft.mass > 0.0 else {}
    return stiffness | {"loss": LOSS, "friction": FRICTION, "slip": SLIP}


def collide(draft: Draft, link: str, name: str, kind: str, value: Any, place: Array, law: Mapping[str, Any]) -> None:
    """A surface of a solid of a collision, or a note of it.

    Parameters
    ----------
    kind, value
        One of `SOLIDS` with its sizes, or ``"mesh"`` with its file and scale; others are noted.
    place
        (7,) in the link.
    law
        Keys of the surface's table.
    """
    if kind == "mesh":
        file, scale = value
        points = _points(draft, file)
        if points is not None:
            points = points * np.asarray(scale)
            if depth := depth_inside(points):
                draft.leave("contacts inside of convex hulls", f"{name} ({depth:.2g} m deep)")
            hull(draft, link, name, points, place, law)
    elif kind not in SOLIDS:
        draft.leave("contacts with other shapes", f"{kind} of {link or 'the world'}")
    elif not np.all(np.asarray(value, dtype=float) > 0.0):
        draft.leave("contacts with shapes without size", name)
    else:
        draft.surface(link, name, kind, value, place, **law)


def hull(draft: Draft, link: str, name: str, points: Array, place: Array, law: Mapping[str, Any]) -> tuple[str, Array]:
    """A surface of the convex hull of points (n, 3); its name, or none with a note, and its corners (m, 3)."""
    try:
        corners, depth = largest_hull(points, FEW_CORNERS, FINENESS)
    except ValueError as error:
        draft.leave("contacts with meshes that have no volume", f"{name} ({error})")
        return "", NO_CORNERS
    if depth:
        draft.leave("corners of convex hulls but the farthest", f"{name} (up to {depth:.2g} m outside)")
    return draft.surface(link, name, "points", corners, place, **law), corners


def too_fine(kind: str, corners: Array) -> bool:
    """Whether a shape is a mesh with too many faces and edges to meet others than planes."""
    return kind == "mesh" and faces_and_edges(corners.tolist()) > MOST_FACETS


def many(kinds: Sequence[str], corners: Sequence[Array]) -> bool:
    """Whether a pair with a mesh has too many pairs of edges: corners of the mesh by those of the other shape."""
    sizes = [len(of) if kind == "mesh" else CORNERS.get(kind, 0) for kind, of in zip(kinds, corners, strict=True)]
    return "mesh" in kinds and sizes[0] * sizes[1] > MOST_VERTICES


def _points(draft: Draft, name: str) -> Array | None:
    """Points (n, 3) of a mesh in the model's folder; None and a note of it where there are none."""
    file = draft.file_inside(name)
    if file is None:
        draft.leave("meshes that are no readable file in the model's folder", name)
        return None
    readers = {".stl": lambda at: triangles_of(at).reshape(-1, 3), ".obj": _obj}
    if file.suffix.lower() not in readers:
        draft.leave("contacts with meshes that are neither STL nor OBJ", name)
        return None
    try:
        points = readers[file.suffix.lower()](file)
        if not len(points) or not np.all(np.isfinite(points)):
            raise ValueError("a number that is not finite" if len(points) else "no points")
        return points
    except (ValueError, OSError) as error:
        draft.leave("contacts with meshes that cannot be read", f"{name} ({error})")
        return None


def _obj(file: Path) -> Array:
    """(n, 3) vertices of a Wavefront OBJ file."""
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"no file of at most {MOST_BYTES // 1_000_000} MB")
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    found = np.array([words[1:4] for line in lines if (words := line.split())[:1] == ["v"]], dtype=float)
    return found.reshape(-1, 3)
