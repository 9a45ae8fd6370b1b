"""The film: poses between samples are poses, all is in the picture, the page is whole and made in silence."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.semantics.spaces.rotations import matrix_to_quaternion
from ephs.show import ShowError, animate
from ephs.show.beside import _poses
from ephs.show.motions.motion import (
    between,
    equivalent_box,
    film,
    frame_all,
    point_of,
    poses_at,
    rotate,
)
from ephs.show.motions.solids import solid_of
from ephs.show.motions.symbols import add_body
from tests.numerics import largest
from tests.scenes import shipped
from tests.show.conftest import Altered
from tests.written import scene_of_text

UNIT = st.floats(-1.0, 1.0)
VECTORS = st.tuples(UNIT, UNIT, UNIT).map(np.array)
QUATERNIONS = (
    st.tuples(UNIT, UNIT, UNIT, UNIT)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(lambda q: q / np.linalg.norm(q))
)


def matrix_of(quaternion):
    return np.stack([rotate(quaternion, each) for each in np.eye(3)], axis=1)


@given(QUATERNIONS)
def test_matrix_and_quaternion_agree(quaternion):
    matrix = matrix_of(quaternion)
    assert largest(matrix @ matrix.T - np.eye(3)) < 1e-14
    again = matrix_to_quaternion(matrix)
    assert min(largest(again - quaternion), largest(again + quaternion)) < 1e-7


@given(VECTORS, VECTORS)
def test_springs_reach_from_end_to_end(first, second):
    turn, length = between(first, second)
    assert np.linalg.norm(turn) == pytest.approx(1.0, abs=1e-14)
    assert largest(first + rotate(turn, np.array([0.0, 0.0, length])) - second) < 1e-6


@given(st.tuples(*[st.floats(0.1, 1.0)] * 3).map(np.array), st.floats(0.1, 10.0), QUATERNIONS)
def test_a_stand_in_has_the_inertia_of_its_body(sides, mass, turn):
    moments = mass / 12.0 * (np.sum(sides**2) - sides**2)
    rotation = matrix_of(turn)
    inertia = rotation @ np.diag(moments) @ rotation.T
    found, placed = equivalent_box(mass, inertia)
    axes = matrix_of(placed)
    again = axes @ np.diag(mass / 12.0 * (np.sum(found**2) - found**2)) @ axes.T
    assert largest(again - inertia) < 1e-9 * largest(inertia)


@given(st.lists(VECTORS, min_size=1, max_size=8), st.floats(0.01, 1.0))
def test_the_camera_sees_every_point(points, reach):
    cloud = np.array(points)
    view = frame_all(cloud, reach)
    place, target = np.array(view.position), np.array(view.target)
    ahead = (target - place) / np.linalg.norm(target - place)
    for point in cloud:
        way = point - place
        assert way @ ahead > 0
        angle = math.acos(np.clip(way @ ahead / np.linalg.norm(way), -1.0, 1.0))
        assert angle <= view.field / 2
    assert place[2] > target[2]  # never from under the floor


def test_frames_are_poses_on_the_way(crank):
    frames = film(crank, ["crank", "rod"], 100.0, None)
    poses = frames.poses["rod"]
    assert len(frames.times) == 51 and frames.pause == pytest.approx(0.5 / 50)
    assert largest(np.linalg.norm(poses[:, :4], axis=1) - 1.0) < 1e-14
    # the big end is one point of both bodies in every frame
    ends = crank.scene.joint("big-end")
    one, other = (
        point_of(frames.poses[name], np.array(frame[4:]))
        for name, frame in (("crank", ends.frame1), ("rod", ends.frame2))
    )
    assert largest(one - other) < 1e-4


def test_a_quaternion_that_changes_its_sign_makes_no_jump(crank):
    body = crank.body("rod")
    signs = np.where(np.arange(len(crank.t)) % 3 == 0, -1.0, 1.0)[:, None]
    rates = {"velocity": body.velocity, "angular_velocity": body.angular_velocity}
    flipped = SimpleNamespace(position=body.position, quaternion=body.quaternion * signs, **rates)
    turns, straight = (
        film(of, ["rod"], 30.0, None).poses["rod"][:, :4] for of in (Altered(crank, body=lambda _: flipped), crank)
    )
    assert largest(np.abs((turns * straight).sum(axis=1)) - 1.0) < 1e-12


WHEEL = """
format = 1
name = "wheel"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.wheel]
mass = 1.0
inertia = [0.1, 0.1, 0.2]
[joints.axle]
type = "revolute"
bodies = ["ground", "wheel"]
frame1 = {}
frame2 = { position = [0.5, 0.0, 0.0] }
coordinate = 0.3
rate = 40.0
"""


BOUNCING = """
format = 1
name = "ball"
[bodies.ball]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, 0.3]
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
restitution = 0.5
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""


@pytest.mark.parametrize("until", [2.0, -2.0])
def test_a_fast_wheel_turns_between_instants_as_it_does(until):
    """Eight whole turns and more from one instant to the next, after a start that is not zero."""
    sol = ephs.simulate(scene_of_text(WHEEL), 3.0 + until, t0=3.0, save_at=3.0 + until * np.linspace(0.0, 1.0, 3))
    frames = film(sol, ["wheel"], 30.0, None)
    poses, angle = frames.poses["wheel"], 0.3 + 40.0 * (frames.times - 3.0)
    assert len(frames.times) == 61 and abs(40.0 * until / 2.0) > 6.0 * math.pi
    half = np.stack([np.cos(angle / 2.0), 0.0 * angle, 0.0 * angle, np.sin(angle / 2.0)], axis=1)
    assert largest(np.abs((half * poses[:, :4]).sum(axis=1)) - 1.0) < 1e-9
    still, _ = _poses(sol, float(frames.times[17]))
    assert np.abs((half[17] * still["wheel"][:4]).sum()) == pytest.approx(1.0, abs=1e-9)


def test_poses_between_instants_are_good_to_the_fourth_order():
    """Halved distances of instants leave a sixteenth of the error; straight lines leave a quarter."""
    scene, t, names = shipped("chain"), np.linspace(0.0, 0.8, 57), ["rod3"]
    near = ephs.simulate(scene, 0.8, save_at=t, rtol=1e-10).body("rod3")
    misses = []
    for count in (8, 15):
        sol = ephs.simulate(scene, 0.8, save_at=np.linspace(0.0, 0.8, count), rtol=1e-10)
        poses = poses_at(sol, names, t)["rod3"]
        places = largest(poses[:, 4:] - near.position)
        turns = np.linalg.norm(
            np.minimum(np.abs(poses[:, :4] - near.quaternion), np.abs(poses[:, :4] + near.quaternion)), axis=1
        ).max()
        misses.append((places, turns))
    (far, wide), (close, little) = misses
    assert far > 8.0 * close > 0.0 and wide > 8.0 * little > 0.0


def test_a_ball_that_bounces_is_never_drawn_in_the_floor():
    """Velocities after an impact do not lead there."""
    sol = ephs.simulate(scene_of_text(BOUNCING), 1.0, save_at=np.linspace(0.0, 1.0, 8))
    drawn = film(sol, ["ball"], 500.0, None).poses["ball"][:, 6].min()
    assert 0.1 - 1e-4 < drawn < 0.101 and largest(np.diff(sol.body("ball").velocity[:, 2])) > 1.0


def test_duration_stretches_the_film(crank):
    frames = film(crank, ["rod"], 10.0, 2.0)
    assert len(frames.times) == 21 and frames.pause * 20 == pytest.approx(2.0)
    assert frames.times[-1] == crank.t[-1]


def test_the_page_is_whole_and_made_in_silence(crank, tmp_path, capfd):
    page = animate(crank, tmp_path / "film.html", fps=10.0)
    assert capfd.readouterr() == ("", "")
    assert (tmp_path / "film.html").read_text(encoding="utf-8") == page.html
    page = page.html
    assert "__VISER_EMBED_DATA__" in page and "<title>slider-crank</title>" in page
    assert not re.findall(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=\"?https?://", page)


@pytest.mark.parametrize(
    ("asked", "words"),
    [({"fps": 0.0}, "fps = 0.0"), ({"duration": -1.0}, "duration = -1.0")],
)
def test_impossible_films_are_refused(crank, asked, words):
    with pytest.raises(ShowError, match=words):
        animate(crank, **asked)


def test_a_system_without_scene_cannot_be_animated(circuit):
    with pytest.raises(ShowError, match=f"{circuit.name}: found no bodies"):
        animate(circuit)


class Recorder:
    """Notes what is added to a scene."""

    def __init__(self):
        self.scene, self.calls = self, []

    def __getattr__(self, name):
        return lambda node, **options: self.calls.append((name, node, options))


def test_several_shapes_are_drawn_where_they_are(tmp_path):
    mesh = tmp_path / "part.stl"
    corners = ("0 0 0", "1 0 0", "0 1 0")
    loop = "\n".join(f"vertex {corner}" for corner in corners)
    mesh.write_text(f"solid s\nfacet normal 0 0 1\nouter loop\n{loop}\nendloop\nendfacet\nendsolid s\n")
    shapes = (
        {"box": [1.0, 2.0, 3.0], "position": [1.0, 0.0, 0.0], "rotation": [0.0, 1.0, 0.0, 0.0]},
        {"sphere": 0.5, "position": [0.0, 0.0, 9.0]},
        {"mesh": str(mesh), "scale": [2.0, 3.0, 1.0]},
    )
    body = SimpleNamespace(shape=None, shapes=shapes, mass=1.0, inertia=np.eye(3))
    recorder = Recorder()
    solid = solid_of(body, "a")
    add_body(recorder, "/a/shape", solid, (0, 0, 0), 1.0, None)
    (box, _, boxed), (ball, _, there), (part, _, scaled) = recorder.calls
    assert (box, ball, part) == ("add_mesh_simple", "add_icosphere", "add_mesh_simple")
    assert len({node for _, node, _ in recorder.calls}) == 3
    assert boxed["vertices"].max(axis=0).tolist() == [1.5, 1.0, 1.5]
    assert there["position"] == [0.0, 0.0, 9.0]
    assert scaled["vertices"].max(axis=0).tolist() == [2.0, 3.0, 0.0]
    assert solid.reach == pytest.approx(9.5)
