"""MJCF: MuJoCo compiles the model, which resolves defaults, units, orientations and inertias; its result is read.

Source: the MuJoCo documentation, "XML Reference" and "Computation". Joints are read at the reference configuration.
"""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, final

import numpy as np

from ephs.mechanics.imports.collisions import STOP_LOSS
from ephs.mechanics.imports.draft import Draft, along, pose, turned_tensor
from ephs.mechanics.imports.mjcf_actuators import actuators, tendons
from ephs.mechanics.imports.mjcf_contacts import contacts, rate_and_ratio
from ephs.mechanics.imports.mjcf_keys import SOFT_DRY, SOFT_STOPS, Compiled, disabled
from ephs.mechanics.imports.mjcf_links import Thread, loops, screws
from ephs.mechanics.imports.mjcf_names import MjcfNames, noted
from ephs.mechanics.imports.mjcf_source import MjcfSource
from ephs.mechanics.scene.errors import fault
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import symmetric_eigen

# Shapes of a compiled MJCF, for pictures only.


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


LEAST = 2e-15
"""Least mass in kg and moment of inertia in kg m² that MuJoCo takes of a moving body, with some room."""
ROUNDED = 1e-12
"""Share of a moment of inertia that is lost to rounding in its principal axes."""
DIMENSIONS = {"free": 6, "spherical": 3, "prismatic": 1, "revolute": 1}
READ = (
    *("body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "body_iquat", "qpos0", "qpos_spring"),
    *(
        "jnt_pos",
        "jnt_axis",
        "jnt_range",
        "jnt_stiffness",
        "dof_damping",
        "dof_frictionloss",
        "eq_data",
        "site_pos",
        "site_quat",
    ),
    *("geom_pos", "geom_quat", "geom_size", "mesh_pos", "mesh_quat", "mesh_scale"),
    *("geom_solref", "geom_friction", "geom_solmix", "pair_solref", "pair_friction", "mesh_vert"),
)


@final
@dataclass(frozen=True, slots=True, eq=False)
class GivenInertia:
    """A mass, and an inertia (3, 3) in the axes of its body, or else in those of the inertial frame."""

    mass: float
    tensor: Array
    in_body: bool


def read_mjcf(root: Any, draft: Draft) -> None:
    """The bodies and joints of a model; several joints of a body get frames without mass between them."""
    source = MjcfSource(root, draft)
    if draft.faults:
        return
    try:
        mujoco: Any = import_module("mujoco")
    except ModuleNotFoundError:
        draft.faults.append(fault("no importer", "", "an MJCF, but no MuJoCo to read it"))
        return
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)  # otherwise it writes a log file to the working directory
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # deprecated elements of the format
            spec = mujoco.MjSpec.from_string(source.text, include=source.models, assets=source.assets)
            spec.compiler.fusestatic = False
            given = _impossible_inertias(spec, draft)
            raw = spec.compile()
            own = {int(body.id): inertia for body, inertia in given}
            model = Compiled(spec, raw, draft)
    except (ValueError, RuntimeError) as error:  # MuJoCo's own errors among them
        words = " ".join(str(error).split())
        draft.faults.append(fault("not compiled", "", f"that MuJoCo says: {words}"))
        return
    finally:
        mujoco.set_mju_user_warning(before)
    sizes = [float(np.abs(values).max(initial=0.0)) for values in _numbers(raw, own)]
    lengths = [np.linalg.norm(rows, axis=1) for rows in _directions(raw)]
    if not all(size <= LARGEST for size in sizes) or not all(np.all(np.abs(n - 1.0) < 0.1) for n in lengths):
        draft.faults.append(fault("large", "", "a compiled model with other numbers, or none", most=LARGEST))
        return
    for text in said:
        draft.leave("what MuJoCo warns of", " ".join(text.split()))
    names = MjcfNames(model)
    draft.gravity = [0.0, 0.0, 0.0] if disabled(model, "GRAVITY") else list(model.opt.gravity)
    threads = screws(model, names)
    model.pass_by("bodies", 0)
    for b in range(1, model.nbody):
        _body(model, b, own, names, draft)
        model.name("bodies", b, names.bodies[b])
        _joints(model, b, names, threads, draft)
        shapes(model, b, names.bodies[b], source, draft)
    contacts(model, names, draft)
    ropes = tendons(model, names, draft)
    loops(model, names, threads.values(), draft)
    actuators(model, names, ropes, draft)  # not on joints that are held
    noted(model, names, draft)
    model.leave_unread()


def _numbers(model: Any, own: Mapping[int, GivenInertia]) -> Iterator[Any]:
    """All that is read of a compiled model."""
    yield model.opt.gravity
    for inertia in own.values():
        yield inertia.mass
        yield inertia.tensor
    for name in READ:
        yield getattr(model, name)


def _directions(model: Any) -> Iterator[Any]:
    """Rows that MuJoCo made unit vectors, unless their numbers were too large or too small for that."""
    mujoco: Any = import_module("mujoco")
    for name in ("body_quat", "body_iquat", "geom_quat", "site_quat", "mesh_quat"):
        yield getattr(model, name)
    yield model.jnt_axis[model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)]
    welds = (model.eq_type == int(mujoco.mjtEq.mjEQ_WELD)) & (model.eq_objtype == int(mujoco.mjtObj.mjOBJ_BODY))
    yield model.eq_data[welds, 6:10]


def _impossible_inertias(spec: Any, draft: Draft) -> list[tuple[Any, GivenInertia]]:
    """Inertias that MuJoCo refuses, each with its body, to which the nearest possible one is given for compilation.

    Left alone are models that change them as they are compiled.
    """
    c, found = spec.compiler, list[tuple[Any, GivenInertia]]()
    if c.balanceinertia or c.boundmass > 0.0 or c.boundinertia > 0.0 or c.settotalmass > 0.0 or c.inertiafromgeom == 1:
        return found
    for number, body in enumerate(spec.bodies[1:], 1):
        if not body.explicitinertial:
            continue
        whole = bool(np.isfinite(body.fullinertia).all())
        given = GivenInertia(float(body.mass), _tensor(body.fullinertia) if whole else np.diag(body.inertia), whole)
        if not (np.isfinite(given.mass) and np.isfinite(given.tensor).all()):  # the check of all numbers refuses them
            body.mass, body.inertia, body.fullinertia = 1.0, np.ones(3), [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
            found.append((body, given))
            continue
        moments, axes = symmetric_eigen(given.tensor) if whole else (np.array(body.inertia), np.eye(3))
        largest = moments.max()
        lacking = 2.0 * largest - moments.sum()
        if given.mass >= LEAST and moments.min() >= LEAST and lacking <= -ROUNDED * largest:
            continue
        found.append((body, given))
        # The two smaller moments grow equally until their sum is the largest.
        more = max(0.5 * (lacking + 2.0 * ROUNDED * abs(largest)), 0.0)
        order = np.argsort(moments)
        moments[order[:2]] += more
        moments = np.maximum(moments, LEAST)
        body.mass = max(given.mass, LEAST)
        if whole:
            near = axes @ np.diag(moments) @ axes.T
            body.fullinertia = near[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        else:
            body.inertia = moments
        if lacking > ROUNDED * largest:
            what = "the impossible inertia, in what MuJoCo derives of it (dampratio, springdamper), of"
            draft.leave(what, body.name or f"body_{number}")
    return found


def _tensor(entries: Any) -> Array:
    """The tensor (3, 3) of its entries xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _body(model: Compiled, b: int, own: Mapping[int, GivenInertia], names: MjcfNames, draft: Draft) -> None:
    principal = pose(rotation=model.body_iquat[b])[:4]
    given = own.get(b, GivenInertia(float(model.body_mass[b]), np.diag(model.body_inertia[b]), in_body=False))
    tensor = given.tensor if given.in_body else turned_tensor(principal, given.tensor)
    draft.body(names.bodies[b], given.mass, tensor, model.body_ipos[b])


def _joints(model: Compiled, b: int, names: MjcfNames, threads: Mapping[int, Thread], draft: Draft) -> None:
    """The chain from a body's parent to it."""
    body, before = names.bodies[b], names.bodies[int(model.body_parentid[b])]
    at = pose(model.body_pos[b], model.body_quat[b])
    first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
    if count == 0:
        draft.joint(f"{body}_fixed", "fixed", before, body, at, pose(), {})
    rest = list(range(first, first + count))
    while rest:
        j = rest.pop(0)
        thread = threads.get(j)
        if thread is not None:  # two joints of the file are one
            del rest[0]
            j = thread.hinge
            draft.rename(names.joints[thread.slide], names.joints[j])
        kind, last = names.kinds[j], not rest
        centre, axis = model.jnt_pos[j], model.jnt_axis[j]
        frame = pose(centre if kind in ("revolute", "spherical") else (0.0, 0.0, 0.0))
        if kind in ("revolute", "prismatic"):
            turned = along(axis, frame)
            assert turned is not None  # MuJoCo makes axes unit vectors
            frame = turned
        after = body if last else draft.frame_without_mass(names.between(b, j))
        entries = _passive(model, j, kind) | draft.dry(names.joints[j], _dry(model, j), DIMENSIONS[kind])
        if thread is not None:
            kind, entries["pitch"] = "screw", thread.pitch
            slide = _passive(model, thread.slide, "prismatic")
            for key in ("friction", "armature"):
                entries[key] += thread.pitch**2 * slide[key]
            entries |= draft.dry(names.joints[j], _dry(model, j) + abs(thread.pitch) * _dry(model, thread.slide), 1)
        draft.joint(names.joints[j], kind, before, after, SE3.compose(at, frame), frame, entries)
        for each in (j,) if thread is None else (thread.hinge, thread.slide):
            model.name("joints", each, names.joints[each])
            _stops(model, each, names, draft, of_screw=thread is not None and each == thread.slide)
            if not _dry(model, each):
                model.pass_by("joints", each, *SOFT_DRY)
        before, at = after, pose()


def _stops(model: Compiled, j: int, names: MjcfNames, draft: Draft, *, of_screw: bool) -> None:
    """Limits of a joint; their stiffness is the inertia that it moves by MuJoCo's stiffness per inertia."""
    limits, name = np.array(model.jnt_range[j]), names.joints[j]
    off = not bool(model.jnt_limited[j]) or disabled(model, "LIMIT", "CONSTRAINT")
    lone = names.kinds[j] in ("revolute", "prismatic") and not of_screw
    if off or not lone or not draft.contact:
        model.pass_by("joints", j, *SOFT_STOPS)
        if not off:
            draft.leave("limits of", name)
        return
    rate, ratio = rate_and_ratio(model.jnt_solref[j])
    stiffness = rate**2 / max(float(model.raw.dof_invweight0[model.jnt_dofadr[j]]), 1.0 / LARGEST)
    law = {"limit_stiffness": min(stiffness, LARGEST), "limit_loss": min(STOP_LOSS * ratio, LARGEST)}
    draft.limit(name, *(limits - model.qpos0[int(model.jnt_qposadr[j])]), **law)


def _dry(model: Compiled, j: int) -> float:
    loss = float(model.dof_frictionloss[model.jnt_dofadr[j]])
    return 0.0 if disabled(model, "FRICTIONLOSS", "CONSTRAINT") else loss


def _passive(model: Compiled, j: int, kind: str) -> dict[str, Any]:
    """Damping, stiffness, rest and armature; coordinates count from the reference configuration."""
    dof, q, axial = model.jnt_dofadr[j], int(model.jnt_qposadr[j]), kind in ("revolute", "prismatic")
    friction, stiffness = float(model.dof_damping[dof]), float(model.jnt_stiffness[j])
    rest = float(model.qpos_spring[q] - model.qpos0[q])
    entries: dict[str, Any] = {"friction": 0.0 if disabled(model, "DAMPER") else friction}
    if axial:
        entries["armature"] = float(model.dof_armature[dof])
    if not disabled(model, "SPRING"):
        entries["stiffness"] = stiffness
        if axial and stiffness:
            entries["rest"] = rest
    return entries
