"""Sweeps and sensitivities through soft contact, against runs of their own and differences; what hard contact says."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.parameters import varied
from ephs.solve.posing.errors import OptionError
from tests.written import scene_of_text

SCENE = """
format = 1
name = "thrown"
[bodies.ball]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, 0.12]
velocity = [1.0, 0.0, -0.2]
[surfaces.ball]
body = "ball"
shape = { sphere = 0.1 }
{law}
friction = 0.3
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
SOFT = "stiffness = 1e4\nexponent = 1.5\nloss = 0.2\nslip = 1e-2"
PATHS = [*(f"contacts.ball_floor.{key}" for key in ("stiffness", "loss", "friction")), "bodies.ball.mass"]
VALUES = [1e4, 0.2, 0.3, 1.0]
STEP, UNTIL = 2e-4, 0.12


def scene_of(law=SOFT):
    return scene_of_text(SCENE.replace("{law}", law))


def end(sol):
    ball = sol.body("ball")
    return np.concatenate([ball.position[-1], ball.velocity[-1]])


def run(scene, path=None, value=None):
    model = scene if path is None else varied(scene, {path: value})
    return end(ephs.simulate(model, UNTIL, method="rk54", step=STEP, audit="off"))


def test_sensitivities_through_contact_are_those_of_differences():
    scene = scene_of()
    found = ephs.sensitivity(scene, PATHS, UNTIL, method="rk54", step=STEP)
    slopes = found.of(end)
    touched = ephs.simulate(scene, UNTIL, method="rk54", step=STEP, audit="off").contact("ball_floor")
    assert touched.gap.min() < 0.0
    for slope, path, value in zip(slopes.T, PATHS, VALUES, strict=True):
        by = 1e-4 * value
        expected = (run(scene, path, value + by) - run(scene, path, value - by)) / (2.0 * by)
        assert np.abs(expected).max() > 0.0
        assert slope == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def test_a_sweep_through_contact_is_its_runs():
    scene, values, path = scene_of(), [0.1, 0.3, 0.6], "contacts.ball_floor.friction"
    found = ephs.sweep(
        scene, {path: values}, UNTIL, outputs=["joints.ball.rate"], save_at=[0.0, UNTIL], method="rk54", step=STEP
    )
    assert np.all(found["status"] == "done")
    rates = found["joints.ball.rate"].to_numpy()[:, -1]
    for rate, value in zip(rates, values, strict=True):
        sol = ephs.simulate(varied(scene, {path: value}), UNTIL, method="rk54", step=STEP, audit="off")
        assert rate == pytest.approx(sol.joint("ball").rate[-1], rel=1e-12, abs=1e-13)
    assert np.ptp(rates[:, 3]) > 1e-2, "it slips"


def test_hard_contact_says_that_it_has_no_derivative():
    scene = scene_of("restitution = 0.5")
    with pytest.raises(OptionError, match="impulses"):
        ephs.sensitivity(scene, ["bodies.ball.mass"], UNTIL, method="rk54", step=STEP)
