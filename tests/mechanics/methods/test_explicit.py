"""Explicit methods on the reduced form: references by others, the natural method's limit, orders, loops, inputs."""

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from benchmarks.cases import CASES
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.finding.mechanism import reduce_system
from ephs.testing import mechanisms
from tests.numerics import largest
from tests.scenes import model_of, of_all_scenes, shipped
from tests.written import scene_of_text

BY_NAME = {case.name: case for case in CASES}
TIGHT = {"method": "rk87", "rtol": 1e-10, "atol": 1e-10}


def distance(one, other, scene):
    """Largest difference of positions and rotations of bodies, coordinates of joints, entropies, in this order."""
    worst = 0.0
    for name, _ in scene.all_bodies():
        a, b = one.body(name), other.body(name)
        worst = max(worst, largest(a.position - b.position), largest(a.rotation - b.rotation))
    for path in one:
        if tuple(path)[-1] == "s":
            worst = max(worst, largest(one[path] - other[path]))
    return worst


def limit_is_met(scene, until, h, slack=0.05):
    """The explicit result lies where the natural method's steps h and h/2 point to."""
    exact = ephs.simulate(scene, until, save_at=[until], **TIGHT)
    coarse, fine = (ephs.simulate(scene, until, step=step, save_at=[until]) for step in (h, 0.5 * h))
    far, near = distance(coarse, exact, scene), distance(fine, exact, scene)
    assert near <= (0.25 + slack) * far + 1e-8
    assert exact.constraint_error.max(initial=0.0) <= 1e-10
    assert exact.energy_error.max(initial=0.0) <= 1e-7
    return exact, fine


@of_all_scenes
def test_the_natural_method_tends_to_the_explicit_one(file):
    scene = ephs.load(file)
    h = {"heavy-top": 5e-4, "motor-four-bar": 2.5e-4}.get(file.stem, 4e-3)  # currents settle in a millisecond
    exact, fine = limit_is_met(scene, 0.4, h)
    assert exact.heat[-1] == pytest.approx(fine.heat[-1], rel=2e-2, abs=1e-6)
    assert exact.work[-1] == pytest.approx(fine.work[-1], rel=2e-2, abs=1e-6)
    for name, _ in scene.all_joints():
        assert np.allclose(exact.joint(name).coordinate[-1], fine.joint(name).coordinate[-1], atol=1e-2)


@settings(max_examples=12)
@given(scene=mechanisms(max_bodies=3))
def test_so_it_does_on_generated_mechanisms(scene):
    limit_is_met(scene, 0.05, 5e-3, slack=0.2)


@pytest.mark.parametrize("name", ["andrews-squeezer", "revolute-chain-4", "spherical-chain-2", "tumbling-body"])
def test_references_of_independent_computations_are_met(name):
    case = BY_NAME[name]
    sol = ephs.simulate(case.scene(), case.time, method="rk87", rtol=1e-12, atol=1e-12, save_at=[case.time])
    assert case.error(sol) <= 1e-9
    assert sol.constraint_error.max() <= 1e-10


def test_a_fast_top_is_met_by_smaller_tolerances():
    case = BY_NAME["heavy-top"]
    errors = [
        case.error(ephs.simulate(case.scene(), case.time, method="rk87", rtol=tol, atol=tol, save_at=[case.time]))
        for tol in (1e-8, 1e-10, 1e-12)
    ]
    assert errors[2] <= 1e-9
    assert errors[0] > errors[1] > errors[2]


def test_dense_output_has_the_order_of_the_steps():
    scene = BY_NAME["spherical-chain-2"].scene()
    times = np.linspace(0.0, 1.0, 23)
    every = ephs.simulate(scene, 1.0, save_at=times, **TIGHT)
    for t in (7, 22):
        alone = ephs.simulate(scene, times[t], save_at=[times[t]], **TIGHT)
        for name, _ in scene.all_bodies():
            assert largest(every.body(name).position[t] - alone.body(name).position[-1]) <= 1e-8
    assert np.array_equal(every.t, times)


def test_few_unknowns_are_left():
    scene = shipped("four-bar")
    problem = problem_of_scene(scene)
    model = model_of(problem)
    reduced = reduce_system(problem, model)
    assert reduced.freedoms == 3
    assert len(reduced.cut) == 1
    assert reduced.unknowns < 0.1 * model.unknowns
    summary = ephs.simulate(scene, 0.1, **TIGHT).summary()
    assert summary["unknowns"] == {"paper": model.unknowns, "used": reduced.unknowns}


def test_a_loop_of_prescribed_joints_is_refused_by_name():
    text = """
    format = 1
    [bodies.bar]
    mass = 1.0
    inertia = [0.1, 0.1, 0.1]
    [joints.left]
    type = "revolute"
    bodies = ["ground", "bar"]
    at = [0.0, 0.0, 0.0]
    axis = [1.0, 0.0, 0.0]
    motion = { rate = 0.0 }
    [joints.right]
    type = "revolute"
    bodies = ["ground", "bar"]
    at = [0.5, 0.0, 0.0]
    axis = [1.0, 0.0, 0.0]
    motion = { rate = 0.0 }
    """
    with pytest.raises(ephs.OptionError, match=r"that of (left|right), which closes a loop of prescribed joints"):
        ephs.simulate(scene_of_text(text), 0.1, **TIGHT)
