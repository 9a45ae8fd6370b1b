"""A run knows no unit: in other units of length, mass and time the same mechanism moves the same, by every method."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.own_units import NEAR, SI, OwnUnits, mobility_of
from ephs.mechanics.scene.rescaled import rescaled
from tests.methods import OF_SCENES
from tests.scenes import shipped

FOUR_BAR = shipped("four-bar")
SPAN, STEP = 0.125, 2.0**-6
EXPONENTS = st.tuples(*[st.integers(-30, 30)] * 3)
SOLVED = 1e-11
"""Relative; Newton's iterations end at 1e-13 of what moves, and radau's at a part of its tolerance."""


def ran(name, exponents=(0, 0, 0), **more):
    length, mass, time = (2.0**k for k in exponents)
    method = METHODS[name]
    steps = {"step": STEP * time} if method.fixed else {"rtol": 1e-9, "atol": 1e-12}
    scene = rescaled(FOUR_BAR, length, mass, time)
    return ephs.simulate(scene, SPAN * time, method=name, save_at=[0.0, SPAN * time], **steps, **more)


def moved(sol, exponents=(0, 0, 0)):
    """What the run found, in the units of the scene that it was scaled from."""
    length, mass, time = (2.0**k for k in exponents)
    energy = mass * length**2 / time**2
    joint, body = sol.joint("main"), sol.body("coupler")
    return np.concatenate([
        joint.coordinate[-1], joint.rate[-1] * time, body.position[-1] / length, body.velocity[-1] * time / length,
        [sol.heat[-1] / energy, sol.work[-1] / energy],
    ])  # fmt: skip


@pytest.mark.parametrize("name", OF_SCENES)
def test_a_run_knows_no_unit(name):
    there = moved(ran(name))
    near = SOLVED if METHODS[name].fixed else 1e-6

    @settings(max_examples=2)
    @example(exponents=(-28, 0, 0))
    @example(exponents=(30, -30, 30))
    @given(exponents=EXPONENTS)
    def law(exponents):
        np.testing.assert_allclose(moved(ran(name, exponents), exponents), there, rtol=near, atol=near)

    law()


@pytest.mark.parametrize("name", ["natural", "natural4", "rk54", "radau"])
def test_a_whole_unit_further_every_bit_is_the_same(name):
    there = moved(ran(name))
    for exponents in ((NEAR[0], 0, 0), (-NEAR[0], NEAR[1], -NEAR[2])):
        np.testing.assert_array_equal(moved(ran(name, exponents), exponents), there)


@settings(max_examples=10)
@example(exponents=(-28, 0, 0))
@given(exponents=EXPONENTS)
def test_mobility_knows_no_unit(exponents):
    scene = rescaled(FOUR_BAR, *(2.0**k for k in exponents))
    found = mobility_of(problem_of_scene(scene))
    assert (found.mobility, found.redundant) == (1, 3)


def test_near_metres_kilograms_and_seconds_runs_are_in_these():
    assert OwnUnits.of(FOUR_BAR) == SI
    assert OwnUnits.of(rescaled(FOUR_BAR, 2.0**-28)) == OwnUnits(2.0**-32, 1.0, 1.0)


def test_what_users_give_and_see_is_in_their_units(tmp_path):
    """Inputs, events, progress, steps, failures and journals of a run in units of its own."""
    exponents = (-28, -24, 22)
    length, mass, time = (2.0**k for k in exponents)
    energy = mass * length**2 / time**2
    seen = []

    def of(length, time, energy):
        def push(t, state):
            return 0.3 * energy * np.sin(5.0 * t / time) * np.cos(float(state["joints.main.pe.q_r"][0]))

        def level(t, state):
            return float(state["bodies.coupler.pe.q"][4]) / length - start - 1e-3

        return {"inputs": {"joints.main": push}, "events": [ephs.Event(level, "level")]}

    start = float(FOUR_BAR.body("coupler").pose[4])
    far = ran(
        "rk54", exponents, **of(length, time, energy), journal=tmp_path / "run.journal",
        progress=lambda t, until, stats: seen.append((t, until)),
    )  # fmt: skip
    near = ran("rk54", **of(1.0, 1.0, 1.0))
    np.testing.assert_allclose(moved(far, exponents), moved(near), rtol=SOLVED, atol=SOLVED)
    assert [c.t / time for c in far.events] == pytest.approx([c.t for c in near.events], rel=1e-9)
    assert far.stats["step"] == STEP * time and far.t[-1] == SPAN * time
    for one, two in zip(far.events, near.events, strict=True):
        assert one.state["bodies.coupler.pe.q"][4] / length == pytest.approx(
            two.state["bodies.coupler.pe.q"][4], rel=1e-9
        )
    assert all(t <= until == SPAN * time for t, until in seen)
    np.testing.assert_array_equal(moved(ephs.load_solution(tmp_path / "run.journal"), exponents), moved(far, exponents))
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(rescaled(FOUR_BAR, length, mass, time), time, method="natural", step=time / 256.0,
                      inputs={"joints.main": lambda t, state: np.nan if t > 0.25 * time else 0.0})  # fmt: skip
    assert caught.value.time == 0.25 * time
