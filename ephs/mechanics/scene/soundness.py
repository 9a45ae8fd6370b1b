"""Scenes from result files: checks of all types, shapes and sizes.

Scene files are checked as they are read, key by key; a result file holds what was a scene once, unless it was changed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np

from ephs.mechanics.scene.attached import ATTACHED, Actuator
from ephs.mechanics.scene.errors import ModelWarning, legible
from ephs.mechanics.scene.geometry import UNIVERSAL, coupling, joint_types
from ephs.mechanics.scene.model import ENVIRONMENT, GROUND, Joint, Scene
from ephs.mechanics.shapes.pairs import SIZES
from ephs.operad import Path as Name

__all__ = ["check_scene", "meshes_within"]


def check_scene(scene: Scene) -> None:
    """Look at everything of a scene.

    Raises
    ------
    ValueError
        Something is not what scenes have.
    """
    for name, sizes in _shapes(scene):
        for key, (value, shape) in sizes.items():
            array = np.asarray(value)
            if array.shape != shape or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
                raise ValueError(f"{legible(name)}.{key} is {legible(str(value))}, expected finite numbers {shape}")
    _check_names(scene)
    bodies = {GROUND, *(name for name, _ in scene.all_bodies())}
    nodes = {ENVIRONMENT, *(name for name, _ in scene.all_thermal())}
    for kind, known, named in (
        ("body", bodies, [end for _, j in (*scene.all_joints(), *scene.all_springs()) for end in (j.body1, j.body2)]),
        ("body", bodies, [each.body for _, each in (*scene.all_markers(), *scene.all_surfaces())]),
        ("surface", dict(scene.all_surfaces()), [name for _, c in scene.all_contacts() for name in c.surfaces]),
        ("thermal node", nodes, [contact.heat for _, contact in scene.all_contacts()]),
        ("body", bodies, [body for _, tendon in scene.all_tendons() for body in tendon.bodies]),
        ("thermal node", nodes, [tendon.heat for _, tendon in scene.all_tendons()]),
        (
            "tendon",
            dict(scene.all_tendons()),
            [x.tendon for _, _, x in scene.all_attachments() if isinstance(x, Actuator) and x.tendon],
        ),
        ("body", bodies, [load.body for _, load in scene.all_loads()]),
        ("body", bodies, [node for _, beam in scene.all_beams() for node in beam.nodes]),
        ("joint", dict(scene.all_joints()), [name for _, beam in scene.all_beams() for name in beam.joints]),
        ("thermal node", nodes, [each.heat for _, each in (*scene.all_joints(), *scene.all_springs())]),
        ("joint", dict(scene.all_joints()), [name for _, _, each in scene.all_attachments() for name in each.tied]),
        ("thermal node", nodes, [each.heat for _, _, each in scene.all_attachments()]),
        ("thermal node", nodes, [end for _, each in scene.all_conduction() for end in each.between]),
    ):
        for name in named:
            if name not in known:
                raise ValueError(f"there is no {kind} {legible(str(name))}")


def meshes_within(scene: Scene, homes: Iterable[Path]) -> Scene:
    """The scene without meshes outside these folders."""
    folders, lost = [home.resolve() for home in homes], list[str]()

    def near(shape: Mapping[str, Any] | None) -> bool:
        if not shape or "mesh" not in shape:
            return True
        file = Path(str(shape["mesh"])).resolve()
        if any(file.is_relative_to(folder) for folder in folders):
            return True
        lost.append(str(file))
        return False

    def kept(scene: Scene) -> Scene:
        bodies = {
            name: replace(body, shape=body.shape if near(body.shape) else None, shapes=tuple(filter(near, body.shapes)))
            for name, body in scene.bodies.items()
        }
        return replace(scene, bodies=bodies, parts={name: kept(part) for name, part in scene.parts.items()})

    found = kept(scene)
    if lost:
        files = ", ".join(map(legible, sorted(set(lost))))
        warn(f"meshes outside of the file's folder and the working folder are not drawn: {files}", ModelWarning, 2)
    return found if lost else scene


def _shapes(scene: Scene) -> Iterator[tuple[str, dict[str, tuple[Any, tuple[int, ...]]]]]:
    """Every number with its required shape."""
    w = scene.world
    yield "world", {"gravity": (w.gravity, (3,)), "temperature": (w.temperature, ()), "pressure": (w.pressure, ())}
    for name, body in scene.all_bodies():
        yield (
            name,
            {
                "mass": (body.mass, ()),
                "inertia": (body.inertia, (3, 3)),
                "pose": (body.pose, (7,)),
                "twist": (body.twist, (6,)),
            },
        )
    for name, j in scene.all_joints():
        if j.kind not in joint_types():
            raise ValueError(f"joint {legible(name)} is of the kind {legible(str(j.kind))}")
        yield name, _joint(j)
    for name, s in scene.all_springs():
        numbers = {"stiffness": s.stiffness, "length": s.length, "damping": s.damping}
        yield name, {"at1": (s.at1, (3,)), "at2": (s.at2, (3,))} | {key: (x, ()) for key, x in numbers.items()}
    for name, node in scene.all_thermal():
        yield name, {key: (getattr(node, key), ()) for key in ("capacity", "temperature", "pull", "reference")}
    for name, conduction in scene.all_conduction():
        yield name, {"conductance": (conduction.conductance, ())}
    for name, marker in scene.all_markers():
        yield name, {"at": (marker.at, (3,))}
    for name, surface in scene.all_surfaces():
        ((kind, sizes),) = surface.shape.items()
        if kind not in SIZES:
            raise ValueError(f"surface {legible(name)} is a {legible(str(kind))}")
        known = SIZES[kind]
        expected: tuple[int, ...] = np.shape(sizes) if known is None else known
        yield name, {"frame": (surface.frame, (7,))} | ({kind: (sizes, expected)} if kind != "plane" else {})
    for name, contact in scene.all_contacts():
        yield name, {key: (number, ()) for key, number in contact.law.numbers}
    for _, name, each in scene.all_attachments():
        yield name, each.values()
    for name, tendon in scene.all_tendons():
        numbers = {"stiffness": tendon.stiffness, "length": tendon.length, "damping": tendon.damping}
        yield name, {"points": (tendon.points, (len(tendon.bodies), 3))} | {key: (x, ()) for key, x in numbers.items()}
    for name, load in scene.all_loads():
        yield name, {"force": (load.force, (3,)), "moment": (load.moment, (3,)), "ramp": (load.ramp, ())}


def _joint(j: Joint) -> dict[str, tuple[Any, tuple[int, ...]]]:
    of = coupling(j.kind, float(j.pitch))
    if (j.kind == UNIVERSAL) != (j.middle is not None):
        raise ValueError(f"{legible(j.name)}.middle is {legible(str(j.middle))}; universal joints have one, no others")
    d = of.dim
    return {
        "pitch": (j.pitch, ()),
        "frame1": (j.frame1, (7,)),
        "frame2": (j.frame2, (7,)),
        "friction": (j.friction, (d, d)),
        "stiffness": (j.stiffness, (d,)),
        "rest": (j.rest, (d,)),
        "drive": (j.drive, (d,)),
        "rate": (j.rate, (d,)),
        "coordinate": (j.coordinate, (of.size,)),
        "armature": (j.armature, ()),
        **({} if j.motion is None else {f"motion.{key}": (number, ()) for key, number in j.motion.numbers}),
        **({} if j.middle is None else {"middle": (j.middle, (7,))}),
        **({} if j.stop is None else {f"stop.{key}": (number, ()) for key, number in j.stop.numbers}),
        **({} if j.dry is None else {f"dry.{key}": (number, ()) for key, number in j.dry.numbers}),
        **({} if j.strain is None else _strain(j)),
    }


def _strain(j: Joint) -> dict[str, tuple[Any, tuple[int, ...]]]:
    s = j.strain
    if s is None or j.kind != "free":
        raise ValueError(f"joint {legible(j.name)} has a strain, which free joints have only")
    if s.order not in (2, 4):
        raise ValueError(f"{legible(j.name)}.strain.order is {legible(str(s.order))}; expected 2 or 4")
    return {
        "strain.length": (s.length, ()),
        "strain.stiffness": (s.stiffness, (6,)),
        "strain.rest": (s.rest, (6,)),
        "strain.damping": (s.damping, ()),
    }


def _check_names(scene: Scene) -> None:
    kinds = ("bodies", "joints", "springs", "thermal", "conduction", "markers", "surfaces", "contacts")
    for things in (getattr(scene, kind) for kind in (*kinds, "beams", "loads", "tendons", *ATTACHED)):
        for name, thing in things.items():
            if Name([name]) != (thing.name,):
                raise ValueError(f"{legible(name)} is called {legible(str(thing.name))}")
    for name, part in scene.parts.items():
        Name([name])
        _check_names(part)
