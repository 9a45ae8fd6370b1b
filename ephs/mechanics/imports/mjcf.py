"""MJCF: MuJoCo compiles the model, which resolves defaults, units, orientations and inertias; its result is read.

Source: the MuJoCo documentation, "XML Reference" and "Computation". Joints are read at the reference configuration.
"""

import warnings
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ephs.mechanics.imports.draft import Draft, along, pose, turned_tensor
from ephs.mechanics.imports.mjcf_actuators import actuators, tendons
from ephs.mechanics.imports.mjcf_contacts import contacts
from ephs.mechanics.imports.mjcf_keys import SOFT_DRY, SOFT_STOPS, Keys, disabled
from ephs.mechanics.imports.mjcf_links import Thread, loops, screws
from ephs.mechanics.imports.mjcf_names import Names, noted
from ephs.mechanics.imports.mjcf_shapes import shapes
from ephs.mechanics.imports.mjcf_source import Source
from ephs.mechanics.scene.errors import fault
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.semantics.spaces import SE3

Inertias = dict[int, tuple[float, Any]]
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


def read_mjcf(root: Any, draft: Draft) -> None:
    """The bodies and joints of a model; several joints of a body get frames without mass between them."""
    source = Source(root, draft)
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
            spec = mujoco.MjSpec.from_string(source.text, assets=source.assets)
            spec.compiler.fusestatic = False
            given = _own_inertias(spec)
            model = spec.compile()
            own: Inertias = {int(body.id): inertia for body, inertia in given}
            keys = Keys.of(spec, draft)
    except (ValueError, RuntimeError) as error:  # MuJoCo's own errors among them
        words = " ".join(str(error).split())
        draft.faults.append(fault("not compiled", "", f"that MuJoCo says: {words}"))
        return
    finally:
        mujoco.set_mju_user_warning(before)
    sizes = [float(np.abs(values).max(initial=0.0)) for values in _numbers(model, own)]
    lengths = [np.linalg.norm(rows, axis=1) for rows in _directions(model)]
    if not all(size <= LARGEST for size in sizes) or not all(np.all(np.abs(n - 1.0) < 0.1) for n in lengths):
        draft.faults.append(fault("large", "", "a compiled model with other numbers, or none", most=LARGEST))
        return
    for text in said:
        draft.leave("what MuJoCo warns of", " ".join(text.split()))
    names = Names(model)
    draft.gravity = [0.0, 0.0, 0.0] if disabled(model, "GRAVITY") else list(model.opt.gravity)
    threads = screws(model, names)
    for b in range(1, model.nbody):
        _body(model, b, own, names, draft)
        keys.note("bodies", b, names.bodies[b])
        _joints(model, b, names, threads, keys, draft)
        shapes(model, b, names.bodies[b], source, draft)
    contacts(model, names, keys, draft)
    actuators(model, names, tendons(model, names, keys, draft), keys, draft)
    loops(model, names, {thread.equality for thread in threads.values()}, draft)
    noted(model, names, draft)
    keys.note_options()


def _numbers(model: Any, own: Inertias) -> Iterator[Any]:
    """All that is read of a compiled model."""
    yield model.opt.gravity
    for mass, inertia in own.values():
        yield mass
        yield inertia
    for name in READ:
        yield getattr(model, name)


def _directions(model: Any) -> Iterator[Any]:
    """Rows that MuJoCo made unit vectors, unless their numbers were too large or too small for that."""
    mujoco: Any = import_module("mujoco")
    for name in ("body_quat", "body_iquat", "geom_quat", "site_quat", "mesh_quat"):
        yield getattr(model, name)
    yield model.jnt_axis[model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)]
    yield model.eq_data[model.eq_type == int(mujoco.mjtEq.mjEQ_WELD), 6:10]


def _own_inertias(spec: Any) -> list[tuple[Any, tuple[float, Any]]]:
    """The numerical inertias of bodies, replaced by valid ones because MuJoCo refuses impossible ones.

    Left alone are models that change them as they are compiled.
    """
    c, found = spec.compiler, list[tuple[Any, tuple[float, Any]]]()
    if c.balanceinertia or c.boundmass > 0.0 or c.boundinertia > 0.0 or c.settotalmass > 0.0 or c.inertiafromgeom == 1:
        return found
    for body in spec.bodies[1:]:
        if body.explicitinertial:
            whole = np.isfinite(body.fullinertia).all()
            found.append((body, (float(body.mass), np.array(body.fullinertia if whole else body.inertia))))
            body.mass, body.inertia = 1.0, np.ones(3)
            body.fullinertia = np.array([np.nan, 0.0, 0.0, 0.0, 0.0, 0.0])
    return found


def _body(model: Any, b: int, own: Inertias, names: Names, draft: Draft) -> None:
    mass, moments = own.get(b, (float(model.body_mass[b]), np.array(model.body_inertia[b])))
    if moments.shape == (6,):
        xx, yy, zz, xy, xz, yz = moments
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        tensor = np.diag(moments)
    rotation = pose(rotation=model.body_iquat[b])[:4]
    draft.body(names.bodies[b], mass, turned_tensor(rotation, tensor), model.body_ipos[b])


def _joints(model: Any, b: int, names: Names, threads: Mapping[int, Thread], keys: Keys, draft: Draft) -> None:
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
        frame = pose(model.jnt_pos[j] if kind in ("revolute", "spherical") else (0.0, 0.0, 0.0))
        if kind in ("revolute", "prismatic"):
            turned = along(model.jnt_axis[j], frame)
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
        limited = bool(model.jnt_limited[j]) and not disabled(model, "LIMIT", "CONSTRAINT")
        stopped = limited and kind in ("revolute", "prismatic")
        if stopped:
            draft.limit(names.joints[j], *(model.jnt_range[j] - model.qpos0[int(model.jnt_qposadr[j])]))
        elif limited:
            draft.leave("limits of", names.joints[j])
        pointless = SOFT_STOPS if not (stopped and draft.contact) else ()
        for each in (j,) if thread is None else (thread.hinge, thread.slide):
            keys.note("joints", each, names.joints[each], (*pointless, *(() if _dry(model, each) else SOFT_DRY)))
        before, at = after, pose()


def _dry(model: Any, j: int) -> float:
    off = disabled(model, "FRICTIONLOSS", "CONSTRAINT")
    return 0.0 if off else float(model.dof_frictionloss[model.jnt_dofadr[j]])


def _passive(model: Any, j: int, kind: str) -> dict[str, Any]:
    """Damping, stiffness, rest and armature; coordinates count from the reference configuration."""
    entries: dict[str, Any] = {"friction": 0.0}
    if kind in ("revolute", "prismatic"):
        entries["armature"] = float(model.dof_armature[model.jnt_dofadr[j]])
    if not disabled(model, "DAMPER"):
        entries["friction"] = float(model.dof_damping[model.jnt_dofadr[j]])
    if not disabled(model, "SPRING"):
        entries["stiffness"] = float(model.jnt_stiffness[j])
        if kind in ("revolute", "prismatic") and entries["stiffness"]:
            q = int(model.jnt_qposadr[j])
            entries["rest"] = float(model.qpos_spring[q] - model.qpos0[q])
    return entries
