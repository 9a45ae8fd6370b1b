"""Scenes from result files: checks of all types, shapes and sizes.

Scene files are checked as they are read, key by key; a result file holds what was a scene once, unless it was changed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.element import HOLDERS, OUTSIDE, Measured, SceneElement
from ephs.mechanics.scene.errors import ModelWarning, legible, warn_caller
from ephs.mechanics.scene.geometry import UNIVERSAL, coupling, joint_types
from ephs.mechanics.scene.model import ELEMENTS, Body, Joint, Scene, mapped
from ephs.mechanics.scene.resolve_elements import broken
from ephs.mechanics.scene.site import nodes_of_shells
from ephs.operad import Path as Name

Sizes: TypeAlias = dict[str, tuple[Any, tuple[int, ...]]]
"""Numbers with their required shapes."""


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
    for name, each in _all(scene):
        if isinstance(each, Element) and (wrong := next(broken(Checked(each, name)), None)):
            raise ValueError(str(wrong))
    _check_names(scene)
    there = {section: {name for name, _ in scene.every(section)} for section in ELEMENTS}
    named = [(kind, name) for _, each in _all(scene) for kind in set(each.names.values()) for name in each.named(kind)]
    beams = [beam for _, beam in scene.all_beams()]
    named += [("body", name) for beam in beams for name in beam.nodes]
    named += [("joint", name) for beam in beams for name in beam.joints]
    nodes = nodes_of_shells(scene)
    for kind, name in named:
        known = (kind == "body" and name in nodes) or any(name in there[section] for section in HOLDERS[kind])
        if name not in OUTSIDE[kind] and not known:
            first = HOLDERS[kind][0]
            what = {"bodies": "body", "thermal": "thermal node"}.get(first, first.removesuffix("s"))
            raise ValueError(f"there is no {what} {legible(str(name))}")


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

    def kept(_: str, body: Body) -> Body:
        return replace(body, shape=body.shape if near(body.shape) else None, shapes=tuple(filter(near, body.shapes)))

    found = mapped(scene, {"bodies": kept})
    if lost:
        files = ", ".join(map(legible, sorted(set(lost))))
        warn_caller(ModelWarning(f"meshes outside of the file's folder and the working folder are not drawn: {files}"))
    return found if lost else scene


def _all(scene: Scene) -> Iterator[tuple[str, SceneElement]]:
    """Every element of a scene with its dotted name."""
    for section in ELEMENTS:
        yield from scene.every(section)
    yield from ((name, each) for _, name, each in scene.all_elements())


def _shapes(scene: Scene) -> Iterator[tuple[str, Sizes]]:
    """Every number with its required shape, but those of elements whose models check them."""
    yield "world", scene.world.values()
    yield from ((f"{path}ground", {"origin": (level.origin, (7,))}) for path, level in scene.levels())
    for name, each in (pair for section in ELEMENTS for pair in scene.every(section)):
        match each:
            case Joint():
                yield name, _joint(name, each)
            case Measured():
                yield name, each.values()


def _joint(name: str, j: Joint) -> Sizes:
    if j.kind not in joint_types():
        raise ValueError(f"joint {legible(name)} is of the kind {legible(str(j.kind))}")
    if (j.kind == UNIVERSAL) != (j.middle is not None):
        raise ValueError(f"{legible(j.name)}.middle is {legible(str(j.middle))}; universal joints have one, no others")
    of = coupling(j.kind, float(j.pitch))
    inside = {"motion": j.motion, "stop": j.stop, "dry": j.dry}
    laws = {f"{key}.{part}": (x, ()) for key, law in inside.items() if law is not None for part, x in law.numbers}
    return j.values(of.dim) | {"coordinate": (j.coordinate, (of.size,))} | laws | _strain(j)


def _strain(j: Joint) -> Sizes:
    s = j.strain
    if s is None:
        return {}
    if j.kind != "free":
        raise ValueError(f"joint {legible(j.name)} has a strain, which free joints have only")
    if s.order not in (2, 4):
        raise ValueError(f"{legible(j.name)}.strain.order is {legible(str(s.order))}; expected 2 or 4")
    return {f"strain.{key}": given for key, given in s.values().items()}


def _check_names(scene: Scene) -> None:
    for section in (*ELEMENTS, *scene.elements):
        for name, thing in scene.section(section).items():
            if Name([name]) != (thing.name,):
                raise ValueError(f"{legible(name)} is called {legible(str(thing.name))}")
    for name, part in scene.parts.items():
        Name([name])
        _check_names(part)
