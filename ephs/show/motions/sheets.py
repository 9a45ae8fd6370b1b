"""Shells as surfaces: quadrilaterals between points of bodies, and the values of their elements as colours."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.site import Site
from ephs.show.motions.motion import Array, point_of

STILL: Final = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
"""Pose of the ground."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class DrawnShell:
    """The faces of a shell.

    Attributes
    ----------
    ends : tuple of (str, (3,))
        For each corner a body, or the ground, and its place in it, m.
    cells : (n, 4)
        Corners of each face.
    nodes : frozenset of str
        Bodies that are its nodes, and not drawn.
    heat : str
        The thermal node that takes its heat.
    """

    ends: tuple[tuple[str, Array], ...]
    cells: NDArray[np.int64]
    nodes: frozenset[str]
    heat: str

    def places(self, poses: Mapping[str, Array]) -> Array:
        """(…, m, 3) corners in the world, of poses (…, 7) of the bodies."""
        shape = next(iter(poses.values())).shape if poses else STILL.shape
        still = np.broadcast_to(STILL, shape)
        return np.stack([point_of(poses.get(body, still), at) for body, at in self.ends], axis=-2)


def normals(corners: Array) -> Array:
    """(n, 3) twice the areas of quadrilaterals, along their normals, from corners (n, 4, 3)."""
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def sheets_of(scene: Any) -> dict[str, DrawnShell]:
    """The shells of a scene, or of a system's outline."""
    found: dict[str, DrawnShell] = {}
    for path, level in scene.levels():
        for name, shell in level.shells.items():
            faces = shell.faces(Site(level, shell))
            ends = tuple((body if body == GROUND else path + body, at) for body, at in faces.ends)
            sink = shell.heat if shell.heat not in level.thermal else path + shell.heat
            found[path + name] = DrawnShell(ends, faces.cells, frozenset(path + node for node in faces.nodes), sink)
    return found
