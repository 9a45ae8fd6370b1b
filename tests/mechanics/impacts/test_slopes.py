"""Cylinders, capsules, spheres and boxes on slopes, hard: rolling, slipping, standing and tipping."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.shapes.pairs import ROUNDED
from tests.mechanics.impacts.test_hard_contact import inclined
from tests.written import scene_of_text

G, MASS, RADIUS, LENGTH = 9.81, 2.0, 0.1, 0.3
THICK = 0.2
HEAD = 'format = 1\nname = "slope"\n[world]\ngravity = [0.0, 0.0, -9.81]\n'
BODY = """
[bodies.it]
mass = 2.0
inertia = {inertia}
position = {at}
rotation = {turn}
[surfaces.it]
body = "it"
shape = {{ {shape} }}
restitution = 0.0
friction = {friction}
"""
GROUND = """
[surfaces.{name}]
body = "ground"
shape = {{ {shape} }}
position = {at}
rotation = {turn}
restitution = 0.0
friction = 100.0
"""
FLAT = {"plane": ("plane = {}", 0.0), "box": (f"box = [2.0, 2.0, {THICK}]", 0.5 * THICK)}
"""Shapes of slopes, and the depth of their origins below the face."""
LYING = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]
"""Rotation that turns z to y."""


def product(one, other):
    a, u, b, v = one[0], np.array(one[1:]), other[0], np.array(other[1:])
    return [float(a * b - u @ v), *(a * v + b * u + np.cross(u, v)).tolist()]


def sloped(theta, ground, shape, height, inertia, friction, turn=(1.0, 0.0, 0.0, 0.0)):
    """A scene with a body whose centre is so high above a slope that falls along x; its directions down and up."""
    tilt, up, down = inclined(theta)
    kind, depth = FLAT[ground]
    text = HEAD + GROUND.format(name="slope", shape=kind, at=(-depth * up).tolist(), turn=tilt)
    text += BODY.format(
        at=(height * up).tolist(), turn=product(tilt, list(turn)), shape=shape, inertia=inertia, friction=friction
    )
    return scene_of_text(text), down, up


RTOL = 1e-6


def run(scene, until):
    sol = ephs.simulate(scene, until, method="rk54", rtol=RTOL)
    assert sol.stats["least_production"] >= 0.0
    return sol


ROUND = {
    "cylinder": (f"cylinder = [{RADIUS}, {LENGTH}]", 0.5),
    "capsule": (f"capsule = [{RADIUS}, {LENGTH}]", 0.45),
    "sphere": (f"sphere = {RADIUS}", 0.4),
}
"""Shapes, and moments of inertia about their axes by m r²."""


@pytest.mark.parametrize("ground", FLAT)
@pytest.mark.parametrize("shape", ROUND)
@pytest.mark.parametrize("steep", [0.9, 1.1])
def test_round_bodies_roll_up_to_a_slope_and_slip_beyond(steep, shape, ground):
    """They roll with g sin θ/(1 + J/mr²), cylinders with 2/3 g sin θ, up to tan θ = μ (1 + mr²/J), of cylinders 3μ."""
    (kind, ratio), mu = ROUND[shape], 0.1
    theta, inertia = float(np.arctan(steep * mu * (1.0 + 1.0 / ratio))), ratio * MASS * RADIUS**2
    scene, down, _ = sloped(theta, ground, kind, RADIUS, [0.03, 0.03, inertia], mu, LYING)
    sol = run(scene, 0.05)
    until, rolls, weight = sol.t[-1], steep < 1.0, MASS * G * np.cos(theta)
    pull = G * np.sin(theta) / (1.0 + ratio) if rolls else G * (np.sin(theta) - mu * np.cos(theta))
    spin = pull / RADIUS if rolls else mu * weight / (ratio * MASS * RADIUS)
    slid = 0.0 if rolls else 0.5 * (pull - spin * RADIUS) * until**2
    assert sol.body("it").velocity[-1] @ down == pytest.approx(pull * until, rel=10.0 * RTOL)
    turning = sol.body("it").rotation[-1] @ sol.body("it").angular_velocity[-1]
    assert turning == pytest.approx([0.0, spin * until, 0.0], abs=10.0 * RTOL * spin * until)
    # the slip is the difference of two ways, each known as its velocity is
    ways = 0.5 * (pull + spin * RADIUS) * until**2
    assert sol.heat[-1] == pytest.approx(mu * weight * slid, rel=0.0, abs=10.0 * RTOL * mu * weight * ways)
    assert np.abs(sol.energy_error).max() <= 1e-11


@pytest.mark.parametrize("ground", FLAT)
@pytest.mark.parametrize("steep", [0.9, 1.1])
def test_a_slender_box_stands_up_to_a_slope_and_tips_beyond(steep, ground):
    """Up to tan θ = width/height, on a box without its rounded edges; beyond, φ̈ = a + b φ about the lower edge."""
    wide, high, until = 0.05 - (ROUNDED * 0.1 if ground == "box" else 0.0), 0.15, 0.0625
    theta, moment = float(np.arctan(steep * wide / high)), MASS / 3.0 * (0.05**2 + high**2)
    kind = f"box = [0.1, 0.2, {2.0 * high}]"
    scene, down, _ = sloped(theta, ground, kind, high, [moment] * 3, 1.0)
    sol = run(scene, until)
    motion, edge = sol.body("it"), moment + MASS * (wide**2 + high**2)
    lever = high * np.sin(theta) - wide * np.cos(theta), high * np.cos(theta) + wide * np.sin(theta)
    rise, grow = (MASS * G * arm / edge for arm in lever)
    turned = 2.0 * float(np.arccos(min(1.0, abs(motion.quaternion[-1] @ motion.quaternion[0]))))
    if steep < 1.0:
        assert motion.position[-1] == pytest.approx(motion.position[0], abs=1e-12)
        assert sol.contact("slope_it").force[-1] @ down == pytest.approx(-MASS * G * np.sin(theta), rel=1e-6)
    else:  # about a sharp edge, or rolling on a rounded one, by which its lever changes
        expected = rise / grow * (np.cosh(np.sqrt(grow) * until) - 1.0)
        assert turned == pytest.approx(expected, rel=1e-4 if ground == "plane" else 0.02)
        assert np.ptp(sol.energy) <= 160 * np.finfo(float).eps * MASS * G * high
