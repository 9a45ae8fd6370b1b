"""Scene files to scenes; every fault of a file and of the parts that it uses is reported at once."""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.assembly import assemble
from ephs.mechanics.scene.beams import BeamDraft, check_beam, resolve_beam
from ephs.mechanics.scene.bodies import resolve_body
from ephs.mechanics.scene.contacts import overlaps
from ephs.mechanics.scene.custom import is_name
from ephs.mechanics.scene.entries import Document, read_document
from ephs.mechanics.scene.errors import (
    Fault,
    ModelWarning,
    SceneError,
    SceneWarning,
    fault,
    legible,
    shown,
    told,
    warn_caller,
)
from ephs.mechanics.scene.joints import Asked, resolve_joint
from ephs.mechanics.scene.meant import as_meant
from ephs.mechanics.scene.model import ATTACHED, ENVIRONMENT, GROUND, KINDS, Scene, World, frozen, mapped, with_sections
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.resolve_elements import (
    ReferableNames,
    placed_faults,
    resolve_elements,
    settled,
    with_contacts,
)
from ephs.mechanics.scene.state import adjusted, scale_of
from ephs.mechanics.scene.stops import beyond, with_stops
from ephs.mechanics.scene.text import file_inside, file_text, lost
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.operad.collector import paused_collector
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3

# A scene displaced as a whole: placement of a part in the world of its scene.


def moved(scene: Scene, pose: Array, world: World) -> Scene:
    """The scene with its ground moved by a pose (7,), in another world.

    Body-frame twists stay, so velocities turn with it; what is fixed to the ground moves along.
    """

    def frame(body: str, offset: Array) -> Array:
        return frozen(SE3.compose(pose, offset)) if body == GROUND else offset

    def carried(there: Array) -> Array:
        return frozen(SE3.normalise(SE3.compose(pose, there)))

    changes = {
        **dict.fromkeys((*KINDS, *REGISTERED), lambda _, x: x.moved(pose)),
        "bodies": lambda _, b: replace(b, pose=carried(b.pose)),
        "joints": lambda _, j: replace(j, frame1=frame(j.body1, j.frame1), frame2=frame(j.body2, j.frame2)),
    }
    return mapped(scene, changes, world, origin=carried)


MODELS = (".urdf", ".xml", ".sdf")
"""Endings of files in other formats, which are imported."""
MOST_LEVELS = 50
"""Names in a dotted key, and parts within parts."""
MOST_PARTS = 2000
"""Largest number of parts in a scene, against exponential nesting."""
# The TOML reader's time is quadratic in the number of names in a key.
_NAME = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_NAME}[ \t]*+\.[ \t]*+){{{MOST_LEVELS}}}")


@final
@dataclass(frozen=True, slots=True)
class _FileReading:
    """Reading of files, and findings in them: faults, impossible inertias, elements of a model without a counterpart,
    and what is given of joints' states.

    ``home`` is the folder of the first file, outside of which none is read; ``files`` counts those that are.
    """

    base: str
    adjust: bool
    inertia: str | None
    home: Path
    contact: bool
    files: Counter[str] = field(default_factory=Counter)
    faults: list[Fault] = field(default_factory=list)
    odd: list[Fault] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    asked: dict[str, Asked] = field(default_factory=dict)


@paused_collector()
def load(
    path: str | PathLike[str],
    base: str = "fixed",
    adjust: bool = False,
    inertia: str | None = None,
    *,
    contact: bool = False,
) -> Scene:
    """Read a scene file, or a model in another format.

    Parameters
    ----------
    path : a scene file (``.toml``), a URDF (``.urdf``), an MJCF (``.xml``) or an SDF (``.sdf``)
    base : ``"fixed"`` or ``"free"``, connection of the root of a URDF with the ground; other files contain it
    adjust : replace an inconsistent initial state by the nearest consistent one; the scene's
        ``adjusted`` reports the change
    inertia : ``"strict"``, ``"warn"`` or ``"nearest"``: whether an inertia without a possible mass distribution is
        refused, kept, or replaced by the nearest possible one; default: as in the scene file, and ``"warn"``
        for other formats
    contact : import limits of joints and contacts from models in other formats

    Warns
    -----
    SceneWarning
        Once, with all inertias that were kept or replaced, and all frames that were moved so that loops can move.
    ModelWarning
        Once, with all elements of a model that the scene does not have.

    Raises
    ------
    SceneError
        With all faults.
    """
    r = _FileReading(base, adjust, inertia, Path(path).parent.resolve(), contact)
    if base not in ("fixed", "free"):
        r.faults.append(fault("base", "base", shown(base)))
    if inertia not in (None, "strict", "warn", "nearest"):
        r.faults.append(fault("inertia mode", "inertia", shown(inertia)))
    scene = _read(Path(path), None, (), r) if not r.faults else None
    if scene is None or r.faults:
        raise SceneError(str(path), r.faults)
    scene, said, r.faults[:] = as_meant(scene)
    if r.faults:
        raise SceneError(str(path), r.faults)
    if odd := [*told(r.odd), *filter(None, [said])]:
        warn_caller(SceneWarning("\n  ".join([f"{path}:", *map(str, odd)])))
    if r.left:
        warn_caller(ModelWarning(f"{path}:", r.left))
    return scene


def _read(path: Path, world: World | None, stack: tuple[Path, ...], r: _FileReading) -> Scene | None:
    """A scene from a file, in a given world if it is a part; None where there were faults."""
    faults = r.faults
    raw = _parse(path, r)
    if raw is None:
        return None
    document = read_document(raw, path.stem, faults)
    r = replace(r, adjust=r.adjust or document.assembly.adjust)
    world = _world(document, world, faults)
    parts, lost = _parts(document, path, world, stack, r)
    _check_names(document, faults)
    sections = document.sections
    rods = _beams(document, world)
    parts |= {name: rod.nodes for name, rod in rods.items()}
    warm = {name for rod in rods.values() for name in rod.thermal}
    names = ReferableNames.of(document, parts, warm, lost | (set(sections["beams"]) - set(rods)))
    for table in sections["beams"].values():
        check_beam(table, names)
    mode = r.inertia or document.assembly.inertia
    bodies = [resolve_body(table, mode, path.parent, r.odd) for table in sections["bodies"].values()]
    joints = [resolve_joint(table, names) for table in sections["joints"].values()]
    thermal = {name: ThermalNode(name, **dict(table.entry)) for name, table in sections["thermal"].items()}
    elements = resolve_elements(document, names, path.parent, faults)
    if faults:
        return None
    drafts = [*filter(None, joints), *(start for rod in rods.values() for start in rod.joints)]
    placed, coupled, open_joints = assemble(bodies, drafts, parts, world.gravity)
    r.asked.update({joint.name: asked for joint, asked in drafts})
    elements["conduction"] |= {name: x for rod in rods.values() for name, x in rod.conduction.items()}
    scene = Scene(
        document.name,
        world,
        placed,
        coupled,
        thermal=thermal | {name: x for rod in rods.values() for name, x in rod.thermal.items()},
        parts=parts,
        source=str(path),
        beams={name: rod.beam for name, rod in rods.items()},
    )
    scene = with_contacts(with_sections(scene, elements), faults)
    if faults:
        return None
    scene = with_stops(document, settled(scene))
    if faults:
        return None
    touched = bool(scene.contacts) or any(joint.limits is not None for _, joint in scene.all_joints())
    length = scale_of(scene).length if touched else 1.0
    r.odd.extend([*beyond(scene, length, faults), *overlaps(scene, length, faults)])
    faults += placed_faults(scene)
    if faults:
        return None
    if r.adjust:
        scene, open_joints = adjusted(scene, r.asked)
    faults += open_joints
    if not faults:
        faults += placed_faults(scene, adjusted=True)
    return None if faults else scene


def _parse(path: Path, r: _FileReading) -> Mapping[str, Any] | None:
    faults = r.faults
    if path.suffix in MODELS:
        from ephs.mechanics.imports import read_model

        return read_model(path, r.base, faults, r.left, contact=r.contact)
    if path.suffix != ".toml":
        found = shown(path.suffix) if path.suffix else "a file without suffix"
        faults.append(fault("suffix", "", found, hint=lost(path)))
        return None
    text = file_text(path, faults)
    if text is None:
        return None
    if long := _LONG_KEY.search(text):
        line = text.count("\n", 0, long.start()) + 1
        faults.append(fault("long key", f"line {line}", f"{shown(long[0][:40])}…", most=MOST_LEVELS))
        return None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = re.search(r" \(at line (\d+), column (\d+)\)", str(error))
        where = f"line {place[1]}, column {place[2]}" if place else "end of file"
        said = str(error).replace(place[0], "") if place else str(error).removesuffix(" (at end of document)")
        written = text.splitlines()[int(place[1]) - 1].strip() if place else ""
        faults.append(fault("syntax", where, f"{shown(written)} ({said})" if written else said))
    except RecursionError:
        faults.append(fault("deep", "", "tables and lists nested too deeply", most=MOST_LEVELS))
    except ValueError as error:  # a whole number of too many digits
        faults.append(fault("syntax", "", str(error)))
    return None


def _world(document: Document, wanted: World | None, faults: list[Fault]) -> World:
    given = document.world
    own = None if given is None else World(frozen(given.gravity), given.temperature, given.pressure)
    if wanted is None:
        return own or World()
    if own is not None and _described(own) != _described(wanted):
        faults.append(fault("world differs", "world", _described(own), wanted=_described(wanted)))
    return wanted


def _described(world: World) -> str:
    gravity = ", ".join(f"{entry:.15g}" for entry in world.gravity)
    return f"gravity [{gravity}], {world.temperature:.15g} K, {world.pressure:.15g} Pa"


def _parts(
    document: Document, path: Path, world: World, stack: tuple[Path, ...], r: _FileReading
) -> tuple[dict[str, Scene], set[str]]:
    """The parts, moved to their places, and the names of those that could not be read."""
    faults = r.faults
    stack = (*stack, path.resolve())
    found: dict[str, Scene] = {}
    for name, table in document.sections["parts"].items():
        entry, key = table.entry, table.key
        pose = values.pose(table)
        if not table.sound("use"):
            continue
        file = path.parent / entry.use
        if file_inside(file, r.home) is None:
            table.fault("outside scene", "use")
            continue
        r.files["parts"] += 1
        if r.files["parts"] > MOST_PARTS or len(stack) > MOST_LEVELS:
            if r.files["parts"] == MOST_PARTS + 1 or len(stack) > MOST_LEVELS:
                table.fault("many parts", "use", "one more", most=MOST_PARTS)
            continue
        if file.resolve() in stack:
            chain = " → ".join(p.name for p in (*stack[stack.index(file.resolve()) :], file))
            table.fault("cycle", "use", chain=chain)
            continue
        below = replace(r, faults=[], odd=[], left=[], asked={})
        part = _read(file, world, stack, below)
        faults += [_seen_from_outside(f, key, entry.use) for f in below.faults]
        r.odd.extend(_seen_from_outside(f, key, entry.use) for f in below.odd)
        r.left.extend(f"{legible(key)}: {line}" for line in below.left)
        r.asked.update({f"{name}.{joint}": asked for joint, asked in below.asked.items()})
        if part is not None:
            found[name] = moved(part, np.array(pose), world)
    return found, set(document.sections["parts"]) - set(found)


def _beams(document: Document, world: World) -> dict[str, BeamDraft]:
    """The beams with a valid place and section."""
    drafts = {name: resolve_beam(table, world) for name, table in document.sections["beams"].items()}
    found = {name: draft for name, draft in drafts.items() if draft is not None}
    for name, draft in found.items():
        kinds = {
            "joints": [joint.name for joint, _ in draft.joints],
            "thermal": draft.thermal,
            "conduction": draft.conduction,
        }
        for kind, taken in kinds.items():
            for each in taken:
                if each in document.sections[kind]:
                    document.sections[kind][each].fault("collision", found=shown(each), other=f"the beam {name}")
    return found


def _seen_from_outside(found: Fault, key: str, file: str) -> Fault:
    inner = legible(f"{key}.{found.key}" if found.key else f"{key}.use")
    return replace(found, key=inner, found=f"{found.found} (in {legible(file)})")


def _check_names(document: Document, faults: list[Fault]) -> None:
    """Names are path components, and no path may mean two things."""
    held = {name for table in document.sections["joints"].values() for name in table.entry.bodies}
    for section, tables in document.sections.items():
        for name in tables:
            key = f"{section}.{name}"
            if not is_name(name):
                faults.append(fault("name", f'{section}."{name}"', shown(name)))
            elif name in (GROUND, ENVIRONMENT):
                faults.append(fault("reserved", key, shown(name), reserved=f'"{GROUND}" and "{ENVIRONMENT}"'))
            elif section not in ("parts", "loads", *ATTACHED) and name in document.sections["parts"]:
                faults.append(fault("collision", key, shown(name), other="a part"))
            elif section not in ("beams", "loads", *ATTACHED) and name in document.sections["beams"]:
                faults.append(fault("collision", key, shown(name), other="a beam"))
            elif section == "joints" and name in document.sections["bodies"] and name not in held:
                faults.append(fault("collision", key, shown(name), other="the free joint of the body of this name"))
