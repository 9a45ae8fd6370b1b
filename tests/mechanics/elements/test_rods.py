"""Rods that neither stretch nor shear, and strings: limits by constraints, against closed forms, by order 2."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jn_zeros

import ephs
from ephs.mechanics.elements import components
from ephs.mechanics.elements.beam import hinge_damper
from ephs.mechanics.elements.strain import turning_resistance
from ephs.mechanics.scene import build
from ephs.semantics.spaces import SE3, SO3, pair
from ephs.testing import check_primitive
from tests.mechanics.elements.test_beam import flight_is_lawful
from tests.mechanics.linear.test_beam_statics import HEAD, along
from tests.methods import OF_SCENES
from tests.numerics import largest, slope
from tests.written import scene_of_text

KIRCHHOFF = "{ GJ = 0.8, EI = [1.0, 2.0], rhoA = 1.0, rhoI = [2e-4, 1e-4, 1e-4] }"
STRING = "{ rhoA = 0.3 }"


def rod(points, elements, kind="kirchhoff", section=KIRCHHOFF, more='ends = ["ground"]', gravity=0.0):
    points = [[float(x) for x in point] for point in points]
    place = f"points = {points}\nelements = {elements}\nup = [0.0, 1.0, 0.0]\n"
    return HEAD.format(gravity=gravity) + f'[beams.rod]\n{place}rod = "{kind}"\nsection = {section}\n{more}\n'


def load(elements, **given):
    return f'[loads.tip]\nbody = "rod.{elements}"\n' + "".join(f"{k} = {v}\n" for k, v in given.items())


def assert_of_order_2(found, exact):
    """Errors of 3 runs, each with twice the elements, fall by 4, and their extrapolation meets the closed form."""
    off = np.abs(np.array(found) - exact)
    assert off[1] / off[2] == pytest.approx(4.0, rel=0.1)
    assert abs(found[2] + (found[2] - found[1]) / 3.0 - exact) <= off[2] / 16.0


# ---- rest -----------------------------------------------------------------------------------------------------------


def test_a_string_hangs_as_a_catenary():
    lowest = []
    for elements in (4, 8, 16):
        points = [(-0.5, 0.0, 0.0), (0.0, 0.0, -0.4), (0.5, 0.0, 0.0)]
        ends = 'ends = ["ground", "ground"]'
        scene = scene_of_text(rod(points, elements, "string", STRING, ends, gravity=-9.81))
        lowest.append(ephs.equilibrium(scene).model.body(f"rod.{elements // 2}").pose[6])
    length = sum(scene.beams["rod"].lengths)
    a = brentq(lambda a: 2.0 * a * np.sinh(0.5 / a) - length, 0.05, 10.0)
    assert_of_order_2(lowest, a * (1.0 - np.cosh(0.5 / a)))


# ---- motion ---------------------------------------------------------------------------------------------------------


def test_a_hanging_string_swings_at_the_zeros_of_bessel_functions():
    found = []
    for elements in (8, 16, 32):
        down = [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0)]
        modes = ephs.linearize(scene_of_text(rod(down, elements, "string", STRING, gravity=-9.81))).modes
        all_ = np.sort([mode.frequency for mode in modes if mode.frequency > 1e-3])
        found.append(all_[[0, 2]])  # every one twice, in both planes
    for i, zero in enumerate(jn_zeros(0, 2)):
        assert_of_order_2([pair[i] for pair in found], 0.5 * zero * np.sqrt(9.81) / (2.0 * np.pi))


def test_a_rod_twists_by_its_closed_form():
    """Torsion of a clamped rod: the lowest frequency is √(GJ/ρI₁)/4L."""
    found = []
    for elements in (4, 8, 16):
        modes = ephs.linearize(scene_of_text(rod(along(1.0), elements))).modes
        exact = np.sqrt(0.8 / 2e-4) / 4.0
        found.append(min((mode.frequency for mode in modes), key=lambda f: abs(f - exact)))
    assert_of_order_2(found, exact)


THICK = KIRCHHOFF.replace("[2e-4, 1e-4, 1e-4]", "[2e-2, 1e-2, 1e-2]")
STRUCK = "angular_velocity = [0.5, 2.0, 3.0]\nstrain = [0.1, 0.5, 0.3, 0.0, 0.0, 0.0]\nvelocity = [1.0, 2.0, 3.0]\n"


@pytest.mark.parametrize("name", OF_SCENES)
def test_a_flying_rod_keeps_its_energy_and_its_momenta(name):
    """To rounding what the method keeps, else by its accuracy; a bent rod stays in one piece by every method."""
    scene = scene_of_text(rod(along(1.0), 4, section=THICK, more=STRUCK))
    sol = flight_is_lawful(scene, 0.25, name, 2.0**-8, slice(3))
    assert largest(np.linalg.norm(np.diff(sol.beam("rod").position, axis=1), axis=2) - 0.25) <= 0.01


def test_damping_turns_into_heat_what_the_motion_loses():
    heat = 'damping = 0.02\nheat = "core"\n[thermal.core]\ncapacity = 1.0\ntemperature = 300.0\n'
    scene = scene_of_text(rod(along(1.0), 6, section=THICK, more=STRUCK + heat))
    summary = ephs.simulate(scene, 0.25, method="natural", step=2.0**-8).summary()
    assert summary["heat"] > 0.05
    assert summary["max_energy_error"] <= 1e-11 and summary["min_entropy_production"] >= 0.0
    assert summary["thermal"]["core"]["temperature"] == pytest.approx(300.0 + summary["heat"], rel=1e-12)


def test_stiff_beams_come_to_the_rod():
    """The energies of stretch and shear made 100 and 10 000 times larger: the difference goes with them."""
    scene = scene_of_text(rod(along(1.0), 8) + load(8, force=[0.0, 0.0, 2.0]))
    limit = ephs.equilibrium(scene).model.body("rod.8").pose[4:]
    off = []
    for stiff in (1e3, 1e5, 1e7):
        text = rod(along(1.0), 8, "reissner", KIRCHHOFF.replace("GJ", f"EA = {stiff}, GA = [{stiff}, {stiff}], GJ"))
        found = ephs.equilibrium(scene_of_text(text + load(8, force=[0.0, 0.0, 2.0]))).model.body("rod.8")
        off.append(found.pose[4:] - limit)
    assert np.linalg.norm(off[0] - off[2] - 100.0 * (off[1] - off[2])) <= 0.02 * np.linalg.norm(off[0] - off[2])
    assert np.linalg.norm(off[2]) <= 2e-3  # what 8 elements of either kind differ by


# ---- readings and files ---------------------------------------------------------------------------------------------


def test_a_rod_tells_its_strain_and_what_holds_its_pieces():
    """A cantilever at rest under a load on its end: the load in every section, and its moment about it."""
    rest = ephs.equilibrium(scene_of_text(rod(along(1.0), 8) + load(8, force=[0.3, 0.0, 2.0]))).model
    found = ephs.simulate(rest, 2.0**-8, method="natural", step=2.0**-9).beam("rod")
    assert np.linalg.norm(found.force[-1], axis=1) == pytest.approx(np.hypot(0.3, 2.0), rel=1e-6)
    middle = [(rest.joint(f"rod-{i}"), rest.body(f"rod.{i}").pose) for i in range(1, 9)]
    for (joint, pose), moment in zip(middle, found.moment[-1], strict=True):
        at = SE3.compose(pose, joint.frame2)[4:]
        arm = found.position[-1, -1] - at
        assert np.linalg.norm(moment) == pytest.approx(np.linalg.norm(np.cross(arm, [0.3, 0.0, 2.0])), abs=1e-6)
    assert found.strain[..., :3] * np.array([0.8, 1.0, 2.0]) == pytest.approx(found.moment, abs=1e-9)
    assert not found.strain[..., 3:].any() and found.energy[-1].sum() > 0.1


# ---- damping --------------------------------------------------------------------------------------------------------

BENT = "{ GJ = 0.8, EI = [1.0, 2.0], rhoA = 1.0, rhoI = [2e-2, 1e-2, 1e-2] }"


def heat(elements, turned, method="radau", **options):
    """Heat of a damped rod, clamped at the origin, under its weight and a moment at its tip, named from either end."""
    points, ends, tip = along(1.0), '["ground"]', elements
    if turned:
        points, ends, tip = points[::-1], '["free", "ground"]', 0
    text = rod(points, elements, section=BENT, more=f"ends = {ends}\ndamping = 0.05", gravity=-9.81)
    text += f'[loads.tip]\nbody = "rod.{tip}"\nmoment = [0.5, 0.7, 0.0]\n'
    return ephs.simulate(scene_of_text(text), 0.3, method=method, audit="off", **options).heat[-1]


TAKEN = [("radau", {"rtol": 1e-8}), ("rk54", {"rtol": 1e-8}), ("semi", {"step": 2e-3}), ("natural", {"step": 0.01})]


@pytest.mark.parametrize(("method", "options"), TAKEN, ids=[name for name, _ in TAKEN])
def test_damping_is_the_same_from_either_end(method, options):
    """Though the stiffness differs by axis, so that friction on an angular velocity would differ by its axes."""
    one, other = (heat(4, turned, method, **options) for turned in (False, True))
    if method == "semi":  # its stages are not even, but its steps of 2e-3 s err by more
        allowed = abs(heat(4, False, method, step=1e-3) / one - 1.0)
        assert allowed < 1e-4
    else:
        allowed = 10.0 * options.get("rtol", 1e-9)
    assert one == pytest.approx(other, rel=allowed)


def test_friction_on_an_angular_velocity_is_not(monkeypatch):
    """The control, which is of order one in the elements: the mean of both ends is of order two."""
    monkeypatch.setattr(build, "hinge_damper", lambda mu: components.joint_friction(pair("spherical"), mu))
    off = [abs(heat(n, True, rtol=1e-8) / heat(n, False, rtol=1e-8) - 1.0) for n in (4, 8)]
    assert off[0] > 4e-3 and off[0] / off[1] == pytest.approx(2.0, rel=0.2)


def test_the_heat_of_damping_is_of_order_2():
    found = [heat(n, False, rtol=1e-8) for n in (4, 8, 16)]
    assert (found[1] - found[0]) / (found[2] - found[1]) == pytest.approx(4.0, rel=0.15)


def test_the_damping_of_a_hinge_resists_the_rate_of_its_rotation_vector():
    """By its structure, and as differences of rotation vectors say."""
    d, turn = np.diag([0.8, 1.0, 2.0]), np.array([0.4, -0.9, 0.5])
    check_primitive(hinge_damper(d), max_examples=20)
    q, u = SO3.exp(turn), np.array([0.3, 0.2, -0.7])
    rate = slope(lambda t: SO3.log(SO3.compose(q, SO3.exp(t * u))), 1e-5)
    power = u @ np.array(turning_resistance(q, d)) @ u
    assert power == pytest.approx(rate @ d @ rate, rel=1e-8)
    assert abs(u @ d @ u - power) > 1e-2 * power
