"""SDF and MJCF with loops: two formats, one mechanism; and every kind of SDF's joints."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.shapes.dry import Dry
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.imports.models import MJCF, SDF
from tests.numerics import largest


def test_two_formats_describe_one_mechanism(write, quiet):
    scenes = [quiet(write(SDF, "sdf")), quiet(write(MJCF, "xml"))]
    assert [scene.name for scene in scenes] == ["four-bar"] * 2
    assert [scene.joint("motor").dry for scene in scenes] == [Dry(0.01)] * 2
    runs = [ephs.simulate(scene, 1.0, rtol=1e-10, atol=1e-12, save_at=np.linspace(0.0, 1.0, 5)) for scene in scenes]
    for body in ("crank", "coupler", "rocker"):
        assert largest(runs[0].body(body).position - runs[1].body(body).position) < 1e-8
    for run in runs:
        assert largest(run.constraint_error) < 1e-10
        assert run.summary()["mobility"] == 1


def sdf(joint, version="1.7"):
    """Two links that nothing holds: b turned about x by 90° and moved; and a joint."""
    link = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1.2</iyy><izz>0.9</izz></inertia></inertial>"
    return f"""<sdf version="{version}"><model name="m"><link name="a"><pose>0 0 1 0 0 0</pose>{link}</link>
    <link name="b"><pose degrees="true">1 0 1 90 0 0</pose>{link}</link>
    <joint name="j" {joint}</joint></model></sdf>"""


ENDS = "<parent>a</parent><child>b</child>"
HALF = np.sqrt(0.5)
# joint: (kind, twists of b in world axes (angular, linear) that its freedoms make, of b's frame's origin)
JOINTS = {
    f'type="revolute">{ENDS}<axis><xyz>0 1 0</xyz></axis>': ("revolute", [[0, 0, 1, 0, 0, 0]]),
    f'type="continuous">{ENDS}<pose>0 0 -1 0 0 0</pose><axis><xyz>1 0 0</xyz></axis>': (
        "revolute",
        [[1, 0, 0, 0, 0, -1]],  # b is 1 m off the axis, towards −y
    ),
    f'type="prismatic">{ENDS}<axis><xyz expressed_in="a">1 0 1</xyz></axis>': ("prismatic", [[0, 0, 0, HALF, 0, HALF]]),
    f'type="prismatic">{ENDS}<axis><xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame></axis>': (
        "prismatic",
        [[0, 0, 0, 0, 0, 1]],
    ),
    f'type="screw">{ENDS}<screw_thread_pitch>0.5</screw_thread_pitch><axis><xyz>0 1 0</xyz></axis>': (
        "screw",
        [[0, 0, 1, 0, 0, 0.5 / (2 * np.pi)]],
    ),
    f'type="screw">{ENDS}<thread_pitch>-20</thread_pitch><axis><xyz>0 1 0</xyz></axis>': (
        "screw",
        [[0, 0, 1, 0, 0, 0.05]],
    ),
    f'type="universal">{ENDS}<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>': (
        "universal",
        [[1, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]],
    ),
    f'type="revolute2">{ENDS}<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>': (
        "universal",
        [[0, 0, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0]],
    ),
    f'type="ball">{ENDS}': ("spherical", None),
    f'type="fixed">{ENDS}': ("fixed", []),
}


@pytest.mark.parametrize("joint", JOINTS, ids=lambda j: j.split('"')[1])
def test_joints_of_sdf_move_as_specified(joint, write, quiet):
    kind, twists = JOINTS[joint]
    scene = quiet(write(sdf(joint), "sdf"))
    assert scene.joints["j"].kind == kind
    assert (scene.joints["root_joint"].kind, scene.joints["root_joint"].body2) == ("free", "a")
    assert largest(scene.body("b").pose - [HALF, HALF, 0, 0, 1, 0, 1]) < 1e-14
    dynamics = ephs.dynamics(scene)
    jacobian = dynamics.jacobian(dynamics.state0, "b")[:, dynamics.freedoms["j"]]
    turn = quaternion_to_matrix(scene.body("b").pose[:4])
    found = np.vstack([turn @ jacobian[:3], turn @ jacobian[3:]])
    if twists is None:  # a ball: every rotation about b's origin, in b's axes
        assert largest(found[:3].T @ found[:3] - np.eye(3)) < 1e-14
        assert largest(found[3:]) < 1e-14
    else:
        assert largest(found - np.array(twists, dtype=float).reshape(-1, 6).T, initial=0.0) < 1e-14


def test_axes_of_old_files_are_the_models(write, quiet):
    text = sdf(f'type="prismatic">{ENDS}<axis><xyz>0 0 1</xyz></axis>', "1.4")
    dynamics = ephs.dynamics(quiet(write(text, "sdf")))
    jacobian = dynamics.jacobian(dynamics.state0, "b", [0.0, 0.0, 0.0])[:, dynamics.freedoms["j"]]
    assert largest(jacobian.ravel() - [0, 0, 1]) < 1e-14


def test_a_gearbox_is_noted_and_the_rest_runs(write):
    text = sdf(f'type="fixed">{ENDS}').replace(
        "</model>", f'<joint name="g" type="gearbox">{ENDS}<gearbox_ratio>3</gearbox_ratio></joint></model>'
    )
    with pytest.warns(ephs.ModelWarning, match="gearboxes: g"):
        assert list(ephs.load(write(text, "sdf")).joints) == ["root_joint", "j"]


WELDED = """<mujoco><worldbody>
  <body name="a" pos="0 0 1"><freejoint name="fly"/><geom name="g" size="0.1"/>
    <body name="held" pos="0.3 0 0"><joint name="lock" axis="0 1 0"/><joint name="slow" type="slide" axis="1 0 0"/>
      <geom size="0.1"/></body></body>
  <body name="b" pos="1 0 1.5" euler="0 30 0"><freejoint/><geom size="0.1"/></body>
</worldbody><equality>
  <weld name="glue" body1="a" body2="b" anchor="0.2 0.1 0.3"/><joint name="stop" joint1="lock"/>
  <joint name="couple" joint1="lock" joint2="slow" polycoef="0 1 0.5 0 0"/>
  <connect name="idle" body1="a" body2="b" anchor="0 0 0" active="false"/>
</equality><actuator><position name="servo" joint="lock" kp="3"/></actuator></mujoco>"""


def test_equalities_that_are_lower_pairs_hold(write):
    with pytest.warns(ephs.ModelWarning) as caught:
        scene = ephs.load(write(WELDED, "xml"))
    text = str(caught[0].message)
    assert "equality constraints that are neither lower pairs nor constant ratios: couple" in text
    assert "inactive equality constraints: idle" in text
    assert "not modelled: actuators: servo" in text
    assert "softness of equality constraints: glue, stop" in text
    assert scene.joints["glue"].kind == "fixed"
    assert scene.joints["lock"].motion == ephs.PolynomialMotion((0.0,))
    assert scene.joints["b_joint"].kind == "free"
    assert list(scene.bodies) == ["a", "held", "held_after_lock", "b"]
    sol = ephs.simulate(scene.with_state(rates={"slow": 1.0}), 0.3)
    assert largest(sol.joint("lock").coordinate) < 1e-12
    assert largest(sol.constraint_error) < 1e-10
    apart = sol.body("b").position - sol.body("a").position
    assert largest(apart - [1.0, 0.0, 0.5]) < 1e-9


def test_frames_stand_for_their_links_and_place_the_model(write, quiet):
    text = sdf('type="fixed"><parent>on_a</parent><child>b</child>').replace(
        '<model name="m">',
        '<model name="m" placement_frame="on_a"><pose>5 0 0 0 0 0</pose>'
        '<frame name="deep" attached_to="a"/><frame name="on_a" attached_to="deep"><pose>0 2 0 0 0 0</pose></frame>',
    )
    scene = quiet(write(text, "sdf"))
    assert (scene.joints["j"].body1, scene.joints["j"].body2) == ("a", "b")
    # on_a is 2 m beside a, and comes to lie at x = 5
    assert largest(scene.body("a").pose - [1, 0, 0, 0, 5, -2, 0]) < 1e-14


def test_a_pose_may_be_a_quaternion(write, quiet):
    text = sdf(f'type="fixed">{ENDS}').replace(
        '<pose degrees="true">1 0 1 90 0 0</pose>', '<pose rotation_format="quat_xyzw">1 0 1 0.6 0 0 0.8</pose>'
    )
    scene = quiet(write(text, "sdf"))
    assert largest(scene.body("b").pose - [0.8, 0.6, 0, 0, 1, 0, 1]) < 1e-14


SCREW = """<mujoco><worldbody><body name="nut" pos="0.1 0 1">
  {joints}
  <inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.1 0.2"/></body></worldbody>
<equality><joint name="thread" joint1="{first}" joint2="{second}" polycoef="0 {ratio} 0 0 0"/></equality></mujoco>"""
TURN = '<joint name="turn" axis="0 0 1" damping="0.1"/>'


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("first", "second", "ratio"), [("rise", "turn", 0.05), ("turn", "rise", 20.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_hinge_and_a_slide_in_a_ratio_are_a_screw(order, first, second, ratio, sign, write):
    rise = f'<joint name="rise" type="slide" axis="0 0 {sign}" damping="4"/>'
    text = SCREW.format(joints="".join([TURN, rise][::order]), first=first, second=second, ratio=ratio)
    with pytest.warns(ephs.ModelWarning, match="rise → turn"):
        scene = ephs.load(write(text, "xml"))
    assert list(scene.bodies) == ["nut"]
    joint = scene.joint("turn")
    assert (joint.kind, joint.dim) == ("screw", 1)
    assert abs(joint.pitch - sign * 0.05) < 1e-15
    assert abs(joint.friction[0, 0] - (0.1 + 0.05**2 * 4.0)) < 1e-15
    dynamics = ephs.dynamics(scene)
    expected = -sign * 2.0 * 9.81 * 0.05 / (0.2 + 2.0 * 0.3**2 + 2.0 * 0.05**2)
    assert abs(dynamics.acceleration(dynamics.state0)["turn"][0] - expected) < 1e-12


def test_what_else_holds_the_slide_of_a_screw_is_named(write):
    text = SCREW.format(joints=TURN + '<joint name="rise" type="slide"/>', first="rise", second="turn", ratio=0.05)
    more = text.replace("</equality>", '<joint name="stop" joint1="rise"/></equality>')
    with pytest.warns(ephs.ModelWarning, match="neither lower pairs nor constant ratios: stop"):
        assert ephs.load(write(more, "xml")).joint("turn").kind == "screw"


RATIO = """<mujoco><worldbody>
  <body name="a"><joint name="one" axis="0 1 0" armature="0.3"/><geom size="0.1" pos="0.2 0 0"/></body>
  <body name="b" pos="0 1 0"><joint name="two" axis="0 1 0" armature="0.1"/><geom size="0.1" pos="0.1 0 0"/></body>
</worldbody><actuator><motor name="servo" joint="two" gear="50"/></actuator>
<equality><joint name="couple" joint1="one" joint2="two" polycoef="0 -2 0 0 0"/></equality></mujoco>"""


def test_joints_in_a_ratio_are_geared_and_armatures_are_kept(write):
    with pytest.warns(ephs.ModelWarning, match="softness"):
        scene = ephs.load(write(RATIO, "xml"))
    assert (scene.actuators["servo"].joints, scene.actuators["servo"].ratio) == (["two"], [50.0])
    assert [scene.joints[name].armature for name in ("one", "two")] == [0.3, 0.1]
    sol = ephs.simulate(scene, 0.3, method="rk87")
    one, two = sol.joint("one"), sol.joint("two")
    assert largest(one.coordinate - -2.0 * two.coordinate) <= 1e-12
    mass, moment = scene.bodies["a"].mass, scene.bodies["a"].inertia[1, 1]
    inertia = 4.0 * (0.3 + moment + 0.04 * mass) + 0.1 + moment + 0.01 * mass
    start = (sol.joint("two").rate[1, 0] - sol.joint("two").rate[0, 0]) / (sol.t[1] - sol.t[0])
    assert np.isclose(start, 9.81 * mass * (0.1 - 0.4) / inertia, rtol=1e-3)


HELD = """<mujoco><worldbody><site name="hook" pos="0 0 1"/>
<body name="bar" pos="0 0 1"><freejoint name="fly"/><inertial pos="0.5 0 0" mass="1" diaginertia="0.001 0.1 0.1"/>
<site name="eye"/></body></worldbody><equality><weld {weld}/></equality></mujoco>"""
# words of a weld: acceleration about y; the pin of the third is 1 m below, where the anchor is
WELDS = {
    'site1="hook" site2="eye"': 0.0,
    'site1="hook" site2="eye" torquescale="0.3"': 0.0,
    'body1="bar" anchor="0 0 0" torquescale="0"': 9.81 * 0.5 / (0.1 + 0.5**2 + 1.0**2),
    'site1="hook" site2="eye" torquescale="0"': 9.81 * 0.5 / (0.1 + 0.5**2),
}


@pytest.mark.parametrize("weld", WELDS)
def test_a_weld_without_torques_is_a_pin(weld, write, quiet):
    dynamics = ephs.dynamics(quiet(write(HELD.format(weld=weld), "xml")))
    found = dynamics.acceleration(dynamics.state0)["fly"]
    assert found[1] == pytest.approx(WELDS[weld], rel=1e-12, abs=1e-12)
    assert largest(found[[0, 2]]) < 1e-12


STOP = """<mujoco><compiler angle="radian"/><worldbody><body name="arm" pos="0 0 1">
<joint name="h" {kind} range="-0.5 0.5" {law}/><inertial pos="0.3 0 0" mass="1" diaginertia="0.001 0.01 0.01"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("kind", ['axis="0 1 0"', 'type="slide" axis="0 0 -1"'])
@pytest.mark.parametrize("law", ["", 'solreflimit="0.01 1"', 'solreflimit="-2500 -100"'])
def test_a_stop_of_mujoco_does_not_rebound(kind, law, write):
    path = write(STOP.format(kind=kind, law=law), "xml")
    scene = ephs.load(path, contact=True)
    joint = ephs.simulate(scene.with_state({"h": 0.4}), 1.0, rtol=1e-8, atol=1e-10).joint("h")
    at, rate = joint.coordinate[:, 0], joint.rate[:, 0]
    struck = int(np.argmax(at > 0.5))
    assert rate[struck] > 1.0
    assert rate[struck:].min() >= -0.1  # the inverse of the loss
    inertia = 0.01 + 0.3**2 if "slide" not in kind else 1.0
    time = 0.01 if "0.01" in law else 0.02
    assert np.isclose(scene.joint("h").stop.stiffness, inertia / time**2, rtol=1e-12)
