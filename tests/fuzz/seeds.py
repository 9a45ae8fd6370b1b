"""What inputs are made from: the scenes that ship, the models and the faulty texts of the tests, patterns."""

from pathlib import Path
from struct import pack

from ephs.operad import Pattern
from tests.mechanics.imports.models import MODELS
from tests.mechanics.scene.test_scene_faults import BODY, joint
from tests.operad.models import JOINT
from tests.refused import corpus

ROOT = Path(__file__).resolve().parents[2]

OTHER = BODY.replace("bodies.a", "bodies.b")
SPRING = '[springs.s]\nbodies = ["ground", "a"]\nat1 = [1.0, 0.0, 0.0]\nat2 = [0.0, 0.0, 0.0]\n'
THERMAL = "[thermal.t]\ncapacity = 1.0\ntemperature = 300.0\n"
UNIT = "{ position = [0.0, 0.0, 0.0] }"
PENDULUM = BODY + joint('heat = "t"', "friction = 0.1", "drive = 0.2") + THERMAL
FOUR_BAR = """
[bodies.a]
mass = 0.3
inertia = [0.01, 0.01, 0.001]
position = [0.0, 0.0, 0.5]
[bodies.b]
mass = 0.5
inertia = [0.001, 0.02, 0.02]
position = [0.5, 0.0, 1.0]
[bodies.c]
mass = 0.3
inertia = [0.01, 0.01, 0.001]
position = [1.0, 0.0, 0.5]
""" + "".join(
    f'[joints.j{k}]\ntype = "revolute"\nbodies = ["{ends[0]}", "{ends[1]}"]\n'
    f"at = [{x}, 0.0, {z}]\naxis = [0.0, 1.0, 0.0]\n"
    for k, (ends, x, z) in enumerate(
        [(("ground", "a"), 0.0, 0.0), (("a", "b"), 0.0, 1.0), (("b", "c"), 1.0, 1.0), (("ground", "c"), 1.0, 0.0)]
    )
)
CHAIN = BODY + OTHER + joint(f"frame1 = {UNIT}", f"frame2 = {UNIT}", "coordinate = 0.3", "rate = 1.0", place=False)
SPRUNG = BODY + SPRING + 'damping = 0.1\nheat = "t"\n' + THERMAL
WARM = THERMAL + '[conduction.c]\nbetween = ["t", "environment"]\nconductance = 0.5\n'
KINDS = [
    BODY
    + f'[joints.j]\ntype = "{kind}"\nbodies = ["ground", "a"]\nat = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n{more}'
    for kind, more in {
        "spherical": "stiffness = 1.0\n",
        "planar": "friction = [1.0, 2.0, 3.0]\n",
        "cylindrical": "friction = [[1.0, 0.5], [0.5, 1.0]]\n",
        "screw": "pitch = 0.1\nmotion = { rate = 1.0 }\n",
        "prismatic": "rest = 0.1\nstiffness = 2.0\n",
        "fixed": "",
        "universal": "axis2 = [1.0, 0.0, 0.0]\n",
        "free": "",
    }.items()
]
SHAPES = BODY + 'shapes = [{ box = [1.0, 1.0, 1.0] }, { mesh = "mesh.stl", scale = [1.0, 2.0, 3.0] }]\n'
WORLD = '[world]\ngravity = [0.0, 0.0, -1.0]\n[assembly]\nadjust = true\ninertia = "warn"\n'
PARTS = BODY + '[parts.p]\nuse = "leg.toml"\nposition = [0.0, 1.0, 0.0]\n' + joint(bodies='["a", "p.foot"]')
MARKED = BODY + '[markers.m]\nbody = "a"\nat = [0.0, 0.0, 1.0]\n'
LEG = "format = 1\n" + BODY.replace("bodies.a", "bodies.foot")
"""The scene beside them that they may use."""
_CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
MESH = (
    bytes(80)
    + pack("<I", 4)
    + b"".join(
        pack("<12fH", 0, 0, 0, *(x for k in face for x in _CORNERS[k]), 0)
        for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    )
)
"""A tetrahedron, in binary STL."""

URDF = """<robot name="r"><link name="a"/>
<link name="b"><inertial><origin xyz="0 0 0.3" rpy="1 0 0"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="package://p/mesh.stl" scale="1 1 2"/></geometry></visual></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0 0 1"/><axis xyz="0 1 0"/>
<dynamics damping="0.3" friction="0.1"/><limit lower="-1"/><mimic joint="j"/></joint></robot>"""
SDF = """<sdf version="1.7"><model name="m"><pose>0 0 1 0 0 0</pose><frame name="f"><pose>0 0 0.3 0 0 0</pose></frame>
<link name="a"><pose relative_to="f">0 0 0 0 0 0.2</pose><inertial><mass>0.2</mass><inertia><ixx>2</ixx><iyy>2</iyy>
<izz>1</izz></inertia></inertial><visual name="v"><geometry><box><size>1 1 1</size></box></geometry></visual></link>
<joint name="j" type="screw"><parent>world</parent><child>a</child><axis><xyz expressed_in="f">0 1 0</xyz><dynamics>
<damping>0.1</damping><spring_stiffness>2</spring_stiffness></dynamics></axis><screw_thread_pitch>2</screw_thread_pitch>
</joint></model></sdf>"""
MJCF = """<mujoco model="m"><compiler angle="radian"/><default><joint damping="0.1"/></default>
<asset><mesh name="n" file="mesh.stl"/></asset>
<worldbody><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" stiffness="2" springref="0.4"/><joint type="slide"/>
<inertial pos="0 0 0.1" quat="1 0 0 0" mass="0.2" diaginertia="2 2 2"/></body>
<body name="b"><freejoint/><geom type="capsule" size="0.4 0.1"/></body></worldbody>
<equality><connect body1="a" body2="b" anchor="0 0 0"/></equality><actuator><motor joint="j"/></actuator></mujoco>"""

TEXTS = (
    "q: displacement; p: momentum, exposed; pe(q); ke(p); pkc(q, p)",
    "q: pose; p: body_momentum, exposed; r: relative_pose(screw, pitch=0.1) @ C1; a(q, ~r); b(p, x=r); q2: pose; c(q2)",
    "q: angle; h: angle; i: angle; a(q, ~h, ~i); q ~ h ~ i",
    'x: {"kind": "mine", "space": {"name": "R3", "dim": 3, "size": 3}, "parity": 1}, exposed as state; a.b(y=~x)',
    "p: momentum, exposed; .(p)",
)


def refused(room: str) -> list[tuple[str, str]]:
    """Names of what was sound, and faulty texts."""
    _, cases = corpus(ROOT / f"tests/mechanics/{room}/refused")
    return [case.values[:2] for case in cases]


def seeds() -> dict[str, list[str]]:
    """The texts by kind, small ones first."""
    own = [PENDULUM, FOUR_BAR, CHAIN, SPRUNG, WARM, *KINDS, SHAPES, PARTS, MARKED]
    own += [WORLD + text for text in (PENDULUM, FOUR_BAR, CHAIN, PARTS)]
    scenes = [f'format = 1\nname = "s"\n{text}' for text in own]
    # Everything of one's own counts as much as all that is known to be faulty, or to be large.
    scenes = scenes * 12 + [text for _, text in refused("scene")]
    scenes += [file.read_text(encoding="utf-8") for file in sorted((ROOT / "scenes").glob("*.toml"))]
    patterns = [Pattern.from_text(text) for text in TEXTS] + [JOINT]
    models: dict[str, list[str]] = {"urdf": [], "sdf": [], "xml": []}
    for ending, text in refused("imports"):
        models[ending].append(text)
    for ending, small in (("urdf", URDF), ("sdf", SDF), ("xml", MJCF)):
        models[ending] += [small] * 40 + [MODELS[ending]]
    return {
        "toml": scenes,
        "json": [pattern.to_json() for pattern in patterns],
        "text": list(TEXTS),
        **models,
    }
