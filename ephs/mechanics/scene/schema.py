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
    temperature: Positive = Field(default=293.15, description="of the reference environment, K")
    pressure: Positive = Field(default=101325.0, description="of the reference environment, Pa")


class AssemblyEntry(Entry):
    """``[assembly]``"""

    adjust: Flag = Field(
        default=False, description="take the nearest consistent state with what is given of joints, and report it"
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
    scale: Vector | None = Field(default=None, description="of a mesh, along its axes")
    position: Vector | None = Field(default=None, description="in the centre-of-mass frame, m")
    rotation: Rotation | None = Field(default=None, description="likewise, [w, x, y, z] or a table")


class BodyEntry(Entry):
    """``[bodies.NAME]``"""

    mass: NonNegative | None = Field(default=None, description="kg; 0 needs inertia 0; needed without density")
    inertia: Inertia | None = Field(
        default=None,
        description="about the centre of mass, body axes: xx yy zz [xy xz yz], kg m²; "
        "default: that of the shapes, homogeneous",
    )
    density: Positive | None = Field(
        default=None, description="of the shapes, kg/m³; gives mass and inertia, which are then left out"
    )
    position: Vector | None = Field(default=None, description="centre of mass in the world, m")
    rotation: Rotation | None = Field(default=None, description="body to world, [w, x, y, z] or a table")
    velocity: Vector | None = Field(default=None, description="of the centre of mass, world basis, m/s")
    angular_velocity: Vector | None = Field(default=None, description="body basis, rad/s")
    shape: ShapeEntry | None = Field(
        default=None, description="drawn; also the distribution of mass where no inertia is given"
    )
    shapes: list[ShapeEntry] | None = Field(default=None, description="instead of shape: several")


class FrameEntry(Entry):
    """A pose in a body's centre-of-mass frame."""

    position: Vector = Field(default=[0.0, 0.0, 0.0], description="m")
    rotation: Rotation = Field(default=[1.0, 0.0, 0.0, 0.0], description="[w, x, y, z] or a table")


class MotionEntry(Entry):
    """A prescribed motion: one of four forms, by which the coordinate departs from where it starts."""

    rate: Number | None = Field(default=None, description="constant rate of the single degree of freedom, rad/s or m/s")
    polynomial: Series | None = Field(
        default=None, description="c₁, c₂, … of c₁ t + c₂ t² + …; rad/s, rad/s², … or m/s, m/s², …"
    )
    amplitude: Number | None = Field(default=None, description="A of the harmonic A sin(2π f t + φ), rad or m")
    frequency: Number | None = Field(default=None, description="its f, Hz")
    phase: Number | None = Field(default=None, description="its φ, rad; default: 0")
    times: Series | None = Field(
        default=None, description="of a table: ascending, s; a spline of fifth order, at rest before and after"
    )
    displacements: Series | None = Field(default=None, description="there, rad or m")


class DryEntry(Entry):
    """Dry friction of a joint with one degree of freedom."""

    coulomb: NonNegative = Field(description="force while it slides, N m or N")
    static: NonNegative | None = Field(default=None, description="force at which it begins to; default: coulomb")
    stribeck: Positive = Field(default=0.01, description="rate over which the force falls to coulomb, rad/s or m/s")
    slip: Positive = Field(default=1e-3, description="rate below which it is viscous, rad/s or m/s")


class JointEntry(Entry):
    """``[joints.NAME]``"""

    type: Text = Field(description="the lower pair, or universal")
    bodies: Pair = Field(description='body 1 and body 2; "ground" is the inertial frame')
    at: Vector | None = Field(
        default=None, description="joint origin, world coordinates in the initial configuration, m"
    )
    axis: Vector | None = Field(default=None, description="world direction of the joint frame's z axis")
    xaxis: Vector | None = Field(default=None, description="world direction of its x axis, made normal to z")
    axis2: Vector | None = Field(default=None, description="universal only: the axis fixed in body 2")
    frame1: FrameEntry | None = Field(default=None, description="the joint frame in body 1 (ground: world)")
    frame2: FrameEntry | None = Field(default=None, description="the joint frame in body 2 (ground: world)")
    coordinate: Numbers | None = Field(default=None, description="initial coordinates, with frame1 and frame2; rad, m")
    rate: Numbers | None = Field(default=None, description="initial joint twist u_r; rad/s, m/s")
    pitch: Number | None = Field(default=None, description="screw only, m/rad")
    friction: Matrix = Field(
        default=0.0, description="on the joint twist: a number, one per degree of freedom, or a matrix; N m s, N s/m"
    )
    dry: DryEntry | None = Field(default=None, description="dry friction of a joint with one degree of freedom")
    stiffness: Numbers = Field(default=0.0, description="of the potential ½ k (coordinate − rest)²; N m/rad, N/m")
    rest: Numbers = Field(default=0.0, description="coordinates without force; rad, m")
    heat: Text = Field(default="environment", description="where the friction heat goes: a thermal name")
    armature: NonNegative = Field(
        default=0.0, description="inertia of the single rate itself, as of a rotor that it turns; kg m², kg"
    )
    drive: Numbers = Field(default=0.0, description="constant generalised force on u_r; N m, N")
    motion: MotionEntry | None = Field(default=None, description="prescribed motion of the single degree of freedom")
    limits: Limits | None = Field(
        default=None, description="least and largest coordinate, of one degree of freedom; nan for none; rad or m"
    )
    limit_stiffness: Positive | None = Field(
        default=None, description="of the elastic stops, N m/rad or N/m; default from the mechanism's scale"
    )
    limit_loss: NonNegative | None = Field(
        default=None, description="α of Hunt and Crossley at the elastic stops, s/rad or s/m (default 0.1)"
    )
    limit_restitution: NonNegative | None = Field(
        default=None, le=1.0, description="coefficient of restitution of hard stops, in place of elastic ones"
    )


class SpringEntry(Entry):
    """``[springs.NAME]``"""

    bodies: Pair = Field(description="body 1 and body 2")
    at1: Vector = Field(description="in body 1's centre-of-mass frame (ground: world), m")
    at2: Vector = Field(description="in body 2's, m")
    stiffness: Number = Field(default=0.0, description="N/m")
    length: NonNegative = Field(default=0.0, description="without force, m")
    damping: NonNegative = Field(default=0.0, description="N s/m")
    heat: Text = Field(default="environment", description="where the heat goes: a thermal name")


class MotorEntry(Entry):
    """``[motors.NAME]``"""

    joint: Text = Field(description="a joint with one degree of freedom, which it turns through its gear")
    constant: Number = Field(description="torque of the rotor by the current, N m/A or V s/rad")
    resistance: Positive = Field(description="of the winding, Ω")
    inductance: NonNegative = Field(default=0.0, description="of the winding, H")
    gear: Number = Field(default=1.0, description="rate of the rotor by the joint's, rad/rad or rad/m")
    inertia: NonNegative = Field(default=0.0, description="of the rotor, kg m²")
    voltage: Number = Field(default=0.0, description='V, where no input "motors.NAME" is given')
    heat: Text = Field(default="environment", description="where the winding's heat goes: a thermal name")


class GearEntry(Entry):
    """``[gears.NAME]``"""

    joints: Names = Field(description="two or more with one degree of freedom: a gear, a belt, a differential, a mimic")
    ratio: Numbers = Field(default=1.0, description="rate of the first joint = Σ ratio · rate of the others")
    stiffness: NonNegative = Field(default=0.0, description="of a belt, N m/rad or N/m of the first; 0: rigid")
    damping: NonNegative = Field(default=0.0, description="of a belt's stretching, N m s/rad or N s/m")
    stretch: Number = Field(default=0.0, description="of a belt at the start, rad or m of the first")
    friction: NonNegative = Field(default=0.0, description="on the first joint's rate, N m s/rad or N s/m")
    heat: Text = Field(default="environment", description="where the heat of damping and friction goes: a thermal name")


class CylinderEntry(Entry):
    """``[cylinders.NAME]``"""

    joint: Text = Field(description="a joint with one degree of freedom, which chamber a pushes to larger coordinates")
    area: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(
        description="volume of chambers a and b by the coordinate, m³/m or m³/rad"
    )
    volume: Annotated[list[Positive], Field(min_length=2, max_length=2)] = Field(description="oil in each, m³")
    bulk: Positive = Field(default=1.5e9, description="bulk modulus of the oil, Pa")
    conductance: Positive = Field(description="of the line to each chamber, m³/(s Pa)")
    leak: NonNegative = Field(default=0.0, description="across the piston, m³/(s Pa)")
    pressure: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(
        default=[0.0, 0.0],
        description='of the supplies above the environment\'s, Pa, where no input "cylinders.NAME" is given',
    )
    heat: Text = Field(default="environment", description="where the heat of lines and leak goes: a thermal name")


class GasSpringEntry(Entry):
    """``[gas_springs.NAME]``"""

    joint: Text = Field(description="a joint with one degree of freedom")
    area: Number = Field(description="volume of the gas by the coordinate, m³/m or m³/rad; may be negative")
    volume: Positive = Field(description="at the start, m³")
    pressure: Positive = Field(description="of the gas at the start, absolute, Pa; before the piston is world.pressure")
    temperature: Positive = Field(default=293.15, description="at the start, K")
    gamma: Annotated[float, Field(gt=1.0, allow_inf_nan=False)] = Field(
        default=1.4, description="ratio of specific heats"
    )
    conductance: NonNegative = Field(default=0.0, description="from the gas to heat, W/K; 0: adiabatic")
    heat: Text = Field(default="environment", description="what the gas warms: a thermal name")


class ActuatorEntry(Entry):
    """``[actuators.NAME]``"""

    joints: list[Text] = Field(default=[], description="joints with one degree of freedom")
    tendon: Text | None = Field(default=None, description="instead of joints: a tendon, on whose length it acts")
    ratio: Numbers = Field(default=1.0, description='force on each by the control, the input "actuators.NAME"; N m, N')
    limits: Range | None = Field(default=None, description="least and largest control")


class ThermalEntry(Entry):
    """``[thermal.NAME]``"""

    capacity: Positive = Field(description="J/K")
    temperature: Positive = Field(description="at t = 0, K")


class ConductionEntry(Entry):
    """``[conduction.NAME]``"""

    between: Pair = Field(description='two thermal names, or one and "environment"')
    conductance: NonNegative = Field(description="W/K")


class MarkerEntry(Entry):
    """``[markers.NAME]``"""

    body: Text = Field(description='the body that carries it, or "ground"')
    at: Vector = Field(default=[0.0, 0.0, 0.0], description="in its centre-of-mass frame (ground: world), m")


class PartEntry(Entry):
    """``[parts.NAME]``"""

    use: Text = Field(description="another scene file or model, in the folder of the file that is read, or below")
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="of the part's ground in this world, m")
    rotation: Rotation = Field(default=[1.0, 0.0, 0.0, 0.0], description="[w, x, y, z] or a table")


class SceneFile(Entry):
    """A scene file."""

    format: Literal[1] = Field(description="of this file, always 1")
    name: Text | None = Field(default=None, description="of the scene; default: the file's name")
    world: WorldEntry | None = Field(default=None, description="gravity and the reference environment")
    assembly: AssemblyEntry = Field(default=AssemblyEntry(), description="how the initial state is found")
    bodies: dict[str, BodyEntry] = Field(default_factory=dict, description="rigid bodies, and frames without mass")
    joints: dict[str, JointEntry] = Field(
        default_factory=dict, description="between two bodies, or a body and the ground"
    )
    springs: dict[str, SpringEntry] = Field(default_factory=dict, description="springs and dampers between two points")
    surfaces: dict[str, SurfaceEntry] = Field(default_factory=dict, description="surfaces of bodies, which touch")
    contacts: dict[str, ContactEntry] = Field(default_factory=dict, description="pairs of surfaces")
    beams: dict[str, BeamEntry] = Field(  # pyright: ignore[reportInvalidTypeForm] - a class made at run time
        default_factory=dict, description="rods that bend, twist and stretch"
    )
    tendons: dict[str, TendonEntry] = Field(default_factory=dict, description="tendons through points of bodies")
    loads: dict[str, LoadEntry] = Field(default_factory=dict, description="forces and moments on bodies")
    motors: dict[str, MotorEntry] = Field(default_factory=dict, description="motors with circuit and gear on joints")
    gears: dict[str, GearEntry] = Field(default_factory=dict, description="ties between the rates of joints")
    cylinders: dict[str, CylinderEntry] = Field(default_factory=dict, description="hydraulic cylinders on joints")
    gas_springs: dict[str, GasSpringEntry] = Field(default_factory=dict, description="gas behind pistons on joints")
    actuators: dict[str, ActuatorEntry] = Field(default_factory=dict, description="controls that are forces on joints")
    thermal: dict[str, ThermalEntry] = Field(default_factory=dict, description="what heat warms")
    conduction: dict[str, ConductionEntry] = Field(default_factory=dict, description="how heat passes between them")
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
