"""The scene file's tables as pydantic models: the keys, their types, units and defaults.

One model a table; where keys are the attributes of an element, the model is made of the element. Values whose form
depends on another key (a number, or one per degree of freedom) are taken as numbers or lists here and brought to shape
by `resolve`.
"""

from typing import Any, Literal, TypeAlias

from pydantic import create_model

from ephs.mechanics.scene.bodies import World
from ephs.mechanics.scene.model import ELEMENTS, KINDS
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_elements import table_of
from ephs.mechanics.scene.schema_flexible import BeamEntry
from ephs.mechanics.scene.schema_numbers import (
    Entry,
    Extents,
    Flag,
    Inertia,
    Limits,
    Matrix,
    NonNegative,
    Number,
    Numbers,
    Pair,
    Positive,
    Series,
    Sizes,
    Text,
    Vector,
    key,
)
from ephs.mechanics.scene.thermal import ThermalNode


class AssemblyEntry(Entry):
    """``[assembly]``"""

    adjust: Flag = key(
        "replace an inconsistent initial state by the nearest consistent one, and report the change", False
    )
    inertia: Literal["strict", "warn", "nearest"] = key(
        '"warn" accepts a physically impossible inertia, "nearest" takes the nearest possible one', "strict"
    )


class ShapeEntry(Entry):
    """``shape``: one of four, and its pose in the body."""

    box: Extents | None = key("edge lengths, m", None)
    sphere: Positive | None = key("radius, m", None)
    cylinder: Sizes | None = key("radius and length along z, m", None)
    mesh: Text | None = key("a mesh file (.stl .obj .ply .glb .off) in the scene file's folder, or below", None)
    scale: Vector | None = key("scale of a mesh along its axes", None)
    position: Vector | None = key("origin in the centre-of-mass frame, m", None)
    rotation: Rotation | None = key("orientation there, [w, x, y, z] or a table", None)


class BodyEntry(Entry):
    """``[bodies.NAME]``"""

    mass: NonNegative | None = key("kg; required unless density is given; 0 only with inertia 0", None)
    inertia: Inertia | None = key(
        "about the centre of mass, body axes: xx yy zz [xy xz yz], kg m²; default: from the shapes, homogeneous", None
    )
    density: Positive | None = key("density of the shapes, kg/m³; replaces mass and inertia", None)
    position: Vector | None = key("centre of mass in the world, m", None)
    rotation: Rotation | None = key("body to world, [w, x, y, z] or a table", None)
    velocity: Vector | None = key("of the centre of mass, world basis, m/s", None)
    angular_velocity: Vector | None = key("body basis, rad/s", None)
    shape: ShapeEntry | None = key("shape for pictures, and for the inertia where none is given", None)
    shapes: list[ShapeEntry] | None = key("list of shapes, instead of shape", None)


class FrameEntry(Entry):
    """A pose in a body's centre-of-mass frame."""

    position: Vector = key("origin, m", [0.0, 0.0, 0.0])
    rotation: Rotation = key("orientation, [w, x, y, z] or a table", [1.0, 0.0, 0.0, 0.0])


class MotionEntry(Entry):
    """A prescribed motion: the change of the coordinate from its initial value, in one of four forms."""

    rate: Number | None = key("constant rate of the single degree of freedom, rad/s or m/s", None)
    polynomial: Series | None = key(
        "coefficients c₁, c₂, … of c₁ t + c₂ t² + …; rad/s, rad/s², … or m/s, m/s², …", None
    )
    amplitude: Number | None = key("amplitude A of the harmonic A sin(2π f t + φ), rad or m", None)
    frequency: Number | None = key("frequency f of the harmonic, Hz", None)
    phase: Number | None = key("phase φ of the harmonic, rad; default: 0", None)
    times: Series | None = key("ascending times of a table, s; a spline of fifth order, at rest before and after", None)
    displacements: Series | None = key("displacements at these times, rad or m", None)


class DryEntry(Entry):
    """Dry friction of a joint with one degree of freedom."""

    coulomb: NonNegative = key("friction force while sliding, N m or N")
    static: NonNegative | None = key("force at which sliding begins; default: coulomb", None)
    stribeck: Positive = key("rate over which the force falls to coulomb, rad/s or m/s", 0.01)
    slip: Positive = key("rate below which the friction is viscous, rad/s or m/s", 1e-3)


class JointEntry(Entry):
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


class PartEntry(Entry):
    """``[parts.NAME]``"""

    use: Text = key("another scene file or model, in the folder of this file, or below")
    position: Vector = key("position of the part's ground in this world, m", [0.0, 0.0, 0.0])
    rotation: Rotation = key("its orientation, [w, x, y, z] or a table", [1.0, 0.0, 0.0, 0.0])


WorldEntry: Any = table_of(World, "world")
_TABLES: dict[str, tuple[type[Entry], str]] = {
    "bodies": (BodyEntry, "rigid bodies, and massless frames"),
    "joints": (JointEntry, "joints between two bodies, or a body and the ground"),
    "beams": (BeamEntry, "rods that bend, twist and stretch"),
    "thermal": (table_of(ThermalNode, "thermal.NAME"), "thermal nodes: stores of heat"),
}
_SECTIONS = {name: (KINDS[name], KINDS[name].said) if name in KINDS else _TABLES[name] for name in ELEMENTS}
_SECTIONS["parts"] = PartEntry, "other scene files as subsystems"
SECTIONS: dict[str, type[Entry]] = {key: table for key, (table, _) in _SECTIONS.items()}
_Name: TypeAlias = Text | None
_FILE: dict[str, Any] = {
    "format": (Literal[1], key("version of the file format, always 1")),
    "name": (_Name, key("name of the scene; default: the file's name", None)),
    "world": (WorldEntry | None, key("gravity and the reference environment", None)),
    "assembly": (
        AssemblyEntry,
        key("treatment of inconsistent initial states and inertias", AssemblyEntry()),
    ),
}
for _key, (_table, _said) in _SECTIONS.items():
    _FILE[_key] = dict[str, _table], key(_said, default_factory=dict)
FILE_KEYS = tuple(_FILE)
"""Keys at the top of scene files, without registered sections."""


def scene_file() -> Any:
    """The model of a scene file, registered sections included."""
    own: dict[str, Any] = {
        section: (dict[str, of], key(of.said, default_factory=dict)) for section, of in REGISTERED.items()
    }
    return create_model("SceneFile", __base__=Entry, __doc__="A scene file.", **_FILE, **own)


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scene file, for editors."""
    return scene_file().model_json_schema()
