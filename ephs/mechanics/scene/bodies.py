"""World, bodies and joints of a resolved scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, final

import numpy as np

from ephs.mechanics.scene.element import (
    ENVIRONMENT,
    GROUND,
    NON_NEGATIVE,
    POSE,
    POSITIVE,
    TWIST,
    Measured,
    Named,
    Number,
    SceneElement,
    frozen,
)
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law
from ephs.semantics.bundles.bundle import Array
from ephs.solve.motion_law import MotionLaw

IDENTITY_POSE = frozen([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class World(Measured):
    """Gravity, and the reference environment."""

    gravity: Annotated[Array, Number(length=1, time=-2, count=3), "gravity in the world, m/s²"] = field(
        default_factory=lambda: frozen([0.0, 0.0, -9.81])
    )
    temperature: Annotated[float, Number(least=POSITIVE), "temperature of the reference environment, K"] = 293.15
    pressure: Annotated[
        float, Number(energy=1, length=-3, least=POSITIVE), "pressure of the reference environment, Pa"
    ] = 101325.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class Body(SceneElement):
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
    mass: Annotated[float, Number(energy=1, length=-2, time=2, least=NON_NEGATIVE)]
    inertia: Annotated[Array, Number(energy=1, time=2, count=3, square=True)]
    pose: Annotated[Array, POSE]
    twist: Annotated[Array, TWIST]
    shape: Mapping[str, Any] | None = None
    shapes: tuple[Mapping[str, Any], ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Joint(SceneElement):
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
    body1: Annotated[str, Named("body")]
    body2: Annotated[str, Named("body")]
    frame1: Annotated[Array, POSE]
    frame2: Annotated[Array, POSE]
    pitch: Annotated[float, Number(length=1)]
    friction: Annotated[Array, Number(energy=1, time=1, others=-1, each=0, square=True)]
    stiffness: Annotated[Array, Number(energy=1, others=-2, each=0)]
    rest: Annotated[Array, Number(others=1, each=0)]
    heat: Annotated[str, Named("node")]
    drive: Annotated[Array, Number(energy=1, others=-1, each=0)]
    motion: MotionLaw | None
    coordinate: Array
    rate: Annotated[Array, Number(time=-1, others=1, each=0)]
    middle: Annotated[Array | None, POSE] = None
    limits: Array | None = None
    stop: Law | Impact | None = None
    dry: Dry | None = None
    strain: Strain | None = None
    armature: Annotated[float, Number(energy=1, time=2, first=-2, least=NON_NEGATIVE)] = 0.0

    @property
    def dim(self) -> int:
        """The number of freedoms d."""
        return int(self.rate.shape[0])


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
