"""Meshes of shells in scenes: files with quadrilaterals, triangles and named sets of points; sides of meshes."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, Self, final

import numpy as np

from ephs.mechanics.elements.shell.mesh import Indices, grid, quadrilaterals
from ephs.mechanics.scene.polytope import MOST_BYTES
from ephs.semantics.bundles.bundle import Array

FORMATS: Final[Mapping[str, str]] = {".msh": "gmsh", ".obj": "obj", ".off": "off", ".vtk": "vtk"}
"""Endings of mesh files, and their readers; of these formats, none names other files or unpacks an archive."""
FACES: Final = ("quad", "triangle")
IGNORED: Final = ("line", "vertex")
"""Cells that only name points."""


@final
class MeshError(ValueError):
    """A mesh that is none, by a key of its table: what was found there, and expected."""

    def __init__(self, at: str, found: str, expected: str) -> None:
        super().__init__(f"{at}: {found}, expected {expected}")
        self.told = {"at": at, "found": found, "expected": expected}


@final
@dataclass(frozen=True, slots=True, eq=False)
class SheetMesh:
    """Points (m, 3), elements (n, 4), and the points of each side."""

    points: Array
    cells: Indices
    sides: list[list[int]]

    @classmethod
    def of_corners(cls, corners: Sequence[Sequence[float]], elements: tuple[int, int]) -> Self:
        """A grid between four corners; its sides begin at one corner each."""
        a, b, c, d = (np.array(corner) for corner in corners)

        def surface(u: Array, v: Array) -> Array:
            u, v = u[:, None], v[:, None]
            return ((1.0 - u) * ((1.0 - v) * a + v * d) + u * ((1.0 - v) * b + v * c)).T

        points, _, cells = grid(surface, elements)
        number = np.arange(len(points)).reshape(elements[0] + 1, elements[1] + 1)
        return cls(points, cells, [side.tolist() for side in (number[:, 0], number[-1], number[:, -1], number[0])])

    @classmethod
    def of_elements(
        cls, points: Sequence[Sequence[float]] | Array, cells: Sequence[Sequence[int]], sides: Sequence[Sequence[int]]
    ) -> Self:
        """A mesh of quadrilaterals and triangles.

        Where triangles are divided, edges get points in the middle. Such a point belongs to a side if both ends of its
        edge do, and the edge is on the border of the mesh or has an end inside.
        """
        whole, quads, ends = quadrilaterals(np.array(points, dtype=float).reshape(-1, 3), cells)
        if not len(ends):
            return cls(whole, quads, [[*side] for side in sides])
        ways = [tuple(sorted((a, cell[i - 1]))) for cell in cells for i, a in enumerate(cell)]
        count = Counter(ways)
        border = {way for way in ways if count[way] == 1}
        outer = {node for way in border for node in way}

        def middles(side: Sequence[int]) -> list[int]:
            at = {*side}
            edges = [{a, b} <= at and ((a, b) in border or not {a, b} <= outer) for a, b in ends.tolist()]
            return [len(points) + k for k, of in enumerate(edges) if of]

        return cls(whole, quads, [[*side, *middles(side)] for side in sides])


def mesh_of(file: Path) -> tuple[Array, list[list[int]], dict[str, list[int]]]:
    """Points (m, 3), the points of each element, and sets of points by name; what belongs to no element is left out.

    Raises
    ------
    ValueError
        Fault of the file: it cannot be read, or holds other elements.
    """
    if find_spec("meshio") is None:
        raise ValueError("that cannot be read without the package meshio: pip install ephs[meshes]")
    if file.suffix.lower() not in FORMATS:
        raise ValueError(f"that does not end in {', '.join(FORMATS)}")
    if not file.is_file():
        raise ValueError("that does not exist")
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"of more than {MOST_BYTES // 1_000_000} MB")
    try:
        mesh: Any = import_module(f"meshio.{FORMATS[file.suffix.lower()]}").read(str(file))
        points, kinds = np.asarray(mesh.points, dtype=float), [str(block.type) for block in mesh.cells]
        blocks = [np.asarray(block.data, dtype=np.int64) for block in mesh.cells]
        sets = _sets(mesh, blocks)
    except Exception as error:  # readers of foreign files raise any exception
        raise ValueError(f"that cannot be read ({error or type(error).__name__})") from None
    other = [kind for kind in kinds if kind not in (*FACES, *IGNORED)]
    if other:
        raise ValueError(f"with elements {other[0]}")
    cells = [row for kind, block in zip(kinds, blocks, strict=True) if kind in FACES for row in block.tolist()]
    if not cells:
        raise ValueError("without quadrilaterals and triangles")
    used = sorted({node for row in cells for node in row})
    number = {node: k for k, node in enumerate(used)}
    if points.ndim != 2 or used[0] < 0 or used[-1] >= len(points):
        raise ValueError("whose elements have points that are not there")
    places = np.zeros((len(used), 3))
    places[:, : points.shape[1]] = points[used]
    named = {name: [number[node] for node in nodes if node in number] for name, nodes in sets.items()}
    return places, [[number[node] for node in row] for row in cells], named


def _sets(mesh: Any, blocks: list[Any]) -> dict[str, list[int]]:
    """Points by the names of sets of points, of sets of cells, and of physical groups."""
    found: dict[str, set[int]] = {}
    for name, nodes in mesh.point_sets.items():
        found.setdefault(str(name), set()).update(np.asarray(nodes, dtype=np.int64).ravel().tolist())
    for name, parts in mesh.cell_sets.items():
        for block, part in zip(blocks, parts, strict=True):
            chosen = block[np.asarray(part, dtype=np.int64)] if part is not None and len(part) else block[:0]
            found.setdefault(str(name), set()).update(chosen.ravel().tolist())
    numbers, groups = mesh.field_data, mesh.cell_data.get("gmsh:physical", [])
    for block, group in zip(blocks, groups, strict=False):
        for name, (number, _) in numbers.items():
            found.setdefault(str(name), set()).update(block[np.asarray(group) == number].ravel().tolist())
    return {name: sorted(nodes) for name, nodes in found.items() if not name.startswith("gmsh:")}
