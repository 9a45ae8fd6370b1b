"""Every kind of bad input is refused by name: the key, what was found, what was expected."""

import copy
import pickle
import tomllib

import pytest

from ephs.mechanics.imports.convert import toml_text
from ephs.mechanics.scene import SceneError, SceneWarning
from ephs.mechanics.scene.load import load
from ephs.mechanics.scene.schema import SECTIONS

BODY = "[bodies.a]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n"
OTHER = BODY.replace("bodies.a", "bodies.b")


def joint(*lines: str, kind: str = "revolute", bodies: str = '["ground", "a"]', place: bool = True) -> str:
    where = "at = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n" if place else ""
    return f'[joints.j]\ntype = "{kind}"\nbodies = {bodies}\n{where}' + "\n".join(lines) + "\n"


def body(*lines: str, mass: str = "1.0", inertia: str = "[1.0, 1.0, 1.0]") -> str:
    return f"[bodies.a]\nmass = {mass}\ninertia = {inertia}\n" + "\n".join(lines) + "\n"


SPRING = '[springs.s]\nbodies = ["ground", "a"]\nat1 = [1.0, 0.0, 0.0]\nat2 = [0.0, 0.0, 0.0]\n'
THERMAL = "[thermal.t]\ncapacity = 1.0\ntemperature = 300.0\n"
UNIT = "{ position = [0.0, 0.0, 0.0] }"

# name: (text, key of the fault, words of its line)
FAULTS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "syntax": ("format = 1\n[bodies.a\n", "line 2, column 10", ("valid TOML",)),
    "double key": ("format = 1\nformat = 1\n", "line 2, column 11", ("valid TOML",)),
    "format missing": ('name = "format"\n', "format", ("nothing", "expected 1")),
    "format 2": ("format = 2\n", "format", ("found 2", "expected 1")),
    "format true": ("format = true\n", "format", ("found true",)),
    "unknown table": ("[boddies.a]\nmass = 1.0\n", "boddies", ('did you mean "bodies"?',)),
    "unknown key": (body("massa = 1.0"), "bodies.a.massa", ("unknown key", 'did you mean "mass"?')),
    "misspelled mass": (BODY.replace("mass", "mas"), "bodies.a.mas", ('did you mean "mass"?',)),
    "misspelled requirement": (
        THERMAL + '[conduction.c]\nbetwen = ["t", "environment"]\nconductance = 1.0\n',
        "conduction.c.betwen",
        ('did you mean "between"?',),
    ),
    "unknown key below": (
        body("shape = { bax = [1.0, 1.0, 1.0] }"),
        "bodies.a.shape.bax",
        ('did you mean "box"?',),
    ),
    "table wanted": ("bodies = 3\n", "bodies.NAME", ("a table",)),
    "table wanted below": ("[bodies]\na = 3\n", "bodies.a", ("found 3", "a table")),
    "mass missing": ("[bodies.a]\ninertia = [1.0, 1.0, 1.0]\n", "bodies.a.mass", ("nothing", "kg")),
    "mass text": (body(mass='"1 kg"'), "bodies.a.mass", ('found "1 kg"', "a number")),
    "mass bool": (body(mass="true"), "bodies.a.mass", ("found true", "a number")),
    "mass negative": (body(mass="-1.0"), "bodies.a.mass", ("found -1.0", "not below 0")),
    "mass nan": (body(mass="nan"), "bodies.a.mass", ("found nan", "finite")),
    "mass large": (body(mass="1e51"), "bodies.a.mass", ("found 1e+51", "at most 1e+50")),
    "position large": (body("position = [0.0, -1e300, 0.0]"), "bodies.a.position[1]", ("at most 1e+50",)),
    "friction large": (BODY + joint("friction = 1e60"), "joints.j.friction", ("at most 1e+50",)),
    "temperature tiny": (THERMAL.replace("300.0", "1e-300"), "thermal.t.temperature", ("above 0",)),
    "a rod": (body(inertia="[1.0, 1.0, 0.0]"), "bodies.a.inertia", ("positive principal moments", "nearest")),
    "a point": (body(inertia="[0.0, 0.0, 0.0]"), "bodies.a.inertia", ("positive principal moments",)),
    "unprintable name": (
        '[bodies."a\\u0007b"]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n',
        'bodies."a\\x07b"',
        ("printable",),
    ),
    "tilde": (BODY.replace("bodies.a", 'bodies."~a"'), 'bodies."~a"', ("not beginning with ~",)),
    "long name": (BODY.replace("bodies.a", f"bodies.{'a' * 201}"), f'bodies."{"a" * 201}"', ("at most 200",)),
    "long key": ("a." * 60 + "a = 1\n", "line 2", ("at most 50 names",)),
    "deep": ("format = " + "[" * 5000, "", ("at most 50 levels",)),
    "part outside": ('[parts.p]\nuse = "../no.toml"\n', "parts.p.use", ("folder of the scene",)),
    "part elsewhere": ('[parts.p]\nuse = "/no.toml"\n', "parts.p.use", ("folder of the scene",)),
    "folder as name": ('name = "../../home"\n', "name", ("valid name of a folder",)),
    "position inf": (body("position = [0.0, inf, 0.0]"), "bodies.a.position[1]", ("found inf", "finite")),
    "position short": (body("position = [0.0, 1.0]"), "bodies.a.position", ("[0.0, 1.0]", "3 entries")),
    "position long": (body("position = [0, 1, 2, 3]"), "bodies.a.position", ("3 entries",)),
    "position number": (body("position = 1.0"), "bodies.a.position", ("a list",)),
    "inertia count": (body(inertia="[1.0, 1.0]"), "bodies.a.inertia", ("3 or 6 numbers",)),
    "inertia negative": (body(inertia="[1.0, 1.0, -0.1]"), "bodies.a.inertia", ("-0.1", "no negative")),
    "inertia product": (
        body(inertia="[1.0, 1.0, 1.0, 2.0, 0.0, 0.0]"),
        "bodies.a.inertia",
        ("principal moments -1", "no negative"),
    ),
    "inertia triangle": (body(inertia="[1.0, 1.0, 2.1]"), "bodies.a.inertia", ("above the sum", "warn")),
    "massless": (body(mass="0.0"), "bodies.a.inertia", ("expected 0",)),
    "quaternion": (body("rotation = [1.0, 0.0, 0.0, 0.1]"), "bodies.a.rotation", ("norm 1.00498", "unit")),
    "shape and shapes": (
        body("shape = { sphere = 1.0 }\nshapes = [{ sphere = 1.0 }]"),
        "bodies.a.shape",
        ("either shape or shapes",),
    ),
    "scale of a sphere": (
        body("shapes = [{ sphere = 1.0, scale = [1.0, 1.0, 1.0] }]"),
        "bodies.a.shapes[0].scale",
        ("meshes only",),
    ),
    "key of a shape": (body("shapes = [{ spere = 1.0 }]"), "bodies.a.shapes[0].spere", ('did you mean "sphere"',)),
    "turned shape": (
        body("shape = { sphere = 1.0, rotation = [1.0, 1.0, 0.0, 0.0] }"),
        "bodies.a.shape.rotation",
        ("unit quaternion",),
    ),
    "two shapes": (
        body("shape = { sphere = 1.0, box = [1.0, 1.0, 1.0] }"),
        "bodies.a.shape",
        ("box and sphere",),
    ),
    "no shape": (body("shape = {}"), "bodies.a.shape", ("empty",)),
    "flat sphere": (body("shape = { sphere = 0.0 }"), "bodies.a.shape.sphere", ("above 0",)),
    "dotted name": (BODY.replace("bodies.a", 'bodies."a.b"'), 'bodies."a.b"', ("without dots",)),
    "blank name": (BODY.replace("bodies.a", 'bodies."a b"'), 'bodies."a b"', ("without dots and blanks",)),
    "reserved": (BODY.replace("bodies.a", "bodies.ground"), "bodies.ground", ("fixed meaning",)),
    "free joint's name": (
        BODY + OTHER + joint(bodies='["ground", "b"]').replace("joints.j", "joints.a"),
        "joints.a",
        ("the free joint",),
    ),
    "unknown body": (BODY + joint(bodies='["ground", "aa"]'), "joints.j.bodies[1]", ('did you mean "a"?',)),
    "no body": (joint(bodies='["ground", "crank"]'), "joints.j.bodies[1]", ("there are: nothing",)),
    "three bodies": (BODY + joint(bodies='["ground", "a", "a"]'), "joints.j.bodies", ("2 entries",)),
    "itself": (BODY + joint(bodies='["a", "a"]'), "joints.j.bodies", ('"a" twice', "two different")),
    "ground twice": (joint(bodies='["ground", "ground"]'), "joints.j.bodies", ('"ground" twice',)),
    "unknown type": (
        BODY + joint(kind="revolut"),
        "joints.j.type",
        ("one of revolute", 'did you mean "revolute"?'),
    ),
    "both places": (
        BODY + joint(f"frame1 = {UNIT}"),
        "joints.j",
        ("at, axis and frame1", "either at and axis, or"),
    ),
    "no place": (BODY + joint(place=False), "joints.j", ("where the joint is", "at and axis")),
    "no axis": (BODY + joint("at = [0.0, 0.0, 0.0]", place=False), "joints.j.axis", ("nothing", "z axis")),
    "no at": (BODY + joint("axis = [0.0, 0.0, 1.0]", place=False), "joints.j.at", ("joint origin",)),
    "one frame": (BODY + joint(f"frame1 = {UNIT}", place=False), "joints.j.frame2", ("body too",)),
    "frame quaternion": (
        BODY + joint("frame1 = { rotation = [2.0, 0.0, 0.0, 0.0] }", f"frame2 = {UNIT}", place=False),
        "joints.j.frame1.rotation",
        ("norm 2",),
    ),
    "zero axis": (
        BODY + joint("at = [0.0, 0.0, 0.0]", "axis = [0.0, 0.0, 0.0]", place=False),
        "joints.j.axis",
        ("non-zero",),
    ),
    "xaxis along axis": (BODY + joint("xaxis = [0.0, 0.0, 2.0]"), "joints.j.xaxis", ("not parallel to axis",)),
    "xaxis beside frames": (
        BODY + joint(f"frame1 = {UNIT}", f"frame2 = {UNIT}", "xaxis = [1.0, 0.0, 0.0]", place=False),
        "joints.j.xaxis",
        ("together with frame1",),
    ),
    "axis2 of revolute": (BODY + joint("axis2 = [1.0, 0.0, 0.0]"), "joints.j.axis2", ("universal",)),
    "axis2 missing": (BODY + joint(kind="universal"), "joints.j.axis2", ("nothing", "body 2")),
    "axis2 parallel": (
        BODY + joint("axis2 = [0.0, 0.0, -1.0]", kind="universal"),
        "joints.j.axis2",
        ("not parallel to axis",),
    ),
    "pitch of revolute": (BODY + joint("pitch = 0.1"), "joints.j.pitch", ("no pitch for a revolute",)),
    "coordinate with at": (BODY + joint("coordinate = 0.1"), "joints.j.coordinate", ("found 0.1", "0 where")),
    "coordinate length": (
        BODY + joint("coordinate = [0.1, 0.2]", f"frame1 = {UNIT}", f"frame2 = {UNIT}", place=False),
        "joints.j.coordinate",
        ("1 number",),
    ),
    "rate number": (BODY + joint("rate = 1.0", kind="spherical"), "joints.j.rate", ("a list of 3 numbers",)),
    "friction negative": (BODY + joint("friction = -1.0"), "joints.j.friction", ("positive semidefinite",)),
    "friction asymmetric": (
        BODY + joint("friction = [[1.0, 0.5], [0.2, 1.0]]", kind="cylindrical"),
        "joints.j.friction",
        ("a symmetric matrix",),
    ),
    "friction indefinite": (
        BODY + joint("friction = [[1.0, 2.0], [2.0, 1.0]]", kind="cylindrical"),
        "joints.j.friction",
        ("positive semidefinite",),
    ),
    "friction shape": (BODY + joint("friction = [1.0, 2.0]"), "joints.j.friction", ("1 by 1",)),
    "friction ragged": (
        BODY + joint("friction = [[1.0, 2.0], [2.0]]", kind="cylindrical"),
        "joints.j.friction",
        ("2 by 2",),
    ),
    "friction text": (BODY + joint('friction = ["a"]'), "joints.j.friction", ("a number or a list",)),
    "friction nan": (BODY + joint("friction = nan"), "joints.j.friction", ("finite",)),
    "drive length": (
        BODY + joint("drive = [1.0, 2.0]", kind="spherical"),
        "joints.j.drive",
        ("a list of 3 numbers",),
    ),
    "drive number": (BODY + joint("drive = 1.0", kind="planar"), "joints.j.drive", ("a list of 3 numbers",)),
    "drive of fixed": (BODY + joint("drive = 1.0", kind="fixed"), "joints.j.drive", ("no number",)),
    "rest turned": (
        BODY + joint("rest = [0.1, 0.0, 0.0]", kind="spherical"),
        "joints.j.rest",
        ("rest 0 on a rotation vector",),
    ),
    "motion of two": (
        BODY + joint("motion = { rate = 1.0 }", kind="cylindrical"),
        "joints.j.motion",
        ("one degree of freedom", "2 degrees of freedom"),
    ),
    "motion and drive": (
        BODY + joint("motion = { rate = 1.0 }", "drive = 1.0"),
        "joints.j",
        ("either motion or drive",),
    ),
    "motion and rate": (BODY + joint("motion = { rate = 1.0 }", "rate = 2.0"), "joints.j.rate", ("1.0",)),
    "motion empty": (BODY + joint("motion = {}"), "joints.j.motion", ("empty", "one form")),
    "motion against velocity": (
        body("angular_velocity = [0.0, 0.0, 2.0]") + joint("motion = { rate = 1.0 }"),
        "joints.j.motion",
        ("a rate of 2", "1, the prescribed rate"),
    ),
    "unknown heat": (BODY + THERMAL + joint('heat = "tt"'), "joints.j.heat", ('did you mean "t"?',)),
    "spring heat": (BODY + SPRING + 'heat = "u"\n', "springs.s.heat", ("there are: nothing",)),
    "spring bodies": (BODY + SPRING.replace('"a"', '"q"'), "springs.s.bodies[1]", ('found "q"',)),
    "spring damping": (BODY + SPRING + "damping = -1.0\n", "springs.s.damping", ("not below 0",)),
    "spring without length": (
        BODY + SPRING.replace("1.0", "0.0") + "length = 1.0\n",
        "springs.s",
        ("at the same point",),
    ),
    "temperature": (THERMAL.replace("300.0", "0.0"), "thermal.t.temperature", ("found 0.0", "above 0")),
    "capacity": (THERMAL.replace("1.0", "-1.0"), "thermal.t.capacity", ("above 0",)),
    "world temperature": ("[world]\ntemperature = -3.0\n", "world.temperature", ("above 0",)),
    "conduction ends": (
        THERMAL + '[conduction.c]\nbetween = ["t", "t"]\nconductance = 1.0\n',
        "conduction.c.between",
        ('"t" twice',),
    ),
    "conduction unknown": (
        THERMAL + '[conduction.c]\nbetween = ["t", "x"]\nconductance = 1.0\n',
        "conduction.c.between[1]",
        ('"environment" or',),
    ),
    "conductance": (
        THERMAL + '[conduction.c]\nbetween = ["t", "environment"]\nconductance = -1.0\n',
        "conduction.c.conductance",
        ("not below 0",),
    ),
    "assembly": ('[assembly]\ninertia = "lax"\n', "assembly.inertia", ("'strict', 'warn' or 'nearest'",)),
    "adjust": ("[assembly]\nadjust = 1\n", "assembly.adjust", ("true or false",)),
    "gap": (
        body("position = [0.3, 0.0, 0.0]") + joint(f"frame1 = {UNIT}", f"frame2 = {UNIT}", place=False),
        "joints.j",
        ("a gap of 0.3 m and 0 rad", "adjust = true"),
    ),
    "gap in angle": (
        body("position = [0.0, 0.0, 0.0]")
        + joint("coordinate = 0.5", f"frame1 = {UNIT}", f"frame2 = {UNIT}", place=False),
        "joints.j",
        ("0 m and 0.5 rad",),
    ),
    "velocity": (body("velocity = [0.0, 0.25, 0.0]") + joint(), "joints.j", ("0.25 m/s and 0 rad/s",)),
    "rate differs": (
        body("angular_velocity = [0.0, 0.0, 2.0]") + joint("rate = 1.0"),
        "joints.j.rate",
        ("found 1", "2, as the velocities of the bodies"),
    ),
    "part missing": ('[parts.p]\nuse = "no.toml"\n', "parts.p.use", ("no file",)),
    "part of itself": ('[parts.p]\nuse = "scene.toml"\n', "parts.p.use", ("scene.toml → scene.toml",)),
    "part suffix": ('[parts.p]\nuse = "no.yaml"\n', "parts.p.use", (".toml",)),
    "part's rotation": (
        '[parts.p]\nuse = "no.toml"\nrotation = [1, 1, 0, 0]\n',
        "parts.p.rotation",
        ("unit",),
    ),
    "part and body": (
        BODY + '[parts.a]\nuse = "no.toml"\n',
        "bodies.a",
        ("that a part does not use",),
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_fault(name, scene):
    text, key, words = FAULTS[name]
    with pytest.raises(SceneError) as caught:
        scene(text)
    faults = {fault.key: str(fault) for fault in caught.value.faults}
    assert key in faults, faults
    assert all(word in faults[key] for word in words), faults[key]
    assert caught.value.path.endswith("scene.toml")
    assert str(caught.value).splitlines()[0].startswith(caught.value.path)
    assert len(str(caught.value).splitlines()) == 1 + len(caught.value.faults)


@pytest.mark.parametrize("name", [name for name in FAULTS if not name.startswith("part")])
def test_one_mistake_is_one_fault(name, scene):
    with pytest.raises(SceneError) as caught:
        scene(FAULTS[name][0])
    assert len(caught.value.faults) == 1, str(caught.value)


def test_all_faults_of_a_file_at_once(scene):
    text = (
        "[world]\ngravty = [0.0, 0.0, 0.0]\n"
        + body("rotation = [1.0, 1.0, 0.0, 0.0]", mass="-1.0", inertia="[1.0, 1.0, 3.0]")
        + joint("friction = -1.0", 'heat = "nowhere"', bodies='["ground", "b"]')
        + SPRING.replace("at2 = [0.0, 0.0, 0.0]", "at2 = [nan, 0.0, 0.0]")
        + THERMAL.replace("1.0", '"one"')
    )
    with pytest.raises(SceneError) as caught:
        scene(text)
    assert {fault.key for fault in caught.value.faults} == {
        "world.gravty",
        "bodies.a.mass",
        "bodies.a.inertia",
        "bodies.a.rotation",
        "joints.j.friction",
        "joints.j.heat",
        "joints.j.bodies[1]",
        "springs.s.at2[0]",
        "thermal.t.capacity",
    }


def test_faults_of_parts_are_reported_with_those_of_the_scene(scene):
    text = body(mass="-1.0") + '[parts.p]\nuse = "leg.toml"\n' + joint(bodies='["a", "p.foot"]')
    with pytest.raises(SceneError) as caught:
        scene(text, leg="format = 1\n" + body("mess = 1.0"))
    assert {fault.key for fault in caught.value.faults} == {"bodies.a.mass", "parts.p.bodies.a.mess"}
    assert "leg.toml" in str(caught.value)


def test_parts_that_use_each_other(scene):
    with pytest.raises(SceneError) as caught:
        scene('[parts.p]\nuse = "leg.toml"\n', leg='format = 1\n[parts.q]\nuse = "scene.toml"\n')
    (fault,) = caught.value.faults
    assert fault.key == "parts.p.parts.q.use"
    assert "scene.toml → leg.toml → scene.toml" in fault.advice


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("a.yaml", b"", ".toml, .urdf, .xml or .sdf"),
        ("a", b"", "without suffix"),
        ("a.toml", b"\xff\xfe", "UTF-8"),
        ("b.toml", None, "no file"),
    ],
)
def test_files_that_are_no_scenes(name, content, words, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=words) as caught:
        load(tmp_path / name)
    assert caught.value.path == str(tmp_path / name)


def test_base_must_be_known(tmp_path):
    (tmp_path / "a.toml").write_text("format = 1\n")
    with pytest.raises(SceneError, match='"fixed" or "free"'):
        load(tmp_path / "a.toml", base="fix")
    with pytest.raises(SceneError, match="readable"):
        load(tmp_path.joinpath("d.toml").mkdir() or tmp_path / "d.toml")


@pytest.mark.parametrize("inertia", ["[1.0, 1.0, 2.1]", "[1.0, 1.0, -0.1]"])
def test_impossible_inertia_may_be_let_through(inertia, scene):
    with pytest.warns(SceneWarning, match=r"bodies\.a\.inertia"):
        loaded = scene('[assembly]\ninertia = "warn"\n' + body(inertia=inertia))
    assert loaded.body("a").inertia[2, 2] == float(inertia.strip("[]").split(",")[2])


@pytest.mark.parametrize("inertia", ["[1.0, 1.0, 2.0]", "[1.0, 1.0, 1e-6]", "[1.0, 1.0, 2.0000000001]"])
def test_limits_of_possible_inertia(inertia, scene):
    assert scene(body(inertia=inertia)).body("a").mass == 1.0


def test_a_massless_frame(scene):
    assert scene(body(mass="0.0", inertia="[0.0, 0.0, 0.0]")).body("a").mass == 0.0


def test_nearly_unit_quaternions_are_normalised(scene):
    loaded = scene(body("rotation = [0.7071067, 0.7071067, 0.0, 0.0]"))
    w, x = loaded.body("a").pose[:2]
    assert abs(w * w + x * x - 1.0) < 1e-15


def test_errors_travel_between_processes(scene):
    with pytest.raises(SceneError) as caught:
        scene(body(mass="-1.0"))
    back = pickle.loads(pickle.dumps(caught.value))
    assert (str(back), back.faults, back.path) == (str(caught.value), caught.value.faults, caught.value.path)


@pytest.mark.parametrize("section", SECTIONS)
def test_an_empty_table_is_valid_or_its_faults_are_told(section, tmp_path):
    (tmp_path / "scene.toml").write_text(f"format = 1\n[{section}.one]\n")
    try:
        load(tmp_path / "scene.toml")
    except SceneError as error:
        assert all(fault.key for fault in error.faults)


EVERY = """format = 1
[bodies.arm]
mass = 1.0
inertia = [0.01, 0.02, 0.02]
position = [0.3, 0.0, 0.0]
[bodies.slide]
mass = 1.0
inertia = [0.01, 0.02, 0.02]
position = [0.0, 2.0, 0.0]
[joints.h]
type = "revolute"
bodies = ["ground", "arm"]
axis = [0.0, 1.0, 0.0]
at = [0.0, 0.0, 0.0]
limits = [-1.0, 1.0]
[joints.s]
type = "prismatic"
bodies = ["ground", "slide"]
axis = [1.0, 0.0, 0.0]
at = [0.0, 2.0, 0.0]
[tendons.cable]
bodies = ["ground", "arm"]
points = [[0.0, 0.0, 1.0], [0.1, 0.0, 0.1]]
stiffness = 10.0
[surfaces.floor]
body = "ground"
shape = { plane = {} }
position = [0.0, 0.0, -3.0]
[surfaces.ball]
body = "arm"
shape = { sphere = 0.1 }
stiffness = 1e4
loss = 1.0
[contacts.c]
surfaces = ["floor", "ball"]
[markers.tip]
body = "arm"
at = [0.1, 0.0, 0.0]
[actuators.push]
joints = ["h"]
ratio = 2.0
limits = [-1.0, 1.0]
[cylinders.ram]
joint = "s"
area = [1e-3, 8e-4]
volume = [1e-4, 1e-4]
conductance = 1e-9
[gas_springs.soft]
joint = "s"
area = 1e-3
volume = 1e-3
pressure = 1e5
[loads.push]
body = "arm"
force = [1.0, 0.0, 0.0]
"""


@pytest.mark.filterwarnings("ignore::ephs.SceneWarning")
def test_without_a_key_or_with_a_shorter_list_a_scene_is_valid_or_its_faults_are_told(tmp_path):
    whole, file = tomllib.loads(EVERY), tmp_path / "scene.toml"
    places = [(section, name, key) for section, tables in whole.items() if section != "format"
              for name, table in tables.items() for key in table]  # fmt: skip
    faults = 0
    for section, name, key in places:
        given = whole[section][name][key]
        for short in [None, *([given[:-1], given[:1], []] if isinstance(given, list) else [])]:
            changed = copy.deepcopy(whole)
            del changed[section][name][key]
            if short is not None:
                changed[section][name][key] = short
            file.write_text(toml_text(changed))
            try:
                load(file)
            except SceneError as error:
                faults += len(error.faults)
    assert faults > 60
