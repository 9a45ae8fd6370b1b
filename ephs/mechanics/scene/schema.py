"""The scene file's tables as pydantic models: the keys, their types, units and defaults.

One model a table; where keys are the attributes of an element, the model is made of the element. Values whose form
depends on another key (a number, or one per degree of freedom) are taken as numbers or lists here and brought to shape
by `resolve`.
"""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, create_model

from ephs.mechanics.scene.attached import Actuator, Cylinder, GasSpring, Gear, Motor
from ephs.mechanics.scene.bodies import Marker, Spring, World
from ephs.mechanics.scene.flexible import Load, Tendon
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_elements import table_of
from ephs.mechanics.scene.schema_flexible import BeamEntry
from ephs.mechanics.scene.schema_numbers import (
    Entry,
    Flag,
    Inertia,
    Limits,
    Matrix,
    NonNegative,
    Number,
    Numbers,
    Pair,
    Positive,
    Range,
    Series,
    Text,
    Vector,
)
from ephs.mechanics.scene.schema_touching import ContactEntry, SurfaceEntry
from ephs.mechanics.scene.thermal import Conduction, ThermalNode


class AssemblyEntry(Entry):
    """``[assembly]``"""

    adjust: Flag = Field(
        default=False,
        description="replace an inconsistent initial state by the nearest consistent one, and report the change",
    )
    inertia: Literal["strict", "warn", "nearest"] = Field(
        default="strict",
        description='"warn" accepts a physically impossible inertia, "nearest" takes the nearest possible one',
    )


class ShapeEntry(Entry):
    """``shape``: one of four, and its pose in the body."""

    box: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="edge lengths, m"
    )
    sphere: Positive | None = Field(default=None, description="radius, m")
    cylinder: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="radius and length along z, m"
    )
    mesh: Text | None = Field(
        default=None, description="a mesh file (.stl .obj .ply .glb .off) in the scene file's folder, or below"
    )
    scale: Vector | None = Field(default=None, description="scale of a mesh along its axes")
    position: Vector | None = Field(default=None, description="origin in the centre-of-mass frame, m")
    rotation: Rotation | None = Field(default=None, description="orientation there, [w, x, y, z] or a table")


class BodyEntry(Entry):
    """``[bodies.NAME]``"""

    mass: NonNegative | None = Field(
        default=None, description="kg; required unless density is given; 0 only with inertia 0"
    )
    inertia: Inertia | None = Field(
        default=None,
        description="about the centre of mass, body axes: xx yy zz [xy xz yz], kg m²; "
        "default: from the shapes, homogeneous",
    )
    density: Positive | None = Field(
        default=None, description="density of the shapes, kg/m³; replaces mass and inertia"
    )
    position: Vector | None = Field(default=None, description="centre of mass in the world, m")
    rotation: Rotation | None = Field(default=None, description="body to world, [w, x, y, z] or a table")
    velocity: Vector | None = Field(default=None, description="of the centre of mass, world basis, m/s")
    angular_velocity: Vector | None = Field(default=None, description="body basis, rad/s")
    shape: ShapeEntry | None = Field(
        default=None, description="shape for pictures, and for the inertia where none is given"
    )
    shapes: list[ShapeEntry] | None = Field(default=None, description="list of shapes, instead of shape")


class FrameEntry(Entry):
    """A pose in a body's centre-of-mass frame."""

    position: Vector = Field(default=[0.0, 0.0, 0.0], description="origin, m")
    rotation: Rotation = Field(default=[1.0, 0.0, 0.0, 0.0], description="orientation, [w, x, y, z] or a table")


class MotionEntry(Entry):
    """A prescribed motion: the change of the coordinate from its initial value, in one of four forms."""

    rate: Number | None = Field(default=None, description="constant rate of the single degree of freedom, rad/s or m/s")
    polynomial: Series | None = Field(
        default=None, description="coefficients c₁, c₂, … of c₁ t + c₂ t² + …; rad/s, rad/s², … or m/s, m/s², …"
    )
    amplitude: Number | None = Field(
        default=None, description="amplitude A of the harmonic A sin(2π f t + φ), rad or m"
    )
    frequency: Number | None = Field(default=None, description="frequency f of the harmonic, Hz")
    phase: Number | None = Field(default=None, description="phase φ of the harmonic, rad; default: 0")
    times: Series | None = Field(
        default=None,
        description="ascending times of a table, s; a spline of fifth order, at rest before and after",
    )
    displacements: Series | None = Field(default=None, description="displacements at these times, rad or m")


class DryEntry(Entry):
    """Dry friction of a joint with one degree of freedom."""

    coulomb: NonNegative = Field(description="friction force while sliding, N m or N")
    static: NonNegative | None = Field(default=None, description="force at which sliding begins; default: coulomb")
    stribeck: Positive = Field(default=0.01, description="rate over which the force falls to coulomb, rad/s or m/s")
    slip: Positive = Field(default=1e-3, description="rate below which the friction is viscous, rad/s or m/s")


class JointEntry(Entry):
    """``[joints.NAME]``"""

    type: Text = Field(description="kind of joint: a lower pair, universal, or a registered kind")
    bodies: Pair = Field(description='body 1 and body 2; "ground" is the inertial frame')
    at: Vector | None = Field(
        default=None, description="joint origin, world coordinates in the initial configuration, m"
    )
    axis: Vector | None = Field(default=None, description="world direction of the joint frame's z axis")
    xaxis: Vector | None = Field(
        default=None, description="world direction of the joint frame's x axis, made normal to z"
    )
    axis2: Vector | None = Field(default=None, description="universal only: the axis fixed in body 2")
    frame1: FrameEntry | None = Field(default=None, description="the joint frame in body 1 (ground: world)")
    frame2: FrameEntry | None = Field(default=None, description="the joint frame in body 2 (ground: world)")
    coordinate: Numbers | None = Field(default=None, description="initial coordinates, with frame1 and frame2; rad, m")
    rate: Numbers | None = Field(default=None, description="initial joint twist u_r; rad/s, m/s")
    pitch: Number | None = Field(default=None, description="screw only, m/rad")
    friction: Matrix = Field(
        default=0.0,
        description="viscous, on the joint twist: a number, one per degree of freedom, or a matrix; N m s, N s/m",
    )
    dry: DryEntry | None = Field(default=None, description="dry friction of a joint with one degree of freedom")
    stiffness: Numbers = Field(
        default=0.0, description="stiffness k of the potential ½ k (coordinate − rest)²; N m/rad, N/m"
    )
    rest: Numbers = Field(default=0.0, description="coordinates at which this spring is without force; rad, m")
    heat: Text = Field(default="environment", description="thermal node that takes up the friction heat")
    armature: NonNegative = Field(
        default=0.0, description="inertia added to the joint's rate, for example that of a geared rotor; kg m², kg"
    )
    drive: Numbers = Field(default=0.0, description="constant generalised force on u_r; N m, N")
    motion: MotionEntry | None = Field(default=None, description="prescribed motion of the single degree of freedom")
    limits: Limits | None = Field(
        default=None,
        description="least and largest coordinate of a joint with one degree of freedom; nan for no limit; rad or m",
    )
    limit_stiffness: Positive | None = Field(
        default=None, description="stiffness of the elastic stops, N m/rad or N/m; default from the mechanism's scale"
    )
    limit_loss: NonNegative | None = Field(
        default=None, description="Hunt–Crossley loss α of the elastic stops, s/rad or s/m (default 0.1)"
    )
    limit_restitution: NonNegative | None = Field(
        default=None, le=1.0, description="coefficient of restitution of hard stops, in place of elastic ones"
    )


class PartEntry(Entry):
    """``[parts.NAME]``"""

    use: Text = Field(description="another scene file or model, in the folder of this file, or below")
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="position of the part's ground in this world, m")
    rotation: Rotation = Field(default=[1.0, 0.0, 0.0, 0.0], description="its orientation, [w, x, y, z] or a table")


WorldEntry: Any = table_of(World, "world")
_LENGTH = Field(default=None, description="without force, m; default: as at the start")
_POINTS = Field(description="one in each, in its centre-of-mass frame (ground: world), m")
_LIMITS = Field(default=None, description="least and largest control")
_SECTIONS: dict[str, tuple[type[Entry], str]] = {
    "bodies": (BodyEntry, "rigid bodies, and massless frames"),
    "joints": (JointEntry, "joints between two bodies, or a body and the ground"),
    "springs": (
        table_of(Spring, "springs.NAME", bodies=(Pair, Field(description="body 1 and body 2"))),
        "springs and dampers between two points",
    ),
    "surfaces": (SurfaceEntry, "surfaces of bodies for contact"),
    "contacts": (ContactEntry, "pairs of surfaces that can touch"),
    "beams": (BeamEntry, "rods that bend, twist and stretch"),
    "tendons": (
        table_of(
            Tendon,
            "tendons.NAME",
            points=(Annotated[list[Vector], Field(min_length=2)], _POINTS),
            length=(NonNegative | None, _LENGTH),
        ),
        "tendons through points of bodies",
    ),
    "loads": (table_of(Load, "loads.NAME"), "forces and moments on bodies"),
    "motors": (table_of(Motor, "motors.NAME"), "motors with circuit and gear on joints"),
    "gears": (table_of(Gear, "gears.NAME"), "linear relations between the rates of joints"),
    "cylinders": (table_of(Cylinder, "cylinders.NAME"), "hydraulic cylinders on joints"),
    "gas_springs": (table_of(GasSpring, "gas_springs.NAME"), "gas springs on joints"),
    "actuators": (
        table_of(Actuator, "actuators.NAME", limits=(Range | None, _LIMITS)),
        "actuators: forces on joints by a control",
    ),
    "thermal": (table_of(ThermalNode, "thermal.NAME"), "thermal nodes: stores of heat"),
    "conduction": (table_of(Conduction, "conduction.NAME"), "heat conduction between thermal nodes"),
    "markers": (table_of(Marker, "markers.NAME"), "points on bodies"),
    "parts": (PartEntry, "other scene files as subsystems"),
}
SECTIONS: dict[str, type[Entry]] = {key: table for key, (table, _) in _SECTIONS.items()}
_Name: TypeAlias = Text | None
_FILE: dict[str, Any] = {
    "format": (Literal[1], Field(description="version of the file format, always 1")),
    "name": (_Name, Field(default=None, description="name of the scene; default: the file's name")),
    "world": (WorldEntry | None, Field(default=None, description="gravity and the reference environment")),
    "assembly": (
        AssemblyEntry,
        Field(default=AssemblyEntry(), description="treatment of inconsistent initial states and inertias"),
    ),
}
for _key, (_table, _said) in _SECTIONS.items():
    _FILE[_key] = dict[str, _table], Field(default_factory=dict, description=_said)
SceneFile: Any = create_model("SceneFile", __base__=Entry, __doc__="A scene file.", **_FILE)


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scene file, for editors."""
    return SceneFile.model_json_schema()
