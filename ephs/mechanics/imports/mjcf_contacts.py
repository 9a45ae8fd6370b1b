"""Contacts of a compiled MJCF.

Pairs of geoms are those that MuJoCo looks at: the model's own pairs, and others with bits that match, on bodies that
are neither one nor parent and child, and that are not excluded. Its contacts have no stiffness in N/m: the scene's are
the model's mass by MuJoCo's stiffness per mass, (τ ζ)⁻² of time constant and damping ratio of ``solref``. At ζ = 1 the
model's weight on one contact sinks by g τ².
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import combinations
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.collisions import LOSS, MOST_FACETS, NO_CORNERS, SINKING, SLIP, hull, many, too_fine
from ephs.mechanics.imports.draft import Draft, pose
from ephs.mechanics.imports.mjcf_keys import Compiled, disabled
from ephs.mechanics.imports.mjcf_names import MjcfNames
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.mechanics.shapes.pairs import PAIRS
from ephs.semantics.bundles.bundle import Array

FINE = f"contacts but those with planes, of meshes with more than {MOST_FACETS} faces and edges"


@final
@dataclass(frozen=True, slots=True)
class Parameters:
    """Parameters of a pair: ``solref`` (2,), sliding, spinning and rolling ``friction`` (3,), and ``condim``."""

    solref: Array
    friction: Array
    condim: int


def contacts(model: Compiled, names: MjcfNames, draft: Draft) -> None:
    """Surfaces and contacts of a model, or a note of its contacts."""
    pairs = {} if disabled(model, "CONTACT", "CONSTRAINT") else _pairs(model, names, draft)
    if not draft.contact:
        for b in sorted({int(model.geom_bodyid[g]) for pair in pairs for g in pair}):
            draft.leave("contacts of", names.bodies[b] or "the world")
        for kind, count in (("geoms", model.ngeom), ("pairs", model.npair)):
            for number in range(count):
                model.pass_by(kind, number)
        return
    shapes = {g: _shape(model, g) for pair in pairs for g in pair}
    surfaces: dict[int, tuple[str, Array]] = {}
    mass = draft.mass
    for (one, other), parameters in pairs.items():
        kinds = (shapes[one] or ("",))[0], (shapes[other] or ("",))[0]
        told = f"{_named(model, names, one)} and {_named(model, names, other)}"
        if kinds not in PAIRS and kinds[::-1] not in PAIRS:
            draft.leave("contacts between", told)
            continue
        for g in (one, other):
            if g not in surfaces:
                surfaces[g] = _surface(model, g, shapes[g] or ("", ()), names, draft)
        fine = [g for g, kind in zip((one, other), kinds, strict=True) if too_fine(kind, surfaces[g][1])]
        if fine and "plane" not in kinds:
            for g in fine:
                draft.leave(FINE, _named(model, names, g))
        elif many(kinds, [surfaces[g][1] for g in (one, other)]):
            draft.leave("contacts between shapes with many edges", told)
        elif surfaces[one][0] and surfaces[other][0]:
            draft.touch((surfaces[one][0], surfaces[other][0]), _law(parameters, mass))
    met = {g for pair in set(pairs) - _own(model) for g in pair}
    for g in range(model.ngeom):
        model.name("geoms", g, _named(model, names, g))
        if g not in met:  # the numbers of its pairs, if there are any, are its contacts'
            model.pass_by("geoms", g)
    for p in range(model.npair):
        ends = " and ".join(_named(model, names, int(g[p])) for g in (model.pair_geom1, model.pair_geom2))
        model.name("pairs", p, ends)
        if not pairs:
            model.pass_by("pairs", p)
            continue
        if np.any(model.pair_friction[p, [0, 3]] != model.pair_friction[p, [1, 4]]):
            draft.leave("friction that depends on the direction, of", ends)
    overridden = import_module("mujoco").mjtEnableBit.mjENBL_OVERRIDE
    if pairs and model.opt.enableflags & int(overridden):
        draft.leave("options", "override")


def _surface(model: Any, g: int, shape: tuple[str, Any], names: MjcfNames, draft: Draft) -> tuple[str, Array]:
    """The name of a geom's surface, and its corners (n, 3) if it is a mesh."""
    place = pose(model.geom_pos[g], model.geom_quat[g])
    body, name = names.bodies[int(model.geom_bodyid[g])], _named(model, names, g)
    if shape[0] == "mesh":
        return hull(draft, body, name, shape[1], place, {})
    return draft.surface(body, name, *shape, place), NO_CORNERS


def _pairs(model: Any, names: MjcfNames, draft: Draft) -> dict[tuple[int, int], Parameters]:
    """Pairs of geoms with their parameters; those that the model names replace what is found."""
    found: dict[tuple[int, int], Parameters] = {}
    for p in range(model.npair):
        one, other = sorted((int(model.pair_geom1[p]), int(model.pair_geom2[p])))
        if model.geom_bodyid[one] == model.geom_bodyid[other]:
            draft.leave("contacts within a body", f"{_named(model, names, one)} and {_named(model, names, other)}")
            model.pass_by("pairs", p)
            continue
        friction = model.pair_friction[p, [0, 2, 3]]
        found[one, other] = Parameters(model.pair_solref[p], friction, int(model.pair_dim[p]))
    for one, other in _meeting(model):
        found.setdefault((one, other), _mixed(model, one, other))
    return found


def _mixed(model: Any, one: int, other: int) -> Parameters:
    """MuJoCo's rule (`mj_contactParam`): the geom of higher priority decides; of equal ones the larger friction and
    ``condim``, and ``solref`` weighed by ``solmix``."""
    both = [one, other]
    weights, solref, friction = model.geom_solmix[both], model.geom_solref[both], model.geom_friction[both]
    condim, priority = model.geom_condim[both].tolist(), model.geom_priority[both].tolist()
    if priority[0] != priority[1]:
        k = int(priority[1] > priority[0])
        return Parameters(solref[k], friction[k], condim[k])
    share = weights / weights.sum() if weights.sum() > 0.0 else np.array([0.5, 0.5])
    mixed = share @ solref if np.all(solref[:, 0] > 0.0) else solref.min(axis=0)
    return Parameters(mixed, friction.max(axis=0), max(condim))


def _own(model: Compiled) -> set[tuple[int, int]]:
    """The pairs that the model names, lower number first."""
    ends = zip(model.pair_geom1, model.pair_geom2, strict=True)
    return {(min(pair), max(pair)) for one, other in ends for pair in [(int(one), int(other))]}


def _meeting(model: Any) -> Iterator[tuple[int, int]]:
    loose = disabled(model, "FILTERPARENT")
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    bits, masks = model.geom_contype[:].tolist(), model.geom_conaffinity[:].tolist()
    carrier, welded, parent = (x[:].tolist() for x in (model.geom_bodyid, model.body_weldid, model.body_parentid))
    for one, other in combinations(range(model.ngeom), 2):
        if not (bits[one] & masks[other] or bits[other] & masks[one]):
            continue
        bodies = carrier[one], carrier[other]
        first, second = (welded[b] for b in bodies)
        above = [welded[parent[b]] for b in (first, second)]
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
        case kinds.mjGEOM_MESH:
            return "mesh", _corners(model, int(model.geom_dataid[g]))
        case _:
            return None


def _named(model: Any, names: MjcfNames, g: int) -> str:
    body = names.bodies[int(model.geom_bodyid[g])] or "world"
    return str(model.geom(g).name) or f"{body}_{g - int(model.body_geomadr[int(model.geom_bodyid[g])])}"


def _corners(model: Any, m: int) -> Array:
    """(n, 3) vertices of the convex hull with which MuJoCo collides, in the geom's frame."""
    start, own = int(model.mesh_graphadr[m]), int(model.mesh_vertadr[m])
    count = int(model.mesh_graph[start])
    numbers = model.mesh_graph[start + 2 + count : start + 2 + 2 * count]
    return np.array(model.mesh_vert[own + numbers], dtype=float)


def rate_and_ratio(solref: Array) -> tuple[float, float]:
    """The rate 1/(τ ζ) in 1/s and the damping ratio ζ of ``solref``, which may be stiffness and damping per mass."""
    first, second = map(float, solref)
    if (first > 0.0) != (second > 0.0) or not first:  # MuJoCo takes its default for a mixture of both formats
        first, second = SINKING, 1.0
    if first > 0.0:
        return 1.0 / max(first * second, 1.0 / LARGEST), second
    rate = float(np.sqrt(-first))  # stiffness and damping have their signs reversed
    return rate, -second / (2.0 * rate)


def _law(given: Parameters, mass: float) -> dict[str, float]:
    rate, ratio = rate_and_ratio(given.solref)
    law = {"stiffness": float(mass * rate**2), "loss": float(LOSS * ratio), "slip": SLIP}
    for key, value, least in zip(("friction", "spinning", "rolling"), given.friction, (3, 4, 6), strict=True):
        if given.condim >= least:
            law[key] = float(value)
    return law
