"""MJCF beyond the robots: meshes, defaults, frames, flags; formats are known by what is in the file."""

import mujoco
import numpy as np
import pytest

import ephs
from ephs.mechanics.imports.read import read_model
from ephs.mechanics.shapes.dry import Dry
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.imports.by_mujoco import assert_accelerates_alike, compiled, forward
from tests.mechanics.imports.models import MODELS, URDF
from tests.numerics import largest

pytestmark = pytest.mark.filterwarnings("ignore::ephs.ModelWarning")

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 0.7, 0], [0, 0.2, 0.5]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
OBJ = "".join("v {} {} {}\n".format(*c) for c in CORNERS) + "".join(
    "f {} {} {}\n".format(*(i + 1 for i in f)) for f in FACES
)
RICH = """<mujoco model="rich">
  <compiler meshdir="parts" eulerseq="zyx"/>
  <option gravity="0 0 -2"><flag contact="disable"/></option>
  <default><joint damping="0.1"/><default class="big"><geom density="500"/></default></default>
  <asset><mesh name="wedge" file="wedge.obj" scale="0.5 0.5 1"/><material name="red"/>
    <texture name="t" type="2d" builtin="flat" width="4" height="4"/></asset>
  <visual><map znear="0.1"/></visual>
  <worldbody>
    <light pos="0 0 1"/><geom type="plane" size="1 1 1" material="red"/>
    <frame pos="0 0 1" euler="30 20 10">
      <body name="arm" childclass="big"><joint name="a" axis="0 1 0"/>
        <geom type="mesh" mesh="wedge" pos="0.1 0 0.2" euler="0 0 40" material="red"/>
        <replicate count="2" offset="0.3 0 0"><body name="leg" pos="0 0 0.5"><joint axis="1 0 0"/>
          <geom type="ellipsoid" size="0.1 0.2 0.3"/></body></replicate></body>
    </frame>
  </worldbody>
  <keyframe><key qpos="1 1 1"/></keyframe>
</mujoco>"""


@pytest.fixture
def rich(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/wedge.obj").write_text(OBJ)
    path = tmp_path / "rich.xml"
    path.write_text(RICH)
    return path


def test_mujoco_accelerates_alike(rich):
    scene = ephs.load(rich)
    assert ephs.dynamics(scene).joints == ("a", "leg0_joint", "leg1_joint")
    assert_accelerates_alike(compiled(rich), scene, [1.0, -2.0, 0.5], [0.3, -0.4, 0.5])


def test_meshes_are_where_mujoco_has_them(rich):
    model = compiled(rich)
    data = forward(model)
    body = ephs.load(rich).body("arm")
    (shape,) = body.shapes
    assert shape["mesh"] == str(rich.parent / "parts/wedge.obj")
    inside = (
        np.array(shape["position"]) + (CORNERS * shape["scale"]) @ quaternion_to_matrix(np.array(shape["rotation"])).T
    )
    found = body.pose[4:] + inside @ quaternion_to_matrix(body.pose[:4]).T
    (geom,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    expected = data.geom_xpos[geom] + model.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T
    apart = np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1)
    assert apart.max() < 1e-6  # single precision


def test_flags_are_kept(write):
    body = (
        '<body name="a"><joint name="j" axis="0 1 0" damping="1" stiffness="2"/><geom size="0.1" pos="1 0 0"/></body>'
    )

    def load(flag):
        return ephs.load(write(f"<mujoco><option><flag {flag}/></option><worldbody>{body}</worldbody></mujoco>", "xml"))

    assert load('gravity="disable"').world.gravity.tolist() == [0.0, 0.0, 0.0]
    assert load('spring="disable"').joint("j").stiffness.tolist() == [0.0]
    assert load('damper="disable"').joint("j").friction.tolist() == [[0.0]]
    kept = load('contact="disable"').joint("j")
    assert (kept.stiffness.tolist(), kept.friction.tolist()) == ([2.0], [[1.0]])


@pytest.mark.parametrize("rate", [-2.0, 3.0])
def test_dry_friction_of_a_sliding_joint_is_mujocos(write, rate):
    bodies = "".join(
        f"""<body name="{name}"><joint name="{name}" {kind} damping="0.1" frictionloss="{loss}"/>
        <geom size="0.1" pos="0.3 0 0.2"/>"""
        for name, kind, loss in (("turn", 'axis="0 1 0"', 0.7), ("slide", 'type="slide" axis="1 0 1"', 4.0))
    )
    path = write(f"<mujoco><worldbody>{bodies}</body></body></worldbody></mujoco>", "xml")
    scene = ephs.load(path)
    assert (scene.joint("turn").dry, scene.joint("slide").dry) == (Dry(0.7), Dry(4.0))
    # a regularised law: sqrt(rate² + slip²) = rate (1 + 1e-7)
    assert_accelerates_alike(compiled(path), scene, [rate, -rate], within=1e-6)


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf"])
def test_a_format_is_known_by_its_first_element(ending, tmp_path):
    path = tmp_path / f"model{ending}"
    path.write_text(URDF)
    assert ephs.load(path).name == "arm"


def test_a_model_may_be_a_part(tmp_path):
    (tmp_path / "arm.urdf").write_text(MODELS["urdf"])
    path = tmp_path / "scene.toml"
    path.write_text('format = 1\n[parts.left]\nuse = "arm.urdf"\nposition = [0.0, 1.0, 0.0]\n')
    with pytest.warns(ephs.ModelWarning, match=r"parts\.left: not modelled: limits of: shoulder") as caught:
        scene = ephs.load(path)
    assert len(caught) == 1
    alone = ephs.load(tmp_path / "arm.urdf")
    moved = scene.body("left.spin").pose[4:] - alone.body("spin").pose[4:]
    assert largest(moved - [0.0, 1.0, 0.0]) < 1e-14


HEAVY = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1"/>
<body name="arm" pos="0 0 9"><joint name="hinge" axis="0 1 0"/>
  <inertial pos="0.1 0 0" mass="{mass}" {given}/></body>
<body name="door" pos="3 0 9"><joint name="leaf" axis="0 0 1" springdamper="0.2 0.5"/>
  <inertial pos="0 0 0" mass="{mass}" {given}/></body>
<body name="ball" pos="0 5 0.1"><freejoint/><inertial pos="0 0 0" mass="{mass}" {given}/>
  <geom name="s" size="0.1"/></body>
{more}</worldbody><actuator><position name="servo" joint="hinge" kp="100" dampratio="0.7"/></actuator></mujoco>"""
ODD = """<body name="odd" pos="0 0 20"><joint name="o"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 5"/></body>"""


@pytest.mark.parametrize("more", ["", ODD])
@pytest.mark.parametrize("given", ['diaginertia="{0} {1} {2}"', 'fullinertia="{0} {1} {2} 0.001 0 0"'])
@pytest.mark.filterwarnings("ignore::ephs.SceneWarning")
def test_what_follows_from_masses_follows_from_those_of_the_file(more, given, write):
    mass, (x, y, z) = 50.0, (0.2, 0.3, 0.4)
    text = HEAVY.format(mass=mass, given=given.format(x, y, z), more=more)
    scene = ephs.load(write(text, "xml"), contact=True)
    # MuJoCo's documentation: damping 2 ζ √(k I) of a servo; of a spring k = I/(τ ζ)², damping 2 I/τ
    inertia = y + mass * 0.1**2
    assert np.isclose(scene.joint("hinge").friction[0, 0], 2.0 * 0.7 * np.sqrt(100.0 * inertia), rtol=1e-12)
    assert np.isclose(scene.joint("leaf").stiffness[0], z / (0.2 * 0.5) ** 2, rtol=1e-12)
    assert np.isclose(scene.joint("leaf").friction[0, 0], 2.0 * z / 0.2, rtol=1e-12)
    whole = 3.0 * mass + (1.0 if more else 0.0)
    assert np.isclose(scene.contacts["floor_s"].law.stiffness, whole / 0.02**2, rtol=1e-12)
    found = scene.body("arm").inertia
    assert largest(np.diag(found) - [x, y, z]) < 1e-14
    assert abs(found[0, 1] - (0.001 if "full" in given else 0.0)) < 1e-15


HAND = """<mujoco model="sub"><compiler meshdir="parts" angle="degree"/><default><joint damping="0.3"/></default>
<asset><mesh name="m" file="wedge.obj"/>{deeper}</asset><worldbody><body name="hand" pos="0 0 0.1">
<joint name="k" axis="0 1 0" range="-30 30"/><geom type="mesh" mesh="m"/>{finger}</body></worldbody>
<actuator><motor name="pull" joint="k" gear="2"/></actuator></mujoco>"""
ARM = """<mujoco><compiler angle="radian"/><asset><model name="s" file="sub/hand.xml"/></asset><worldbody>
<body name="arm"><joint name="h" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>
<frame pos="0.5 0 0"><attach model="s" body="hand" prefix="a_"/></frame>
<frame pos="-0.5 0 0" euler="0 0 1"><attach model="s" body="hand" prefix="b_"/></frame></body></worldbody></mujoco>"""
TIP = '<mujoco><worldbody><body name="tip"><joint name="t" axis="0 1 0"/><geom size="0.1"/></body></worldbody></mujoco>'


def test_attached_models_move_as_in_mujoco(tmp_path):
    (tmp_path / "sub/parts").mkdir(parents=True)
    (tmp_path / "sub/parts/wedge.obj").write_text(OBJ)
    deeper, finger = '<model name="d" file="tip.xml"/>', '<attach model="d" body="tip" prefix="f_"/>'
    (tmp_path / "sub/tip.xml").write_text(TIP)
    (tmp_path / "sub/hand.xml").write_text(HAND.format(deeper=deeper, finger=finger))
    (tmp_path / "arm.xml").write_text(ARM)
    model = compiled(tmp_path / "arm.xml")
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    scene = ephs.load(tmp_path / "arm.xml")
    names = [model.joint(j).name for j in range(model.njnt)]
    assert names == ["h", "a_k", "a_f_t", "b_k", "b_f_t"] == [*scene.joints]
    assert set(scene.actuators) == {"a_pull", "b_pull"}
    assert_accelerates_alike(model, scene, *np.random.default_rng(5).standard_normal((2, model.nq)))


@pytest.mark.parametrize(
    ("inertial", "told"), [("", True), ('<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', False)]
)
def test_mass_that_is_lost_with_a_mesh_is_told(inertial, told, tmp_path):
    text = f"""<mujoco><asset><mesh name="m" file="../far.stl"/></asset><worldbody><body name="b"><joint/>{inertial}
    <geom size="0.1"/><geom name="bone" type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    (tmp_path / "model.xml").write_text(text)
    faults, left = [], []
    assert read_model(tmp_path / "model.xml", "fixed", faults, left) is not None
    assert any(line.endswith("masses of shapes whose meshes are not read: bone") for line in left) == told
