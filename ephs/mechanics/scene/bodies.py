"""World, bodies, joints, springs and markers of a resolved scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.element import (
    ENVIRONMENT,
    GROUND,
    NON_NEGATIVE,
    POSE,
    POSITIVE,
    TWIST,
    Element,
    Measured,
    Number,
    frozen,
)
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law
from ephs.solve.motion_law import MotionLaw

__all__ = ["IDENTITY_POSE", "Body", "Joint", "Marker", "Spring", "World", "free_joint"]

Array = NDArray[np.float64]
IDENTITY_POSE = frozen([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class World(Measured):
    """Gravity ``(3,)`` in m/s², and the reference environment: temperature in K, pressure in Pa."""

    numbers: ClassVar[Mapping[str, Number]] = {
        "gravity": Number(length=1, time=-2, count=3),
        "temperature": Number(least=POSITIVE),
        "pressure": Number(energy=1, length=-3, least=POSITIVE),
    }
    gravity: Array = field(default_factory=lambda: frozen([0.0, 0.0, -9.81]))
    temperature: float = 293.15
    pressure: float = 101325.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Body(Element):
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

    numbers: ClassVar[Mapping[str, Number]] = {
        "mass": Number(energy=1, length=-2, time=2, least=NON_NEGATIVE),
        "inertia": Number(energy=1, time=2, count=3, square=True),
        "pose": POSE,
        "twist": TWIST,
    }
    name: str
    mass: float
    inertia: Array
    pose: Array
    twist: Array
    shape: Mapping[str, Any] | None = None
    shapes: tuple[Mapping[str, Any], ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Joint(Element):
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

    names: ClassVar[Mapping[str, str]] = {"body1": "body", "body2": "body", "heat": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "frame1": POSE,
        "frame2": POSE,
        "middle": POSE,
        "pitch": Number(length=1),
        "friction": Number(energy=1, time=1, others=-1, each=0, square=True),
        "stiffness": Number(energy=1, others=-2, each=0),
        "rest": Number(others=1, each=0),
        "drive": Number(energy=1, others=-1, each=0),
        "rate": Number(time=-1, others=1, each=0),
        "armature": Number(energy=1, time=2, first=-2, least=NON_NEGATIVE),
    }
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
class Spring(Element):
    """A massless spring-damper between two points, ``½ k (distance − length)²``.

    ``at1`` and ``at2`` ``(3,)`` are in the bodies' centre-of-mass frames (ground: world); stiffness N/m,
    length m, damping N s/m.
    """

    names: ClassVar[Mapping[str, str]] = {"body1": "body", "body2": "body", "heat": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "stiffness": Number(energy=1, length=-2),
        "length": Number(length=1, least=NON_NEGATIVE),
        "damping": Number(energy=1, length=-2, time=1, least=NON_NEGATIVE),
        "at1": Number(length=1, count=3),
        "at2": Number(length=1, count=3),
    }
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
class Marker(Element):
    """A point of interest: ``at`` ``(3,)`` in its body's centre-of-mass frame (ground: world)."""

    names: ClassVar[Mapping[str, str]] = {"body": "body"}
    numbers: ClassVar[Mapping[str, Number]] = {"at": Number(length=1, count=3)}
    name: str
    body: str
    at: Array


def free_joint(body: Body) -> Joint:
    """The implicit free joint of a body that no joint holds: of the ground and the body, both frames the
    identity."""
    zero = frozen(np.zeros(6))
    return Joint(
        name=body.name,
        kind="free",
        body1=GROUND,
        body2=body.name,
        frame1=IDENTITY_POSE,
        frame2=IDENTITY_POSE,
        pitch=0.0,
        friction=frozen(np.zeros((6, 6))),
        stiffness=zero,
        rest=zero,
        heat=ENVIRONMENT,
        drive=zero,
        motion=None,
        coordinate=body.pose,
        rate=body.twist,
    )
