"""Hard contact against closed forms: impacts, the last bounce, sticking and slipping, rocking."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from tests.written import scene_of_text

HARD = [name for name, method in METHODS.items() if method.impacts]
RUNS = [*((name, 2.0**-5) for name in HARD), ("rk87", None)]
G = 9.81
BODY = """
[bodies.{name}]
mass = {mass}
inertia = {inertia}
position = {position}
rotation = {rotation}
velocity = {velocity}
angular_velocity = {spin}
[surfaces.{name}]
body = "{name}"
shape = {{ {shape} }}
restitution = {restitution}
friction = {friction}
"""
FLOOR = """
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
rotation = {rotation}
restitution = 1.0
friction = 100.0
"""
UPRIGHT = [1.0, 0.0, 0.0, 0.0]
USUAL = {
    "mass": 2.0, "inertia": [8e-3] * 3, "position": [0.0] * 3, "rotation": UPRIGHT, "velocity": [0.0] * 3,
    "spin": [0.0] * 3, "shape": "sphere = 0.1", "restitution": 0.0, "friction": 0.0,
}  # fmt: skip


def body(name, **given):
    return BODY.format(name=name, **(USUAL | given))


def scene_of(*parts, gravity=G, floor=UPRIGHT):
    head = f'format = 1\nname = "hard"\n[world]\ngravity = [0.0, 0.0, {-gravity}]\n'
    end = FLOOR.format(rotation=floor) if floor else ""
    return scene_of_text(head + "".join(parts) + end)


def inclined(theta):
    """Rotation of a slope that falls along x, and its directions up and down."""
    up, down = np.array([[np.sin(theta), 0.0, np.cos(theta)], [np.cos(theta), 0.0, -np.sin(theta)]])
    return [float(np.cos(theta / 2.0)), 0.0, float(np.sin(theta / 2.0)), 0.0], up, down


def lawful(sol):
    """Both laws in every step, and the energy of the whole to rounding."""
    assert np.abs(sol.energy_error).max() <= 1e-11
    assert sol.stats["least_production"] >= 0.0
    return sol


def run(scene, until, method="rk87", step=None, **options):
    return lawful(ephs.simulate(scene, until, method=method, step=step, **options))


@pytest.mark.parametrize(("method", "step"), RUNS)
def test_a_ball_bounces_until_it_rests(method, step):
    """Infinitely many bounces end at √(2H/g)(1 + e)/(1 − e), and all of the energy is heat.

    Each is an event, at √(2H/g) (1 + 2e + … + 2eᵏ).
    """
    fall, e = 0.2, 0.5
    scene = scene_of(body("ball", position=[0.0, 0.0, 0.1 + fall], restitution=e))
    last = np.sqrt(2.0 * fall / G) * (1.0 + e) / (1.0 - e)
    sol = run(scene, 1.2 * last, method, step, save_at=[0.9 * last, last, 1.1 * last, 1.2 * last])
    assert sol.heat[0] < 2.0 * G * fall * (1.0 - 1e-5)
    assert sol.heat[1:] == pytest.approx(2.0 * G * fall, abs=1e-9)
    assert sol.body("ball").position[1:, 2] == pytest.approx(0.1, abs=1e-9)
    assert sol.contact("ball_floor").force[-1] == pytest.approx([0.0, 0.0, 2.0 * G], abs=1e-5)
    strikes = [event.t for event in sol.events if event.name == "contacts.ball_floor strikes"]
    bounces = np.sqrt(2.0 * fall / G) * np.cumsum([1.0, *(2.0 * e**k for k in range(1, 12))])
    assert strikes[:12] == pytest.approx(bounces, abs=1e-7)
    assert np.all(np.diff(strikes) > 0.0)
    rests = sol.events[-1]
    assert (rests.name, rests.t) == ("contacts.ball_floor sticks", pytest.approx(last, abs=1e-6))
    assert rests.state["bodies.ball.pe.q"][6] == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("method", HARD)
def test_three_hard_balls_share_a_blow_by_one_coefficient(method):
    """Moreau's law: (−1/3, 2/3, 2/3), where elastic balls would come to nearly (0, 0, 1)."""
    balls = [
        body(name, position=[x, 0.0, 0.0], velocity=[v, 0.0, 0.0], restitution=1.0)
        for name, x, v in (("a", -0.05, 1.0), ("b", 0.2, 0.0), ("c", 0.4, 0.0))
    ]
    sol = run(scene_of(*balls, gravity=0.0, floor=None), 0.2, method, 2.0**-5)
    found = [sol.body(name).velocity[-1, 0] for name in "abc"]
    assert found == pytest.approx([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], abs=1e-12)
    assert abs(sol.heat[-1]) <= 1e-12


@pytest.mark.parametrize(("method", "step"), RUNS)
def test_a_sphere_slides_until_it_rolls(method, step):
    """v = 5/7 v₀ from 2 v₀/(7 μ g) on, and 2/7 of the energy are heat."""
    m, mu, v0 = 2.0, 0.3, 1.0
    scene = scene_of(body("ball", position=[0.0, 0.0, 0.1], velocity=[v0, 0.0, 0.0], friction=mu))
    until = 2.0 * v0 / (7.0 * mu * G)
    times = [0.5 * until, until, 1.5 * until]
    sol = run(scene, times[-1], method, step, save_at=times)
    speeds = sol.body("ball").velocity[:, 0]
    tolerance = 1e-4 if step is None else 2e-3
    assert speeds[0] == pytest.approx(v0 - 0.5 * mu * G * until, abs=tolerance)
    assert speeds[1:] == pytest.approx(5.0 / 7.0 * v0, abs=tolerance)
    assert sol.body("ball").angular_velocity[-1, 1] == pytest.approx(speeds[-1] / 0.1, abs=1e-6)
    assert sol.heat[-1] == pytest.approx(m * v0**2 / 7.0, abs=tolerance)
    assert sol.contact("ball_floor").slip[[0, 2]] == pytest.approx([0.5 * v0, 0.0], abs=tolerance)
    (event,) = sol.events
    assert event.name == "contacts.ball_floor sticks"
    assert event.t == pytest.approx(until, abs=1e-6 if step is None else step)


@pytest.mark.parametrize(("mu", "sliding"), [(0.2, True), (0.6, False)])
def test_a_block_on_a_slope_slides_or_stays_where_it_is(mu, sliding):
    theta, until = 0.3, 0.4
    turn, up, down = inclined(theta)
    block = body(
        "block", position=(0.01 * up).tolist(), rotation=turn, inertia=[0.01] * 3, shape="box = [0.4, 0.3, 0.02]",
        friction=mu,
    )  # fmt: skip
    sol = ephs.simulate(scene_of(block, floor=turn), until, method="rk54", step=2.0**-5)
    way = (sol.body("block").position[-1] - 0.01 * up) @ down
    falling = G * (np.sin(theta) - mu * np.cos(theta)) if sliding else 0.0
    assert sol.body("block").velocity[-1] @ down == pytest.approx(falling * until, abs=1e-12)
    assert way == pytest.approx(0.5 * falling * until**2, abs=1e-12)
    assert sol.heat[-1] == pytest.approx(mu * 2.0 * G * np.cos(theta) * way, abs=1e-11)
    pressed = sol.contact("block_floor").force[-1]
    friction = mu * np.cos(theta) if sliding else np.sin(theta)
    assert pressed == pytest.approx(2.0 * G * (np.cos(theta) * up - friction * down), abs=1e-4)


def test_a_rocking_block_loses_by_its_slenderness():
    """Housner: an impact on the other edge leaves (1 − 3/2 sin² α)² of the kinetic energy; a quarter of the period is
    arcosh(1/(1 − θ₀/α))/p for slender blocks, p² = 3 g/4R."""
    b, h, thick, m = 0.02, 0.2, 0.1, 2.0
    radius, alpha, tilt = np.hypot(b, h), np.arctan2(b, h), 0.02
    turn = [float(np.cos(tilt / 2.0)), 0.0, float(np.sin(tilt / 2.0)), 0.0]
    centre = [float(-radius * np.sin(alpha - tilt)), 0.0, float(radius * np.cos(alpha - tilt))]
    inertia = [
        m / 3.0 * (h * h + thick * thick / 4.0),
        m / 3.0 * (b * b + h * h),
        m / 3.0 * (b * b + thick * thick / 4.0),
    ]
    block = body(
        "block", mass=m, position=centre, rotation=turn, inertia=inertia, shape=f"box = [{2 * b}, {thick}, {2 * h}]",
        friction=5.0,
    )  # fmt: skip
    quarter = np.arccosh(1.0 / (1.0 - tilt / alpha)) / np.sqrt(3.0 * G / (4.0 * radius))
    sol = run(scene_of(block), 1.5 * quarter, "rk54", 2.0**-8, save_at=[0.98 * quarter, 1.02 * quarter])
    energy = m * G * radius * (np.cos(alpha - tilt) - np.cos(alpha))
    assert sol.heat[0] == pytest.approx(0.0, abs=1e-4 * energy)
    assert sol.heat[1] / energy == pytest.approx(1.0 - (1.0 - 1.5 * np.sin(alpha) ** 2) ** 2, rel=1e-3)


BALL = {"position": [0.0, 0.0, 0.3], "restitution": 0.5}


@pytest.mark.parametrize("name", [name for name, method in METHODS.items() if method.scenes and not method.impacts])
def test_methods_without_impacts_say_which_have_them(name):
    step = 0.01 if METHODS[name].fixed else None
    with pytest.raises(ephs.OptionError, match=r"rk54, rk87.*contacts\.ball_floor.* acts by impulses"):
        ephs.simulate(scene_of(body("ball", **BALL)), 0.1, method=name, step=step)


def test_impacts_do_not_run_backward():
    with pytest.raises(ephs.OptionError, match="does not run backward"):
        ephs.simulate(scene_of(body("ball", **BALL)), -0.1)


def test_a_hard_surface_meets_an_elastic_one_elastically():
    soft = body("ball", **BALL).replace("restitution = 0.5", "stiffness = 1e5")
    scene = scene_of(soft)
    assert scene.contacts["ball_floor"].law.stiffness == 1e5
