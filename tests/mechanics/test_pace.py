"""Steps that are chosen follow what is prescribed, where no error tells how long they may be."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import ephs
from benchmarks.hard import CASES
from ephs.mechanics.runs.pace import TIMES, TURN, longest_step
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from examples.failing import four_bar
from tests.mechanics.methods.test_by_hand import four_bar as four_bar_by_hand
from tests.scenes import ROOT
from tests.written import scene_of_text

SLIDE = """
format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.a]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [3.0, 0.0, 0.0]
[bodies.b]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [0.0, 4.0, 0.0]
[joints.slide]
type = "prismatic"
bodies = ["ground", "a"]
at = [3.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
motion = { rate = RATE }
"""


def test_a_joint_moves_by_a_tenth_of_a_turn_or_of_the_extent_at_most():
    for rate, expected in (("-2.0", TURN * 5.0 / 2.0), ("0.0", np.inf)):
        assert (
            longest_step(problem_of_scene(scene_of_text(SLIDE.replace("RATE", rate))), 8, 1e-6, (0.0, 1.0)) == expected
        )
    assert longest_step(problem_of_scene(four_bar(2.5)), 2, 0.0, (0.0, 1.0)) == TURN
    assert longest_step(problem_of_scene(four_bar(2.5)), 2, 1e-6, (0.0, 1.0)) == pytest.approx(0.01)


@pytest.mark.parametrize("rtol", [1e-5, 1e-6])
def test_steps_of_low_order_follow_the_tolerance_where_nothing_is_free(rtol):
    """Momenta of natural satisfy constraints to the order of its steps, and there is no position that could show it."""
    case = CASES["dead centre"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ephs.CostWarning)
        sol = ephs.simulate(case.make(), case.until, method="natural", rtol=rtol)
    assert case.error(sol) <= TIMES * rtol


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_no_step_leaps_over_what_a_linkage_cannot_reach(method):
    with pytest.raises(ephs.SimulationError) as failed:
        ephs.simulate(four_bar(1.2), 6.0, method=method)
    assert 4.0 < failed.value.time < 4.1


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "auto"])
def test_the_work_of_what_is_prescribed_is_as_good_as_the_rest(method):
    text = (ROOT / "scenes/slider-crank.toml").read_text()
    scene = scene_of_text(text.replace("drive = 0.06", "motion = { rate = 10.0 }"))
    sol = ephs.simulate(scene, 1.0, method=method)
    assert sol.energy_error.max() < 1e-6
    assert sol.stats["longest_step"] <= TURN / 10.0
    assert ephs.simulate(scene, 0.1, method=method, max_step=0.003).stats["longest_step"] <= 0.003


@pytest.mark.parametrize("joint", ["shoulder", "elbow"])
@pytest.mark.parametrize("turned", [False, True], ids=["planar", "spatial"])
def test_what_drives_a_joint_outweighs_friction_and_springs_in_it(joint, turned):
    text = (ROOT / "ephs/templates/double-pendulum.toml").read_text()
    more = "motion = { rate = 1.5 }\nrate = 1.5\nfriction = 0.4\nstiffness = 3.0\nrest = 0.2\n"
    text = text.replace(f"[joints.{joint}]\n", f"[joints.{joint}]\n{more}")
    if turned:  # the upper axis stands aslant of the lower one
        text = text.replace(
            "0.5], rotation = [0.7071067811865476, 0.0, 0.7071067811865476, 0.0] }\ncoordinate = 0.5",
            "0.5], rotation = [0.8, 0.0, 0.6, 0.0] }\ncoordinate = 0.5",
        )
    scene = scene_of_text(text)
    natural = ephs.simulate(scene, 1.0, method="natural", step=1e-3)
    explicit = ephs.simulate(scene, 1.0, method="rk87", rtol=1e-10, atol=1e-12)
    assert explicit.energy_error.max() < 1e-8
    assert explicit.work[-1] == pytest.approx(natural.work[-1], rel=1e-4)


@pytest.mark.parametrize("told", ["law", "function"])
@pytest.mark.parametrize("seconds", [0.4, 5.12], ids=["any", "a-cycle-a-sample"])
def test_a_crank_made_by_hand_has_the_limit_of_that_in_a_scene(told, seconds):
    """A sine of 50 Hz, 0.01 rad: its largest rate is π rad/s, whatever the samples are in step with."""
    law = ephs.HarmonicMotion(0.01, 50.0, 0.5 * np.pi)
    scene, system, poses, _ = four_bar_by_hand()
    joints = {**scene.joints, "main": replace(scene.joints["main"], motion=law, drive=np.zeros(1))}
    value = law if told == "law" else lambda t: law.rate(t)
    problem = problem_of_system(system, poses, {"motor": {"effort": value}})
    for order, rtol in ((8, 1e-6), (2, 1e-9)):
        expected = min(TURN, (TIMES * rtol) ** (1.0 / order)) / np.pi
        of_scene = longest_step(problem_of_scene(replace(scene, joints=joints)), order, rtol, (0.0, seconds))
        assert of_scene == longest_step(problem, order, rtol, (0.0, seconds)) == pytest.approx(expected, rel=1e-3)
