"""The scene file's tables as pydantic models: the keys, their types, units and defaults.

One model a table. Values whose form depends on another key (a number, or one per degree of freedom) are taken as
numbers or lists here and brought to shape by `resolve`.
"""

from typing import Annotated, Any, Literal

from pydantic import Field

from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_flexible import BeamEntry, LoadEntry, TendonEntry
from ephs.mechanics.scene.schema_numbers import (
    Entry,
    Flag,
    Inertia,
    Limits,
    Matrix,
    Names,
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


class WorldEntry(Entry):
    """``[world]``"""

    gravity: Vector = Field(default=[0.0, 0.0, -9.81], description="gravity in the world, m/s²")
    temperature: Positive = Field(default=293.15, description="temperature of the reference environment, K")
    pressure: Positive = Field(default=101325.0, description="pressure of the reference environment, Pa")


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


class SpringEntry(Entry):
    """``[springs.NAME]``"""

    bodies: Pair = Field(description="body 1 and body 2")
    at1: Vector = Field(description="point in body 1's centre-of-mass frame (ground: world), m")
    at2: Vector = Field(description="point in body 2's, m")
    stiffness: Number = Field(default=0.0, description="N/m")
    length: NonNegative = Field(default=0.0, description="length without force, m")
    damping: NonNegative = Field(default=0.0, description="N s/m")
    heat: Text = Field(default="environment", description="thermal node that takes up the heat")


class MotorEntry(Entry):
    """``[motors.NAME]``"""

    joint: Text = Field(description="the driven joint, of one degree of freedom")
    constant: Number = Field(description="torque constant: torque of the rotor per current, N m/A or V s/rad")
    resistance: Positive = Field(description="resistance of the winding, Ω")
    inductance: NonNegative = Field(default=0.0, description="inductance of the winding, H")
    gear: Number = Field(
        default=1.0, description="gear ratio: rate of the rotor per rate of the joint, rad/rad or rad/m"
    )
    inertia: NonNegative = Field(default=0.0, description="inertia of the rotor, kg m²")
    voltage: Number = Field(default=0.0, description='voltage without an input "motors.NAME", V')
    heat: Text = Field(default="environment", description="thermal node that takes up the heat of the winding")


class GearEntry(Entry):
    """``[gears.NAME]``"""

    joints: Names = Field(
        description="two or more joints with one degree of freedom: a gear, a belt, a differential, a mimic"
    )
    ratio: Numbers = Field(default=1.0, description="rate of the first joint = Σ ratio · rate of the others")
    stiffness: NonNegative = Field(
        default=0.0, description="stiffness of a belt, N m/rad or N/m of the first joint; 0: rigid"
    )
    damping: NonNegative = Field(default=0.0, description="damping of the belt's stretch, N m s/rad or N s/m")
    stretch: Number = Field(default=0.0, description="initial stretch of a belt, rad or m of the first joint")
    friction: NonNegative = Field(
        default=0.0, description="viscous friction on the first joint's rate, N m s/rad or N s/m"
    )
    heat: Text = Field(default="environment", description="thermal node that takes up the heat of damping and friction")


class CylinderEntry(Entry):
    """``[cylinders.NAME]``"""

    joint: Text = Field(description="a joint with one degree of freedom; chamber a pushes it to larger coordinates")
    area: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(
        description="change of volume of chambers a and b per coordinate, m³/m or m³/rad"
    )
    volume: Annotated[list[Positive], Field(min_length=2, max_length=2)] = Field(
        description="volume of oil in each chamber, m³"
    )
    bulk: Positive = Field(default=1.5e9, description="bulk modulus of the oil, Pa")
    conductance: Positive = Field(description="conductance of the line to each chamber, m³/(s Pa)")
    leak: NonNegative = Field(default=0.0, description="conductance of the leak across the piston, m³/(s Pa)")
    pressure: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(
        default=[0.0, 0.0],
        description='pressures of the supplies above world.pressure without an input "cylinders.NAME", Pa',
    )
    heat: Text = Field(default="environment", description="thermal node that takes up the heat of lines and leak")


class GasSpringEntry(Entry):
    """``[gas_springs.NAME]``"""

    joint: Text = Field(description="a joint with one degree of freedom")
    area: Number = Field(description="change of the gas volume per coordinate, m³/m or m³/rad; may be negative")
    volume: Positive = Field(description="initial volume, m³")
    pressure: Positive = Field(
        description="initial absolute pressure, Pa; world.pressure acts on the other side of the piston"
    )
    temperature: Positive = Field(default=293.15, description="initial temperature, K")
    gamma: Annotated[float, Field(gt=1.0, allow_inf_nan=False)] = Field(
        default=1.4, description="ratio of specific heats"
    )
    conductance: NonNegative = Field(
        default=0.0, description="thermal conductance from the gas to its thermal node, W/K; 0: adiabatic"
    )
    heat: Text = Field(default="environment", description="thermal node that exchanges heat with the gas")


class ActuatorEntry(Entry):
    """``[actuators.NAME]``"""

    joints: list[Text] = Field(default=[], description="joints with one degree of freedom")
    tendon: Text | None = Field(default=None, description="instead of joints: a tendon, on whose length it acts")
    ratio: Numbers = Field(default=1.0, description='force on each by the control, the input "actuators.NAME"; N m, N')
    limits: Range | None = Field(default=None, description="least and largest control")


class ThermalEntry(Entry):
    """``[thermal.NAME]``"""

    capacity: Positive = Field(description="heat capacity, J/K")
    temperature: Positive = Field(description="initial temperature, K")


class ConductionEntry(Entry):
    """``[conduction.NAME]``"""

    between: Pair = Field(description='two thermal nodes, or one and "environment"')
    conductance: NonNegative = Field(description="thermal conductance, W/K")


class MarkerEntry(Entry):
    """``[markers.NAME]``"""

    body: Text = Field(description='the body that carries it, or "ground"')
    at: Vector = Field(default=[0.0, 0.0, 0.0], description="point in its centre-of-mass frame (ground: world), m")


class PartEntry(Entry):
    """``[parts.NAME]``"""

    use: Text = Field(description="another scene file or model, in the folder of this file, or below")
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="position of the part's ground in this world, m")
    rotation: Rotation = Field(default=[1.0, 0.0, 0.0, 0.0], description="its orientation, [w, x, y, z] or a table")


class SceneFile(Entry):
    """A scene file."""

    format: Literal[1] = Field(description="version of the file format, always 1")
    name: Text | None = Field(default=None, description="name of the scene; default: the file's name")
    world: WorldEntry | None = Field(default=None, description="gravity and the reference environment")
    assembly: AssemblyEntry = Field(
        default=AssemblyEntry(), description="treatment of inconsistent initial states and inertias"
    )
    bodies: dict[str, BodyEntry] = Field(default_factory=dict, description="rigid bodies, and massless frames")
    joints: dict[str, JointEntry] = Field(
        default_factory=dict, description="joints between two bodies, or a body and the ground"
    )
    springs: dict[str, SpringEntry] = Field(default_factory=dict, description="springs and dampers between two points")
    surfaces: dict[str, SurfaceEntry] = Field(default_factory=dict, description="surfaces of bodies for contact")
    contacts: dict[str, ContactEntry] = Field(default_factory=dict, description="pairs of surfaces that can touch")
    beams: dict[str, BeamEntry] = Field(  # pyright: ignore[reportInvalidTypeForm] - a class made at run time
        default_factory=dict, description="rods that bend, twist and stretch"
    )
    tendons: dict[str, TendonEntry] = Field(default_factory=dict, description="tendons through points of bodies")
    loads: dict[str, LoadEntry] = Field(default_factory=dict, description="forces and moments on bodies")
    motors: dict[str, MotorEntry] = Field(default_factory=dict, description="motors with circuit and gear on joints")
    gears: dict[str, GearEntry] = Field(
        default_factory=dict, description="linear relations between the rates of joints"
    )
    cylinders: dict[str, CylinderEntry] = Field(default_factory=dict, description="hydraulic cylinders on joints")
    gas_springs: dict[str, GasSpringEntry] = Field(default_factory=dict, description="gas springs on joints")
    actuators: dict[str, ActuatorEntry] = Field(
        default_factory=dict, description="actuators: forces on joints by a control"
    )
    thermal: dict[str, ThermalEntry] = Field(default_factory=dict, description="thermal nodes: stores of heat")
    conduction: dict[str, ConductionEntry] = Field(
        default_factory=dict, description="heat conduction between thermal nodes"
    )
    markers: dict[str, MarkerEntry] = Field(default_factory=dict, description="points on bodies")
    parts: dict[str, PartEntry] = Field(default_factory=dict, description="other scene files as subsystems")


SECTIONS: dict[str, type[Entry]] = {
    "bodies": BodyEntry,
    "joints": JointEntry,
    "springs": SpringEntry,
    "surfaces": SurfaceEntry,
    "contacts": ContactEntry,
    "beams": BeamEntry,
    "tendons": TendonEntry,
    "loads": LoadEntry,
    "motors": MotorEntry,
    "gears": GearEntry,
    "cylinders": CylinderEntry,
    "gas_springs": GasSpringEntry,
    "actuators": ActuatorEntry,
    "thermal": ThermalEntry,
    "conduction": ConductionEntry,
    "markers": MarkerEntry,
    "parts": PartEntry,
}


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scene file, for editors."""
    return SceneFile.model_json_schema()
