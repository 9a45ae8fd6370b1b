"""Bad models end in one SceneError that names what is wrong, whatever the text; nothing outside the folder is read."""

import os
import sys
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ephs
from ephs.cli import main
from tests.mechanics.imports.models import MODELS, URDF

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
"""
LINK = '<link name="{}"/>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'


def robot(*parts):
    return '<robot name="r">' + "".join(parts) + "</robot>"


def links(names):
    return "".join(LINK.format(name) for name in names)


def inertial(mass="1", xx="1", yy="1", zz="1"):
    inertia = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="b"><inertial><mass value="{mass}"/>{inertia}</inertial></link>'


def mjcf(body, more=""):
    return f"<mujoco><worldbody>{body}</worldbody>{more}</mujoco>"


BALL = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"


ONE = f'<model name="m"><link name="a">{BALL}</link></model>'
WORLD = f'<world name="w">{ONE}</world>'


def sdf(*parts):
    return '<sdf version="1.7"><model name="m">' + "".join(parts) + "</model></sdf>"


# name: (ending, text, key of the fault, words in it)
FAULTS = {
    "not well-formed": ("urdf", "<robot>\n<link", "line 2, column 1", ["well-formed XML"]),
    "empty": ("sdf", "", "line 1, column 1", ["well-formed XML"]),
    "another root": ("xml", "<html/>", "", ["<html>", "<robot>, <mujoco>, <sdf>"]),
    "billion laughs, URDF": ("urdf", LAUGHS + robot(LINK.format("&c;")), "line 2", ["<!DOCTYPE"]),
    "billion laughs, MJCF": ("xml", LAUGHS + mjcf('<body name="&c;"/>'), "line 2", ["<!DOCTYPE"]),
    "billion laughs, SDF": ("sdf", LAUGHS + sdf(), "line 2", ["<!DOCTYPE"]),
    "deep": ("urdf", "<robot>" + "<a>" * 1000 + "</a>" * 1000 + "</robot>", "", ["200 levels"]),
    "xacro": (
        "urdf",
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="m"/></robot>',
        "robot",
        ["expand the macros"],
    ),
    "no link": ("urdf", robot(), "links", ["at least one link"]),
    "two links of a name": ("urdf", robot(links("aa")), "links.a", ['a second link "a"']),
    "two joints of a name": (
        "urdf",
        robot(links("abc"), JOINT.format("j", "fixed", "a", "b", ""), JOINT.format("j", "fixed", "a", "c", "")),
        "joints.j",
        ['a second joint "j"'],
    ),
    "a link without name": ("urdf", robot("<link/>"), "links[0].name", ["a name"]),
    "an unknown joint": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "revolut", "a", "b", "")),
        "joints.j.type",
        ['"revolut"', "planar", 'did you mean "revolute"'],
    ),
    "a joint without kind": (
        "urdf",
        robot(links("ab"), '<joint name="j"><parent link="a"/><child link="b"/></joint>'),
        "joints.j.type",
        ["nothing"],
    ),
    "a missing link": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "bb", "")),
        "joints.j.child",
        ['"bb"', 'did you mean "b"'],
    ),
    "no parent": (
        "urdf",
        robot(links("ab"), '<joint name="j" type="fixed"><child link="b"/></joint>'),
        "joints.j.parent",
        ["nothing", "there are: a, b"],
    ),
    "two roots": (
        "urdf",
        robot(links("abc"), JOINT.format("j", "fixed", "a", "b", "")),
        "links",
        ["2: a, c", "one root link"],
    ),
    "two parents": (
        "urdf",
        robot(links("abc"), JOINT.format("j", "fixed", "a", "c", ""), JOINT.format("k", "fixed", "b", "c", "")),
        "joints.k.child",
        ['"c", the child of joint "j"'],
    ),
    "a cycle": (
        "urdf",
        robot(
            links("abc"),
            JOINT.format("j", "fixed", "b", "c", ""),
            JOINT.format("k", "fixed", "c", "b", ""),
        ),
        "joints.j",
        ["a cycle of links"],
    ),
    "nothing but a cycle": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "b", ""), JOINT.format("k", "fixed", "b", "a", "")),
        "joints.j",
        ["a cycle of links"],
    ),
    "a word for a number": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "b", '<origin xyz="0 one 0"/>')),
        "joints.j.origin.xyz",
        ['"0 one 0"', "3 finite numbers"],
    ),
    "too few numbers": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "b", '<origin rpy="0 0"/>')),
        "joints.j.origin.rpy",
        ["3 finite numbers"],
    ),
    "nan": ("urdf", robot(inertial("nan")), "links.b.inertial.mass.value", ['"nan"', "finite"]),
    "no mass": (
        "urdf",
        robot('<link name="b"><inertial><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'),
        "links.b.inertial.mass.value",
        ["nothing"],
    ),
    "negative mass": ("urdf", robot(inertial("-1")), "links.b.inertial.mass", ["-1 kg", "not below 0"]),
    "an axis of zeros": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "revolute", "a", "b", '<axis xyz="0 0 0"/>')),
        "joints.j.axis.xyz",
        ["non-zero length"],
    ),
    "negative damping": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "revolute", "a", "b", '<dynamics damping="-1"/>')),
        "joints.j.dynamics.damping",
        ["-1", "not below 0"],
    ),
    "no model": ("sdf", '<sdf version="1.7"/>', "model", ["none", "one world"]),
    "two worlds": ("sdf", f'<sdf version="1.7">{2 * WORLD}</sdf>', "model", ["2 worlds", "one world"]),
    "two models of a name": ("sdf", f'<sdf version="1.7">{2 * ONE}</sdf>', "models.m", ['a second model "m"']),
    "a model within without links": ("sdf", sdf('<model name="inner"/>'), "links", ["none"]),
    "a parent that is an empty model": (
        "sdf",
        sdf(
            f'<link name="a">{BALL}</link><model name="inner"/>'
            '<joint name="j" type="fixed"><parent>inner</parent><child>a</child></joint>'
        ),
        "models.inner",
        ["none", "at least one link"],
    ),
    "an end on a cycle of frames": (
        "sdf",
        sdf(
            f'<link name="a">{BALL}</link><frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>'
            '<joint name="j" type="fixed"><parent>f</parent><child>a</child></joint>'
        ),
        "joints.j.parent",
        ["200 levels"],
    ),
    "two rotations of an origin": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "b", '<origin rpy="1 0 0" quat_xyzw="0 0 0 1"/>')),
        "joints.j.origin.quat_xyzw",
        ["rpy beside it"],
    ),
    "a quaternion of zeros": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "fixed", "a", "b", '<origin quat_xyzw="0 0 0 0"/>')),
        "joints.j.origin.quat_xyzw",
        ["zeros"],
    ),
    "a word for a limit": (
        "urdf",
        robot(links("ab"), JOINT.format("j", "revolute", "a", "b", '<limit lower="low" upper="1"/>')),
        "joints.j.limit.lower",
        ['"low"'],
    ),
    "an include": ("sdf", sdf("<include><uri>model://x</uri></include>"), "include", ['"model://x"']),
    "SDF without links": ("sdf", sdf(), "links", ["none"]),
    "an unknown joint in SDF": (
        "sdf",
        sdf(f'<link name="a">{BALL}</link><joint name="j" type="hinge"><parent>world</parent><child>a</child></joint>'),
        "joints.j.type",
        ['"hinge"', "revolute2"],
    ),
    "a missing link in SDF": (
        "sdf",
        sdf(f'<link name="a">{BALL}</link><joint name="j" type="ball"><parent>world</parent><child>b</child></joint>'),
        "joints.j.child",
        ['"b"'],
    ),
    "a cycle of frames": (
        "sdf",
        sdf(
            f'<link name="a"><pose relative_to="f"/>{BALL}</link>'
            '<frame name="f"><pose relative_to="g"/></frame><frame name="g"><pose relative_to="f"/></frame>'
        ),
        "frames.g.pose",
        ["f → g → f"],
    ),
    "an unknown frame": (
        "sdf",
        sdf(f'<link name="a"><pose relative_to="nowhere"/>{BALL}</link>'),
        "links.a.pose",
        ['"nowhere"'],
    ),
    "a pose of five": ("sdf", sdf(f'<link name="a"><pose>0 0 0 0 0</pose>{BALL}</link>'), "links.a.pose", ["6 finite"]),
    "a thread without pitch": (
        "sdf",
        sdf(
            f'<link name="a">{BALL}</link><joint name="j" type="screw"><parent>world</parent><child>a</child>'
            "<thread_pitch>0</thread_pitch></joint>"
        ),
        "joints.j.thread_pitch",
        ["not 0"],
    ),
    "nan, MJCF": ("xml", mjcf('<body name="nan" pos="0 NaN 0"/>'), "body.pos", ['"0 NaN 0"', "finite"]),
    "what MuJoCo does not know": ("xml", mjcf("<bodi/>"), "", ["MuJoCo says", "unrecognized element"]),
    "a body without mass": ("xml", mjcf('<body name="a"><joint/></body>'), "", ["MuJoCo says", "mass and inertia"]),
    "two bodies of a name": ("xml", mjcf('<body name="a"/><body name="a"/>'), "", ["MuJoCo says", "repeated name"]),
    "an attached model outside": (
        "xml",
        mjcf('<body name="a"><attach model="m"/></body>', '<asset><model name="m" file="../x.xml"/></asset>'),
        'model "../x.xml"',
        ["folder of"],
    ),
    "a model attached to itself": (
        "xml",
        mjcf('<body name="a"><attach model="m"/></body>', '<asset><model name="m" file="model.xml"/></asset>'),
        'model "model.xml"',
        ["within itself"],
    ),
    "an include outside": ("xml", '<mujoco><include file="../x.xml"/></mujoco>', 'include "../x.xml"', ["folder of"]),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told(name, write, capsys):
    ending, text, key, words = FAULTS[name]
    path = write(text, ending)
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(path)
    assert caught.value.path == str(path)
    told = [str(fault) for fault in caught.value.faults if fault.key == key]
    assert len(told) == 1, caught.value
    assert all(word in told[0] for word in words), told
    assert main(["check", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(str(path))
    assert "Traceback" not in said


def test_all_faults_are_told_at_once(write):
    text = robot(links("abc"), JOINT.format("j", "hinge", "a", "d", ""), JOINT.format("k", "fixed", "x", "c", ""))
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(write(text))
    assert [fault.key for fault in caught.value.faults][:3] == ["joints.j.type", "joints.j.child", "joints.k.parent"]


def test_large_files_are_refused_by_their_size(tmp_path):
    path = tmp_path / "large.urdf"
    with path.open("wb") as file:
        file.truncate(101_000_000)
    with pytest.raises(ephs.SceneError, match="101 MB, expected at most 100 MB"):
        ephs.load(path)


@pytest.mark.parametrize("ending", sorted(MODELS))
def test_other_encodings_cannot_hide_entities(ending, tmp_path):
    path = tmp_path / f"model.{ending}"
    path.write_bytes((LAUGHS.replace("?>", ' encoding="utf-16"?>', 1) + MODELS[ending]).encode("utf-16"))
    with pytest.raises(ephs.SceneError, match="UTF-8"):
        ephs.load(path)


MESH = (
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"
)
GEOMETRY = {
    "urdf": robot('<link name="a"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'),
    "sdf": sdf(
        '<link name="a">' + BALL + '<visual name="v"><geometry><mesh><uri>{}</uri></mesh></geometry></visual></link>'
    ),
    "xml": "<mujoco><asset><mesh name='m' file='{}'/></asset>"
    "<worldbody><body name='a'><geom size='1'/><geom type='mesh' mesh='m'/></body></worldbody></mujoco>",
}


@pytest.mark.parametrize("ending", sorted(GEOMETRY))
@pytest.mark.parametrize("way", ["up", "absolute", "link", "address", "missing"])
def test_meshes_outside_are_not_read_but_named(ending, way, tmp_path):
    inside = tmp_path / "robot"
    inside.mkdir()
    secret = tmp_path / "secret.stl"
    secret.write_text(MESH)
    (inside / "link.stl").symlink_to(secret)
    name = {
        "up": "../secret.stl",
        "absolute": str(secret),
        "link": "link.stl",
        "address": "http://localhost/secret.stl",
        "missing": "none.stl",
    }[way]
    path = inside / f"model.{ending}"
    path.write_text(GEOMETRY[ending].format(name))
    with pytest.warns(ephs.ModelWarning) as caught:
        scene = ephs.load(path)
    assert not any("mesh" in shape for shape in scene.body("a").shapes)
    assert any(name in str(each.message) and "model's folder" in str(each.message) for each in caught)


@pytest.mark.filterwarnings("ignore::ephs.ModelWarning")
def test_includes_of_the_folder_are_read_once(tmp_path):
    (tmp_path / "arm.xml").write_text(
        '<mujocoinclude><body name="arm"><joint name="j"/><geom size="1"/></body></mujocoinclude>'
    )
    path = tmp_path / "model.xml"
    path.write_text(mjcf('<include file="arm.xml"/>'))
    assert list(ephs.load(path).joints) == ["j"]
    path.write_text(mjcf('<include file="arm.xml"/><include file="arm.xml"/>'))
    with pytest.raises(ephs.SceneError, match="second include"):
        ephs.load(path)
    (tmp_path / "arm.xml").write_text('<mujocoinclude><include file="arm.xml"/></mujocoinclude>')
    path.write_text(mjcf('<include file="arm.xml"/>'))
    with pytest.raises(ephs.SceneError, match="second include"):
        ephs.load(path)


def test_without_mujoco_there_is_one_clear_error(write, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    path = write(MODELS["xml"], "xml")
    with pytest.raises(ephs.SceneError, match=r"pip install 'ephs\[models\]'"):
        ephs.load(path)
    assert main(["check", str(path)]) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ephs.ModelWarning)
        assert ephs.load(write(URDF)).name == "arm"  # which needs none


# Every example writes its file anew: the folder may be the same for all.
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_broken_texts_load_or_are_refused(data, tmp_path):
    ending = data.draw(st.sampled_from(sorted(MODELS)))
    text = MODELS[ending]
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text) - 1))
        stop = start + data.draw(st.integers(0, 30))
        put = data.draw(
            st.sampled_from(["", "0", "-1", "nan", "1e400", '"', "<", "/>", "a", "world", " ", "é", "\x00"])
        )
        text = text[:start] + put + text[stop:]
    path = tmp_path / f"model.{ending}"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ephs.ModelWarning)
        warnings.simplefilter("ignore", ephs.SceneWarning)
        try:
            ephs.load(path)
        except ephs.SceneError as error:
            assert error.faults
    assert not os.path.exists("MUJOCO_LOG.TXT")


@pytest.mark.filterwarnings("ignore::ephs.ModelWarning")
@pytest.mark.parametrize("given", ['diaginertia="1 1 5"', 'fullinertia="1 1 5 0.1 0 0"', 'diaginertia="0 1 1"'])
def test_inertias_that_mujoco_refuses_are_kept_by_name(given, write):
    body = f'<body name="a"><joint name="j"/><inertial pos="1 0 0" quat="0 1 0 0" mass="2" {given}/></body>'
    path = write(mjcf(body.replace('quat="0 1 0 0"', "") if "full" in given else body), "xml")
    with pytest.warns(ephs.SceneWarning, match=r"bodies\.a\.inertia") as caught:
        scene = ephs.load(path)
    assert sum(issubclass(each.category, ephs.SceneWarning) for each in caught) == 1
    assert scene.body("a").mass == 2.0
    found = np.diag(scene.body("a").inertia)
    assert np.abs(found - [float(word) for word in given.split('"')[1].split()[:3]]).max() < 1e-10
    with pytest.warns(ephs.SceneWarning, match="replaced by"):
        ephs.load(path, inertia="nearest")
    if "0 1 1" not in given:  # a rod is possible
        with pytest.raises(ephs.SceneError, match=r"bodies\.a\.inertia"):
            ephs.load(path, inertia="strict")


@pytest.mark.filterwarnings("ignore::ephs.ModelWarning")
def test_masses_that_mujoco_scales_are_its_own(write):
    body = '<body name="a"><joint/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>'
    path = write(f'<mujoco><compiler settotalmass="6"/><worldbody>{body}</worldbody></mujoco>', "xml")
    assert ephs.load(path).body("a").mass == 6.0
