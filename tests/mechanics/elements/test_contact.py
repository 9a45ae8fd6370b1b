"""Contacts and stops against closed forms, by every method."""

import json
from dataclasses import asdict
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import ephs
from ephs.mechanics.elements.contact import contact_energy, contact_loss
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs import pace
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.shapes.gap import (
    edges,
    plane_rim,
    plane_sphere,
    rounded_box_sphere,
    segments,
    sphere_rounded_box,
)
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.mechanics.tree.finding import mechanism
from ephs.operad import Path
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.testing import check_primitive
from tests.methods import OF_SCENES
from tests.numerics import EPS, largest
from tests.written import scene_of_text

GAPS = (
    plane_sphere(0.3),
    plane_sphere(0.0),
    plane_rim(0.2),
    rounded_box_sphere((0.1, 0.2, 0.3), 0.0, 0.5),
    rounded_box_sphere((0.0, 0.0, 0.0), 0.3, 0.5),
    sphere_rounded_box(0.3, (0.1, 0.2, 0.3), 0.1),
    segments(0.2, 0.3, 0.4, 0.1),
    edges(0.2, 0.3, 0.4, 0.1),
)
HEAD = 'format = 1\nname = "touching"\n[world]\ngravity = [0.0, 0.0, {gravity}]\n'
BALL = """
[bodies.ball]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.0, {height}]
velocity = [{along}, 0.0, {speed}]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
stiffness = {stiffness}
exponent = {exponent}
loss = {loss}
friction = {friction}
slip = {slip}
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
"""
BLOCK = """
[bodies.lower]
mass = 1.0
inertia = [7e-3, 7e-3, 7e-3]
position = [0.0, 3.0, 0.101]
[bodies.upper]
mass = 1.0
inertia = [7e-3, 7e-3, 7e-3]
position = [0.05, 3.02, 0.33]
rotation = {{ axis = [1.0, 2.0, 0.5], angle = 0.2 }}
[surfaces.lower]
body = "lower"
shape = {{ box = [0.2, 0.2, 0.2] }}
stiffness = {stiffness}
loss = {loss}
friction = {friction}
[surfaces.upper]
body = "upper"
shape = {{ box = [0.2, 0.2, 0.2] }}
stiffness = {stiffness}
loss = {loss}
friction = {friction}
"""
RODS = """
[bodies.long]
mass = 1.0
inertia = [2e-2, 2e-2, 2e-3]
position = [0.0, 3.0, 0.6]
[bodies.short]
mass = 1.0
inertia = [7e-3, 7e-3, 2e-3]
position = [0.15, 3.01, 0.8]
rotation = {{ axis = [1.0, 2.0, 0.5], angle = 0.2 }}
velocity = [-1.0, 0.0, 0.0]
[surfaces.long]
body = "long"
shape = {{ capsule = [0.05, 0.6] }}
stiffness = {stiffness}
loss = {loss}
friction = {friction}
[surfaces.short]
body = "short"
shape = {{ capsule = [0.05, 0.1] }}
stiffness = {stiffness}
loss = {loss}
friction = {friction}
"""
USUAL = {
    "gravity": 0.0, "height": 0.15, "along": 0.0, "speed": 0.0, "stiffness": 1e5, "exponent": 1.0, "loss": 0.0,
    "friction": 0.0, "slip": 1e-3,
}  # fmt: skip


POSES = st.tuples(
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda x: np.linalg.norm(x) > 0.1),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
).map(lambda x: np.concatenate([np.array(x[0]) / np.linalg.norm(x[0]), x[1]]))


@pytest.mark.parametrize("gap", GAPS, ids=[gap.name for gap in GAPS])
@given(pose=POSES, out=st.floats(0.0, 1.0))
def test_beyond_its_support_a_gap_is_open(gap, pose, out):
    places, reach = list(gap.support.places), gap.support.limit
    at = pose[places] if len(places) > 1 else np.ones(1)
    if np.linalg.norm(at) > 1e-3:
        pose[places] = at / np.linalg.norm(at) * (reach * (1.0 + 1e-12) + out)
        assert gap.distance(pose) >= 0.0


@pytest.mark.parametrize("gap", [gap for gap in GAPS if gap.support.halves], ids=lambda gap: gap.name)
@given(pose=POSES, out=st.floats(0.0, 0.1), axis=st.integers(0, 2), upper=st.booleans(), back=st.booleans())
def test_behind_a_face_of_boxes_about_its_frames_a_gap_is_open(gap, pose, out, axis, upper, back):
    """The nearest corner of the second box is put in front of a face of the first one, or the other way round."""
    halves = np.reshape(gap.support.halves, (2, 3))[:: -1 if back else 1]
    corners = np.array(list(product(*((-x, x) for x in halves[1]))))
    ways = corners @ quaternion_to_matrix(pose[:4])[axis]
    far = halves[0, axis] + gap.support.margin + out
    pose[4 + axis] = far - ways.min() if upper else -far - ways.max()
    assert gap.distance(SE3.inverse(pose) if back else pose) >= 0.0


@pytest.mark.parametrize(("gap", "turn"), [(plane_sphere(0.3), [1.0, 0.0, 0.0, 0.0]), (plane_rim(0.2), [1, 1, 0, 0])])
def test_below_its_support_a_gap_above_a_plane_may_be_closed(gap, turn):
    """So that the law above fails for a smaller one."""
    pose = np.array([*(np.array(turn) / np.linalg.norm(turn)), 0.0, 0.0, 0.99 * gap.support.limit])
    assert gap.distance(pose) < 0.0


@pytest.mark.parametrize(
    ("text", "until", "touching"),
    [
        (BALL, 0.25, ["ball_floor"]),
        (BALL + BLOCK, 0.1, ["floor_lower", "lower_upper"]),
        (BALL + RODS, 0.1, ["long_short"]),
    ],
    ids=["plane", "boxes", "rods"],
)
def test_what_is_out_of_reach_is_left_out_to_the_last_bit(text, until, touching, monkeypatch):
    options = {"height": 0.15, "along": 1.0, "gravity": -9.81, "loss": 0.3, "friction": 0.4}
    found = run(scene_of(text, **options), until)
    called = []

    def everywhere(*_):
        called.append(True)
        return 0, [0.0] * 9

    monkeypatch.setattr(mechanism, "_support", everywhere)
    oracle = run(scene_of(text, **options), until)
    for name in touching:
        assert called and found.contact(name).gap.min() < 0.0 < found.contact(name).gap.max()
    for name, _ in found.scene.all_bodies():
        assert np.array_equal(found.body(name).position, oracle.body(name).position)
    assert np.array_equal(found.heat, oracle.heat)


def scene_of(text, **numbers):
    return scene_of_text((HEAD + text).format(**(USUAL | numbers)))


def run(scene, until, method="rk87", step=None, **options):
    """A run whose results count, whatever its audit says of constant steps."""
    if step is None:
        options = {"rtol": 1e-9, "atol": 1e-11} | options
    return ephs.simulate(scene, until, method=method, step=step, audit="off", **options)


def rebound(speed, loss):
    """Speed after an impact by Hunt and Crossley: v dv/(1 + cv) = −(k/m) dⁿ dd has one potential on the way back."""
    c = 1.5 * loss

    def potential(v):
        return v / c - np.log1p(c * v) / c**2

    return brentq(lambda v: potential(-v) - potential(speed), 0.0, min(speed, (1.0 - 1e-9) / c))


@pytest.mark.parametrize(("name", "exponent"), [*((name, 1.5) for name in OF_SCENES), ("rk87", 1.0), ("natural", 1.0)])
def test_an_impact_loses_what_hunt_and_crossley_say(name, exponent):
    scene = scene_of(BALL, speed=-1.0, loss=0.4, exponent=exponent)
    fixed = METHODS[name].fixed
    sol = run(scene, 0.125, name, step=2.0**-13 if fixed else None)
    speed = float(sol.body("ball").velocity[-1, 2])
    error = 2e-3 if fixed else 1e-5
    assert speed == pytest.approx(rebound(1.0, 0.4), abs=error)
    assert sol.heat[-1] == pytest.approx(1.0 - speed**2, abs=error)


STOPPED = """
[bodies.slide]
mass = 2.0
inertia = [1.0, 1.0, 1.0]
position = [0.0, 0.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "slide"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
rate = {rate}
limits = [{lower}, {upper}]
limit_stiffness = 1e5
limit_loss = 0.4
"""


@pytest.mark.parametrize(
    ("name", "rate", "lower"),
    [*((name, -1.0, -0.05) for name in ("semi", "radau", "natural4")), ("rk87", 1.0, "nan"), ("natural", 1.0, -0.05)],
)
def test_a_stop_is_an_impact(name, rate, lower):
    scene = scene_of(STOPPED, rate=rate, lower=lower, upper=0.05)
    fixed = METHODS[name].fixed
    sol = run(scene, 0.0859375, name, step=2.0**-13 if fixed else None)
    assert sol.joint("rail").rate[-1, 0] == pytest.approx(-rate * rebound(1.0, 0.4), abs=2e-3 if fixed else 1e-5)


def test_without_loss_a_ball_comes_back():
    """An arc of an oscillator between two parabolas, and every joule is there."""
    m, g, k, fall = 2.0, 9.81, 1e5, 0.05
    scene = scene_of(BALL, gravity=-g, stiffness=k)
    down, rate, speed = np.sqrt(2.0 * fall / g), np.sqrt(k / m), np.sqrt(2.0 * g * fall)
    touching = (np.pi + 2.0 * np.arctan(g / rate / speed)) / rate
    for name, error in (("rk87", 1e-7), ("radau", 1e-6)):
        sol = run(scene, 2.0 * down + touching, name)
        assert sol.body("ball").position[-1, 2] == pytest.approx(0.15, abs=error)
    sol = run(scene, 0.5, "natural", step=2.0**-9)
    assert sol.contact("ball_floor").gap.min() < 0.0
    assert largest(sol.energy_error) <= 1e-12


def test_a_sphere_slides_until_it_rolls():
    """v = 5/7 v₀ from 2 v₀/(7 μ g) on, and 2/7 of the energy are heat; what slips on is of the size of `slip`."""
    m, g, mu, v0, k, slip = 2.0, 9.81, 0.3, 1.0, 1e5, 1e-4
    rest = 0.1 - m * g / k
    scene = scene_of(BALL, gravity=-g, height=rest, along=v0, stiffness=k, friction=mu, slip=slip)
    until = 2.0 * v0 / (7.0 * mu * g)
    sol = run(scene, 1.5 * until, save_at=[0.5 * until, 1.5 * until])
    assert sol.body("ball").velocity[0, 0] == pytest.approx(v0 - 0.5 * mu * g * until, abs=10.0 * slip)
    assert sol.body("ball").velocity[-1, 0] == pytest.approx(5.0 / 7.0 * v0, abs=10.0 * slip)
    assert sol.body("ball").angular_velocity[-1, 1] == pytest.approx(50.0 / 7.0 * v0, abs=100.0 * slip)
    assert sol.heat[-1] == pytest.approx(m * v0**2 / 7.0, abs=10.0 * slip)


@pytest.mark.parametrize("gap", GAPS, ids=lambda gap: f"{gap.name}-{gap.radius:g}")
def test_the_loss_is_an_onsager_structure(gap):
    check_primitive(contact_loss(gap, ConstitutiveLaw(1e3, 1.5, 0.2, 0.5, 0.1, 0.01, 0.02)), max_examples=100)


@pytest.mark.parametrize("gap", GAPS, ids=lambda gap: f"{gap.name}-{gap.radius:g}")
def test_the_energy_has_an_exact_slope(gap):
    rng, law = np.random.default_rng(5), ConstitutiveLaw(1e3, 1.5)
    energy, q_r, touched = contact_energy(gap, law), Path.of("q_r"), 0
    for _ in range(100):
        x = 0.3 * rng.normal(size=7)
        x[:4] /= np.linalg.norm(x[:4])
        v = 0.5 * rng.normal(size=6)
        ends = x, SE3.compose(x, SE3.exp(v))
        before, after = (energy.energy({q_r: at}) for at in ends)
        if min(float(gap.distance(at)) for at in ends) < -gap.support.depth:
            assert np.isnan(before) or np.isnan(after)
            continue
        touched += (before > 0.0) != (after > 0.0)
        along = energy.discrete_gradient({q_r: x}, v)
        scale = before + after + np.abs(along) @ np.abs(v) + law.energy(1.0) * EPS
        assert abs(after - before - along @ v) <= 1e-13 * scale
    assert touched >= 5


def test_forces_are_those_that_move_the_ball():
    times = np.linspace(0.09, 0.12, 601)
    sol = run(scene_of(BALL, gravity=-9.81, loss=0.3), 0.12, save_at=times)
    contact, pushed = sol.contact("ball_floor"), np.gradient(sol.body("ball").velocity[:, 2], times)
    assert contact.gap.min() < 0.0 < contact.gap.max()
    assert contact.force[1:-1, 2] == pytest.approx(2.0 * (pushed + 9.81)[1:-1], abs=0.02 * contact.force.max())
    heat = np.concatenate([[0.0], np.cumsum(0.5 * (contact.heat[1:] + contact.heat[:-1]) * np.diff(times))])
    assert heat[-1] == pytest.approx(sol.heat[-1] - sol.heat[0], rel=1e-3)


def test_contacts_of_older_result_files_have_the_same_laws_and_places():
    scene = scene_of(BALL, loss=0.25)
    older = json.loads(scene_to_text(scene))
    for name, of in scene.contacts.items():
        older["contacts"][name] = {
            "name": name, "surfaces": of.surfaces, "law": asdict(of.law), "heat": of.heat,
        }  # fmt: skip
    for name, of in scene.surfaces.items():
        frame = {"shape": [7], "values": of.frame.tolist()}
        older["surfaces"][name] = {"name": name, "body": of.body, "shape": of.shape, "frame": frame}
    again = scene_from_text(json.dumps(older))
    assert {name: of.law for name, of in again.contacts.items()} == {
        name: of.law for name, of in scene.contacts.items()
    }
    start, before = (each.system().state() for each in (again, scene))
    assert all(np.array_equal(start[path], value) for path, value in before.items())


PLATE = """
[bodies.bullet]
mass = 0.1
inertia = [1e-5, 1e-5, 1e-5]
position = [0.013, 0.0, 5.0]
velocity = [0.0, 0.0, -40.0]
[surfaces.bullet]
body = "bullet"
shape = { sphere = 0.01 }
stiffness = 1e7
[surfaces.plate]
body = "ground"
shape = { box = [2.0, 2.0, 0.001] }
"""


@pytest.mark.parametrize("name", [name for name in OF_SCENES if METHODS[name].adaptive])
@pytest.mark.filterwarnings("ignore::ephs.CostWarning")
def test_no_step_leaps_over_a_thin_plate(name, monkeypatch):
    scene = scene_of_text(HEAD.format(gravity=0.0) + PLATE)
    assert ephs.simulate(scene, 0.2, method=name, rtol=1e-3, audit="off").body("bullet").velocity[-1, 2] > 30.0
    monkeypatch.setattr(pace, "_contact_step", lambda _: np.inf)
    assert ephs.simulate(scene, 0.2, method=name, rtol=1e-3, audit="off").body("bullet").velocity[-1, 2] == -40.0


def test_the_limit_is_half_the_way_through():
    longest = pace.longest_step(problem_of_scene(scene_of_text(HEAD.format(gravity=0.0) + PLATE)), 5, 1e-3, (0.0, 1.0))
    assert longest == pytest.approx(0.5 * 0.021 / 40.0, rel=0.1)


TURNING = """
[bodies.ball]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [0.0, 0.0, 0.0999]
angular_velocity = [0.0, 0.0, 3.0]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
stiffness = 1e5
loss = 1.0
spinning = {arm}
[surfaces.block]
body = "ground"
shape = {{ {shape} }}
position = [0.0, 0.0, {below}]
"""
CUBE = [list(corner) for corner in product((-0.2, 0.2), repeat=3)]
BLOCKS = {"plane = {}": 0.0, "box = [0.4, 0.4, 0.4]": -0.2, f"points = {CUBE}": -0.2, "cylinder = [0.2, 0.4]": -0.2}


def slowed(shape, arm=5e-3):
    text = HEAD.format(gravity=-9.81) + TURNING.format(shape=shape, below=BLOCKS[shape], arm=arm)
    return ephs.simulate(scene_of_text(text), 0.1, method="rk87", rtol=1e-9, atol=1e-11).body("ball")


@pytest.mark.parametrize("shape", BLOCKS)
def test_a_ball_that_spins_on_a_face_is_slowed_whatever_has_the_face(shape):
    """The arm times the mean normal force slows the ball; near the weight, about which the force swings."""
    spin = slowed(shape).angular_velocity[-1, 2]
    assert spin == pytest.approx(slowed("plane = {}").angular_velocity[-1, 2], abs=1e-6)
    assert spin == pytest.approx(3.0 - 5e-3 * 2.0 * 9.81 * 0.1 / 8e-3, abs=0.3)
    assert slowed(shape, arm=0.0).angular_velocity[-1, 2] == pytest.approx(3.0, abs=1e-6)  # the control


@pytest.mark.parametrize("radii", [(0.1, 0.1), (0.1, 0.3)])
def test_gaps_of_balls_that_change_roles_are_the_same(radii):
    """Normals are opposite, points the same point in space, and they roll on the same radius."""
    one, other = (rounded_box_sphere((0.0, 0.0, 0.0), *pair) for pair in (radii, radii[::-1]))
    pose = np.array([0.8, 0.0, 0.6, 0.0, 0.05, -0.02, 0.99 * sum(radii)])
    back = SE3.inverse(pose)
    (normal, place), (opposite, again) = one.contact(pose), other.contact(back)
    turn = quaternion_to_matrix(pose[:4])
    np.testing.assert_allclose(turn @ normal, -np.array(opposite), atol=1e-14)
    np.testing.assert_allclose(pose[4:] + turn @ place, again, atol=1e-14)
    assert one.radius == pytest.approx(other.radius, rel=1e-14)
    assert one.distance(pose) == pytest.approx(other.distance(back), abs=1e-14)
