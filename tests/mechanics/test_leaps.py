"""Steps that pass a thin surface without an instant inside are found; steps that meet it are not."""

import numpy as np
import pytest

import ephs
from ephs.solve.auditing.audit import LEAP
from tests.written import scene_of_text

THICK, RADIUS, SPEED, START = 0.02, 0.01, 10.0, 0.26
SCENE = f"""
format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.ball]
mass = 1.0
inertia = [4e-5, 4e-5, 4e-5]
position = [SIDE, 0.0, START]
velocity = [0.0, 0.0, -{SPEED}]
[surfaces.ball]
body = "ball"
shape = {{ sphere = {RADIUS} }}
stiffness = 1e7
[surfaces.plate]
body = "ground"
shape = {{ box = [1.0, 1.0, {THICK}] }}
stiffness = 1e7
"""
WAY = THICK + 2.0 * RADIUS


@pytest.fixture
def ball():
    def scene(side=0.0):
        return scene_of_text(SCENE.replace("SIDE", repr(side)).replace("START", repr(START)))

    return scene


@pytest.mark.parametrize("by_hand", [False, True])
@pytest.mark.parametrize("kept", [None, 5])
def test_a_ball_that_passes_a_plate_in_a_step_is_found(kept, by_hand, ball):
    """0.1 m a step through 0.04 m: the motion is that of a free body, and every balance is kept.

    The stage of such a step of `natural` does not lie inside the plate.
    """
    step, until = 0.0097, 0.06
    times = None if kept is None else np.linspace(0.0, until, kept)
    model, name = (ball().system(), "bodies.ball") if by_hand else (ball(), "ball")
    run = ephs.simulate(model, until, method="natural", step=step, save_at=times, audit="off")
    assert run.body(name).position[-1, 2] == pytest.approx(START - SPEED * until), "the control: it went through"
    (path, _, size) = max(run.linked.leaps(step), key=lambda leap: leap[2])
    assert str(path) == "contacts.ball_plate" and size == pytest.approx(SPEED * step / WAY, rel=1e-6)
    (finding,) = run.audit.findings
    assert finding.law == "accuracy"
    assert finding.path == "contacts.ball_plate"
    assert finding.size == pytest.approx(SPEED * step / WAY, rel=1e-6)
    assert finding.allowed == LEAP
    assert START - SPEED * finding.at < 0.0, "the instant after it"


def test_a_ball_at_the_end_of_an_arm_that_turns_is_found():
    """Its body only turns, about a centre 1 m aside."""
    text = SCENE.replace("SIDE", "-1.0").replace("START", repr(START)).replace(f"-{SPEED}]", "0.0]")
    text = text.replace(
        "[surfaces.ball]", f"angular_velocity = [0.0, {SPEED}, 0.0]\n[surfaces.ball]\nposition = [1.0, 0.0, 0.0]"
    )
    run = ephs.simulate(scene_of_text(text), 0.06, method="natural", step=0.0097, audit="off")
    assert run.body("ball").position[-1] == pytest.approx([-1.0, 0.0, START]), "the control: it met nothing"
    (leap,) = run.motion.leaps(0.0097)
    assert leap[2] == pytest.approx(SPEED * 0.0097 / WAY, rel=1e-2)


def test_the_step_that_is_advised_meets_the_plate(ball):
    run = ephs.simulate(ball(), 0.06, method="natural", step=0.0097, audit="off")
    short = float(run.audit.findings[0].advice.split(" of ")[1].split()[0])
    met = ephs.simulate(ball(), 0.06, method="natural", step=short, audit="off")
    assert met.contact("ball_plate").gap.min() < 0.0
    assert not any("passed" in finding.advice for finding in met.audit.findings)


@pytest.mark.parametrize("method", ["natural", "variational", "rk54"])
@pytest.mark.parametrize("part", [0.03, 0.15, 0.3, 0.45])
@pytest.mark.parametrize("offset", [0.0, 0.4])
def test_no_soft_contact_lets_a_ball_through_in_silence(offset, part, method):
    """Steps of a part of the plate's way: runs end where the contact has no direction, or are found to pass it."""
    start = START + offset * part * WAY
    scene = scene_of_text(SCENE.replace("SIDE", "0.0").replace("START", repr(start)).replace("1e7", "100.0"))
    try:
        run = ephs.simulate(scene, 0.06, method=method, step=part * WAY / SPEED, audit="off")
    except ephs.SimulationError as error:
        assert error.outcome is ephs.Outcome.DEPTH and error.path == "contacts.ball_plate.point0.pe"
        return
    assert part > 0.1, "shorter steps have an end in the layer in which runs end"
    assert run.body("ball").position[-1, 2] < 0.0, "it went through"
    (finding,) = run.audit.findings
    assert finding.path == "contacts.ball_plate" and "passed" in finding.advice


def test_an_overlap_that_turns_back_is_not():
    """A swing to 0.8 of the way to the middle, by steps that are longer than the layer in which runs end."""
    deep = 0.8 * 0.5 * WAY
    stiffness = 2.0 * (SPEED / deep) ** 2  # two surfaces in series have half of it
    scene = scene_of_text(SCENE.replace("SIDE", "0.0").replace("START", repr(START)).replace("1e7", repr(stiffness)))
    run = ephs.simulate(scene, 0.06, method="rk87", step=0.2 * WAY / SPEED, audit="off")
    assert run.contact("ball_plate").gap.min() < -0.9 * deep
    assert not any("passed" in finding.advice for finding in run.audit.findings)


@pytest.mark.parametrize("side", [0.6, 0.52])
def test_a_ball_that_passes_beside_the_plate_is_not(side, ball):
    assert ephs.simulate(ball(side), 0.06, method="natural", step=0.0097).audit.passed


def test_a_ball_that_bounces_is_not_where_few_instants_are_kept(ball):
    run = ephs.simulate(ball(), 0.06, method="rk54", rtol=1e-4, save_at=np.linspace(0.0, 0.06, 4))
    assert run.audit.passed
    assert run.body("ball").velocity[-1, 2] > 0.0


@pytest.mark.parametrize("method", ["auto", "rk54", "rk87", "radau", "semi"])
def test_chosen_steps_of_a_system_meet_a_plate_as_those_of_its_scene(method, ball):
    """Nothing but the plate limits steps before they meet; a system had no such limit, and the ball fell through."""
    scene = ball()
    ends = [
        ephs.simulate(model, 0.06, method=method, audit="off").body(name).position[-1]
        for model, name in ((scene, "ball"), (scene.system(), "bodies.ball"))
    ]
    assert ends[0][2] > 0.0
    assert ends[1] == pytest.approx(ends[0], abs=1e-3)


def test_hard_surfaces_are_passed_neither(ball):
    """By a system made by hand, at a speed at which one step would lead through."""
    text = SCENE.replace("SIDE", "0.0").replace("START", repr(START)).replace("stiffness = 1e7", "restitution = 0.5")
    run = ephs.simulate(scene_of_text(text).system(), 0.06)
    assert run.body("bodies.ball").velocity[-1, 2] == pytest.approx(0.5 * SPEED, rel=1e-6)
