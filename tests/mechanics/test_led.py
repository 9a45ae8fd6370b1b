"""The work of prescribed motions that leave no freedom: through dead centres, by every method."""

from dataclasses import replace

import numpy as np
import pytest

import ephs
from benchmarks.hard.dead_centre import RATE, folding, gained
from ephs import PolynomialMotion
from tests.numerics import EPS, largest
from tests.scenes import shipped
from tests.written import scene_of_text

UNTIL = 4.9
SHAFT = """
format = 1
[bodies.shaft]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
angular_velocity = [0.0, 0.0, 2.0]
[bodies.bob]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.0, 0.0, 0.0]
velocity = [0.0, 2.0, 0.0]
angular_velocity = [0.0, 0.0, 2.0]
[joints.drive]
type = "revolute"
bodies = ["ground", "shaft"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
motion = { rate = 2.0 }
[joints.hinge]
type = "revolute"
bodies = ["shaft", "bob"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
"""


@pytest.mark.filterwarnings("ignore::ephs.CostWarning")
@pytest.mark.parametrize(
    ("method", "rtol"),
    [(m, r) for m in ("auto", "rk54", "rk87", "radau") for r in (1e-4, 1e-6, 1e-10)],
)
def test_work_through_dead_centres_is_right_or_found_wrong(method, rtol):
    """At a dead centre of equal lengths the slider may stop, and the rod turn with the crank: who does so says so."""
    sol = ephs.simulate(folding(), UNTIL, method=method, rtol=rtol, audit="off")
    moves = abs(sol.body("slider").velocity[-1, 0]) > 1.0
    assert moves == (sol.work[-1] == pytest.approx(gained(UNTIL), abs=1e-11 * sol.kinetic.max()))
    assert moves or [finding.law for finding in sol.audit.findings] == ["ledger"]
    if method == "radau" and rtol <= 1e-6:
        assert moves and sol.audit.passed


@pytest.mark.parametrize("method", ["natural", "natural4", "variational", "rk54"])
def test_constant_steps_find_it_to_their_order(method):
    sol = ephs.simulate(folding(), UNTIL, method=method, step=0.01, audit="off")
    bound = 1e-3 if method == "natural" else 1e-7  # its velocities at nodes are off the joints by h²
    assert sol.work[-1] == pytest.approx(gained(UNTIL), abs=bound * sol.kinetic.max())


def test_heat_is_part_of_the_work():
    """The rod turns by twice the rate against the crank: friction μ makes heat 4 μ ω² t."""
    sol = ephs.simulate(folding(0.3), UNTIL, method="radau")
    heat = 4.0 * 0.3 * RATE**2 * UNTIL
    assert sol.heat[-1] == pytest.approx(heat, rel=1e-4)
    assert sol.work[-1] == pytest.approx(gained(UNTIL) + heat, rel=1e-4)


def test_a_motion_that_leaves_freedoms_is_counted_by_its_multiplier():
    """A pendulum on a shaft that turns evenly: work is the sum of its power, right to the method's error, which the
    plain defect of the balance shows."""
    sol = ephs.simulate(scene_of_text(SHAFT), 1.0, method="rk54", rtol=1e-4)
    assert 1e-12 < sol.stats["plain_defect"]["largest"] / sol.ledgers.scale < 1e-2
    assert sol.energy_error.max() < 1e-12


@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_a_loop_that_is_held_at_rest_takes_few_iterations(method):
    """All velocities are rounding: residuals of constraints have no scale of their own, and none is made of it."""
    scene = shipped("slider-crank")
    scene = replace(
        scene,
        bodies={name: replace(body, twist=np.zeros(6)) for name, body in scene.bodies.items()},
        joints={
            name: replace(joint, rate=0.0 * joint.rate)
            if name != "bearing"
            else replace(joint, rate=0.0 * joint.rate, drive=None, motion=PolynomialMotion([0.0]))
            for name, joint in scene.joints.items()
        },
    )
    sol = ephs.simulate(scene, 0.3, method=method, **({"step": 1e-2} if method == "natural" else {}))
    assert sol.audit.passed and sol.joint("bearing").coordinate[-1, 0] == 0.0
    assert sol.stats["iterations"] <= 12 * sol.stats["steps"]


HELD = """
format = 1
[bodies.rod]
mass = {mass}
inertia = [0.001, 0.2, 0.2]
position = [0.5, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
motion = {{ times = [0.0, 1.0], displacements = [{held}, {held}] }}
"""


@pytest.mark.parametrize("method", ["rk87", "rk54", "auto", "radau"])
def test_the_work_of_what_holds_a_joint_is_rounding_and_no_finding(method, tmp_path):
    file = tmp_path / "held.toml"
    for held, mass in ((0.2, 2.0), (0.2, 2e4), (1.3, 2.0)):
        file.write_text(HELD.format(held=held, mass=mass), encoding="utf-8")
        sol = ephs.simulate(ephs.load(file), 0.5, method=method)
        assert sol.audit.passed, sol.audit
        assert largest(sol.work) <= 100.0 * EPS * mass * 9.81
