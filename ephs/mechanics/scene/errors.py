"""Faults of scenes: one exception for the layer, every text in one table."""

import math
import sys
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from heapq import nsmallest
from typing import Any, final

from ephs.operad.messages import legible as legible
from ephs.operad.messages import nearest_name as nearest_name

ALIKE = 3
"""Number of faults that expect the same from which on they share a text."""
SHOWN = 10
"""Names that the message of a warning shows of a longer list."""


@final
@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a scene.

    Attributes
    ----------
    key : dotted path of the faulty key, as ``bodies.crank.mass`` or ``joints.pin.bodies[1]``; empty for the
        file itself
    found, expected : what is there, what should be
    advice : what to do
    """

    key: str
    found: str
    expected: str
    advice: str = ""

    def __str__(self) -> str:
        where = f"{self.key}: " if self.key else ""
        return f"{where}found {self.found}, expected {self.expected}" + (f"; {self.advice}" if self.advice else "")


def told(faults: Iterable[Fault]) -> list[str]:
    """A line for each fault, but one text for many that expect the same, followed by what was found."""
    groups: dict[tuple[str, str], list[Fault]] = {}
    for one in faults:
        groups.setdefault((one.expected, one.advice), []).append(one)
    lines: list[str] = []
    for (expected, advice), alike in groups.items():
        if len(alike) < ALIKE:
            lines += map(str, alike)
        else:
            lines.append(f"{len(alike)} times expected {expected}" + (f"; {advice}" if advice else ""))
            lines += [f"  {one.key}: found {one.found}" for one in alike]
    return lines


@final
class SceneError(ValueError):
    """A scene that cannot be used. Its message names the file, then each fault on a line.

    Attributes
    ----------
    path : the file, or the scene's name where there is none
    faults : every fault that was found
    """

    def __init__(self, path: str, faults: Iterable[Fault]) -> None:
        self.path = str(path)
        self.faults = tuple(faults)
        super().__init__(self.path, self.faults)

    def __str__(self) -> str:
        count = "1 fault" if len(self.faults) == 1 else f"{len(self.faults)} faults"
        return "\n".join([f"{self.path}: {count}", *(f"  {fault}" for fault in self.faults)])


@final
class SceneWarning(UserWarning):
    """A usable but physically implausible scene."""


@final
class ModelWarning(UserWarning):
    """An imported model has elements without a counterpart in scenes.

    Attributes
    ----------
    lines : a line for each kind of them, with all names; the message has the first `SHOWN` names of each
    """

    def __init__(self, path: str, lines: Iterable[str] = ()) -> None:
        self.lines = tuple(lines)
        super().__init__("\n  ".join([path, *map(_shortened, self.lines)]))


def warn_caller(warning: Warning) -> None:
    """Give a warning at the line of the first caller outside of this package."""
    frame, level = sys._getframe(1), 2
    while frame is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in _INNER:
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level)


def _shortened(line: str) -> str:
    names = line.split(", ")
    more = len(names) - SHOWN
    return line if more < 2 else f"{', '.join(names[:SHOWN])}, and {more} more"


_INNER = ("ephs", "contextlib")
"""Modules whose lines say nothing to a user: this package, and what its decorators run in."""
# code: (expected, advice); both may name the values given to `fault`.
TEXTS: dict[str, tuple[str, str]] = {
    # the file
    "no file": ("a scene file", "{hint}"),
    "not readable": ("a readable file", "check what the path names, and its permissions"),
    "suffix": ("a file that ends in .toml, .urdf, .xml or .sdf", "{hint}"),
    "encoding": ("UTF-8 text", "save the file as UTF-8"),
    "syntax": ("valid TOML", "correct the syntax there; units are written as comments"),
    "base": ('"fixed" or "free"', "choose the connection of the imported root with the ground"),
    "inertia mode": ('"strict", "warn" or "nearest"', "choose the treatment of impossible inertias"),
    "format": ("1", "write format = 1 as the first line"),
    "long key": ("keys of at most {most} names", "nest tables less deeply"),
    "outside scene": ("a file in the folder of the scene or below", "copy it there; files elsewhere are not read"),
    "many parts": ("at most {most} uses of parts, nested ones included", "combine some of them in one file"),
    "cycle": ("a scene that does not contain itself", "remove one of these uses: {chain}"),
    "world differs": ("{wanted}, as in the scene that uses it", "remove [world] from the part, or make it equal"),
    # models in other formats
    "model suffix": ("a file that ends in .urdf, .xml or .sdf", "check the file's name"),
    "link": (
        "a path that is not a link, for copies of meshes",
        "remove the link, or choose another name for the scene file",
    ),
    "scene suffix": ("a file that ends in .toml", "choose another name for the scene file"),
    "size": ("at most {most:g} MB", "the file is text; meshes have files of their own"),
    "entities": ("XML without <!DOCTYPE and <!ENTITY", "remove these declarations"),
    "xml": ("well-formed XML", "correct the syntax at the place named"),
    "deep": ("at most {most} levels", "nest tables or elements less deeply"),
    "copies": ("at most {most} elements, copies included", "make fewer copies"),
    "root element": ("one of {known}", "check the content of the file"),
    "xacro": ("plain URDF", "expand the macros first: xacro FILE > MODEL.urdf"),
    "value": ("{what}", "correct the value"),
    "twice": ("a unique name", "rename one of the two"),
    "unknown link": ("a link of this model", "{hint}"),
    "no link": ("at least one link", "check that the file is complete"),
    "two parents": ("one parent", "a URDF is a tree; close loops in an SDF or a scene file"),
    "link cycle": ("a tree of links", "remove one of these joints"),
    "roots": ("one root link", "connect the other roots to it by joints"),
    "unknown frame": ("a frame of this model", "{hint}"),
    "frame cycle": ("frames without a cycle", "place one of them relative to the model"),
    "one model": ("models, or one world with models", "split the file"),
    "not supported": ("a model without {what}", "{hint}"),
    "outside": ("a file in the folder of the model", "copy it there; files elsewhere are not read"),
    "not compiled": ("a model that MuJoCo can compile", "correct the reported fault"),
    "no importer": ("the module mujoco", "python -m pip install 'ephs[models]'"),
    # keys, types and names
    "unknown key": ("one of {known}", "{hint}"),
    "missing": ("{what}", "add this key"),
    "table": ("a table", "write it as [{key}] with keys below"),
    "type": ("{what}", "correct the value"),
    "length": ("{what}", "correct the number of entries"),
    "large": ("a number of at most {most:g} in size", "check the unit"),
    "finite": ("a finite number", "nan and inf are not allowed"),
    "range": ("{what}", "correct the value"),
    "name": ("at most 200 printable characters, without dots and blanks, not beginning with ~", "rename it"),
    "scene name": (
        "a valid name of a folder: at most 200 printable characters, without / and \\",
        "rename the scene; its results are saved in a folder of this name",
    ),
    "reserved": ("another name", "{reserved} have a fixed meaning; rename it"),
    "collision": ("a name that {other} does not use", "rename one of them"),
    "unknown body": ('"ground" or a body', "{hint}"),
    "unknown node": ("a node of {first} … {last}", "correct the number"),
    "welded node": ("a node that moves by itself", "take {body} in its place"),
    "unknown thermal": ('"environment" or a [thermal] name', "{hint}"),
    "unknown type": ("one of {known}", "{hint}"),
    "overlap": (
        "less than {most:.3g} m at the start",
        "the energy of this overlap is part of the initial energy; move one of the bodies",
    ),
    "dry joint": ("a joint with one degree of freedom and no prescribed motion", "remove dry"),
    "dry static": ("a number ≥ coulomb = {coulomb:g}", "static friction is at least as large as sliding friction"),
    "limited joint": ("a joint with one degree of freedom and no prescribed motion", "remove limits"),
    "beyond stop": ("an initial coordinate between the hard stops", "move the joint, or remove limit_restitution"),
    "beyond soft stop": (
        "less than {most:.3g} beyond the stops at the start",
        "the stops' energy is part of the initial energy; set the joint's coordinate between them",
    ),
    "no scale": ("a stiffness, since the scene gives no time scale for a default", "add this key"),
    "not continued": (
        "a start that follows from poses and rates, or from its table",
        "let continued(self, states) return an element that starts there",
    ),
    "not built": ("an element that can be built", "correct its values"),
    "unknown surface": ("a surface", "{hint}"),
    "many faces": (
        "at most {most} where it meets other shapes than planes",
        "take fewer points, or several simple shapes, or put both surfaces into one group",
    ),
    "hard and soft": ("stiffness or restitution", "hard contacts have no {soft}: remove one of the two"),
    "hard overlap": (
        "hard surfaces without initial overlap",
        "move one of the bodies, or give one of the surfaces a stiffness",
    ),
    "mesh": ("a file in the scene's folder or below", "move it there, and write its path relative to the scene file"),
    "mesh kind": ("a mesh that ends in one of {known}", "convert it to one of these"),
    "both shapes": ("either shape or shapes", "remove one of the two"),
    "density": ("density without mass and inertia", "remove mass and inertia, or density"),
    "density shape": ("box, sphere or cylinder shapes", "give mass and inertia, or such shapes"),
    "centre": (
        "shapes whose common centre of mass is the origin of the body's frame",
        "shift the positions of the shapes by {shift}",
    ),
    "only mesh": ("no scale for a {kind}", "scale belongs to meshes only"),
    "shape": ("one of box, sphere, cylinder, mesh", "a shape has exactly one of these keys"),
    # bodies
    "quaternion": ("a unit quaternion [w, x, y, z] to 1e-6", "divide it by its norm"),
    "inertia indefinite": ("no negative principal moment", 'correct the tensor, or set assembly.inertia = "warn"'),
    "inertia triangle": (
        "no principal moment above the sum of the two others",
        'correct the tensor, or set assembly.inertia = "warn"',
    ),
    "inertia singular": (
        "positive principal moments",
        'give it inertia about every axis, or set assembly.inertia = "nearest"',
    ),
    "inertia kept": (
        "moments of a possible mass distribution",
        'kept; inertia "nearest" takes the nearest possible ones',
    ),
    "inertia nearest": ("moments of a possible mass distribution", "replaced by the nearest possible ones: {taken}"),
    "inertia zero": ("positive principal moments", "moments below {least:.3g} kg m² are replaced by it"),
    "mass zero": ("a mass for this inertia, or inertia 0", "replaced by {mass:.3g} kg"),
    "massless": ("0 for a body of mass 0", "give it a mass, or inertia = [0, 0, 0]"),
    # joints
    "same body": ("two different bodies", "a joint connects two bodies, or a body and the ground"),
    "both places": ("either at and axis, or frame1 and frame2", "remove one of the two pairs"),
    "no place": ("{what}", "give at and axis, or frame1 and frame2"),
    "direction": ("a direction of non-zero length", "correct the vector"),
    "xaxis": ("a direction not parallel to axis", "choose another xaxis, or remove it"),
    "parallel": ("a direction not parallel to {other}", "the two axes of a universal joint must differ"),
    "only universal": ("no axis2 for a {kind} joint", "axis2 belongs to universal joints only"),
    "only screw": ("no pitch for a {kind} joint", "pitch belongs to screw joints only"),
    "xaxis with frames": ("no xaxis together with frame1 and frame2", "remove it; the frames define the x axis"),
    "friction shape": ("a number, {d} numbers, or a symmetric {d} by {d} matrix", "correct the value"),
    "friction sign": ("a symmetric, positive semidefinite matrix", "friction cannot produce energy; correct the value"),
    "friction asymmetric": ("a symmetric matrix", "make entry [i][j] equal to entry [j][i]"),
    "rest rotation": ("rest 0 on a rotation vector", "turn frame1 or frame2 instead"),
    "motion freedoms": (
        "a joint with one degree of freedom",
        "motion prescribes a single rate; this joint has {d} degrees of freedom",
    ),
    "armature": (
        "0, or a joint with one degree of freedom and no prescribed motion",
        "remove armature, or choose another joint",
    ),
    "motor joint": ("a joint with one degree of freedom and no prescribed motion", "name another joint"),
    "gear freedoms": ("a joint with one degree of freedom", "choose other joints"),
    "unknown joint": ("a joint of the scene", "{hint}"),
    "motion and drive": (
        "either motion or drive",
        "remove one of the two; a drive has no effect on a prescribed motion",
    ),
    "motion form": (
        "rate, or polynomial, or amplitude and frequency (and phase), or times and displacements",
        "give the keys of one form",
    ),
    "motion number": ("{expected}", "correct the value"),
    "motion rate": ("{motion}, the prescribed initial rate", "remove rate, or make it equal to this"),
    "coordinate at": ("0 where at and axis are given", "give frame1 and frame2 to start at another coordinate"),
    # beams
    "section": (
        "either EA, GA, GJ, EI, rhoA, rhoI, or one of circle, tube, rectangle with E, nu, rho",
        "give all keys of one of the two forms",
    ),
    "tube": ("an inner radius below the outer one", "give the outer radius first"),
    "beam place": ("either from and to, or points", "give one of the two"),
    "beam points": ("a point different from the previous one", "remove it, or move it"),
    "beam elements": (
        "a multiple of the {segments} segments, at most {most}",
        "every point is a node; change the number",
    ),
    "beam heat": ("either heat or thermal, which has a thermal node for each element", "remove one of the two"),
    "rod radius": (
        "a radius, since the section is neither a circle nor a tube",
        "add the radius of the contact surface",
    ),
    "rod expansion": ("0 for {rod}, which is inextensible", 'use rod = "reissner"'),
    "rod order": ("2 for {rod}", "only reissner has elements of order 4"),
    "rod strain": (
        "0 for the strains that {rod} does not have",
        "kirchhoff has torsion and bending, a string has none",
    ),
    "string damping": ("0 for a string, which has no bending stiffness", 'use rod = "kirchhoff"'),
    "up": ("a direction not parallel to any tangent of the beam", "choose another up"),
    "unknown tendon": ("a tendon of this file", "{hint}"),
    # assembly
    "gap": ("gaps below {limit}", "correct {who}, or set assembly.adjust = true"),
    "velocity": ("residuals below {limit}", "correct the velocities of {who}, or set assembly.adjust = true"),
    "rate differs": (
        "{actual}, as the velocities of the bodies give it",
        "remove rate, or correct the velocities of {who}",
    ),
    "motion differs": (
        "{motion}, the prescribed rate",
        "correct the velocities of {who}, or set assembly.adjust = true",
    ),
    "nearly movable": (
        "a mechanism that moves with gaps below {limit} of its length, or does not move",
        "align the axes of its joints, or remove the constraint that blocks it",
    ),
    "no assembly": (
        "positions that close every loop",
        "no consistent state was found nearby; correct the positions of {who}",
    ),
    "no motion": ("velocities that satisfy the joints", "the prescribed rates contradict each other; correct them"),
    # numbers by path
    "unknown parameter": ("the path of a number of the scene", "{hint}"),
    "entry": ("an entry {shape}", "give the index of one entry"),
    "one number": ("the same number for all degrees of freedom", "vary its entries one by one"),
    "held velocity": ("a free body", "vary the rate of a joint instead: joints.{joint}.rate"),
    # states
    "unknown state": ("a {what} of the scene", "{hint}"),
    "state length": ("{what}", "give one number per degree of freedom, in the order of the degrees of freedom"),
    "no time": ("one of the solution's times, {first:g} to {last:g}", "save the solution at this time (save_at)"),
}


def fault(code: str, key: str, found: object, **values: Any) -> Fault:
    """Fault of this code, its texts filled with ``values``; texts from files are abbreviated and escaped."""
    expected, advice = TEXTS[code]
    key = legible(key)
    words = {name: legible(value) if isinstance(value, str) else value for name, value in values.items()}
    return Fault(key, legible(str(found)), expected.format(key=key, **words), advice.format(key=key, **words))


def shown(value: Any) -> str:
    """A value in the file's notation, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return "nan" if math.isnan(value) else repr(value)
    if isinstance(value, list):
        text = "[" + ", ".join(shown(entry) for entry in value) + "]"
        return text if len(text) <= 60 else f"{text[:57]}…] of {len(value)} entries"
    return str(value)


def did_you_mean(name: str, known: Iterable[str], otherwise: str) -> str:
    """A hint at the nearest known name, or ``otherwise``."""
    near = nearest_name(name, known)
    return f'did you mean "{near}"?' if near else otherwise


def listing(names: Iterable[str], limit: int = 12) -> str:
    """The first names, for a message."""
    known = nsmallest(limit + 1, names)
    return ", ".join(known[:limit]) + (", …" if len(known) > limit else "") if known else "nothing"


def unknown_name(what: str, name: str, known: Iterable[str], scene: str = "scene") -> SceneError:
    """The error for an unknown body or joint of a scene."""
    names = list(known)
    hint = did_you_mean(name, names, f"the known ones are {listing(names)}")
    return SceneError(scene, [fault("unknown state", "", f'{what} "{name}"', what=what, hint=hint)])
