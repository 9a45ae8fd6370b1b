"""Massless bodies in loops: what rows and prescribed motions determine moves without mass, the rest is refused."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from tests.numerics import largest
from tests.written import scene_of_text

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


def scene_of(text, massless=MASSLESS):
    return scene_of_text(text.format(massless=massless))


@pytest.mark.parametrize("method", [name for name in METHODS if name != "variational"])
def test_a_massless_lever_follows_the_motion_of_its_end(method):
    """All methods close loops to rounding; positions of `natural` are off by A (ω h)²/12."""
    constant = {} if method in ("rk54", "rk87", "radau") else {"step": 1e-3 if method == "natural" else 5e-3}
    run = ephs.simulate(scene_of(AXLE), 0.05, method=method, **constant)
    angle = run.joint("hinge").coordinate.ravel()
    allowed = 1e-6 if method == "natural" else 1e-12
    assert largest(angle - np.arcsin(0.1 * np.sin(10.0 * run.t))) <= allowed


def test_the_car_axis_arrives_where_it_is_published():
    run = ephs.simulate(scene_of(AXLE + CAR), 3.0, method="rk87", rtol=1e-10, atol=1e-11)
    chassis, end = run.body("chassis"), np.array([0.5, 0.0, 0.0])
    arm = chassis.rotation[-1] @ end
    turning = np.cross(chassis.angular_velocity[-1], arm)
    places = [chassis.position[-1] - arm, chassis.position[-1] + arm]
    rates = [chassis.velocity[-1] - turning, chassis.velocity[-1] + turning]
    found = np.concatenate([each[:2] for each in (*places, *rates)])
    assert largest(found - PUBLISHED) <= 1e-9


def test_forces_are_the_limit_of_those_of_light_bodies():
    """Joint wrenches, which masses of 1e-9 kg change by that times accelerations, of some 40 m/s² here."""
    light = "mass = 1e-9\ninertia = [1e-9, 1e-9, 1e-9]"
    wrenches = []
    for massless in (MASSLESS, light):
        run = ephs.simulate(scene_of(AXLE + CAR, massless), 0.05, method="rk87", rtol=1e-10, atol=1e-11)
        wrenches.append([run.joint(name).wrench[-1] for name in ("guide", "knee", "hinge", "road")])
    found, limit = map(np.array, wrenches)
    assert np.array_equal(np.isnan(found), np.isnan(limit))
    assert np.nanmax(np.abs(found - limit)) <= 1e-6


def test_a_massless_body_that_no_row_determines_is_refused():
    with pytest.raises((ephs.SimulationError, ephs.SceneError), match=r"no mass"):
        ephs.simulate(scene_of(AXLE + LOOSE), 0.1)


LEG = """
[bodies.lo{i}]
{mass}
position = {low}
[bodies.hi{i}]
{mass}
position = {high}
[joints.u{i}]
type = "universal"
bodies = ["ground", "lo{i}"]
at = {foot}
axis = {axis}
axis2 = {axis2}
[joints.p{i}]
type = "prismatic"
bodies = ["lo{i}", "hi{i}"]
at = {middle}
axis = {along}
drive = {drive}
[joints.s{i}]
type = "spherical"
bodies = ["hi{i}", "plat"]
at = {head}
"""


def stewart(mass):
    """A platform of 20 kg on six legs, each of two halves of this mass in kg."""
    given = f"mass = {mass!r}\ninertia = [{mass / 100!r}, {mass / 100!r}, {mass / 100!r}]" if mass else MASSLESS
    text = "format = 1\n[bodies.plat]\nmass = 20.0\ninertia = [0.6, 0.7, 1.1]\nposition = [0.0, 0.0, 0.7]\n"
    for i in range(6):
        turn = np.radians(60.0 * (i // 2 * 2) + np.array([-1.0, 1.0])[i % 2] * np.array([15.0, 45.0]))
        foot = np.array([0.6 * np.cos(turn[0]), 0.6 * np.sin(turn[0]), 0.0])
        head = np.array([0.35 * np.cos(turn[1]), 0.35 * np.sin(turn[1]), 0.7])
        along = (head - foot) / np.linalg.norm(head - foot)
        axis = np.cross([0.0, 0.0, 1.0], along)
        axis /= np.linalg.norm(axis)
        points = {"foot": foot, "head": head, "low": 0.75 * foot + 0.25 * head, "high": 0.25 * foot + 0.75 * head}
        points |= {"middle": 0.5 * (foot + head), "along": along, "axis": axis, "axis2": np.cross(axis, along)}
        text += LEG.format(i=i, mass=given, drive=40.0 + 2.0 * i, **{k: v.tolist() for k, v in points.items()})
    return scene_of_text(text)


def test_a_platform_on_massless_legs_is_the_limit_of_light_ones():
    """What mass m of the legs changes is proportional to it, up to (12 m / 20)² and the tolerance of 1e-9."""
    at = {m: ephs.simulate(stewart(m), 0.2, method="rk87", rtol=1e-9, save_at=[0.2]) for m in (0.0, 1e-3, 1e-2)}
    places = {m: sol.body("plat").position[-1] for m, sol in at.items()}
    light, heavy = ((places[m] - places[0.0]) / m for m in (1e-3, 1e-2))
    assert largest(light) > 0.01
    assert largest(light - heavy) < 12.0 * 1e-2 / 20.0 * largest(light)


def test_linearised_massless_legs_are_the_limit_of_light_ones():
    found = {m: ephs.linearize(stewart(m)).A for m in (0.0, 1e-6, 1e-4)}
    rates = {m: np.sort(np.abs(np.linalg.eigvals(A))) for m, A in found.items()}
    assert [A.shape for A in found.values()] == 3 * [(12, 12)]
    heavy = largest(rates[1e-4] - rates[0.0]) / 1e-4
    assert heavy > 0.01
    assert largest(rates[1e-6] - rates[0.0]) < 2.0 * 1e-6 * heavy + 1e-9


def test_tangents_of_massless_legs_are_the_limit_of_light_ones():
    """By natural; an explicit method refuses them."""
    found = {
        m: ephs.sensitivity(stewart(m), ["bodies.plat.mass"], 0.05, method="natural", step=0.01) for m in (0.0, 1e-6)
    }
    one, other = (of["bodies.plat.pe.q"][-1].ravel() for of in found.values())
    assert largest(one) > 1e-4
    assert largest(one - other) < 1e-5 * largest(one)
    with pytest.raises(ephs.OptionError, match="method is 'rk87'"):
        ephs.sensitivity(stewart(0.0), ["bodies.plat.mass"], 0.05, method="rk87")


BETWEEN = """
format = 1
[world]
gravity = [0.4, -1.0, 0.7]
[bodies.frame]
mass = 0.0
inertia = [0.0, 0.0, 0.0]
position = {at}
[bodies.block]
mass = 2.0
inertia = [0.2, 0.3, 0.4]
position = {place}
[joints.outer]
type = "{kind}"
bodies = ["ground", "frame"]
at = {at}
axis = {axis}
[joints.inner]
type = "{kind}"
bodies = ["frame", "block"]
at = {at}
axis = {other}
"""
"""A frame without mass between two joints in one place."""


def between(kind, seed, tilt):
    """With axes anywhere, so far from each other in rad; and the axes."""
    source = np.random.default_rng(seed)
    axis, aside = np.linalg.qr(source.normal(size=(3, 2)))[0].T
    other = np.cos(tilt) * axis + np.sin(tilt) * aside
    at, place = source.normal(size=(2, 3))
    given = {"at": at, "place": place, "axis": axis, "other": other}
    text = BETWEEN.format(kind=kind, **{key: value.tolist() for key, value in given.items()})
    return scene_of_text(text), np.array([axis, aside])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["prismatic", "revolute", "cylindrical", "spherical"])
def test_two_joints_with_one_axis_do_not_determine_what_is_between_them(kind, seed):
    """However rounding turns out, which the sweeps may take for mass."""
    scene, _ = between(kind, seed, 0.0)
    model = ephs.dynamics(scene)  # whose places and Jacobians are known all the same
    at = model.state0
    for refused in (lambda: ephs.simulate(scene, 0.01), lambda: model.acceleration(at), lambda: model.mass_matrix(at)):
        with pytest.raises(ephs.SimulationError, match="not determined"):
            refused()


@pytest.mark.parametrize("tilt", [1e-3, 0.1, 1.5])
@pytest.mark.parametrize("seed", range(3))
def test_two_slides_in_one_plane_fall_along_it(seed, tilt):
    """The control: as far as rounding over the square of the angle."""
    scene, plane = between("prismatic", seed, tilt)
    dynamics = ephs.dynamics(scene)
    found = dynamics.acceleration(dynamics.state0)
    axis, other = plane[0], np.cos(tilt) * plane[0] + np.sin(tilt) * plane[1]
    along = found["outer"][0] * axis + found["inner"][0] * other
    assert largest(along - plane.T @ (plane @ [0.4, -1.0, 0.7])) <= 1e-14 / np.sin(tilt) ** 2
