"""URDF: Pinocchio and MuJoCo see the same robot; friction, shapes and names are kept."""

from itertools import pairwise
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.imports.read import read_model
from ephs.mechanics.shapes.dry import Dry
from tests.mechanics.imports.by_mujoco import compiled, forward
from tests.mechanics.imports.models import URDF
from tests.mechanics.imports.pinocchio_robots import compare, robot
from tests.numerics import largest


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_pinocchio_sees_the_same_robot(base, write, quiet):
    path = write(URDF)
    scene, model = quiet(path, base=base), robot(path, base)
    assert sum(joint.dim for joint in scene.joints.values()) == model.nv
    heavy = sum(body.mass for body in scene.bodies.values()) - (3.0 if base == "fixed" else 0.0)  # on the ground
    assert abs(heavy - pin.computeTotalMass(model)) < 1e-14
    assert compare(scene, model, np.random.default_rng(1)) <= 1e-11


def test_links_are_where_pinocchio_has_them(write, quiet):
    path = write(URDF)
    scene, model = quiet(path), robot(path, "fixed")
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    centres = {"turn": [0, 0, 0.3], "spin": [0.2, 0, 0], "slide": [0, 0.1, 0], "plate": [0, 0.1, 0.2]}
    for link, inside in centres.items():
        frame = data.oMf[model.getFrameId(link)]
        centre = frame.act(np.array(inside))
        assert largest(scene.body(link).pose[4:] - centre) < 1e-14
        turned = pin.Quaternion(frame.rotation)
        assert abs(abs(scene.body(link).pose[:4] @ [turned.w, *turned.vec()]) - 1.0) < 1e-14


def test_what_is_kept(write, quiet):
    scene = quiet(write(URDF))
    assert scene.name == "arm"
    assert scene.joints["root_joint"].kind == "fixed"
    assert scene.joints["shoulder"].friction.tolist() == [[0.3]]
    assert scene.joints["shoulder"].dry == Dry(0.1)
    assert scene.bodies["hand_tip"].mass == 0.0
    shapes = scene.bodies["base"].shapes
    assert [(next(iter(shape)), len(shape)) for shape in shapes] == [("box", 3)]
    # the box is 0.1 above the link's frame, whose centre of mass is at (0.1, 0.2, 0.3)
    assert largest(np.array(shapes[0]["position"]) - [-0.1, -0.2, -0.2]) < 1e-15
    assert scene.bodies["turn"].shapes[0]["cylinder"] == [0.05, 0.4]


def test_a_frame_without_mass_rides_along(write, quiet):
    scene = quiet(write(URDF), base="free")
    sol = ephs.simulate(scene.with_state(rates={"rail": 0.5, "shoulder": 1.0}), 0.1)
    between = sol.body("hand_tip").position - sol.body("slide").position
    inside = np.einsum("nji,nj->ni", sol.body("slide").rotation, between)
    assert largest(inside - [0.0, -0.1, 1.0]) < 1e-10
    assert largest(sol.constraint_error) < 1e-10


def test_a_spherical_joint_is_mujocos_ball(write, quiet):
    text = """<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0.1 0 0.3"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.01" ixz="0" iyz="0"/></inertial></link>
    <joint name="j" type="spherical"><parent link="a"/><child link="b"/>
    <origin xyz="0 0.2 0" rpy="0.1 0.2 0.3"/></joint>
    </robot>"""
    dynamics = ephs.dynamics(quiet(write(text)))
    data = forward(compiled(text), rates=[0.3, -0.2, 0.5])
    found = dynamics.acceleration(dynamics.state(rates={"j": data.qvel}))["j"]
    assert largest(found - data.qacc) < 1e-12


def test_the_warning_comes_once_and_names_everything(write):
    with pytest.warns(ephs.ModelWarning) as caught:
        ephs.load(write(URDF))
    assert len(caught) == 1
    text = str(caught[0].message)
    for words in (
        "contacts of: base",
        "limits of: shoulder, rail",
        "transmissions: motor",
        "hand.tip → hand_tip, elbow.pitch → elbow_pitch",
    ):
        assert words in text


MIMIC = URDF.replace('<axis xyz="1 0 2"/>', '<axis xyz="1 0 2"/><mimic joint="shoulder" multiplier="2" offset="0.1"/>')


def test_a_joint_that_mimics_another_follows_it(write, quiet):
    scene = quiet(write(MIMIC))
    moving = scene.with_state(rates={"shoulder": 0.5, "rail": 1.0, "elbow_pitch": 0.2})
    sol = ephs.simulate(moving, 0.3, method="rk87")
    shoulder, rail = sol.joint("shoulder"), sol.joint("rail")
    assert sol.stats["form"] == "reduced"
    assert largest(rail.rate - 2.0 * shoulder.rate) <= 1e-11
    assert largest(rail.coordinate - (2.0 * shoulder.coordinate + 0.1)) <= 1e-11
    assert largest(shoulder.rate - 0.5) > 0.1


def test_a_joint_that_mimics_one_that_mimics_starts_where_that_one_does(write, quiet):
    """Each follows the one before from the start on; a ring of them is named."""
    mimics = {"j1": ("j0", 2.0, 0.4), "j2": ("j1", -1.5, 0.0), "j3": ("j2", 0.5, -0.2)}
    names = ["j0", "j2", "j1", "j3"]  # in an order of the file that is not theirs

    def robot(mimics):
        links = "".join(
            f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>'
            for i in range(5)
        )
        joints = "".join(
            f'<joint name="{name}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="0 0 1"/>'
            + ('<mimic joint="{}" multiplier="{}" offset="{}"/>'.format(*mimics[name]) if name in mimics else "")
            + "</joint>"
            for i, name in enumerate(names)
        )
        return write(f'<robot name="r">{links}{joints}</robot>')

    sol = ephs.simulate(quiet(robot(mimics)).with_state(rates={"j0": 1.0, "j1": 2.0, "j2": -3.0, "j3": -1.5}), 0.2)
    for name, (other, ratio, offset) in mimics.items():
        one, followed = (sol.joint(each).coordinate for each in (name, other))
        assert largest(one - (ratio * followed + offset)) <= 1e-9
        assert offset or largest(one[0]) > 0.1  # the control: without an offset of its own it does not start at 0
    with pytest.warns(ephs.ModelWarning, match=r"mimicry of: j2 \(of j1\), j1 \(of j2\)"):
        ephs.load(robot({"j1": ("j2", 2.0, 0.0), "j2": ("j1", 0.5, 0.0)}))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('multiplier="2"', 'multiplier="two"', "joints.rail.mimic.multiplier"),
    ],
)
def test_mimicry_that_does_not_fit_is_told_by_its_key(write, old, new, words):
    with pytest.raises(ephs.SceneError, match=words):
        ephs.load(write(MIMIC.replace(old, new)))


@pytest.mark.parametrize("other", ["table", "shuolder, which is not there"])
def test_a_joint_that_mimics_no_joint_of_one_freedom_is_named(write, other):
    with pytest.warns(ephs.ModelWarning, match=rf"mimicry of: rail \(of {other}\)"):
        ephs.load(write(MIMIC.replace('mimic joint="shoulder"', f'mimic joint="{other.partition(",")[0]}"')))


NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff"), min_size=1
)


# Every example writes its file anew: the folder may be the same for all.
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    names=st.lists(
        NAMES | st.sampled_from(["ground", "environment", "world", "~a", "a.b", "a_b", "x" * 300]),
        min_size=2,
        unique=True,
    )
)
def test_every_name_becomes_one_that_a_scene_may_have(names, write, quiet):
    links = "".join(f"<link name={quoteattr(name)}/>" for name in names)
    joints = "".join(
        f"<joint name={quoteattr(b)} type='revolute'><parent link={quoteattr(a)}/><child link={quoteattr(b)}/></joint>"
        for a, b in pairwise(names)
    )
    scene = quiet(write(f"<robot name={quoteattr(names[0])}>{links}{joints}</robot>"))
    assert len(scene.bodies) == len(names)
    assert len(scene.joints) == len(names)
    assert scene.system().pattern.boxes
    assert not {"/", "\\"} & set(scene.name)


INTERFACE = """<robot name="r"><link name="base"/><link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" {effort} velocity="0"/></joint>
<transmission name="t"><joint name="j"/><actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>
</transmission></robot>"""


@pytest.mark.parametrize(("effort", "most"), [('effort="0"', 0.0), ('effort="5"', 5.0), ("", np.inf)])
def test_an_actuator_gives_at_most_the_effort_of_its_joint(effort, most, write, quiet):
    scene = quiet(write(INTERFACE.format(effort=effort)))
    weight, inertia = 9.81 * 0.1, 0.01 + 0.1**2
    sol = ephs.simulate(scene, 1e-7, inputs={"actuators.m": -1.0}, method="rk87", save_at=[0.0, 1e-7])
    found = float(np.diff(sol.joint("j").rate[:, 0])[0]) / 1e-7
    assert found == pytest.approx((weight - min(50.0, most)) / inertia, rel=1e-6)


@given(st.lists(st.floats(-np.pi, np.pi), min_size=3, max_size=3), st.floats(0.1, 10.0))
@settings(max_examples=20)
def test_a_quaternion_of_an_origin_is_the_turn_by_its_angles(tmp_path_factory, angles, scale):
    """``quat_xyzw`` of URDF 1.1, of any length; roll, pitch and yaw by the formula of half angles."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(x / 2), np.sin(x / 2)) for x in angles)
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    z, w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    written = " ".join(repr(scale * float(q)) for q in (x, y, z, w))
    folder, found = tmp_path_factory.mktemp("turned"), []
    for way in (f'quat_xyzw="{written}"', 'rpy="{!r} {!r} {!r}"'.format(*angles)):
        text = URDF.replace('rpy="0.3 -0.2 0.7"', way).replace(
            '<origin xyz="0 0 0.3" rpy="1 0.5 0"/>', f"<origin {way}/>"
        )
        (folder / "m.urdf").write_text(text)
        tables = read_model(folder / "m.urdf", "fixed", [], [])
        turn = np.array(tables["joints"]["shoulder"]["frame1"]["rotation"])
        found.append((turn * np.sign(turn[np.argmax(np.abs(turn))]), np.array(tables["bodies"]["turn"]["inertia"])))
    for one, other in zip(*found, strict=True):
        assert largest(one - other) < 64 * np.finfo(float).eps
