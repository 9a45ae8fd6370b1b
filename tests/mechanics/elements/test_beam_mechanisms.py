"""Beams in mechanisms: a spinning arm, a slider-crank with an elastic rod beside the rigid one."""

import numpy as np
import pytest

import ephs
from tests.numerics import largest
from tests.written import scene_of_text

SPINNING = """format = 1
name = "arm"
[world]
gravity = [0.0, 0.0, 0.0]
[beams.arm]
from = [0.0, 0.0, 0.0]
to = [10.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = 8
section = { EA = 2.8e7, GA = [1e7, 1e7], GJ = 1.4e4, EI = [1.4e4, 1.4e4], rhoA = 1.2, rhoI = [1.2e-3, 6e-4, 6e-4] }
angular_velocity = [0.0, 0.0, 6.0]
damping = 0.01
[joints.hub]
type = "revolute"
bodies = ["ground", "arm.0"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
motion = { rate = 6.0 }
"""

CRANK = """format = 1
name = "elastic slider-crank"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.crank]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, 0.0]
angular_velocity = [0.0, 50.0, 0.0]
[bodies.slider]
mass = 0.1
inertia = [1e-3, 1e-3, 1e-3]
position = [{reach!r}, 0.0, 0.0]
velocity = [7.5, 0.0, 0.0]
[beams.rod]
from = [0.0, 0.0, 0.15]
to = [{reach!r}, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
elements = {elements}
order = 4
section = {{ circle = 0.004, E = {young!r}, nu = 0.3, rho = 7850.0 }}
velocity = [7.5, 0.0, 0.0]
[joints.bearing]
type = "revolute"
bodies = ["ground", "crank"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
motion = {{ rate = 50.0 }}
[joints.pin]
type = "revolute"
bodies = ["crank", "rod.0"]
at = [0.0, 0.0, 0.15]
axis = [0.0, 1.0, 0.0]
[joints.wrist]
type = "revolute"
bodies = ["rod.{elements}", "slider"]
at = [{reach!r}, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.wall]
type = "prismatic"
bodies = ["ground", "slider"]
at = [{reach!r}, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
"""
RADIUS, LENGTH, SPEED, TURN = 0.15, 0.3, 50.0, 2.0 * np.pi / 50.0


def test_a_spinning_arm_stretches_by_its_closed_form():
    """Simo and Vu-Quoc's arm at 6 rad/s: ρA ω² L³/(3 EA) = 5.143e-4 m longer, after its damped waves are gone."""
    sol = ephs.simulate(scene_of_text(SPINNING), 2.0, method="natural", step=0.02, audit="off")
    tip = np.linalg.norm(sol.body("arm.8").position[-1])
    exact = 1.2 * 6.0**2 * 10.0**3 / (3.0 * 2.8e7)
    assert tip - 10.0 == pytest.approx(exact, rel=1e-2)


def crank(young, elements=4, until=0.5 * TURN, steps=200):
    reach = float(np.sqrt(LENGTH**2 - RADIUS**2))
    text = CRANK.format(reach=reach, young=young, elements=elements)
    return ephs.simulate(scene_of_text(text), until, method="natural", step=until / steps, audit="off")


def sag(sol, elements):
    """How far the middle of the rod is off the line between its ends, (n,)."""
    ends = [sol.body(f"rod.{i}").position for i in (0, elements // 2, elements)]
    return np.linalg.norm(ends[1] - 0.5 * (ends[0] + ends[2]), axis=1)


def test_an_elastic_slider_crank_comes_to_a_refined_run_by_order_4():
    runs = [crank(2e10, elements, 0.25 * TURN) for elements in (4, 8, 16)]
    found = [sag(sol, elements) for sol, elements in zip(runs, (4, 8, 16), strict=True)]
    off = [float(largest(each - found[2]) / found[2].max()) for each in found[:2]]
    assert found[2].max() > 3e-3
    assert off[1] <= 0.01 and off[0] >= 10.0 * off[1]


def test_stiff_rods_come_to_the_rigid_mechanism():
    """The slider leaves r cos φ + √(l² − r² sin² φ) by less and less, in proportion to 1/E."""
    off = []
    for young in (2e10, 2e11, 2e12):
        sol = crank(young)
        angle = 0.5 * np.pi - SPEED * sol.t
        rigid = RADIUS * np.cos(angle) + np.sqrt(LENGTH**2 - (RADIUS * np.sin(angle)) ** 2)
        off.append(float(largest(sol.body("slider").position[:, 0] - rigid)))
        assert sol.summary()["max_energy_error"] <= 1e-11
    assert off[0] > 5.0 * off[1] > 25.0 * off[2]
