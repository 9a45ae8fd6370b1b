"""Placement, joint states and adjustment, as laws over generated mechanisms."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene import SceneError
from ephs.mechanics.scene.geometry import coupling, coupling_of, joint_types
from ephs.mechanics.scene.load import load
from ephs.semantics.spaces import SE3
from tests.numerics import generators, largest, seeds
from tests.scenes import ROOT
from tests.written import scene_of_text

FOUR_BAR = ROOT / "scenes" / "four-bar.toml"


def table(name, values):
    return f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())


def frame(pose):
    return f"{{ position = {pose[4:].tolist()}, rotation = {pose[:4].tolist()} }}"


def random_chain(rng, kinds, given_bodies=()):
    """A tree of bodies, each placed by a joint with frames in the bodies."""
    text = "format = 1\n"
    for i, kind in enumerate(kinds):
        moments = rng.uniform(1.0, 1.9, 3)
        values = {"mass": rng.uniform(0.5, 2.0), "inertia": moments.tolist()}
        text += table(f"bodies.b{i}", values | dict(given_bodies).get(i, {}))
        below = "ground" if i == 0 else f"b{rng.integers(0, i)}"
        pitch = 0.3 if kind == "screw" else 0.0
        d = coupling(kind, pitch).dim
        ends = [below, f"b{i}"] if rng.random() < 0.5 else [f"b{i}", below]
        values = {
            "type": f"'{kind}'",
            "bodies": str(ends),
            "frame1": frame(SE3.random(rng)),
            "frame2": frame(SE3.random(rng)),
            "coordinate": rng.uniform(-1.5, 1.5, d).tolist(),
            "rate": rng.uniform(-1.0, 1.0, d).tolist(),
        }
        if kind == "screw":
            values["pitch"] = pitch
        if kind == "universal":
            values["axis2"] = [0.3, 1.0, 0.2]
        text += table(f"joints.j{i}", values)
    return text


def residuals(scene):
    """The defects of every joint, of poses and of twists, in its frame on the second body."""
    bodies = dict(scene.all_bodies())
    found = []
    for _, j in scene.all_joints():
        ends = []
        for name, offset in ((j.body1, j.frame1), (j.body2, j.frame2)):
            pose, twist = SE3.identity(), np.zeros(6)
            if name != "ground":
                pose, twist = bodies[name].pose, bodies[name].twist
            ends.append((SE3.compose(pose, offset), SE3.adjoint(SE3.inverse(offset)) @ twist))
        (frame1, twist1), (frame2, twist2) = ends
        relative, allowed = SE3.compose(SE3.inverse(frame1), frame2), coupling_of(j)
        gap = SE3.increment(allowed.include(j.coordinate), relative)
        slip = twist2 - SE3.adjoint(SE3.inverse(relative)) @ twist1 - allowed.basis(j.coordinate) @ j.rate
        found.append((largest(gap), largest(slip)))
    return np.array(found).reshape(-1, 2).max(axis=0, initial=0.0)


@given(generators, st.lists(st.sampled_from(joint_types()), min_size=1, max_size=6))
def test_joints_place_and_move_bodies(rng, kinds):
    text = random_chain(rng, kinds)
    scene = scene_of_text(text)
    gap, slip = residuals(scene)
    assert gap < 1e-12
    assert slip < 1e-12


@given(generators, st.lists(st.sampled_from(joint_types()), min_size=1, max_size=5))
def test_states_by_joints(rng, kinds):
    """with_state reaches what it is asked for, leaves the rest alone, and its inverse is itself."""
    scene = scene_of_text(random_chain(rng, kinds))
    names = [name for name, _ in scene.all_joints()]
    chosen = [name for name in names if rng.random() < 0.6]
    wanted = {n: rng.uniform(-1.0, 1.0, scene.joint(n).dim) for n in chosen}
    rates = {n: rng.uniform(-1.0, 1.0, scene.joint(n).dim) for n in chosen}
    moved = scene.with_state(wanted, rates)
    for name in names:
        allowed, before, after = coupling_of(scene.joint(name)), scene.joint(name), moved.joint(name)
        target = wanted.get(name, allowed.coordinates(before.coordinate))
        np.testing.assert_allclose(allowed.coordinates(after.coordinate), target, atol=1e-11)
        np.testing.assert_allclose(after.rate, rates.get(name, before.rate), atol=1e-11)
    gap, slip = residuals(moved)
    assert gap < 1e-11
    assert slip < 1e-10
    back = moved.with_state(
        {n: coupling_of(scene.joint(n)).coordinates(scene.joint(n).coordinate) for n in chosen},
        {n: scene.joint(n).rate for n in chosen},
    )
    for name, body in scene.all_bodies():
        assert largest(SE3.increment(body.pose, back.body(name).pose)) < 1e-11
        np.testing.assert_allclose(back.body(name).twist, body.twist, atol=1e-10)


@given(generators, st.sampled_from(joint_types()), st.floats(-3.0, 3.0))
def test_elements_are_found_again(rng, kind, scale):
    middle = SE3.exp(np.array([1.3, 0.4, 0.0, 0.0, 0.0, 0.0]))
    allowed = coupling(kind, 0.3, middle if kind == "universal" else None)
    x = allowed.element(rng.uniform(-1.0, 1.0, allowed.dim) * abs(scale))
    pose = allowed.include(x)
    assert largest(SE3.increment(pose, allowed.include(allowed.fit(pose))), initial=0.0) < 1e-10
    near = allowed.fit(pose, allowed.element(allowed.coordinates(x) + 1e-3))
    np.testing.assert_allclose(allowed.coordinates(near), allowed.coordinates(x), atol=1e-10)


def test_whole_turns_are_kept():
    scene = scene_of_text(random_chain(np.random.default_rng(1), ["revolute", "universal", "screw"]))
    turned = scene.with_state({"j0": 20.0, "j1": [10.0, -8.0], "j2": 30.0})
    again = turned.with_state(rates={"j0": 1.0})
    assert [float(turned.joint(n).coordinate[0]) for n in ("j0", "j1", "j2")] == pytest.approx([20, 10, 30])
    assert [float(again.joint(n).coordinate[0]) for n in ("j0", "j1", "j2")] == pytest.approx([20, 10, 30])


def test_a_free_body_by_its_implicit_joint():
    scene = scene_of_text("format = 1\n[bodies.a]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n")
    moved = scene.with_state({"a": [0.1, 0.2, 0.3, 1.0, 2.0, 3.0]}, {"a": [1, 0, 0, 0, 2, 0]})
    np.testing.assert_allclose(moved.body("a").pose[4:], [1, 2, 3])
    np.testing.assert_allclose(moved.body("a").twist, [1, 0, 0, 0, 2, 0])
    assert moved.joints == {}


def test_wrong_states_are_refused():
    scene = load(FOUR_BAR)
    with pytest.raises(SceneError) as caught:
        scene.with_state({"mian": 0.0, "pin": [1.0, 2.0]}, {"knee": np.nan})
    assert 'did you mean "main"?' in str(caught.value)
    assert "coordinates.pin: found shape (2,), expected a number" in str(caught.value)
    with pytest.raises(SceneError, match=r"joints\.\w+: found a gap of"):
        scene.with_state({"main": 0.1})
    with pytest.raises(SceneError, match=r"joints\.\w+: found velocities"):
        scene.with_state(rates={"main": 0.1})


@settings(max_examples=15)
@given(st.floats(-3.0, 3.0), st.floats(-5.0, 5.0))
def test_a_loop_follows_its_crank(angle, rate):
    scene = load(FOUR_BAR).with_state({"main": angle}, {"main": rate}, adjust=True)
    gap, slip = residuals(scene)
    assert gap < 1e-8
    assert slip < 1e-6
    assert scene.joint("main").coordinate[0] == pytest.approx(angle, abs=1e-8)
    assert scene.joint("main").rate[0] == pytest.approx(rate, abs=1e-8)
    # What closes once, closes again when the loop's coordinates are all given.
    names = ("main", "pin", "knee", "pivot")
    again = load(FOUR_BAR).with_state(
        {n: scene.joint(n).coordinate for n in names}, {n: scene.joint(n).rate for n in names}
    )
    np.testing.assert_allclose(again.body("coupler").pose, scene.body("coupler").pose, atol=1e-7)


OPEN_LOOP = """
format = 1
[assembly]
adjust = {adjust}
[bodies.crank]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.5, 0.0]
[bodies.coupler]
mass = 1000.0
inertia = [100.0, 100.0, 100.0]
position = [0.5, 1.01, 0.0]
velocity = [1.0, 0.0, 0.0]
[joints.a]
type = "revolute"
bodies = ["ground", "crank"]
frame1 = {{}}
frame2 = {{ position = [0.0, -0.5, 0.0] }}
[joints.b]
type = "revolute"
bodies = ["crank", "coupler"]
frame1 = {{ position = [0.0, 0.5, 0.0] }}
frame2 = {{ position = [-0.5, 0.0, 0.0] }}
"""


def test_adjusting_takes_the_nearest_state():
    with pytest.raises(SceneError) as caught:
        scene_of_text(OPEN_LOOP.format(adjust="false"))
    (fault,) = caught.value.faults
    assert fault.key == "joints.b"
    assert "0.01 m" in fault.found
    assert "crank and coupler" in fault.advice
    scene = scene_of_text(OPEN_LOOP.format(adjust="true"))
    gap, slip = residuals(scene)
    assert gap < 1e-8
    assert slip < 1e-6
    report = scene.adjusted
    assert report.gap == pytest.approx(0.01)
    # The coupler's end comes down by 0.01 m, partly by turning: as an impulse there would move it.
    down = 0.01 / 1000.0 / (1.0 / 1000.0 + 0.5**2 / 100.0)
    np.testing.assert_allclose(scene.body("coupler").pose[4:], [0.5, 1.01 - down, 0.0], atol=1e-4)
    assert scene.joint("a").rate[0] == pytest.approx(-1.0, rel=1e-2)
    assert {d.body for d in report.moved} == {"crank", "coupler"}
    assert "coupler: moved 0.0028" in str(scene)
    flag = scene_of_text(OPEN_LOOP.format(adjust="false"), adjust=True)
    np.testing.assert_array_equal(flag.body("coupler").pose, scene.body("coupler").pose)


@example(seed=0, kinds=["free", "free"])  # nothing to adjust but the coordinates
@settings(max_examples=15)
@given(seeds, st.lists(st.sampled_from(joint_types()), min_size=2, max_size=4))
def test_adjusting_repairs_small_errors(seed, kinds):
    """Bodies a little beside their places come back into a consistent state; consistent ones stay."""
    rng = np.random.default_rng(seed)
    chain = random_chain(rng, kinds)
    scene = scene_of_text(chain)
    beside = {}
    for i, (_, body) in enumerate(scene.all_bodies()):
        pose = SE3.retract(body.pose, rng.normal(size=6) * 1e-3)
        beside[i] = {
            "position": pose[4:].tolist(),
            "rotation": pose[:4].tolist(),
            "velocity": rng.normal(size=3).tolist(),
        }
    text = random_chain(np.random.default_rng(seed), kinds, tuple(beside.items()))
    adjusted = scene_of_text(text, adjust=True)
    gap, slip = residuals(adjusted)
    assert gap < 1e-8
    assert slip < 1e-6
    assert scene_of_text(chain, adjust=True).adjusted is None


def test_adjusting_keeps_what_is_prescribed():
    text = FOUR_BAR.read_text().replace("drive = 4.0 ", "motion = { rate = 2.0 } #")
    with pytest.raises(SceneError, match="joints"):
        scene_of_text(text)
    scene = scene_of_text(text, adjust=True)
    assert scene.joint("main").rate[0] == pytest.approx(2.0, abs=1e-8)
    assert residuals(scene)[1] < 1e-6


def test_what_cannot_close_is_refused():
    text = OPEN_LOOP.format(adjust="true") + (
        "[joints.c]\ntype = 'fixed'\nbodies = ['ground', 'coupler']\n"
        "frame1 = { position = [9.0, 0.0, 0.0] }\nframe2 = {}\n"
    )
    with pytest.raises(SceneError, match="no consistent state was found nearby"):
        scene_of_text(text)


def test_placement_does_not_depend_on_the_order_of_joints():
    text = random_chain(np.random.default_rng(3), ["revolute", "spherical", "universal", "free"])
    head, *tables = text.split("[joints.")
    turned = head + "".join("[joints." + entry for entry in reversed(tables))
    for name, body in scene_of_text(text).all_bodies():
        np.testing.assert_allclose(scene_of_text(turned).body(name).pose, body.pose, atol=1e-14)


def test_a_state_from_a_solution():
    """A body on a pin, thrown without weight, comes half a turn far in half a second."""
    scene = scene_of_text(
        "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n"
        "[bodies.a]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\nposition = [0.0, 1.0, 0.0]\n"
        "[joints.j]\ntype = 'revolute'\nbodies = ['ground', 'a']\n"
        "at = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n"
        "[thermal.t]\ncapacity = 1.0\ntemperature = 310.0\n"
    ).with_state({}, {"j": 2.0 * np.pi})
    motion = ephs.simulate(scene, 0.5, rtol=1e-10)
    later = scene.at(motion, 0.5)
    assert later.joint("j").coordinate[0] == pytest.approx(np.pi, abs=1e-9)
    assert later.joint("j").rate[0] == pytest.approx(2.0 * np.pi, rel=1e-9)
    assert later.thermal["t"].temperature == pytest.approx(310.0)
    with pytest.raises(SceneError, match=r"0 to 0\.5"):
        scene.at(motion, -0.3)
