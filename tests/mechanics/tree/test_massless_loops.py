"""Massless bodies in loops: what rows and prescribed motions determine moves without mass, the rest is refused."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS

MASSLESS = "mass = 0.0\ninertia = [0.0, 0.0, 0.0]"
AXLE = """
format = 1
[world]
gravity = [0.0, -1.0, 0.0]
[bodies.axle]
{massless}
angular_velocity = [0.0, 0.0, 1.0]
[bodies.wheel]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [1.0, 0.0, 0.0]
velocity = [0.0, 1.0, 0.0]
[bodies.hub]
{massless}
position = [1.0, 0.0, 0.0]
velocity = [0.0, 1.0, 0.0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "axle"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[joints.road]
type = "prismatic"
bodies = ["ground", "wheel"]
at = [1.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
motion = {{ amplitude = 0.1, frequency = 1.5915494309189535 }}
[joints.slot]
type = "prismatic"
bodies = ["wheel", "hub"]
at = [1.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["hub", "axle"]
at = [1.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
"""
"""A massless lever of 1 m whose end is moved up and down: its angle is arcsin(0.1 sin 10 t)."""
CAR = """
[bodies.block]
{massless}
position = [0.0, 0.5, 0.0]
velocity = [-0.5, 0.0, 0.0]
angular_velocity = [0.0, 0.0, 1.0]
[bodies.chassis]
mass = 1e-3
inertia = [2.5e-4, 2.5e-4, 2.5e-4]
position = [0.5, 0.5, 0.0]
velocity = [-0.5, 0.0, 0.0]
[joints.guide]
type = "prismatic"
bodies = ["axle", "block"]
at = [0.0, 0.5, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.knee]
type = "revolute"
bodies = ["block", "chassis"]
at = [0.0, 0.5, 0.0]
axis = [0.0, 0.0, 1.0]
[springs.left]
bodies = ["ground", "chassis"]
at1 = [0.0, 0.0, 0.0]
at2 = [-0.5, 0.0, 0.0]
stiffness = 1.0
length = 0.5
[springs.right]
bodies = ["axle", "chassis"]
at1 = [1.0, 0.0, 0.0]
at2 = [0.5, 0.0, 0.0]
stiffness = 1.0
length = 0.5
"""
"""The car axis of the Test Set for IVP Solvers (Mazzia, Magherini 2008, II-8): masses ε²M/2 = 5e-4 at both ends."""
PUBLISHED = [
    0.0493455784275402809122, 0.496989460230171153861, 1.04174252488542151681, 0.373911027265361256927,
    -0.0770583684040972357970, 0.00744686658723778553466, 0.0175568157537232222276, 0.770341043779251976443,
]  # fmt: skip
"""Its state at 3 s: x, y of the left and the right end, and their velocities."""
LOOSE = """
[bodies.rod]
mass = 0.0
inertia = [0.0, 0.0, 0.0]
position = [2.0, 0.0, 0.0]
[joints.loose]
type = "revolute"
bodies = ["ground", "rod"]
at = [2.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
"""


def scene_of(tmp_path, text, massless=MASSLESS):
    file = tmp_path / "scene.toml"
    file.write_text(text.format(massless=massless))
    return ephs.load(file)


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("variational", "ida")])
def test_a_massless_lever_follows_the_motion_of_its_end(method, tmp_path):
    """All methods close loops to rounding; positions of `natural` are off by A (ω h)²/12."""
    constant = {} if method in ("rk54", "rk87", "radau") else {"step": 1e-3 if method == "natural" else 5e-3}
    run = ephs.simulate(scene_of(tmp_path, AXLE), 0.05, method=method, **constant)
    angle = run.joint("hinge").coordinate.ravel()
    allowed = 1e-6 if method == "natural" else 1e-12
    assert np.abs(angle - np.arcsin(0.1 * np.sin(10.0 * run.t))).max() <= allowed


def test_the_car_axis_arrives_where_it_is_published(tmp_path):
    run = ephs.simulate(scene_of(tmp_path, AXLE + CAR), 3.0, method="rk87", rtol=1e-10, atol=1e-11)
    chassis, end = run.body("chassis"), np.array([0.5, 0.0, 0.0])
    arm = chassis.rotation[-1] @ end
    turning = np.cross(chassis.angular_velocity[-1], arm)
    places = [chassis.position[-1] - arm, chassis.position[-1] + arm]
    rates = [chassis.velocity[-1] - turning, chassis.velocity[-1] + turning]
    found = np.concatenate([each[:2] for each in (*places, *rates)])
    assert np.abs(found - PUBLISHED).max() <= 1e-9


def test_forces_are_the_limit_of_those_of_light_bodies(tmp_path):
    """Joint wrenches, which masses of 1e-9 kg change by that times accelerations, of some 40 m/s² here."""
    light = "mass = 1e-9\ninertia = [1e-9, 1e-9, 1e-9]"
    wrenches = []
    for massless in (MASSLESS, light):
        run = ephs.simulate(scene_of(tmp_path, AXLE + CAR, massless), 0.05, method="rk87", rtol=1e-10, atol=1e-11)
        wrenches.append([run.joint(name).wrench[-1] for name in ("guide", "knee", "hinge", "road")])
    found, limit = map(np.array, wrenches)
    assert np.array_equal(np.isnan(found), np.isnan(limit))
    assert np.nanmax(np.abs(found - limit)) <= 1e-6


def test_a_massless_body_that_no_row_determines_is_refused(tmp_path):
    with pytest.raises((ephs.SimulationError, ephs.SceneError), match=r"no mass"):
        ephs.simulate(scene_of(tmp_path, AXLE + LOOSE), 0.1)
