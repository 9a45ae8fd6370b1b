"""Joints of a scene: their tables in files, their frames, and what they are when these are resolved."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, final

import numpy as np

from ephs.mechanics.scene import values
from ephs.mechanics.scene.bodies import IDENTITY_POSE, Body
from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.element import ENVIRONMENT, GROUND, NON_NEGATIVE, POSE, Measured, Named, frozen
from ephs.mechanics.scene.element import NumberForm as Measure
from ephs.mechanics.scene.errors import did_you_mean, shown
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.geometry import ROUND, UNIVERSAL, coupling, frame_rotation, joint_types, unit
from ephs.mechanics.scene.motions import MotionEntry, law_of
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_numbers import (
    EntryTable,
    Limits,
    Matrix,
    NonNegative,
    Number,
    Numbers,
    Pair,
    Positive,
    Text,
    Vector,
    key,
)  # fmt: skip
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ALIGNED, ASSEMBLY
from ephs.solve.posing.motion_law import MotionLaw

if TYPE_CHECKING:
    from ephs.mechanics.scene.resolve_elements import ReferableNames


class FrameEntry(EntryTable):
    """A pose in a body's centre-of-mass frame."""

    position: Vector = key("origin, m", [0.0, 0.0, 0.0])
    rotation: Rotation = key("orientation, [w, x, y, z] or a table", [1.0, 0.0, 0.0, 0.0])


class DryEntry(EntryTable):
    """Dry friction of a joint with one degree of freedom."""

    coulomb: NonNegative = key("friction force while sliding, N m or N")
    static: NonNegative | None = key("force at which sliding begins; default: coulomb", None)
    stribeck: Positive = key("rate over which the force falls to coulomb, rad/s or m/s", 0.01)
    slip: Positive = key("rate below which the friction is viscous, rad/s or m/s", 1e-3)


class JointEntry(EntryTable):
    """``[joints.NAME]``"""

    type: Text = key("kind of joint: a lower pair, universal, or a registered kind")
    bodies: Pair = key('body 1 and body 2; "ground" is the inertial frame')
    at: Vector | None = key("joint origin, world coordinates in the initial configuration, m", None)
    axis: Vector | None = key("world direction of the joint frame's z axis", None)
    xaxis: Vector | None = key("world direction of the joint frame's x axis, made normal to z", None)
    axis2: Vector | None = key("universal only: the axis fixed in body 2", None)
    frame1: FrameEntry | None = key("the joint frame in body 1 (ground: world)", None)
    frame2: FrameEntry | None = key("the joint frame in body 2 (ground: world)", None)
    coordinate: Numbers | None = key("initial coordinates, with frame1 and frame2; rad, m", None)
    rate: Numbers | None = key("initial joint twist u_r; rad/s, m/s", None)
    pitch: Number | None = key("screw only, m/rad", None)
    friction: Matrix = key(
        "viscous, on the joint twist: a number, one per degree of freedom, or a matrix; N m s, N s/m", 0.0
    )
    dry: DryEntry | None = key("dry friction of a joint with one degree of freedom", None)
    stiffness: Numbers = key("stiffness k of the potential ½ k (coordinate − rest)²; N m/rad, N/m", 0.0)
    rest: Numbers = key("coordinates at which this spring is without force; rad, m", 0.0)
    heat: Text = key("thermal node that takes up the friction heat", "environment")
    armature: NonNegative = key("inertia added to the joint's rate, for example that of a geared rotor; kg m², kg", 0.0)
    drive: Numbers = key("constant generalised force on u_r; N m, N", 0.0)
    motion: MotionEntry | None = key("prescribed motion of the single degree of freedom", None)
    limits: Limits | None = key(
        "least and largest coordinate of a joint with one degree of freedom; nan for no limit; rad or m", None
    )
    limit_stiffness: Positive | None = key(
        "stiffness of the elastic stops, N m/rad or N/m; default from the mechanism's scale", None
    )
    limit_loss: NonNegative | None = key("Hunt–Crossley loss α of the elastic stops, s/rad or s/m (default 0.1)", None)
    limit_restitution: NonNegative | None = key(
        "coefficient of restitution of hard stops, in place of elastic ones", None, le=1.0
    )


@final
@dataclass(frozen=True, slots=True, eq=False)
class Joint(Measured):
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
    body1: Annotated[str, Named("link")]
    body2: Annotated[str, Named("link")]
    frame1: Annotated[Array, POSE]
    frame2: Annotated[Array, POSE]
    pitch: Annotated[float, Measure(length=1)]
    friction: Annotated[Array, Measure(energy=1, time=1, others=-1, each=0, square=True)]
    stiffness: Annotated[Array, Measure(energy=1, others=-2, each=0)]
    rest: Annotated[Array, Measure(others=1, each=0)]
    heat: Annotated[str, Named("node")]
    drive: Annotated[Array, Measure(energy=1, others=-1, each=0)]
    motion: MotionLaw | None
    coordinate: Array
    rate: Annotated[Array, Measure(time=-1, others=1, each=0)]
    middle: Annotated[Array | None, POSE] = None
    limits: Array | None = None
    stop: ConstitutiveLaw | Impact | None = None
    dry: Dry | None = None
    strain: Strain | None = None
    armature: Annotated[float, Measure(energy=1, time=2, first=-2, least=NON_NEGATIVE)] = 0.0

    @property
    def dim(self) -> int:
        """The number of freedoms d."""
        return int(self.rate.shape[0])


def free_joint(body: Body) -> Joint:
    """The implicit free joint of a body that no joint holds: of the ground and the body, both frames the
    identity."""
    return bare_joint(body.name, "free", (GROUND, body.name), (IDENTITY_POSE, IDENTITY_POSE), body.pose, body.twist)


def bare_joint(
    name: str, kind: str, bodies: tuple[str, str], frames: tuple[Array, Array], coordinate: Array, rate: Array
) -> Joint:
    """A joint without spring, friction and drive: its bodies, its frames (7,) in them, its element and its rate."""
    d = rate.size
    zero, loss, places = frozen(np.zeros(d)), frozen(np.zeros((d, d))), (frozen(frames[0]), frozen(frames[1]))
    return Joint(name, kind, *bodies, *places, 0.0, loss, zero, zero, ENVIRONMENT, zero, None, coordinate, rate)


@final
@dataclass(frozen=True, slots=True)
class Place:
    """A joint's frames C1 and C2, (7,): in the bodies, or in the world at zero coordinates.

    With frames in the bodies the same conventions hold as for every pair: C1 and C2 coincide at zero
    coordinates. The frame C2 of a universal joint is then already turned to have its z axis along the second
    axis, and ``middle`` (7,) is the pose between the two revolute joints.
    """

    frame1: Array
    frame2: Array
    in_bodies: bool
    middle: Array | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """Initial coordinates (d,) and rate (d,) of a joint in a file, None where not given; and whether its frames are
    given in the bodies, else in the world, where the coordinates are 0."""

    coordinates: Array | None = None
    rate: Array | None = None
    in_bodies: bool = True


def resolve_joint(table: Checked[JointEntry], names: "ReferableNames") -> tuple[Joint, Asked] | None:
    """A joint with everything checked but its closure, its frames as the file has them, and its start; None where its
    type or place is not usable."""
    entry = table.entry
    if table.sound("bodies"):
        for i, name in enumerate(entry.bodies):
            names.check(table, name, f"bodies[{i}]", "link")
        if entry.bodies[0] == entry.bodies[1]:
            table.fault("same body", "bodies", f'"{entry.bodies[0]}" twice')
    if table.sound("heat"):
        names.check(table, entry.heat, "heat", "node")
    if not table.sound("type"):
        return None
    if entry.type not in joint_types():
        hint = did_you_mean(entry.type, joint_types(), "take one of these types")
        table.fault("unknown type", "type", known=", ".join(joint_types()), hint=hint)
        return None
    place = _place(table)
    if entry.pitch and entry.type != "screw":
        table.fault("only screw", "pitch", kind=entry.type)
    allowed = coupling(entry.type, entry.pitch or 0.0, None if place is None else place.middle)
    d = allowed.dim
    stiffness = values.freedoms(table, "stiffness", d, spread=True)
    rest = values.freedoms(table, "rest", d, spread=True)
    if rest[list(allowed.turning)].any():
        table.fault("rest rotation", "rest")
    drive = values.freedoms(table, "drive", d)
    motion = _motion(table, d, drive)
    if entry.armature and (d != 1 or entry.motion is not None):
        table.fault("armature", "armature")
    coordinates = rate = None
    if entry.coordinate is not None:
        coordinates = values.freedoms(table, "coordinate", d)
        if (entry.at or entry.axis) and coordinates.any():
            table.fault("coordinate at", "coordinate")
    if motion is not None:
        rate = np.full(d, motion.rate(0.0))
    elif entry.rate is not None:
        rate = values.freedoms(table, "rate", d)
    friction = values.friction(table, "friction", d)
    if place is None:
        return None
    joint = Joint(
        name=table.name,
        kind=entry.type,
        body1=entry.bodies[0],
        body2=entry.bodies[1],
        frame1=frozen(place.frame1),
        frame2=frozen(place.frame2),
        pitch=entry.pitch or 0.0,
        friction=frozen(friction),
        stiffness=frozen(stiffness),
        rest=frozen(rest),
        heat=entry.heat,
        drive=frozen(drive),
        motion=motion,
        coordinate=frozen(allowed.identity()),
        rate=frozen(np.zeros(d)),
        middle=None if place.middle is None else frozen(place.middle),
        dry=_dry(table, d),
        armature=entry.armature,
    )
    return joint, Asked(coordinates if place.in_bodies else None, rate, place.in_bodies)


def _dry(table: Checked[JointEntry], d: int) -> Dry | None:
    found, entry = table.entry.dry, table.entry
    if found is None:
        return None
    if d != 1 or entry.motion is not None:
        what = "a joint with a prescribed motion" if entry.motion is not None else f"a {entry.type} joint"
        table.fault("dry joint", "dry", what)
        return None
    if found.static is not None and found.static < found.coulomb:
        table.fault("dry static", "dry.static", coulomb=found.coulomb)
        return None
    return Dry(**dict(found))


def _motion(table: Checked[JointEntry], d: int, drive: Array) -> MotionLaw | None:
    """The motion law that a joint is prescribed; None without."""
    entry = table.entry
    if entry.motion is None:
        return None
    found = law_of(table.inner("motion", entry.motion))
    rate = found.rate(0.0)
    if d != 1:
        table.fault("motion freedoms", "motion", f"a motion of a {entry.type} joint", d=d)
    elif entry.rate is not None and np.any(entry.rate) and not np.allclose(entry.rate, rate, ASSEMBLY, 0.0):
        table.fault("motion rate", "rate", motion=shown(rate))
    if drive.any():
        table.fault("motion and drive", found="motion and drive")
    return found


def _place(table: Checked[JointEntry]) -> Place | None:
    """A joint's frames, from ``at`` and ``axis`` in the world or from one in each body; None, with a fault, where they
    are invalid."""
    entry = table.entry
    if not table.sound("at", "axis", "xaxis", "axis2", "frame1", "frame2"):
        return None
    count = len(table.faults)
    if entry.axis2 is not None and entry.type != UNIVERSAL:
        table.fault("only universal", "axis2", kind=entry.type)
    given = [name for name in ("at", "axis", "frame1", "frame2") if getattr(entry, name) is not None]
    in_world, in_bodies = entry.at or entry.axis, entry.frame1 or entry.frame2
    if in_world and in_bodies:
        table.fault("both places", found=f"{', '.join(given[:-1])} and {given[-1]}")
        return None
    place = _in_bodies(table) if in_bodies else _in_world(table)
    return place if len(table.faults) == count else None


def _in_world(table: Checked[JointEntry]) -> Place | None:
    entry = table.entry
    required = {"at": entry.at, "axis": entry.axis} if entry.type not in ROUND else {"at": entry.at}
    if not any(required.values()):
        table.fault("no place", found="nothing that says where the joint is", what="at and axis")
        return None
    for name, value in required.items():
        if value is None:
            table.fault("no place", name, "nothing", what=_DESCRIBED[name])
    z = _direction(table, "axis", entry.axis or [0.0, 0.0, 1.0])
    rotation = frame_rotation(z, None if entry.xaxis is None else np.array(entry.xaxis))
    if rotation is None:
        table.fault("xaxis", "xaxis")
        return None
    world1 = np.concatenate((rotation, entry.at or [0.0, 0.0, 0.0]))
    if entry.type != UNIVERSAL:
        return Place(world1, world1, in_bodies=False)
    if entry.axis2 is None:
        table.fault("missing", "axis2", "nothing", what="the world direction of the axis fixed in body 2")
        return None
    world2 = np.concatenate((_second(table, z, entry.axis2), world1[4:]))
    return Place(world1, world2, in_bodies=False, middle=SE3.compose(SE3.inverse(world1), world2))


def _in_bodies(table: Checked[JointEntry]) -> Place | None:
    entry = table.entry
    if entry.xaxis is not None:
        table.fault("xaxis with frames", "xaxis")
    frames: list[Array] = []
    for name in ("frame1", "frame2"):
        frame: FrameEntry | None = getattr(entry, name)
        if frame is None:
            table.fault("no place", name, "nothing", what="the joint frame in this body too")
        frames.append(values.pose(table.inner(name, frame or FrameEntry())))
    if entry.type != UNIVERSAL:
        return Place(frames[0], frames[1], in_bodies=True)
    # The second axis in the axes of C1, at zero angles; by default normal to the first.
    rotation = _second(table, np.array([0.0, 0.0, 1.0]), entry.axis2 or [0.0, 1.0, 0.0])
    middle = np.concatenate((rotation, np.zeros(3)))
    return Place(frames[0], SE3.compose(frames[1], middle), in_bodies=True, middle=middle)


def _second(table: Checked[JointEntry], z: Array, axis2: list[float]) -> Array:
    """The rotation of the frame whose z axis is the second axis of a universal joint."""
    z2 = _direction(table, "axis2", axis2)
    if np.linalg.norm(np.cross(z, z2)) < ALIGNED:
        table.fault("parallel", "axis2", shown(axis2), other="axis")
    rotation: Any = frame_rotation(z2)
    return rotation


def _direction(table: Checked[JointEntry], key: str, vector: list[float]) -> Array:
    direction = unit(np.array(vector))
    if direction is None:
        table.fault("direction", key, shown(vector))
        return np.array([0.0, 0.0, 1.0])
    return direction


_DESCRIBED = {
    "at": "the joint origin in world coordinates",
    "axis": "the world direction of the joint frame's z axis",
}
