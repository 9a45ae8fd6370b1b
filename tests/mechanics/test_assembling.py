"""Mechanisms wired by hand are assembled as scenes are: poses from joints, joints from poses, gaps refused."""

from pathlib import Path

import numpy as np
import pytest

import ephs
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.build import initial_state
from ephs.mechanics.check import check_model
from ephs.mechanics.components import ground
from ephs.mechanics.simulate import problem_of_system
from ephs.mechanics.solve.mobility import mobility
from ephs.operad import Pattern, junction, quantity
from ephs.semantics import AssemblyError, System
from ephs.semantics.spaces import SE3

BARS = {"a": ("o", "crank"), "b": ("crank", "coupler"), "c": ("coupler", "rocker"), "d": ("o", "rocker")}
PINS = np.array([[0.0, 0.0], [0.3, 0.8], [1.5, 1.1], [1.2, 0.0]])
METHODS = ("natural", "natural4")


def bar(start, end):
    """Middle and angle of a bar between two pins."""
    along = end - start
    half = 0.5 * np.arctan2(along[1], along[0])
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half), *(0.5 * (start + end)), 0.0]), np.linalg.norm(along)


POSES = {name: bar(PINS[i], PINS[j])[0] for name, i, j in (("crank", 0, 1), ("coupler", 1, 2), ("rocker", 3, 2))}
LENGTHS = {name: bar(PINS[i], PINS[j])[1] for name, i, j in (("crank", 0, 1), ("coupler", 1, 2), ("rocker", 3, 2))}


def at(x, y=0.0):
    return {"position": [x, y, 0.0]}


def four_bar():
    l1, l2, l3 = (0.5 * LENGTHS[name] for name in ("crank", "coupler", "rocker"))
    frames = {"a": (at(0.0), at(-l1)), "b": (at(l1), at(-l2)), "c": (at(l2), at(l3)), "d": (at(1.2), at(-l3))}
    boxes = {name: {"p": f"p_{name}"} for name in POSES} | {"o": {"p": "p_o"}}
    boxes |= {name: {"p1": f"p_{one}", "p2": f"p_{two}"} for name, (one, two) in BARS.items()}
    pattern = Pattern(junctions={f"p_{n}": junction(quantity.body_momentum) for n in ("o", *POSES)}, boxes=boxes)
    fillings = {name: rigid_body(1.0, [0.1, 0.1, 0.1], gravity=[0.0, -9.81, 0.0]) for name in POSES} | {"o": ground()}
    return System.of(pattern, fillings | {n: joint("revolute", *f) for n, f in frames.items()})


def given(**poses):
    return {f"{name}.pe.q": pose for name, pose in (POSES | poses).items()}


@pytest.mark.parametrize("method", METHODS)
def test_relative_poses_follow_from_poses(method):
    sol = ephs.simulate(four_bar(), 0.2, initial=given(), method=method, step=0.01)
    assert sol["a.pe.q_r"][0] == pytest.approx(2.0 * np.arctan2(POSES["crank"][3], POSES["crank"][0]), abs=1e-14)
    assert sol.constraint_error.max() < 1e-13
    found = mobility(sol.problem.descriptor, sol.problem.descriptor.pack(sol.problem.initial))
    assert (found.mobility, found.redundant) == (1, 3)
    assert np.abs(sol["crank.pe.q"][-1] - POSES["crank"]).max() > 1e-2  # it moves


def test_poses_follow_from_relative_poses():
    angle = 2.0 * np.arctan2(POSES["crank"][3], POSES["crank"][0])
    both = given()
    del both["crank.pe.q"]
    sol = ephs.simulate(four_bar(), 0.1, initial=both | {"a.pe.q_r": angle}, method="natural", step=0.01)
    np.testing.assert_allclose(sol["crank.pe.q"][0], POSES["crank"], atol=1e-14)
    assert sol.constraint_error.max() < 1e-13


@pytest.mark.parametrize("method", METHODS)
def test_a_gap_is_refused_by_joint_and_size(method):
    off = SE3.compose(POSES["coupler"], np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.54, 0.0]))
    with pytest.raises(AssemblyError, match=r"^(b|c): .* open by 0\.54 m and"):
        ephs.simulate(four_bar(), 0.1, initial=given(coupler=off), method=method, step=0.01)
    with pytest.raises(AssemblyError, match=r"^a: .* rad"):
        ephs.simulate(four_bar(), 0.1, initial=given() | {"a.pe.q_r": 0.0}, method=method, step=0.01)


def test_what_a_scene_was_made_into_is_left_as_it_is():
    for file in sorted((Path(__file__).parents[2] / "scenes").glob("*.toml")):
        scene = ephs.load(file)
        state = initial_state(scene)
        system = scene.system()
        inputs = {str(p): {"flow": np.zeros(q.quantity.space.dim)} for p, q in system.interface.items()}
        problem = problem_of_system(system, {str(p): v for p, v in state.items()}, inputs)
        for path, value in state.items():
            np.testing.assert_allclose(problem.initial[path], value, atol=1e-15)


def test_checks_say_how_far_joints_are_closed():
    item = next(i for i in check_model(four_bar(), given()).items if i.name == "closure")
    assert item.ok
