"""What a scene file says is what the scene holds."""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from ephs import PolynomialMotion
from ephs.mechanics.scene import SceneError
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.load import load
from ephs.mechanics.scene.schema import json_schema
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.scene.test_scene_assembly import residuals
from tests.scenes import SCENES

SAMPLES = sorted((Path(__file__).parent / "data").glob("*.toml"))

BODY = "[bodies.a]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n"


@pytest.mark.parametrize("path", SCENES + SAMPLES, ids=lambda path: path.stem)
def test_scene_files_load_and_close(path):
    scene = load(path)
    gap, slip = residuals(scene)
    assert gap < 1e-8 and slip < 1e-7
    assert scene.source == str(path)
    assert scene.adjusted is None
    assert all(name in str(scene) for name, _ in scene.all_bodies())


def test_shipped_scenes_are_the_six():
    names = {path.stem for path in SCENES}
    assert {"mbs", "slider-crank", "heavy-top", "four-bar", "chain", "universal"} <= names
    for path in SCENES:
        assert load(path).name == path.stem
        assert all(body.shape is not None for _, body in load(path).all_bodies())


def test_values_of_a_body(scene):
    loaded = scene(
        "[world]\ngravity = [0, 0, -1]\ntemperature = 300\n"
        "[bodies.a]\nmass = 2\ninertia = [3.0, 4.0, 5.0, 0.1, 0.2, 0.3]\n"
        "position = [1.0, 2.0, 3.0]\nrotation = [0.6, 0.0, 0.8, 0.0]\n"
        "velocity = [1.0, 0.0, 0.0]\nangular_velocity = [0.1, 0.2, 0.3]\nshape = { cylinder = [0.1, 2.0] }\n"
    )
    body = loaded.body("a")
    assert body.inertia.tolist() == [[3.0, 0.1, 0.2], [0.1, 4.0, 0.3], [0.2, 0.3, 5.0]]
    assert body.pose.tolist() == [0.6, 0.0, 0.8, 0.0, 1.0, 2.0, 3.0]
    assert body.twist[:3].tolist() == [0.1, 0.2, 0.3]
    # Rᵀ v for a turn about y
    np.testing.assert_allclose(body.twist[3:], [0.36 - 0.64, 0.0, 0.96], atol=1e-15)
    assert body.shape == {"cylinder": [0.1, 2.0]}
    assert (loaded.world.temperature, loaded.world.pressure) == (300.0, 101325.0)
    assert loaded.name == "scene"
    with pytest.raises(ValueError, match="read-only"):
        body.pose[0] = 1.0


def test_defaults(scene):
    loaded = scene(BODY)
    assert loaded.world.gravity.tolist() == [0.0, 0.0, -9.81]
    assert loaded.world.temperature == 293.15
    assert loaded.body("a").pose.tolist() == [1.0, 0, 0, 0, 0, 0, 0]
    assert not loaded.body("a").twist.any()
    half = scene(BODY + "rotation = [0.0, 1.0, 0.0, 0.0]\nangular_velocity = [1.0, 0.0, 0.0]\n")
    assert half.body("a").pose.tolist() == [0.0, 1.0, 0, 0, 0, 0, 0]
    assert half.body("a").twist.tolist() == [1.0, 0, 0, 0, 0, 0]


def test_the_whole_joint_table(scene):
    """Every key of a joint that may stand beside the others, at its default or not."""
    loaded = scene(
        BODY + "[thermal.housing]\ncapacity = 50.0\ntemperature = 300.0\n"
        "[conduction.c]\nbetween = ['housing', 'environment']\nconductance = 0.2\n"
        "[joints.pin]\ntype = 'revolute'\nbodies = ['ground', 'a']\nat = [0.0, 0.1, 0.12]\n"
        "axis = [1.0, 0.0, 0.0]\nxaxis = [0.0, 1.0, 0.0]\ncoordinate = 0.0\nrate = 0.0\npitch = 0.0\n"
        "friction = 0.5\nstiffness = 2.0\nrest = 0.25\nheat = 'housing'\n"
        "drive = 0.0\nmotion = { rate = 1.0 }\n"
    )
    j = loaded.joint("pin")
    assert (j.friction.tolist(), j.stiffness.tolist(), j.rest.tolist()) == ([[0.5]], [2.0], [0.25])
    assert (j.heat, j.motion, j.drive.tolist(), j.dim) == ("housing", PolynomialMotion((1.0,)), [0.0], 1)
    frame = quaternion_to_matrix(j.frame1[:4])
    np.testing.assert_allclose(frame, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    assert j.frame1[4:].tolist() == [0.0, 0.1, 0.12]
    # The motion moves the body, which gives no velocity of its own.
    np.testing.assert_allclose(loaded.body("a").twist, [1.0, 0, 0, 0, 0.12, -0.1], atol=1e-15)
    assert loaded.conduction["c"].between == ["housing", "environment"]


@pytest.mark.parametrize(
    "axis, x",
    [("[0.0, 0.0, 2.0]", [1, 0, 0]), ("[1.0, 0.0, 0.0]", [0, 1, 0]), ("[0.95, 0.0, 0.1]", [0, 1, 0])],
)
def test_default_x_axis(axis, x, scene):
    place = f"[joints.j]\ntype = 'revolute'\nbodies = ['ground', 'a']\nat = [0.0, 0.0, 0.0]\naxis = {axis}\n"
    frame = quaternion_to_matrix(scene(BODY + place).joint("j").frame1[:4])
    np.testing.assert_allclose(frame[:, 0], x, atol=1e-15)


@pytest.mark.parametrize(
    "kind, friction, expected",
    [
        ("cylindrical", "0.5", [[0.5, 0.0], [0.0, 0.5]]),
        ("cylindrical", "[1, 2]", [[1.0, 0.0], [0.0, 2.0]]),
        ("cylindrical", "[[2.0, 1.0], [1.0, 2.0]]", [[2.0, 1.0], [1.0, 2.0]]),
        ("revolute", "[[2.0]]", [[2.0]]),
        ("fixed", "0.0", np.zeros((0, 0)).tolist()),
        ("universal", "[1.0, 2.0]", [[1.0, 0.0], [0.0, 2.0]]),
    ],
)
def test_friction_forms(kind, friction, expected, scene):
    axis2 = "axis2 = [1.0, 0.0, 0.0]\n" if kind == "universal" else ""
    loaded = scene(
        BODY + f"[joints.j]\ntype = '{kind}'\nbodies = ['ground', 'a']\nat = [0.0, 0.0, 0.0]\n"
        f"axis = [0.0, 0.0, 1.0]\nfriction = {friction}\n" + axis2
    )
    assert loaded.joint("j").friction.tolist() == expected


def test_spherical_and_free_need_no_axis(scene):
    for kind in ("spherical", "free", "fixed"):
        loaded = scene(BODY + f"[joints.j]\ntype = '{kind}'\nbodies = ['ground', 'a']\nat = [0.0, 1.0, 0.0]\n")
        assert loaded.joint("j").frame2.tolist() == [1.0, 0, 0, 0, 0, 1.0, 0]


def test_universal_joint_at_zero(scene):
    loaded = scene(
        BODY + "[joints.j]\ntype = 'universal'\nbodies = ['ground', 'a']\nat = [0.0, 1.0, 0.0]\n"
        "axis = [1.0, 0.0, 0.0]\naxis2 = [0.0, 1.0, 1.0]\n"
    )
    j = loaded.joint("j")
    first, second = quaternion_to_matrix(j.frame1[:4]), quaternion_to_matrix(j.frame2[:4])
    np.testing.assert_allclose(first[:, 2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(second[:, 2], np.array([0, 1, 1]) / np.sqrt(2), atol=1e-15)
    np.testing.assert_allclose(first @ quaternion_to_matrix(j.middle[:4]), second, atol=1e-15)
    assert (j.dim, j.coordinate.tolist()) == (2, [0.0, 0.0])


def test_mesh_is_beside_the_scene(scene, tmp_path):
    loaded = scene(BODY + "shape = { mesh = 'a.stl' }\n")
    assert loaded.body("a").shape == {"mesh": str(tmp_path / "a.stl")}


def test_several_shapes_in_their_places(scene, tmp_path):
    loaded = scene(
        BODY + "shapes = [{ sphere = 1.0, position = [1.0, 2.0, 3.0], rotation = [0.6, 0.8, 0.0, 0.0] }, "
        "{ mesh = 'a.stl', scale = [2.0, 2.0, 2.0] }]\n"
    )
    ball, part = loaded.body("a").shapes
    assert ball == {"sphere": 1.0, "position": [1.0, 2.0, 3.0], "rotation": [0.6, 0.8, 0.0, 0.0]}
    assert part == {"mesh": str(tmp_path / "a.stl"), "scale": [2.0, 2.0, 2.0]}
    assert scene_from_text(scene_to_text(loaded)).body("a").shapes == loaded.body("a").shapes


LEG = """
format = 1
[bodies.foot]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [1.0, 0.0, 0.0]
velocity = [0.0, 2.0, 0.0]
angular_velocity = [0.0, 0.0, 2.0]
[joints.hip]
type = "revolute"
bodies = ["ground", "foot"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
heat = "oil"
[springs.s]
bodies = ["ground", "foot"]
at1 = [0.0, 0.0, 1.0]
at2 = [0.0, 0.0, 0.5]
[thermal.oil]
capacity = 1.0
temperature = 300.0
[conduction.c]
between = ["oil", "environment"]
conductance = 1.0
"""


def test_parts_are_moved_and_turned(scene):
    half = np.sqrt(0.5)
    loaded = scene(
        f"[parts.left]\nuse = 'leg.toml'\nposition = [0.0, 0.0, 5.0]\nrotation = [{half}, {half}, 0.0, 0.0]\n"
        "[parts.right]\nuse = 'leg.toml'\n"
        "[bodies.load]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n"
        "[joints.tie]\ntype = 'spherical'\nbodies = ['right.foot', 'load']\n"
        "frame1 = { position = [0.0, 0.0, 1.0] }\nframe2 = {}\nheat = 'left.oil'\n",
        leg=LEG,
    )
    assert residuals(loaded).max() < 1e-12
    assert [name for name, _ in loaded.all_bodies()] == ["load", "left.foot", "right.foot"]
    left = loaded.body("left.foot")
    np.testing.assert_allclose(left.pose, [half, half, 0, 0, 1, 0, 5], atol=1e-15)
    # The velocity turns with it, the body-frame twist stays.
    np.testing.assert_allclose(left.twist, loaded.body("right.foot").twist, atol=1e-15)
    hip = loaded.joint("left.hip")
    assert (hip.body1, hip.body2, hip.heat) == ("ground", "left.foot", "left.oil")
    np.testing.assert_allclose(quaternion_to_matrix(hip.frame1[:4])[:, 2], [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(dict(loaded.all_springs())["left.s"].at1, [0, -1, 5], atol=1e-15)
    assert dict(loaded.all_conduction())["left.c"].between == ["left.oil", "environment"]
    assert dict(loaded.all_thermal())["right.oil"].temperature == 300.0
    assert loaded.parts["left"].joints["hip"].body2 == "foot"
    # The load was placed by the joint that ties it to the part.
    np.testing.assert_allclose(loaded.body("load").pose[4:], [1, 0, 1], atol=1e-15)
    np.testing.assert_allclose(loaded.body("load").twist, [0, 0, 2, 0, 2, 0], atol=1e-15)


def test_parts_of_parts(scene):
    loaded = scene(
        "[parts.p]\nuse = 'pair.toml'\nposition = [0.0, 1.0, 0.0]\n",
        pair="format = 1\n[parts.q]\nuse = 'leg.toml'\nposition = [0.0, 0.0, 2.0]\n",
        leg=LEG,
    )
    np.testing.assert_allclose(loaded.body("p.q.foot").pose[4:], [1, 1, 2])
    assert loaded.joint("p.q.hip").heat == "p.q.oil"


def test_a_part_lives_in_the_world_of_its_user(scene):
    world = "[world]\ngravity = [0.0, 0.0, -1.0]\n"
    use = "format = 1\n" + world + "[parts.p]\nuse = 'leg.toml'\n"
    assert scene(use, leg=LEG).parts["p"].world.gravity[2] == -1.0
    assert scene(use, leg=LEG + world).parts["p"].world.gravity[2] == -1.0
    with pytest.raises(SceneError, match="remove \\[world\\] from the part") as caught:
        scene(use, leg=LEG + world.replace("-1.0", "-2.0"))
    assert caught.value.faults[0].key == "parts.p.world"


def test_names_that_are_not_there(scene):
    loaded = scene(BODY)
    with pytest.raises(SceneError, match='did you mean "a"'):
        loaded.body("a1")
    with pytest.raises(SceneError, match='joint "pin"'):
        loaded.joint("pin")


def test_a_body_without_a_joint_has_a_free_one(scene):
    loaded = scene(BODY + "position = [1.0, 2.0, 3.0]\nvelocity = [1.0, 0.0, 0.0]\n")
    j = loaded.joint("a")
    assert (j.kind, j.body1, j.body2) == ("free", "ground", "a")
    assert j.coordinate.tolist() == [1.0, 0, 0, 0, 1.0, 2.0, 3.0]
    assert j.rate.tolist() == [0, 0, 0, 1.0, 0, 0]
    assert loaded.joints == {}


def test_scenes_travel_between_processes(scene):
    loaded = scene("[parts.p]\nuse = 'leg.toml'\n", leg=LEG)
    for back in (pickle.loads(pickle.dumps(loaded)), copy.deepcopy(loaded)):
        assert str(back) == str(loaded)
        assert back.body("p.foot").pose.tolist() == loaded.body("p.foot").pose.tolist()


def test_the_schema_can_be_exported():
    schema = json.loads(json.dumps(json_schema()))
    assert schema["additionalProperties"] is False
    assert {"format", "bodies", "joints", "parts"} <= set(schema["properties"])
    for table in schema["$defs"].values():
        assert table["additionalProperties"] is False
        assert all("description" in entry for entry in table["properties"].values())
