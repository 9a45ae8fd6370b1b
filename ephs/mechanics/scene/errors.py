"""Faults of scenes: one exception for the layer, every text in one table."""

from collections.abc import Iterable
from dataclasses import dataclass
from heapq import nsmallest
from typing import Any, final


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
    """An imported model has elements without a counterpart in scenes."""


# code: (expected, advice); both may name the values given to `fault`.
TEXTS: dict[str, tuple[str, str]] = {
    # the file
    "no file": ("a scene file", "check the path"),
    "not readable": ("a readable file", "check what the path names, and its permissions"),
    "suffix": ("a file that ends in .toml, .urdf, .xml or .sdf", "check the file's name"),
    "encoding": ("UTF-8 text", "save the file as UTF-8"),
    "syntax": ("valid TOML", "correct the syntax there; units are written as comments"),
    "base": ('"fixed" or "free"', "choose the connection of the imported root with the ground"),
    "inertia mode": ('"strict", "warn" or "nearest"', "choose the treatment of impossible inertias"),
    "format": ("1", "write format = 1 as the first line"),
    "long key": ("keys of at most {most} names", "no scene has tables nested so deeply"),
    "outside scene": ("a file in the scene's own folder, or below it", "copy it there; nothing else is read"),
    "many parts": ("at most {most} uses of parts, those of parts counted", "join some of them into one file"),
    "cycle": ("a scene that is no part of itself", "take one of these uses out: {chain}"),
    "world differs": (
        "{wanted}, that of the scene that uses it",
        "take [world] out of the part, or make it equal",
    ),
    # models in other formats
    "model suffix": ("a file that ends in .urdf, .xml or .sdf", "check the file's name"),
    "link": (
        "a place that is no link, for copies of meshes",
        "take it away, or choose another name for the scene file",
    ),
    "scene suffix": ("a file that ends in .toml", "choose another name for the scene file"),
    "size": ("at most {most:g} MB", "the file is text; meshes have files of their own"),
    "entities": ("XML without <!DOCTYPE and <!ENTITY", "take these declarations out, comments included"),
    "xml": ("well-formed XML", "correct the syntax at the place named"),
    "deep": ("at most {most} levels", "no model is nested so deeply"),
    "copies": ("at most {most} elements, copies counted", "make fewer copies"),
    "root element": ("one of {known}", "check what the file holds"),
    "xacro": ("plain URDF", "expand the macros first: xacro FILE > MODEL.urdf"),
    "value": ("{what}", "correct the value"),
    "twice": ("a name of its own", "rename one of the two"),
    "unknown link": ("a link of this model", "{hint}"),
    "no link": ("at least one link", "check that the file is complete"),
    "two parents": ("one parent", "a URDF is a tree; close loops in an SDF or a scene file"),
    "link cycle": ("links that lead to a root", "take one of these joints out"),
    "roots": ("one root link", "join the others to it"),
    "unknown frame": ("a frame of this model", "{hint}"),
    "frame cycle": ("frames that lead to the model's", "place one of them relative to the model"),
    "one model": ("one model", "split the file, or join the models"),
    "not supported": ("a model without {what}", "{hint}"),
    "outside": ("a file in the model's own folder", "copy it there; nothing else is read"),
    "not compiled": ("a model that MuJoCo compiles", "correct the reported fault"),
    "no importer": ("the module mujoco", "python -m pip install 'ephs[models]'"),
    # keys, types and names
    "unknown key": ("one of {known}", "{hint}"),
    "missing": ("{what}", "add this key"),
    "table": ("a table", "write it as [{key}] with keys below"),
    "type": ("{what}", "correct the value"),
    "length": ("{what}", "give as many numbers as this"),
    "one freedom": ("a number", "a pair with one degree of freedom takes one number"),
    "large": ("a number of at most {most:g} in size", "check the unit"),
    "finite": ("a finite number", "nan and inf are not allowed"),
    "range": ("{what}", "correct the value"),
    "name": (
        "a name without dots and blanks, of at most 200 printable letters, the first no ~",
        "rename it",
    ),
    "scene name": (
        "a name that a folder can have: printable, of at most 200 letters, without / and \\",
        "rename the scene: results are kept under its name",
    ),
    "reserved": ("a name of your own", "{reserved} have a fixed meaning; rename it"),
    "collision": ("a name that is not taken by {other}", "rename one of them"),
    "unknown body": ('"ground" or a body', "{hint}"),
    "unknown thermal": ('"environment" or a [thermal] name', "{hint}"),
    "unknown type": ("one of {known}", "{hint}"),
    "overlap": (
        "less than {most:.3g} m at the start",
        "the energy of this overlap is in the balance from the start; move one of the bodies",
    ),
    "dry joint": ("a joint with one degree of freedom that is free to move", "take dry out"),
    "dry static": ("a number ≥ coulomb = {coulomb:g}", "friction at rest is no less than while sliding"),
    "limited joint": ("a joint with one degree of freedom that is free to move", "take limits out"),
    "beyond stop": ("a start between hard stops", "move the joint, or take limit_restitution out"),
    "no scale": ("a stiffness, as nothing in the scene moves or falls", "add this key"),
    "unknown surface": ("a surface", "{hint}"),
    "convex mesh": ("an STL file of a convex body", "take its convex hull, or several convex pieces"),
    "surface shape": ("one of sphere, capsule, cylinder, box, plane = {{}}, mesh", "a surface has exactly one shape"),
    "surface pair": ("one plane at most", "list the contacts that are meant, or take other shapes"),
    "two exponents": ("one exponent", "give both surfaces the same, or the contact its own"),
    "no stiffness": (
        "the stiffness of one surface or of the contact, or the restitution of hard ones",
        "add one of these keys",
    ),
    "hard and soft": ("stiffness or restitution", "what is hard has no {soft}: take one of both out"),
    "hard overlap": (
        "hard surfaces that do not overlap at the start",
        "move one of the bodies, or give one of the surfaces a stiffness",
    ),
    "mesh": ("a file in the scene's folder or below", "move it there, and give its path from the scene file"),
    "mesh kind": ("a mesh that ends in one of {known}", "convert it to one of these"),
    "both shapes": ("either shape or shapes", "take one of the two out"),
    "density": ("density without mass and inertia", "leave out mass and inertia, or density"),
    "density shape": ("box, sphere or cylinder shapes", "give mass and inertia, or such shapes"),
    "centre": (
        "shapes whose common centre of mass is the origin of the body's frame",
        "shift the positions of the shapes by {shift}",
    ),
    "only mesh": ("no scale for a {kind}", "scale belongs to meshes only"),
    "shape": ("one of box, sphere, cylinder, mesh", "a shape has exactly one of these keys"),
    # bodies
    "quaternion": ("a unit quaternion [w, x, y, z] to 1e-6", "divide it by its norm"),
    "inertia indefinite": (
        "no negative principal moment",
        'correct the tensor, or set assembly.inertia = "warn"',
    ),
    "inertia triangle": (
        "no principal moment above the sum of the two others",
        'correct the tensor, or set assembly.inertia = "warn"',
    ),
    "inertia singular": (
        "positive principal moments",
        'give it some inertia about every axis, or set assembly.inertia = "nearest"',
    ),
    "inertia kept": (
        "those of a distribution of mass",
        'kept; inertia "nearest" would take the nearest possible ones',
    ),
    "inertia nearest": ("those of a distribution of mass", "took the nearest possible ones: {taken}"),
    "inertia zero": ("positive principal moments", "took those below {least:.3g} kg m² as this"),
    "mass zero": ("a mass that has this inertia, or inertia 0", "took {mass:.3g} kg"),
    "massless": ("0 for a body of mass 0", "give it a mass, or inertia = [0, 0, 0]"),
    # joints
    "same body": ("two different bodies", "a joint connects two bodies, or a body and the ground"),
    "both places": ("either at and axis, or frame1 and frame2", "take one of the two ways out"),
    "no place": ("{what}", "give at and axis, or frame1 and frame2"),
    "direction": ("a direction of non-zero length", "correct the vector"),
    "xaxis": ("a direction that is not along axis", "take another xaxis, or none"),
    "parallel": ("a direction that is not along {other}", "the two axes of a universal joint must differ"),
    "only universal": ("no axis2 for a {kind} joint", "axis2 belongs to universal joints only"),
    "only screw": ("no pitch for a {kind} joint", "pitch belongs to screw joints only"),
    "xaxis with frames": ("no xaxis beside frame1 and frame2", "the frames give the x axis"),
    "friction shape": ("a number, {d} numbers, or a symmetric {d} by {d} matrix", "correct the value"),
    "friction sign": ("a symmetric, positive semidefinite matrix", "friction may not produce energy"),
    "friction asymmetric": ("a symmetric matrix", "make entry [i][j] equal to entry [j][i]"),
    "rest rotation": ("rest 0 on a rotation vector", "turn frame1 or frame2 instead"),
    "motion freedoms": (
        "a joint with one degree of freedom",
        "motion prescribes a single rate; this joint has {d} degrees of freedom",
    ),
    "armature": ("inertia of a joint with one degree of freedom whose motion is free", "give it to another joint"),
    "motor joint": ("a joint with one degree of freedom whose motion is free", "name another joint"),
    "gear freedoms": ("a joint with one degree of freedom", "tie other joints to each other"),
    "gear joints": ("different joints", "name each joint once"),
    "gear ratio": ("{count} numbers, one for each joint, of gears but the first", "give as many"),
    "gear rates": ("the first rate, of {first}, at {rate:.6g}", "give rates that the gear ties together"),
    "unknown joint": ("a joint of the scene", "{hint}"),
    "motion and drive": ("either motion or drive", "a prescribed rate leaves nothing for a drive to do"),
    "motion form": (
        "rate, or polynomial, or amplitude and frequency (and phase), or times and displacements",
        "give the keys of one form",
    ),
    "motion number": ("{expected}", "correct the value"),
    "motion rate": ("{motion}, the prescribed rate", "take rate out, or make it equal to the motion's at the start"),
    "coordinate at": (
        "0 where at and axis are given",
        "give frame1 and frame2 to start at another coordinate",
    ),
    # beams and loads
    "section": (
        "either EA, GA, GJ, EI, rhoA, rhoI, or one of circle, tube, rectangle with E, nu, rho",
        "give the one or the other, complete",
    ),
    "tube": ("an inner radius below the outer one", "give the outer radius first"),
    "beam place": ("either from and to, or points", "give one of the two"),
    "beam points": ("a point away from the one before", "take it out, or move it"),
    "beam elements": ("a multiple of the {segments} segments, at most {most}", "there is a node at every point"),
    "beam heat": ("no heat beside thermal, where each element warms itself", "take one of them out"),
    "rod radius": ("a radius, for the section is no circle and no tube", "say how thick the rod is where it touches"),
    "rod expansion": ("0 for {rod}, which does not stretch", "take reissner"),
    "rod order": ("2 for {rod}", "elements of order 4 stretch and shear"),
    "rod strain": ("0 where {rod} takes no strain", "kirchhoff takes torsion and bending, a string takes none"),
    "string damping": ("0 for a string, which does not resist bending", "take kirchhoff"),
    "up": ("a direction along no tangent of the beam", "give another up"),
    "load ground": ("a body", "loads on the ground do nothing"),
    "tendon points": ("{count} points, one in each of its bodies", "give as many"),
    "tendon bodies": ("two different bodies after each other", "route it from one body to another"),
    "slack damping": ("0 of a tendon with slack", "leave out one of the two; joints and bodies may have friction"),
    "actuator target": ("either joints or a tendon", "give one of the two"),
    "unknown tendon": ("a tendon of this file", "{hint}"),
    "same ends": ("two different points or nodes", "correct one of the two"),
    # assembly
    "gap": ("gaps below {limit}", "correct {who}, or set assembly.adjust = true"),
    "velocity": ("residuals below {limit}", "correct the velocities of {who}, or set assembly.adjust = true"),
    "rate differs": ("{actual}, that of the bodies", "take rate out, or correct the velocities of {who}"),
    "motion differs": (
        "{motion}, the prescribed rate",
        "correct the velocities of {who}, or set assembly.adjust = true",
    ),
    "nearly movable": (
        "one that moves with gaps below {limit} of its length, or does not move",
        "align the axes of its joints, or leave out what holds it",
    ),
    "no assembly": (
        "positions that close every loop",
        "no consistent state is near; correct the positions of {who}",
    ),
    "no motion": (
        "velocities that satisfy the joints",
        "the prescribed rates contradict each other; correct them",
    ),
    # numbers by path
    "unknown parameter": ("a number of the scene, by its path", "{hint}"),
    "entry": ("an entry {shape}", "give the index of one number"),
    "one number": ("one number for all degrees of freedom", "vary its entries one by one"),
    "held velocity": ("a free body", "vary the rate of a joint instead: joints.{joint}.rate"),
    # states
    "unknown state": ("a {what} of the scene", "{hint}"),
    "state length": ("{what}", "give one number per degree of freedom, in the order of the degrees of freedom"),
    "no time": (
        "one of the solution's times, {first:g} to {last:g}",
        "save the solution at this time (save_at)",
    ),
}


_LONGEST = 600
_NEAR_LETTERS, _NEAR_NAMES = 80, 500


def fault(code: str, key: str, found: object, **values: Any) -> Fault:
    """Fault of this code, its texts filled with ``values``; texts from files are abbreviated and escaped."""
    expected, advice = TEXTS[code]
    key = legible(key)
    words = {name: legible(value) if isinstance(value, str) else value for name, value in values.items()}
    return Fault(key, legible(str(found)), expected.format(key=key, **words), advice.format(key=key, **words))


def legible(text: str) -> str:
    """A text abbreviated in the middle where it is long, with control characters escaped."""
    if len(text) > _LONGEST:
        text = f"{text[:200]}… ({len(text)} letters) …{text[-60:]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name nearest to a misspelled one, if any is near; among many names none is looked for."""
    from difflib import get_close_matches

    names = [other for other in known if len(other) <= _NEAR_LETTERS]
    if len(name) > _NEAR_LETTERS or len(names) > _NEAR_NAMES:
        return None
    return next(iter(get_close_matches(name, names, n=1, cutoff=0.6)), None)


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
