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


def joint(*lines: str, kind: str = "revolute", bodies: str = '["ground", "a"]', place: bool = True) -> str:
    where = "at = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n" if place else ""
    return f'[joints.j]\ntype = "{kind}"\nbodies = {bodies}\n{where}' + "\n".join(lines) + "\n"


def body(*lines: str, mass: str = "1.0", inertia: str = "[1.0, 1.0, 1.0]") -> str:
    return f"[bodies.a]\nmass = {mass}\ninertia = {inertia}\n" + "\n".join(lines) + "\n"


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
        ("deep.toml", b"format = " + b"[" * 5000, "nested too deeply, expected at most 50 levels"),
        ("open.toml", b"format = 1\n[bodies.a\n", "line 2, column 10: .*valid TOML"),
        ("twice.toml", b"format = 1\nformat = 1\n", "line 2, column 11: .*valid TOML"),
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
