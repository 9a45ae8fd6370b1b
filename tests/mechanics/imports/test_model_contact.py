"""Limits and contacts of models in other formats, where they are asked for."""

import warnings

import numpy as np
import pytest

import ephs
from ephs.mechanics.imports import convert

MJCF = """
<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" friction="0.8 0.01 0.002"/>
    <body name="drum" pos="0 0 0.5">
      <freejoint/>
      <geom name="barrel" type="cylinder" size="0.1 0.2" mass="2" friction="0.3 0.005 0.001" solref="0.04 0.5"/>
      <body name="arm" pos="0.3 0 0">
        <joint name="swing" type="hinge" axis="0 1 0" range="-30 45" ref="10" limited="true"/>
        <geom name="rod" type="capsule" size="0.02 0.1" mass="0.5"/>
        <body name="tip" pos="0.2 0 0">
          <joint name="slide" type="slide" axis="1 0 0" range="0 0.1" limited="true"/>
          <geom name="knob" type="sphere" size="0.03" mass="0.1" condim="6"/>
        </body>
      </body>
    </body>
    <body name="nest" pos="0 2 1">
      <freejoint/>
      <geom name="egg" type="ellipsoid" size="0.1 0.1 0.2" mass="0.1"/>
    </body>
    <body name="ghost" pos="1 0 1">
      <freejoint/>
      <geom type="sphere" size="0.1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""
URDF = """
<robot name="arm">
  <link name="post"/>
  <link name="arm"><inertial>
    <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="hinge" type="{kind}">
    <parent link="post"/><child link="arm"/><axis xyz="0 1 0"/><limit {limit} effort="1" velocity="1"/>
  </joint>
</robot>
"""


def loaded(file, **options):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return ephs.load(file, **options), "\n".join(str(one.message) for one in said)


@pytest.fixture
def model(tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "drum.xml"
    file.write_text(MJCF, encoding="utf-8")
    return file


def test_limits_and_contacts_are_those_of_the_model(model):
    scene, said = loaded(model, contact=True)
    contacts = {tuple(c.surfaces): c.law for _, c in scene.all_contacts()}
    assert set(contacts) == {("floor", "barrel"), ("floor", "rod"), ("floor", "knob"), ("barrel", "knob")}
    assert "contacts between: floor and egg, barrel and egg" in said and "limits of" not in said
    barrel, knob = contacts["floor", "barrel"], contacts["floor", "knob"]
    assert barrel.stiffness == pytest.approx(scene_mass(scene) / (0.03 * 0.75) ** 2)
    assert (barrel.friction, barrel.spinning, barrel.rolling) == (0.8, 0.0, 0.0)
    assert (knob.friction, knob.spinning, knob.rolling) == (1.0, 0.01, 0.002)
    assert scene.joint("swing").limits == pytest.approx(np.radians([-40.0, 35.0]))
    assert scene.joint("slide").limits == pytest.approx([0.0, 0.1])


def scene_mass(scene):
    return sum(body.mass for _, body in scene.all_bodies())


def test_by_default_they_are_named_and_left(model):
    scene, said = loaded(model)
    assert not scene.contacts and all(joint.limits is None for joint in scene.joints.values())
    assert "limits of: swing, slide" in said
    assert "contacts of: the world, drum, arm, tip, nest" in said


def test_a_converted_model_touches_too(model, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        convert(model, tmp_path / "drum.toml", contact=True)
        again = ephs.load(tmp_path / "drum.toml")
    scene, _ = loaded(model, contact=True)
    assert [c.law for c in again.contacts.values()] == [c.law for c in scene.contacts.values()]
    assert np.array_equal(again.joint("swing").limits, scene.joint("swing").limits)


def test_a_model_comes_to_rest_on_its_floor(model):
    scene, _ = loaded(model, contact=True)
    sol = ephs.simulate(scene, 2.0, method="radau", rtol=1e-4, atol=1e-6)
    assert np.linalg.norm(sol.body("drum").velocity[-1]) < 0.02
    for name in scene.contacts:
        assert sol.contact(name).gap[-1] > -5e-3
    assert sol.joint("swing").coordinate.min() > np.radians(-40.0) - 0.1


@pytest.mark.parametrize(
    ("kind", "limit", "found"),
    [
        ("revolute", 'lower="-1" upper="2"', [-1.0, 2.0]),
        ("prismatic", 'upper="0.5"', [0.0, 0.5]),
        ("continuous", 'lower="-1" upper="2"', None),
        ("revolute", "", None),
    ],
)
def test_limits_of_a_urdf(kind, limit, found, tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(URDF.format(kind=kind, limit=limit), encoding="utf-8")
    limits = loaded(file, contact=True)[0].joint("hinge").limits
    assert limits is None if found is None else limits == pytest.approx(found)


@pytest.mark.parametrize(("lower", "beyond"), [(0.25, 0.25), (0.005, None), (-1.0, None)])
def test_a_start_beyond_a_limit_is_said_by_name(lower, beyond, tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(URDF.format(kind="revolute", limit=f'lower="{lower}" upper="1"'), encoding="utf-8")
    _, said = loaded(file, contact=True)
    if beyond is None:
        assert "beyond them" not in said
    else:
        assert f"joints.hinge.limits: found a start {beyond} beyond them" in said
