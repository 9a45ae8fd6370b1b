"""Contacts of a compiled MJCF.

Pairs of geoms are those that MuJoCo looks at: bits that match, bodies that are neither one nor parent and child, pairs
that are not excluded. Its contacts have no stiffness in N/m: the scene's are the model's mass by the square of the time
constant of ``solref``, so that the model's weight on one contact sinks by g τ².
"""

from collections.abc import Iterator
from importlib import import_module
from itertools import combinations
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import Draft, pose
from ephs.mechanics.imports.mjcf_names import Names
from ephs.mechanics.shapes.pairs import PAIRS

LOSS, SLIP = 1.0, 1e-2
"""Loss in s/m at a damping ratio of 1, and slip velocity in m/s: MuJoCo has neither."""


def contacts(model: Any, names: Names, draft: Draft) -> None:
    """Surfaces and contacts of a model, or a note of its contacts."""
    mujoco: Any = import_module("mujoco")
    off = model.opt.disableflags & (mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    pairs = [] if off else list(_pairs(model))
    if not draft.contact:
        for b in sorted({int(model.geom_bodyid[g]) for pair in pairs for g in pair}):
            draft.leave("contacts of", names.bodies[b] or "the world")
        return
    shapes = {g: _shape(model, g) for pair in pairs for g in pair}
    surfaces: dict[int, str] = {}
    mass = float(np.sum(model.body_mass[1:]))
    for one, other in pairs:
        kinds = (shapes[one] or ("",))[0], (shapes[other] or ("",))[0]
        if kinds not in PAIRS and kinds[::-1] not in PAIRS:
            draft.leave("contacts between", f"{_named(model, names, one)} and {_named(model, names, other)}")
            continue
        for g in (one, other):
            if g not in surfaces:
                kind, size = shapes[g] or ("", ())
                place = pose(model.geom_pos[g], model.geom_quat[g])
                body = names.bodies[int(model.geom_bodyid[g])]
                surfaces[g] = draft.surface(body, _named(model, names, g), kind, size, place)
        draft.touch((surfaces[one], surfaces[other]), _law(model, one, other, mass))


def _pairs(model: Any) -> Iterator[tuple[int, int]]:
    mujoco: Any = import_module("mujoco")
    loose = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    for one, other in combinations(range(model.ngeom), 2):
        if not (
            model.geom_contype[one] & model.geom_conaffinity[other]
            or model.geom_contype[other] & model.geom_conaffinity[one]
        ):
            continue
        bodies = int(model.geom_bodyid[one]), int(model.geom_bodyid[other])
        first, second = (int(model.body_weldid[b]) for b in bodies)
        above = [int(model.body_weldid[int(model.body_parentid[b])]) for b in (first, second)]
        parental = first and second and (above[0] == second or above[1] == first)
        if first != second and (loose or not parental) and not {bodies, bodies[::-1]} & excluded:
            yield one, other


def _shape(model: Any, g: int) -> tuple[str, Any] | None:
    kinds: Any = import_module("mujoco").mjtGeom
    size = np.array(model.geom_size[g])
    match int(model.geom_type[g]):
        case kinds.mjGEOM_PLANE:
            return "plane", ()
        case kinds.mjGEOM_SPHERE:
            return "sphere", size[0]
        case kinds.mjGEOM_CAPSULE:
            return "capsule", [size[0], 2.0 * size[1]]
        case kinds.mjGEOM_CYLINDER:
            return "cylinder", [size[0], 2.0 * size[1]]
        case kinds.mjGEOM_BOX:
            return "box", 2.0 * size
        case _:
            return None


def _named(model: Any, names: Names, g: int) -> str:
    body = names.bodies[int(model.geom_bodyid[g])] or "world"
    return str(model.geom(g).name) or f"{body}_{g - int(model.body_geomadr[int(model.geom_bodyid[g])])}"


def _law(model: Any, one: int, other: int, mass: float) -> dict[str, float]:
    """Stiffness and loss by the mean of both time constants and damping ratios, the larger friction of both."""
    solref = np.array([model.geom_solref[g] for g in (one, other)])
    constants = np.where(solref[:, 0] > 0.0, solref[:, 0], 1.0 / np.sqrt(np.maximum(-solref[:, 0], 1.0)))
    ratios = np.where(solref[:, 0] > 0.0, solref[:, 1], 1.0)
    friction = np.maximum(model.geom_friction[one], model.geom_friction[other])
    size = max(int(model.geom_condim[one]), int(model.geom_condim[other]))
    law = {"stiffness": float(mass / np.mean(constants) ** 2), "loss": float(LOSS * np.mean(ratios)), "slip": SLIP}
    for key, value, least in (("friction", friction[0], 3), ("spinning", friction[1], 4), ("rolling", friction[2], 6)):
        if size >= least:
            law[key] = float(value)
    return law
