"""The work of prescribed motions that leave no freedom: through dead centres, by every method."""

from pathlib import Path

import numpy as np
import pytest

import ephs

START, RATE, UNTIL = 0.7, 3.0, 4.9
HEAD = "format = 1\nname = 'dead centre'\n[world]\ngravity = [0.0, 0.0, 0.0]\n"
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


def crank(tmp_path: Path, friction: float = 0.0) -> ephs.Scene:
    """A slider-crank whose crank and rod are 1 m long, so that it folds: twice a turn all lies on one point."""
    c, s = np.cos(START), np.sin(START)
    pin, end = np.array([c, s]), np.array([2.0 * c, 0.0])
    fast = RATE * np.array([-s, c]), np.array([-2.0 * RATE * s, 0.0])
    bodies = (
        ("crank", 1.0, 0.5 * pin, START, 0.5 * fast[0], RATE),
        ("rod", 1.0, 0.5 * (pin + end), -START, 0.5 * (fast[0] + fast[1]), -RATE),
        ("slider", 0.5, end, 0.0, fast[1], 0.0),
    )
    joints = (
        ("drive", "revolute", "ground", "crank", (0.0, 0.0), f"motion = {{ rate = {RATE} }}"),
        ("pin", "revolute", "crank", "rod", pin, f"friction = {friction}"),
        ("end", "revolute", "rod", "slider", end, ""),
        ("rail", "prismatic", "ground", "slider", end, ""),
    )
    text = HEAD
    for name, mass, (x, y), angle, (vx, vy), rate in bodies:
        about = mass / 12.0
        text += (
            f"[bodies.{name}]\nmass = {mass}\ninertia = [{0.01 * about}, {about}, {about}]\n"
            f"position = [{x!r}, {y!r}, 0.0]\n"
            f"rotation = [{np.cos(0.5 * angle)!r}, 0.0, 0.0, {np.sin(0.5 * angle)!r}]\n"
            f"velocity = [{vx!r}, {vy!r}, 0.0]\nangular_velocity = [0.0, 0.0, {rate}]\n"
        )
    for name, kind, one, other, (x, y), more in joints:
        axis = "[1.0, 0.0, 0.0]" if kind == "prismatic" else "[0.0, 0.0, 1.0]"
        text += (
            f"[joints.{name}]\ntype = '{kind}'\nbodies = ['{one}', '{other}']\nat = [{x!r}, {y!r}, 0.0]\n"
            f"axis = {axis}\n{more}\n"
        )
    file = tmp_path / "crank.toml"
    file.write_text(text.replace("np.float64(", "").replace(")", ""))
    return ephs.load(file)


def gained() -> float:
    """The kinetic energy gained: K = ω² (2 sin² φ + const) of these masses."""
    after = START + RATE * UNTIL
    return RATE**2 * 2.0 * (np.sin(after) ** 2 - np.sin(START) ** 2)


@pytest.mark.filterwarnings("ignore::ephs.CostWarning")
@pytest.mark.parametrize(
    ("method", "rtol"),
    [*((m, r) for m in ("auto", "rk54", "rk87", "radau") for r in (1e-4, 1e-6, 1e-10)), ("alpha", 1e-5)],
)
def test_work_through_dead_centres_is_right_or_found_wrong(method, rtol, tmp_path):
    """At a dead centre of equal lengths the slider may stop, and the rod turn with the crank: who does so says so."""
    sol = ephs.simulate(crank(tmp_path), UNTIL, method=method, rtol=rtol, audit="off")
    moves = abs(sol.body("slider").velocity[-1, 0]) > 1.0
    assert moves == (sol.work[-1] == pytest.approx(gained(), abs=1e-11 * sol.kinetic.max()))
    assert moves or [finding.law for finding in sol.audit.findings] == ["ledger"]
    if method == "radau" and rtol <= 1e-6:
        assert moves and sol.audit.passed


@pytest.mark.parametrize("method", ["natural", "natural4", "variational", "rk54"])
def test_constant_steps_find_it_to_their_order(method, tmp_path):
    sol = ephs.simulate(crank(tmp_path), UNTIL, method=method, step=0.01, audit="off")
    bound = 1e-3 if method == "natural" else 1e-7  # its velocities at nodes are off the joints by h²
    assert sol.work[-1] == pytest.approx(gained(), abs=bound * sol.kinetic.max())


def test_heat_is_part_of_the_work(tmp_path):
    """The rod turns by twice the rate against the crank: friction μ makes heat 4 μ ω² t."""
    sol = ephs.simulate(crank(tmp_path, 0.3), UNTIL, method="radau")
    heat = 4.0 * 0.3 * RATE**2 * UNTIL
    assert sol.heat[-1] == pytest.approx(heat, rel=1e-4)
    assert sol.work[-1] == pytest.approx(gained() + heat, rel=1e-4)


def test_a_motion_that_leaves_freedoms_is_counted_by_its_multiplier(tmp_path):
    """A pendulum on a shaft that turns evenly: work is the sum of its power, right to the method's error."""
    file = tmp_path / "shaft.toml"
    file.write_text(SHAFT)
    sol = ephs.simulate(ephs.load(file), 1.0, method="rk54", rtol=1e-4)
    assert 1e-12 < sol.energy_error.max() < 1e-2
