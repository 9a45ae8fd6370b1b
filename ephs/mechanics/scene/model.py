"""Resolved scene: every default, frame and coordinate as numbers.

Poses are 7-vectors ``[w, x, y, z, rx, ry, rz]``; twists are 6-vectors (angular, linear) in the body's own
frame. All arrays are read-only. Nothing here knows of files; `load` makes these values from them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ephs.mechanics.scene import attached
from ephs.mechanics.scene.adjustment import Adjustment
from ephs.mechanics.scene.flexible import FREE_END, Beam, Load, Strain, Tendon
from ephs.mechanics.scene.surfaces import Contact, Surface
from ephs.mechanics.scene.thermal import Conduction, ThermalNode
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law
from ephs.semantics.kept import Kept
from ephs.solve.motion_law import MotionLaw

if TYPE_CHECKING:
    from ephs.semantics import System

T = TypeVar("T")
J = TypeVar("J", "Joint", "Spring")
Array = NDArray[np.float64]

GROUND = "ground"
ENVIRONMENT = "environment"


def frozen(values: ArrayLike) -> Array:
    """A read-only float copy of ``values``."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


IDENTITY_POSE = frozen([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Gravity ``(3,)`` in m/s², and the reference environment: temperature in K, pressure in Pa."""

    gravity: Array = field(default_factory=lambda: frozen([0.0, 0.0, -9.81]))
    temperature: float = 293.15
    pressure: float = 101325.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body.

    Attributes
    ----------
    mass : kg; 0 for a frame without kinetic energy
    inertia : (3, 3) kg m², about the centre of mass, in body axes
    pose : (7,) of the centre of mass and body axes in the world
    twist : (6,) in the body frame: angular velocity, and the velocity of the centre of mass in body axes
    shape, shapes : one or several, for pictures only: ``{"box": [x, y, z]}``, ``{"sphere": r}``, ``{"cylinder":
        [radius, length]}``, ``{"mesh": file, "scale": …}``, with ``position`` and ``rotation`` in the body
    """

    name: str
    mass: float
    inertia: Array
    pose: Array
    twist: Array
    shape: Mapping[str, Any] | None = None
    shapes: tuple[Mapping[str, Any], ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint of body 2 on body 1, through a lower pair or a universal joint.

    Attributes
    ----------
    kind : name of the pair (a key of the registry of pairs), or ``"universal"``
    body1, body2 : a body's name (dotted for a body of a part), or ``"ground"``
    frame1 : (7,) pose of the joint frame C1 in the centre-of-mass frame of body 1 (in the world for ground)
    frame2 : (7,) pose of the joint frame C2 in body 2, likewise
    pitch : m/rad, of a screw
    friction : (d, d) symmetric, positive semidefinite, on the joint twist u_r
    stiffness, rest : (d,) of the potential ``½ k (coordinate − rest)²``
    heat : where the friction heat goes, ``"environment"`` or the name of a thermal node
    drive : (d,) constant generalised force on u_r
    motion : the prescribed motion law of a single degree of freedom, or None
    coordinate : (size,) initial element of the pair's group; the two angles of a universal joint
    rate : (d,) initial u_r, the twist of C2 relative to C1 in C2; of a universal joint the two angles' rates
    limits, stop : (2,) least and largest coordinate of one degree of freedom, nan for none, and its stops' law; or None
    both dry : dry friction of a joint with one degree of freedom, None without
    middle : (7,) universal only: constant pose from the frame that follows the first revolute (C1 turned by
        angle 1) to the frame before the second, whose z axis is the second axis; None otherwise
    strain : of a beam element, which is a free joint; then friction and stiffness are 0
    """

    name: str
    kind: str
    body1: str
    body2: str
    frame1: Array
    frame2: Array
    pitch: float
    friction: Array
    stiffness: Array
    rest: Array
    heat: str
    drive: Array
    motion: MotionLaw | None
    coordinate: Array
    rate: Array
    middle: Array | None = None
    limits: Array | None = None
    stop: Law | Impact | None = None
    dry: Dry | None = None
    strain: Strain | None = None
    armature: float = 0.0

    @property
    def dim(self) -> int:
        """The number of freedoms d."""
        return int(self.rate.shape[0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """A massless spring-damper between two points, ``½ k (distance − length)²``.

    ``at1`` and ``at2`` ``(3,)`` are in the bodies' centre-of-mass frames (ground: world); stiffness N/m,
    length m, damping N s/m.
    """

    name: str
    body1: str
    body2: str
    at1: Array
    at2: Array
    stiffness: float
    length: float
    damping: float
    heat: str = ENVIRONMENT


@final
@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """A point of interest: ``at`` ``(3,)`` in its body's centre-of-mass frame (ground: world)."""

    name: str
    body: str
    at: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A mechanism in its world: bodies, joints, springs, thermal nodes, and parts, which are scenes
    themselves.

    A part is a scene whose numbers are already in this scene's world. Names inside a scene are local to it;
    from outside, a part's names carry the part's name and a dot in front, at every level.

    Attributes
    ----------
    source : the file that it came from, or None
    adjusted : what an adjusting assembly moved, or None where everything closed
    """

    name: str
    world: World
    bodies: Mapping[str, Body]
    joints: Mapping[str, Joint] = field(default_factory=dict)
    springs: Mapping[str, Spring] = field(default_factory=dict)
    thermal: Mapping[str, ThermalNode] = field(default_factory=dict)
    conduction: Mapping[str, Conduction] = field(default_factory=dict)
    parts: Mapping[str, "Scene"] = field(default_factory=dict)
    source: str | None = None
    adjusted: Adjustment | None = None
    markers: Mapping[str, Marker] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    beams: Mapping[str, Beam] = field(default_factory=dict)
    loads: Mapping[str, Load] = field(default_factory=dict)
    tendons: Mapping[str, Tendon] = field(default_factory=dict)
    motors: Mapping[str, attached.Motor] = field(default_factory=dict)
    gears: Mapping[str, attached.Gear] = field(default_factory=dict)
    cylinders: Mapping[str, attached.Cylinder] = field(default_factory=dict)
    gas_springs: Mapping[str, attached.GasSpring] = field(default_factory=dict)
    actuators: Mapping[str, attached.Actuator] = field(default_factory=dict)
    _kept: Kept = field(default_factory=Kept, init=False, repr=False)

    def system(self) -> "System":
        """The scene as a hierarchical exergetic port-Hamiltonian system."""
        from ephs.mechanics.scene.build import scene_system

        return scene_system(self)

    def with_state(
        self,
        coordinates: Mapping[str, ArrayLike] | None = None,
        rates: Mapping[str, ArrayLike] | None = None,
        *,
        adjust: bool = False,
    ) -> "Scene":
        """The scene in another initial state.

        Parameters
        ----------
        coordinates : joint name to its coordinates, a number or ``(d,)``; rotation vectors in the axes of
            C1. Joints that are not named keep theirs, unless they close a loop. A body without a joint has
            an implicit free joint of its name.
        rates : joint name to its u_r, a number or ``(d,)``.
        adjust : take the nearest state that closes the loops, the named joints held.

        Raises
        ------
        SceneError
            A name is unknown, a value has the wrong length, or a loop does not close to 1e-8 of the mechanism's length.
        """
        from ephs.mechanics.scene.state import with_state

        return with_state(self, coordinates or {}, rates or {}, adjust)

    def at(self, solution: Any, time: float) -> "Scene":
        """The scene in the state of a solution at one of its times, temperatures included."""
        from ephs.mechanics.scene.state import at_solution

        return at_solution(self, solution, time)

    def body(self, name: str) -> Body:
        """The body of this (dotted) name, its names seen from here."""
        part, path, own = self._part_of(name)
        if part is not None and own in part.bodies:
            return replace(part.bodies[own], name=path + own)
        return _find(dict(self.all_bodies()), name, "body")

    def joint(self, name: str) -> Joint:
        """The joint of this (dotted) name, its names seen from here; the implicit free joint of a body
        without a joint too."""
        part, path, own = self._part_of(name)
        if part is not None and own in part.joints:
            return _joint_seen(path, part.joints[own])
        return _find(dict(self.all_joints()) | dict(self.implicit_joints()), name, "joint")

    def all_bodies(self) -> Iterator[tuple[str, Body]]:
        """Every body with its dotted name, parts included."""
        for path, scene in self._scenes():
            for body in scene.bodies.values():
                yield path + body.name, replace(body, name=path + body.name) if path else body

    def all_joints(self) -> Iterator[tuple[str, Joint]]:
        """Every joint with its dotted name; the bodies and heat sink that it names are dotted too."""
        for path, scene in self._scenes():
            for j in scene.joints.values():
                yield path + j.name, _joint_seen(path, j)

    def all_springs(self) -> Iterator[tuple[str, Spring]]:
        """Every spring with its dotted name, as `all_joints`."""
        for path, scene in self._scenes():
            for s in scene.springs.values():
                yield path + s.name, _joint_seen(path, s)

    def all_markers(self) -> Iterator[tuple[str, Marker]]:
        """Every marker with its dotted name."""
        for path, scene in self._scenes():
            for marker in scene.markers.values():
                yield path + marker.name, replace(marker, name=path + marker.name, body=_seen(path, marker.body))

    def all_surfaces(self) -> Iterator[tuple[str, Surface]]:
        """Every surface with its dotted name."""
        for path, scene in self._scenes():
            for each in scene.surfaces.values():
                yield path + each.name, replace(each, name=path + each.name, body=_seen(path, each.body))

    def all_contacts(self) -> Iterator[tuple[str, Contact]]:
        """Every contact with its dotted name; its surfaces and heat sink are dotted too."""
        for path, scene in self._scenes():
            for c in scene.contacts.values():
                pair = path + c.surfaces[0], path + c.surfaces[1]
                yield path + c.name, replace(c, name=path + c.name, surfaces=pair, heat=_seen(path, c.heat))

    def all_beams(self) -> Iterator[tuple[str, Beam]]:
        """Every beam with its dotted name."""
        for path, scene in self._scenes():
            for beam in scene.beams.values():
                one, two = (end if end == FREE_END else _seen(path, end) for end in beam.ends)
                yield path + beam.name, replace(beam, name=path + beam.name, ends=(one, two))

    def all_loads(self) -> Iterator[tuple[str, Load]]:
        """Every load with its dotted name."""
        for path, scene in self._scenes():
            for load in scene.loads.values():
                yield path + load.name, replace(load, name=path + load.name, body=_seen(path, load.body))

    def all_tendons(self) -> Iterator[tuple[str, Tendon]]:
        """Every tendon with its dotted name; its bodies and heat sink are dotted too."""
        for path, scene in self._scenes():
            for t in scene.tendons.values():
                bodies = tuple(_seen(path, body) for body in t.bodies)
                yield path + t.name, replace(t, name=path + t.name, bodies=bodies, heat=_seen(path, t.heat))

    def attachments(self) -> Iterator[tuple[str, str, attached.Attachment]]:
        """Section, name and value of every attachment of this level: motors, gears, cylinders, actuators, …"""
        for section in attached.ATTACHED:
            own: Mapping[str, attached.Attachment] = getattr(self, section)
            for name, each in own.items():
                yield section, name, each

    def all_attachments(self) -> Iterator[tuple[str, str, attached.Attachment]]:
        """Section, dotted name and value of every attachment; its joints and heat sink are dotted too."""
        for path, scene in self._scenes():
            for section, name, each in scene.attachments():
                yield section, path + name, each.seen(path, _seen(path, each.heat))

    def all_thermal(self) -> Iterator[tuple[str, ThermalNode]]:
        """Every thermal node with its dotted name."""
        for path, scene in self._scenes():
            for node in scene.thermal.values():
                yield path + node.name, replace(node, name=path + node.name)

    def all_conduction(self) -> Iterator[tuple[str, Conduction]]:
        """Every conduction with its dotted name, as `all_joints`."""
        for path, scene in self._scenes():
            for c in scene.conduction.values():
                between = (_seen(path, c.between[0]), _seen(path, c.between[1]))
                yield path + c.name, replace(c, name=path + c.name, between=between)

    def implicit_joints(self) -> Iterator[tuple[str, Joint]]:
        """The free joints of the bodies that no joint holds; each has its body's name, both frames are the
        identity."""
        held = {name for _, j in self.all_joints() for name in (j.body1, j.body2)}
        for name, body in self.all_bodies():
            if name not in held:
                yield name, free_joint(body)

    def __str__(self) -> str:
        from ephs.mechanics.scene.words import scene_text

        return scene_text(self)

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.mechanics.scene.words import scene_html

        return scene_html(self)

    def _part_of(self, name: str) -> "tuple[Scene | None, str, str]":
        """The part that a dotted name leads into, or None; the path before the last name; the last name."""
        *parts, own = name.split(".")
        scene: Scene | None = self
        for part in parts:
            scene = None if scene is None else scene.parts.get(part)
        return scene, name[: len(name) - len(own)], own

    def _scenes(self, path: str = "") -> Iterator[tuple[str, "Scene"]]:
        yield path, self
        for name, part in self.parts.items():
            yield from part._scenes(f"{path}{name}.")


def free_joint(body: Body) -> Joint:
    """The implicit free joint of a body that no joint holds: of the ground and the body, both frames the
    identity."""
    zero = frozen(np.zeros(6))
    return Joint(
        body.name, "free", GROUND, body.name, IDENTITY_POSE, IDENTITY_POSE, 0.0, frozen(np.zeros((6, 6))),
        stiffness=zero, rest=zero, heat=ENVIRONMENT, drive=zero, motion=None, coordinate=body.pose, rate=body.twist,
    )  # fmt: skip


def _joint_seen(path: str, j: J) -> J:
    """A joint or spring as seen from outside the part at a path."""
    ends = {key: _seen(path, getattr(j, key)) for key in ("body1", "body2", "heat")}
    return replace(j, name=path + j.name, **ends) if path else j


def _seen(path: str, name: str) -> str:
    """A local name as seen from outside; the ground and the environment are the same everywhere."""
    return name if name in (GROUND, ENVIRONMENT) else path + name


def _find(values: Mapping[str, T], name: str, what: str) -> T:
    if name in values:
        return values[name]
    from ephs.mechanics.scene.errors import unknown_name

    raise unknown_name(what, name, values)
