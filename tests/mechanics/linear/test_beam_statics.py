"""Beams at rest: large bending, follower loads, buckling, modes of stressed states, against closed forms and tables."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import ephs
from tests.numerics import jacobian, largest
from tests.written import scene_of_text

HEAD = 'format = 1\nname = "rods"\n[world]\ngravity = [0.0, 0.0, {gravity}]\n'
ROD = """[beams.{name}]
points = {points}
elements = {elements}
up = {up}
section = {{ {soft}GJ = {GJ!r}, EI = [{EI2!r}, {EI3!r}], rhoA = 1.0, rhoI = {turning} }}
ends = [{ends}]
{form}
{more}
"""
KINDS = {
    "order 2": ("order = 2", "EA = {EA!r}, GA = [{GA!r}, {GA!r}], "),
    "order 4": ("order = 4", "EA = {EA!r}, GA = [{GA!r}, {GA!r}], "),
    "kirchhoff": ('rod = "kirchhoff"', ""),
}
"""Beams of either order, and rods that neither stretch nor shear."""
SOFT = {"EA": 1e4, "GA": 1e4, "GJ": 500.0, "EI2": 500.0, "EI3": 1000.0}
THIN = {"EA": 1e6, "GA": 1e6, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0}


def rod(
    points, elements, section, kind="order 2", name="rod", up=(0.0, 0.0, 1.0), ends='"ground"', more="",
    turning=(2e-3, 1e-3, 1e-3),
):  # fmt: skip
    points, up = [[float(x) for x in point] for point in points], [float(x) for x in up]
    form, soft = KINDS[kind]
    return ROD.format(
        name=name, points=points, elements=elements, up=up, ends=ends, form=form, soft=soft.format(**section),
        more=more, turning=list(turning), **section,
    )  # fmt: skip


def load(body, **given):
    return f'[loads.{body.replace(".", "_")}]\nbody = "{body}"\n' + "".join(f"{k} = {v}\n" for k, v in given.items())


def scene_of(text, gravity=0.0):
    return scene_of_text(HEAD.format(gravity=gravity) + text)


def displaced(scene, body):
    """How far a body goes to its equilibrium."""
    return ephs.equilibrium(scene).model.body(body).pose[4:] - scene.body(body).pose[4:]


def along(length):
    return [(0.0, 0.0, 0.0), (length, 0.0, 0.0)]


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize(
    ("kind", "elements", "follower"),
    [("order 2", 3, "true"), ("order 2", 8, "false"), ("order 4", 4, "true"), ("kirchhoff", 3, "false")],
)
def test_an_end_moment_rolls_a_rod_up_to_a_circle(kind, elements, follower, axis):
    """About either axis of the section, the stiffer one too; rigid pieces are then a regular polygon."""
    moment = [0.0, 0.0, 0.0]
    moment[axis] = 2.0 * np.pi * SOFT[f"EI{axis + 1}"]
    end = f"rod.{elements}"
    text = rod(along(1.0), elements, SOFT, kind, up=(0.0, 1.0, 0.0)) + load(end, moment=moment, follower=follower)
    assert largest(ephs.equilibrium(scene_of(text)).model.body(end).pose[4:]) <= 1e-11


@pytest.mark.parametrize("order", [2, 4])
def test_a_bend_of_45_degrees_goes_to_its_limit_by_its_order(order):
    """Bathe and Bolourchi's cantilever: E = 1e7, section 1 × 1 with J = 1/6 and κ = 5/6, radius 100, 600 across."""
    young = 1e7
    section = {"EA": young, "GA": young / 2.4, "GJ": young / 12.0, "EI2": young / 12.0, "EI3": young / 12.0}
    found = []
    for elements in (4, 8, 16):
        angles = np.linspace(0.0, np.pi / 4.0, 5)
        points = [(100.0 * np.sin(a), 100.0 * (1.0 - np.cos(a)), 0.0) for a in angles]
        text = rod(points, elements, section, f"order {order}") + load(f"rod.{elements}", force=[0.0, 0.0, 600.0])
        found.append(displaced(scene_of(text), f"rod.{elements}"))
    one, two = found[1] - found[0], found[2] - found[1]
    assert np.linalg.norm(one) / np.linalg.norm(two) == pytest.approx(2.0**order, rel=0.05)
    assert largest(found[2] + two / (2.0**order - 1.0) - [-23.5607, -13.6047, 53.4755]) <= 5e-4


def princeton_section(h=12.3777e-3, w=3.2024e-3, young=71.7e9, nu=0.31):
    """Stiffnesses of an aluminium strip."""
    area, strong, weak = h * w, w * h**3 / 12.0, h * w**3 / 12.0
    shear = young / (2.0 * (1.0 + nu))
    return {
        "EA": young * area, "GA": shear * area * 5.0 / 6.0, "GJ": 0.198 * shear * (strong + weak),
        "EI2": young * weak, "EI3": young * strong,
    }  # fmt: skip


PRINCETON = princeton_section()


TABLE = [
    ("order 2", 8.896, 30, 10.112, 79.39), ("kirchhoff", 8.896, 60, 6.605, 129.89), ("order 2", 8.896, 90, 0.0, 146.25),
    ("order 2", 13.345, 15, 16.458, 64.36), ("kirchhoff", 13.345, 45, 15.186, 156.47),
    ("order 2", 13.345, 75, 6.249, 196.10),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "force", "degrees", "y", "z"), TABLE)
def test_the_princeton_beam_goes_where_its_table_says(kind, force, degrees, y, z):
    """Bent about both axes and twisted, with stiffnesses that are 15 and 4 times apart."""
    beta = np.radians(degrees)
    push = load("rod.12", force=[0.0, float(force * np.cos(beta)), float(force * np.sin(beta))])
    scene = scene_of(rod(along(0.508), 12, PRINCETON, kind, up=(0.0, 1.0, 0.0)) + push)
    found = 1e3 * displaced(scene, "rod.12")[1:]
    assert largest(found - [y, z]) <= 0.01 * max(y, z)


def elastica(load_number):
    """Tip (x, y)/L of a cantilever under a dead load across its end, with P L²/EI given, by elliptic integrals."""

    def start(k):
        return np.arcsin(1.0 / (k * np.sqrt(2.0)))

    def excess(k):
        return ellipk(k * k) - ellipkinc(start(k), k * k) - np.sqrt(load_number)

    k = brentq(excess, np.sqrt(0.5) + 1e-12, 1.0 - 1e-9)
    root = np.sqrt(load_number)
    x = np.sqrt(2.0) * np.sqrt(2.0 * k * k - 1.0) / root
    y = 1.0 - 2.0 * (ellipe(k * k) - ellipeinc(start(k), k * k)) / root
    return np.array([x, y])


@pytest.mark.parametrize(
    ("number", "kind"), [(1.0, "order 2"), (10.0, "order 2"), (10.0, "order 4"), (5.0, "kirchhoff")]
)
def test_a_thin_rod_is_the_elastica(number, kind):
    order, tips = 4 if kind == "order 4" else 2, []
    for elements in (8, 16):
        text = rod(along(1.0), elements, THIN | {"EA": 1e8, "GA": 1e8}, kind)
        text += load(f"rod.{elements}", force=[0.0, 0.0, number])
        tips.append(ephs.equilibrium(scene_of(text)).model.body(f"rod.{elements}").pose[[4, 6]])
    limit = tips[1] + (tips[1] - tips[0]) / (2.0**order - 1.0)
    assert largest(limit - elastica(number)) <= largest(tips[1] - tips[0]) / 16.0
    assert (largest(tips[0] - elastica(number)) > 1e-4) == (order == 2)  # eight elements alone


def hanging(number):
    """Tip (x, y)/L of a rod clamped level, that hangs by its own weight, with ρ g A L³/EI given: by collocation."""
    places = np.linspace(0.0, 1.0, 101)

    def slopes(s, y):  # the turn and its rate: EI θ'' = −w (L − s) cos θ
        return np.array([y[1], -number * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    guess = np.zeros((4, places.size))
    for part in np.linspace(0.1, 1.0, 10):
        found = solve_bvp(
            lambda s, y, part=part: slopes(s, y) * [[1.0], [part], [1.0], [1.0]],
            lambda a, b: np.array([a[0], b[1], a[2], a[3]]),
            places, guess, tol=1e-9, max_nodes=10**5,
        )  # fmt: skip
        assert found.success
        guess = found.sol(places)
    return -found.sol(1.0)[[2, 3]] * [-1.0, 1.0]


WIRES = {
    "steel 2 mm": (2e-3, 210e9, 7850.0, 1.0),
    "steel 0.3 mm": (3e-4, 210e9, 7850.0, 1.0),
    "rubber": (5e-3, 5e6, 1100.0, 0.5),
}
"""Radius, Young's modulus, density, length; the last two sag by 0.8 and 0.9 of their length."""


@pytest.mark.parametrize("name", list(WIRES))
def test_a_rod_of_any_softness_hangs_by_its_own_weight(name):
    """From where it is straight, without parts of a load."""
    radius, young, density, length = WIRES[name]
    tips = []
    for elements in (8, 16):
        section = f"section = {{ circle = {radius}, E = {young}, nu = 0.3, rho = {density} }}"
        text = f"[beams.rod]\npoints = [[0.0, 0.0, 0.0], [{length}, 0.0, 0.0]]\nelements = {elements}\n"
        text += f'up = [0.0, 0.0, 1.0]\n{section}\nends = ["ground"]\norder = 2\n'
        rest = ephs.equilibrium(scene_of_text("format = 1\n" + text))
        assert rest.residual <= 1e-9 and rest.steps <= 15
        tips.append(rest.model.body(f"rod.{elements}").pose[[4, 6]] / length)
    exact = hanging(density * 9.81 * length**3 * 4.0 / (young * radius**2))
    limit = tips[1] + (tips[1] - tips[0]) / 3.0
    thick = (radius / length) ** 2 + density * 9.81 * length / young  # shear and stretch, which the elastica has not
    assert largest(limit - exact) <= largest(tips[1] - tips[0]) / 8.0 + 10.0 * thick
    assert exact[1] < -0.04


def frame(elements, force, rigid=1.0):
    """Two legs; ``rigid`` stiffens what does not buckle: stretch, shear and bending in the plane."""
    young, nu, t, h, length = 7.124e10, 0.31, 0.6e-3, 30e-3, 0.24
    shear = young / (2.0 * (1.0 + nu))
    section = {
        "EA": rigid * young * t * h, "GA": rigid * shear * t * h * 5.0 / 6.0, "GJ": shear * h * t**3 / 3.0,
        "EI2": rigid * young * h**3 * t / 12.0, "EI3": young * t**3 * h / 12.0,
    }  # fmt: skip
    corner, end = (length, 0.0, 0.0), (length, -length, 0.0)
    legs = rod([(0.0, 0.0, 0.0), corner], elements, section, "order 4")
    legs += rod([corner, end], elements, section, "order 4", "arm", ends=f'"rod.{elements}"')
    return legs + load(f"arm.{elements}", force=[force, 0.0, 0.0])


@pytest.mark.parametrize("end", [1.5, 3.0, -1.5])
def test_a_right_angle_frame_buckles_out_of_its_plane(end):
    """Whatever the last load: at 1.0868 N one way and 0.6802 N the other, if it is rigid in its plane."""
    (critical,) = ephs.equilibrium(scene_of(frame(4, end, rigid=100.0))).critical
    assert end * critical == pytest.approx(1.0868 if end > 0.0 else -0.6802, abs=1e-4)


def test_loads_of_a_frame_of_rectangular_section_converge():
    """By order 4, to the figure of a refined run: torsion by Saint-Venant's series, soft in its plane, too."""
    section = "section = { rectangle = [30e-3, 0.6e-3], E = 7.124e10, nu = 0.31, rho = 2700.0 }"
    loads = []
    for elements in (4, 8, 16):
        text = re.sub(r"section = .*", section, frame(elements, -1.5))
        (critical,) = ephs.equilibrium(scene_of(text)).critical
        loads.append(-1.5 * critical)
    first, second = np.abs(np.diff(loads))
    assert 12.0 < first / second < 20.0
    assert loads[-1] + (loads[-1] - loads[-2]) / 15.0 == pytest.approx(-0.679, abs=5e-4)


def test_a_path_goes_through_limit_points():
    """A shallow arch with clamped feet snaps: the load falls, and rises again on the other side."""
    angles = np.linspace(-0.25, 0.25, 9)
    points = [(4.0 * np.sin(a), 0.0, 4.0 * np.cos(a)) for a in angles]
    text = rod(points, 8, THIN | {"EA": 1e4, "GA": 1e4}, up=(0.0, 1.0, 0.0), ends='"ground", "ground"')
    found = ephs.equilibrium(scene_of(text + load("rod.4", force=[0.0, 0.0, -600.0])))
    assert np.any(np.diff(found.shares) < 0.0) and found.shares[-1] == 1.0
    assert len(found.critical) >= 2 and found.model.body("rod.4").pose[6] < points[0][2]


@pytest.mark.parametrize(
    ("ends", "first"), [('"ground"', 1.8751040687), ("", 4.7300407449)], ids=["cantilever", "free-free"]
)
@pytest.mark.parametrize("kind", KINDS)
def test_rods_swing_at_the_frequencies_of_thin_beams(kind, ends, first):
    order, found = 4 if kind == "order 4" else 2, []
    for elements in (8, 16):
        text = rod(along(1.0), elements, THIN, kind, ends=ends, turning=(2e-6, 1e-6, 1e-6))
        linear = ephs.linearize(scene_of(text))
        found.append(min(mode.frequency for mode in linear.modes if mode.frequency > 1e-3))
    exact = first**2 / (2.0 * np.pi)
    off = np.abs(np.array(found) / exact - 1.0)
    thick = 1e-6 * first**2  # of shear and rotary inertia, which thin beams have none of
    assert off[1] <= 2.0 * off[0] / 2.0**order + 4.0 * thick
    assert found[1] + (found[1] - found[0]) / (2.0**order - 1.0) == pytest.approx(exact, rel=max(1e-3, off[0] ** 2))
    assert (off[1] > 1e-3) == (order == 2)


def test_tension_stiffens_and_modes_of_the_stressed_state_show_it():
    """A clamped rod under tension swings faster; under compression near Euler's load hardly at all."""
    euler, slow = np.pi**2 / 4.0, []
    for force in (-0.97 * euler, 0.0, euler):
        text = rod(along(1.0), 8, THIN) + load("rod.8", force=[float(force), 0.0, 0.0])
        scene = scene_of(text)
        rest = ephs.equilibrium(scene).model
        slow.append(min(mode.frequency for mode in ephs.linearize(rest).modes if mode.frequency > 1e-6))
    assert slow[0] < 0.3 * slow[1] < 0.3 * slow[2]


def test_loads_count_in_the_derivatives_of_the_dynamics():
    loads = load("rod.2", force=[1.0, 2.0, 30.0], moment=[4.0, 50.0, 6.0])
    loads += load("rod.1", force=[1.0, 20.0, 3.0], moment=[4.0, 5.0, 6.0], follower="true")
    model = ephs.dynamics(scene_of(rod(along(1.0), 2, SOFT) + loads))
    n, h = model.layout.n, 1e-5  # ∛ε: truncation and rounding of differences are equally small
    at, zero = model.moved(model.state0, 0.1 * np.random.default_rng(3).standard_normal(n)), np.zeros(n)
    by = model.derivatives(at, accelerations={})
    forward = model.derivatives(at).acceleration_q
    for exact, function in ((by.force_q, model.inverse_dynamics), (forward, model.acceleration)):
        differenced = jacobian(lambda v, function=function: function(model.moved(at, v), zero), n, h)
        assert largest(exact - differenced) <= 1e-8 * largest(exact)
