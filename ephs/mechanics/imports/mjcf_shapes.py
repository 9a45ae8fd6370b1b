"""Shapes of a compiled MJCF, for pictures only."""

from importlib import import_module
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import Draft, pose
from ephs.mechanics.imports.mjcf_source import MjcfSource
from ephs.semantics.spaces import SE3


def shapes(model: Any, b: int, body: str, source: MjcfSource, draft: Draft) -> None:
    """The geoms of a body; a capsule is a cylinder with two balls, an ellipsoid the box in it."""
    kinds: Any = import_module("mujoco").mjtGeom
    first = int(model.body_geomadr[b])
    for g in range(first, first + int(model.body_geomnum[b])):
        size, place = np.array(model.geom_size[g]), pose(model.geom_pos[g], model.geom_quat[g])
        match int(model.geom_type[g]):
            case kinds.mjGEOM_SPHERE:
                draft.shape(body, "sphere", size[0], place)
            case kinds.mjGEOM_BOX:
                draft.shape(body, "box", 2.0 * size, place)
            case kinds.mjGEOM_ELLIPSOID:
                draft.shape(body, "box", 2.0 / np.sqrt(3.0) * size, place)
            case kinds.mjGEOM_CYLINDER:
                draft.shape(body, "cylinder", [size[0], 2.0 * size[1]], place)
            case kinds.mjGEOM_CAPSULE:
                draft.shape(body, "cylinder", [size[0], 2.0 * size[1]], place)
                for end in (-size[1], size[1]):
                    draft.shape(body, "sphere", size[0], SE3.compose(place, pose([0.0, 0.0, end])))
            case kinds.mjGEOM_MESH:
                _mesh(model, int(model.geom_dataid[g]), body, place, source, draft)
            case _:
                draft.leave("shapes", f"{kinds(int(model.geom_type[g])).name} of {body}")


def _mesh(model: Any, m: int, body: str, place: np.ndarray, source: MjcfSource, draft: Draft) -> None:
    """A mesh; MuJoCo has moved its points to their centre and principal axes."""
    start = int(model.mesh_pathadr[m])
    name = b"" if start < 0 else bytes(model.paths[start:]).partition(b"\0")[0]
    if not name:
        draft.leave("shapes", f"a mesh without file of {body}")
        return
    moved = pose(model.mesh_pos[m], model.mesh_quat[m])
    at = SE3.compose(place, SE3.inverse(moved))
    draft.mesh(body, source.file_of(name.decode()), at, list(model.mesh_scale[m]))
