"""Bad models end in one SceneError that names what is wrong, whatever the text; nothing outside the folder is read."""

import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ephs
from tests.mechanics.imports.models import MODELS, SDF, URDF
from tests.refused import corpus
from tests.typed import typed

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
"""


def robot(*parts):
    return '<robot name="r">' + "".join(parts) + "</robot>"


def mjcf(body, more=""):
    return f"<mujoco><worldbody>{body}</worldbody>{more}</mujoco>"


BALL = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"


def sdf(*parts):
    return '<sdf version="1.7"><model name="m">' + "".join(parts) + "</model></sdf>"


_, REFUSED = corpus(Path(__file__).parent / "refused")


@pytest.mark.parametrize(("ending", "text", "told"), REFUSED)
def test_what_is_wrong_is_said_in_these_lines(ending, text, told, write, capsys):
    path = write(text, ending)
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(path)
    assert [str(fault) for fault in caught.value.faults] == told
    assert caught.value.path == str(path)
    assert typed(f"check {path}") == 2
    said = capsys.readouterr().err
    assert said.startswith(str(path))
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("ending", "text", "words"),
    [
        ("sdf", "", "line 1, column 1: .*well-formed XML"),
        ("urdf", "<robot>" + "<a>" * 1000 + "</a>" * 1000 + "</robot>", "200 levels"),
        ("urdf", URDF.replace('damping="0.3"', 'damping="1_0"'), r'dynamics\.damping: found "1_0".*finite number'),
        ("urdf", URDF.replace('lower="-1"', 'lower="-١"'), r'limit\.lower: found "-١".*finite number'),
        ("sdf", SDF.replace("<mass>0.2<", "<mass>2_0<"), r'inertial\.mass: found "2_0".*finite number'),
        ("xml", mjcf("<bodi/>"), "MuJoCo says.*unrecognized element"),
        ("xml", mjcf('<body name="a"><joint/></body>'), "MuJoCo says.*mass and inertia"),
        ("xml", mjcf('<body name="a"/><body name="a"/>'), "MuJoCo says.*repeated name"),
    ],
)
def test_what_others_say_or_nobody_writes_is_refused(ending, text, words, write):
    with pytest.raises(ephs.SceneError, match=words):
        ephs.load(write(text, ending))


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
    assert typed(f"check {path}") == 2
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
