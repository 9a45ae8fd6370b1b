"""Collision geometry of URDF and SDF as surfaces: against MuJoCo, which reads URDF, against each other, and notes."""

import re
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.mechanics.imports import convert
from ephs.mechanics.imports.collisions import FRICTION, LOSS, SINKING, SLIP
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.mechanics.shapes.pairs import touches
from ephs.semantics.spaces import SE3
from tests.mechanics.imports.test_mjcf_contacts import loaded
from tests.mechanics.shapes.test_meshes import binary_stl, cube
from tests.numerics import seeds

SINGLE = 1e-6
"""MuJoCo keeps meshes in single precision, and its general distances have this tolerance."""
MASS, RADIUS = 2.0, 0.2
LINK = """
<link name="{name}"><inertial><mass value="2"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>{collisions}</link>
"""
SOLIDS = {
    "box": ('<box size="0.1 0.2 0.3"/>', "<box><size>0.1 0.2 0.3</size></box>"),
    "sphere": ('<sphere radius="0.2"/>', "<sphere><radius>0.2</radius></sphere>"),
    "cylinder": (
        '<cylinder radius="0.1" length="0.4"/>',
        "<cylinder><radius>0.1</radius><length>0.4</length></cylinder>",
    ),
    "capsule": ('<capsule radius="0.1" length="0.4"/>', "<capsule><radius>0.1</radius><length>0.4</length></capsule>"),
    "stl": (
        '<mesh filename="package://it/cube.stl" scale="2 1 0.5"/>',
        "<mesh><uri>model://it/cube.stl</uri><scale>2 1 0.5</scale></mesh>",
    ),
    "obj": ('<mesh filename="cube.obj"/>', "<mesh><uri>cube.obj</uri></mesh>"),
}
SDF = """
<sdf version="1.7"><world name="w"><gravity>0 0 -9.81</gravity>
<model name="ground_plane"><static>true</static><pose>0 0 0.5 0 0 0</pose><link name="link">
  <collision name="c"><pose>0 0 -0.5 0 0 0</pose><geometry><plane><normal>0 0 1</normal></plane></geometry>
  <surface><friction><ode><mu>{mu}</mu></ode></friction>{floor}</surface></collision></link></model>
<model name="it"><pose>0 0 {height} 0 0 0</pose>{model}
<link name="body"><inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>
  <collision name="c"><pose>{pose}</pose><geometry>{solid}</geometry>{surface}</collision></link></model>
</world></sdf>
"""
BALL = SOLIDS["sphere"][1]
GIVEN = {"mu": 0.5, "floor": "", "height": 1.0, "model": "", "pose": "0 0 0 0 0 0", "solid": BALL, "surface": ""}


def beside_meshes(text, folder, suffix, **options):
    (folder / "cube.stl").write_bytes(binary_stl(cube()))
    lines = [f"v {x} {y} {z}" for x, y, z in cube().reshape(-1, 3)]
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, len(lines), 3)]
    (folder / "cube.obj").write_text("\n".join(lines), encoding="utf-8")
    return loaded(text, folder, suffix, **options)


def collision(solid, place=(0.0,) * 6, more=""):
    x, y, z, *turn = map(repr, place)
    origin = f'<origin xyz="{x} {y} {z}" rpy="{" ".join(turn)}"/>'
    return f"<collision>{origin}<geometry>{solid}</geometry>{more}</collision>"


def robot(*links):
    """Links in a row, each fixed to the one before."""
    joints = (
        f'<joint name="j{i}" type="fixed"><parent link="l{i - 1}"/><child link="l{i}"/></joint>'
        for i in range(1, len(links))
    )
    each = (LINK.format(name=f"l{i}", collisions=collisions) for i, collisions in enumerate(links))
    return f'<robot name="it">{"".join(each)}{"".join(joints)}</robot>'


def distance(surface, at):
    """From a surface in a fixed link to a ball of radius `RADIUS`, which a single gap measures."""
    ball = np.array([1.0, 0.0, 0.0, 0.0, *at])
    (((here, there, gap),), _) = touches(surface.shape, surface.frame, {"sphere": RADIUS}, ball)
    return float(gap.distance(SE3.compose(SE3.inverse(here), there)))


places = st.tuples(*[st.floats(-0.5, 0.5, width=16)] * 3, *[st.floats(-3.0, 3.0, width=16)] * 3)


@pytest.mark.parametrize("kind", SOLIDS)
@given(place=places, way=seeds)
def test_surfaces_of_a_urdf_are_where_mujoco_has_them_and_those_of_an_sdf_there_too(kind, place, way, tmp_path_factory):
    mujoco = pytest.importorskip("mujoco")
    folder = tmp_path_factory.mktemp("solid")
    away = np.random.default_rng(way).normal(size=3)
    at = 2.0 * away / np.linalg.norm(away)
    text = robot(collision(SOLIDS[kind][0], place))
    scene, _ = beside_meshes(text, folder, "urdf")
    files = {name: (folder / name).read_bytes() for name in ("cube.stl", "cube.obj")}
    spec = mujoco.MjSpec.from_string(text.replace("package://it/", ""), assets=files)
    spec.worldbody.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], pos=at)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ball = model.geom("ball").id
    expected = mujoco.mj_geomDistance(model, data, 1 - ball, ball, 10.0, None)
    (surface,) = scene.surfaces.values()
    assert distance(surface, at) == pytest.approx(expected, abs=10 * SINGLE)
    pose = " ".join(map(repr, place))
    other, _ = beside_meshes(SDF.format(**GIVEN | {"pose": pose, "solid": SOLIDS[kind][1]}), folder, "sdf")
    assert distance(other.surfaces["body_c"], at) == pytest.approx(distance(surface, at), abs=1e-12)


def test_links_of_a_urdf_meet_a_floor_and_not_each_other(tmp_path):
    text = robot(collision(SOLIDS["sphere"][0]), collision(SOLIDS["stl"][0]), collision(SOLIDS["box"][0]) * 2)
    scene, said = beside_meshes(text, tmp_path, "urdf", base="free")
    assert set(scene.surfaces) == {"l0", "l1", "l2_1", "l2_2"} and not scene.contacts
    assert "not modelled: contacts between the links of: it" in said
    floor = '\n[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\n'
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        convert(tmp_path / "model.urdf", tmp_path / "whole.toml", base="free", contact=True)
        (tmp_path / "whole.toml").write_text((tmp_path / "whole.toml").read_text() + floor, encoding="utf-8")
        outer = 'format = 1\nname = "hall"\n[parts.it]\nuse = "model.urdf"\nposition = [0.0, 0.0, 1.0]\n' + floor
        (tmp_path / "hall.toml").write_text(outer, encoding="utf-8")
        whole, hall = ephs.load(tmp_path / "whole.toml"), ephs.load(tmp_path / "hall.toml", "free", contact=True)
    law = ConstitutiveLaw(3 * MASS / SINKING**2, loss=LOSS, friction=FRICTION, slip=SLIP)
    for each, prefix in ((whole, ""), (hall, "it.")):
        pairs = {frozenset(contact.surfaces) for contact in each.contacts.values()}
        assert pairs == {frozenset((prefix + name, "floor")) for name in scene.surfaces}
        assert all(contact.law == law for contact in each.contacts.values())


def test_a_link_has_the_numbers_that_bullet_reads(tmp_path):
    numbers = '<contact><lateral_friction value="0.25"/><stiffness value="3e4"/></contact>'
    beside_meshes(robot(collision(SOLIDS["sphere"][0]) + numbers), tmp_path, "urdf")
    floor = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\n'
    (tmp_path / "hall.toml").write_text(
        'format = 1\nname = "hall"\n[parts.it]\nuse = "model.urdf"\n' + floor, encoding="utf-8"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = ephs.load(tmp_path / "hall.toml", "free", contact=True)
    assert [each.law for each in scene.contacts.values()] == [ConstitutiveLaw(3e4, loss=LOSS, friction=0.25, slip=SLIP)]


def test_an_sdf_rests_on_its_ground_with_the_numbers_of_both(tmp_path):
    kp = "<surface><contact><ode><kp>2e4</kp></ode></contact><friction><ode><mu>0.7</mu></ode></friction></surface>"
    soft = "<contact><ode><kp>6e4</kp></ode></contact>"
    scene, said = beside_meshes(SDF.format(**GIVEN | {"surface": kp, "floor": soft, "height": 0.2}), tmp_path, "sdf")
    (contact,) = scene.contacts.values()
    assert contact.law == ConstitutiveLaw(contact.law.stiffness, loss=LOSS, friction=0.5, slip=SLIP)
    assert contact.law.stiffness == pytest.approx(1.5e4, rel=1e-15)
    assert "contact" not in said
    sol = ephs.simulate(scene, 2.0, method="radau")
    assert RADIUS - sol.body("body").position[-1, 2] == pytest.approx(MASS * 9.81 / 1.5e4, rel=1e-4)


def test_links_of_an_sdf_meet_each_other_where_it_says_so(tmp_path):
    more = "<self_collide>true</self_collide>" + "".join(
        f'<link name="{name}"><pose>{x} 0 0 0 0 0</pose><inertial><mass>1</mass></inertial>'
        f'<collision name="c"><geometry>{BALL}</geometry></collision></link>'
        for name, x in (("a", 2), ("b", 4))
    )
    joint = '<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>'
    for model, expected in ((more + joint, 2), (more.replace("true", "false") + joint, 0)):
        scene, _ = beside_meshes(SDF.format(**GIVEN | {"model": model}), tmp_path, "sdf")
        inner = [c for c in scene.contacts.values() if "ground_plane_link_c" not in c.surfaces]
        assert len(scene.contacts) == 3 + expected and len(inner) == expected


def test_a_joint_that_a_mimic_holds_has_no_limits(tmp_path):
    text = robot("", "", "")
    text = text.replace('name="j1" type="fixed">', 'name="j1" type="revolute"><limit lower="-1" upper="1"/>')
    text = text.replace('name="j2" type="fixed">', 'name="j2" type="revolute"><mimic joint="j1" multiplier="0"/>'
                        '<limit lower="-1" upper="1"/>')  # fmt: skip
    scene, _ = beside_meshes(text, tmp_path, "urdf")
    assert scene.joint("j2").limits is None and scene.joint("j2").motion is not None


URDF_NOTES = {
    "cone": (robot(collision("<cone/>")), "contacts with other shapes: cone of l0"),
    "no size": (robot(collision('<sphere radius="0"/>')), "contacts with shapes without size: l0"),
    "no file": (robot(collision('<mesh filename="none.stl"/>')), "meshes that are no readable file.*: none.stl"),
    "dae": (robot(collision('<mesh filename="x.dae"/>')), "contacts with meshes that are neither STL nor OBJ: x.dae"),
    "broken": (robot(collision('<mesh filename="broken.stl"/>')), r"contacts with meshes that cannot be read: broken"),
    "empty": (robot(collision('<mesh filename="empty.obj"/>')), r"contacts with .* read: empty.obj \(no points\)"),
    "infinite": (robot(collision('<mesh filename="inf.obj"/>')), r"contacts with .* read: inf.obj \(a number that"),
    "flat": (robot(collision('<mesh filename="flat.obj"/>')), "contacts with meshes that have no volume: l0"),
    "concave": (
        robot(collision('<mesh filename="dent.obj"/>')), r"contacts inside of convex hulls: l0 \(0.25 m deep\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", URDF_NOTES)
def test_what_is_lost_of_a_urdf_is_said_by_name(kind, tmp_path):
    text, said = URDF_NOTES[kind]
    (tmp_path / "x.dae").write_text("<COLLADA/>", encoding="utf-8")
    (tmp_path / "broken.stl").write_text("vertex 1 2", encoding="utf-8")
    (tmp_path / "empty.obj").write_text("# cut off", encoding="utf-8")
    (tmp_path / "inf.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 inf\n", encoding="utf-8")
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n", encoding="utf-8")
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    dent = [*corners.tolist(), [0.5, 0.5, 0.75]]
    (tmp_path / "dent.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in dent), encoding="utf-8")
    _, found = beside_meshes(text, tmp_path, "urdf")
    assert re.search(f"not modelled: {said}", found), found


def test_a_model_that_is_not_static_moves_beside_the_other(tmp_path):
    scene, _ = beside_meshes(SDF.format(**GIVEN).replace("<static>true</static>", ""), tmp_path, "sdf")
    assert {name.partition("::")[0] for name in scene.bodies} == {"ground_plane", "it"}
