"""Mechanisms wired by hand are assembled as scenes are: poses from joints, joints from poses, gaps refused."""

import numpy as np
import pytest

import ephs
from benchmarks.hard.four_bars import wired, wired_poses
from ephs.mechanics.motion.links import LinkMotion
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import initial_state, scene_inputs
from ephs.semantics import AssemblyError
from ephs.semantics.spaces import SE3
from ephs.solve.equations.mobility import mobility
from tests.numerics import EPS, largest
from tests.scenes import SCENES, shipped
from tests.written import scene_of_text

METHODS = ("natural", "natural4")


POSES = wired_poses()


def given(**poses):
    return {f"{name}.pe.q": pose for name, pose in (POSES | poses).items()}


@pytest.mark.parametrize("method", METHODS)
def test_relative_poses_follow_from_poses(method):
    sol = ephs.simulate(wired(), 0.2, initial=given(), method=method, step=0.01)
    assert sol["a.pe.q_r"][0] == pytest.approx(2.0 * np.arctan2(POSES["crank"][3], POSES["crank"][0]), abs=1e-14)
    assert sol.constraint_error.max() < 1e-13
    found = mobility(sol.problem.descriptor, sol.problem.descriptor.pack(sol.problem.initial))
    assert (found.mobility, found.redundant) == (1, 3)
    assert largest(sol["crank.pe.q"][-1] - POSES["crank"]) > 1e-2  # it moves


def test_poses_follow_from_relative_poses():
    angle = 2.0 * np.arctan2(POSES["crank"][3], POSES["crank"][0])
    both = given()
    del both["crank.pe.q"]
    sol = ephs.simulate(wired(), 0.1, initial=both | {"a.pe.q_r": angle}, method="natural", step=0.01)
    np.testing.assert_allclose(sol["crank.pe.q"][0], POSES["crank"], atol=1e-14)
    assert sol.constraint_error.max() < 1e-13


@pytest.mark.parametrize("method", METHODS)
def test_a_gap_is_refused_by_joint_and_size(method):
    off = SE3.compose(POSES["coupler"], np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.54, 0.0]))
    with pytest.raises(AssemblyError, match=r"^(b|c): .* open by 0\.54 m and"):
        ephs.simulate(wired(), 0.1, initial=given(coupler=off), method=method, step=0.01)
    with pytest.raises(AssemblyError, match=r"^a: .* rad"):
        ephs.simulate(wired(), 0.1, initial=given() | {"a.pe.q_r": 0.0}, method=method, step=0.01)


def test_what_a_scene_was_made_into_is_left_as_it_is():
    for file in SCENES:
        scene = ephs.load(file)
        state = initial_state(scene)
        system = scene.system()
        inputs = {str(p): {"flow": np.zeros(q.quantity.space.dim)} for p, q in system.interface.items()}
        problem = problem_of_system(system, {str(p): v for p, v in state.items()}, inputs)
        for path, value in state.items():
            np.testing.assert_allclose(problem.initial[path], value, atol=1e-15)


def test_checks_say_how_far_joints_are_closed():
    item = next(i for i in check_model(wired(), given()).items if i.name == "closure")
    assert item.ok


def test_the_system_of_a_scene_starts_as_the_scene_and_what_is_given_moves_the_rest():
    scene = shipped("chain")
    system = scene.system()
    run = {"until": 0.1, "method": "rk54", "step": 0.01}
    one, two = ephs.simulate(system, **run), ephs.simulate(scene, **run)
    for path in one.states:
        assert np.array_equal(one[path], two[path]), path
    name, joint = next((name, j) for name, j in scene.all_joints() if j.kind == "revolute")
    angle = float(joint.coordinate[0]) + 0.4
    moved = problem_of_system(system, {f"joints.{name}.pe.q_r": angle}).initial
    for path, value in initial_state(scene.with_state({name: angle})).items():
        if path[-1] in ("q", "q_r"):
            np.testing.assert_allclose(moved[path], value, atol=1e-14)


@pytest.mark.parametrize("method", ["auto", "rk87", "natural"])
def test_an_input_that_is_missing_is_named(method):
    system = shipped("four-bar").system()
    with pytest.raises(AssemblyError, match=r"^drives\.main: .* give inputs=\{'drives\.main'"):
        ephs.simulate(system, 0.1, method=method)


@pytest.mark.parametrize("name", ["four-bar", "chain", "universal"])
def test_velocity_residuals_are_measured_as_of_scenes(name, monkeypatch):
    scene = shipped(name)
    inputs = {str(path): {"flow": one.value} for path, one in scene_inputs(scene).items()}
    run = {"until": 0.02, "method": "rk54", "step": 2e-3, "audit": "off"}
    sol = ephs.simulate(scene.system(), inputs=inputs, **run)
    fastest = max(largest(sol.body(f"bodies.{body}").angular_velocity) for body in scene.bodies)
    assert sol.velocity_error.max() <= 8 * 6 * 10 * EPS * max(1.0, fastest)
    rates = LinkMotion.rates
    monkeypatch.setattr(LinkMotion, "rates", property(lambda self: {k: 1.5 * r for k, r in rates.fget(self).items()}))
    off = max(largest(rate / 3.0) for rate in sol.problem.linked(sol).rates.values())
    assert sol.problem.linked(sol).velocity_error().max() == pytest.approx(off, rel=1e-9)


def rod_on_a_pin(size):
    """A rod of one shape and density, which turns at 2 rad/s."""
    thick = size**5
    return scene_of_text(
        f"""
        format = 1
        [world]
        gravity = [0.0, 0.0, 0.0]
        [bodies.rod]
        mass = {size**3}
        inertia = [{thick}, {thick}, {0.2 * thick}]
        position = [0.0, 0.0, {-size}]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "rod"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 1.0, 0.0]
        rate = 2.0
        """
    )


@pytest.mark.parametrize(
    ("method", "size"), [*(("rk54", size) for size in (1e-6, 1.0, 1e3)), *(("natural", size) for size in (1e-6, 1.0))]
)
def test_momenta_off_the_joints_are_refused_at_any_size(size, method):
    system = rod_on_a_pin(size).system()
    momentum = np.array(system.initial[ephs.Path.of("bodies.rod.ke.p")])
    run = {"method": method, "step": 1e-3, "initial": {"bodies.rod.ke.p": momentum}}
    assert ephs.simulate(system, 0.01, **run).joint("joints.pin").rate[-1, 0] == pytest.approx(2.0, rel=1e-12)
    momentum[4] += 0.01 * largest(momentum[3:])  # along the pin
    with pytest.raises(ephs.SimulationError, match=r"bodies\.rod\.ke\.p: an initial state that contradicts"):
        ephs.simulate(system, 0.01, **run)


@pytest.mark.parametrize("method", ["rk54", "natural"])
@pytest.mark.parametrize("size", [1e-6, 1e-2, 1.0, 1e3])
def test_states_off_the_joints_of_a_scene_are_refused_at_any_size(size, method):
    scene = rod_on_a_pin(size)
    states = scene.system().initial
    momentum, pose = (np.array(states[ephs.Path.of(f"bodies.rod.{name}")]) for name in ("ke.p", "pe.q"))
    run = {"method": method, "step": 1e-3}
    for given in ({"bodies.rod.ke.p": momentum}, {"bodies.rod.pe.q": pose}):
        rate = ephs.simulate(scene, 0.01, initial=given, **run).joint("pin").rate
        assert rate[-1, 0] == pytest.approx(2.0, rel=1e-9)
    momentum[4] += 0.01 * largest(momentum[3:])
    with pytest.raises(AssemblyError, match=r"^bodies\.rod\.ke\.p: the initial value contradicts the joints"):
        ephs.simulate(scene, 0.01, initial={"bodies.rod.ke.p": momentum}, **run)
    pose[5] += 1e-5 * size
    with pytest.raises(AssemblyError, match="leave a joint open"):
        ephs.simulate(scene, 0.01, initial={"bodies.rod.pe.q": pose}, **run)


@pytest.mark.parametrize("method", ["rk54", "natural"])
def test_ports_of_a_system_are_those_of_its_scene(method):
    """By natural, momenta between steps are off the joints by its error; ports are asked at momenta on them."""
    scene = shipped("four-bar")
    run = {"until": 0.1, "method": method, "step": 0.02, "audit": "off"}
    inputs = {str(path): {"flow": one.value} for path, one in scene_inputs(scene).items()}
    one, two = ephs.simulate(scene, **run), ephs.simulate(scene.system(), inputs=inputs, **run)
    for port in inputs:
        assert largest(one.port(port).power) > 0.0
        np.testing.assert_allclose(two.port(port).power, one.port(port).power, rtol=1e-12)
