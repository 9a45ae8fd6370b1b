"""Several contacts at once: three balls in a row, a block on a slope, a block that rocks."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.mechanics.elements.test_contact import HEAD, run, scene_of
from tests.written import scene_of_text

CRADLE = """
[bodies.{name}]
mass = 2.0
inertia = [8e-3, 8e-3, 8e-3]
position = [{x}, 0.0, 0.0]
velocity = [{speed}, 0.0, 0.0]
[surfaces.{name}]
body = "{name}"
shape = {{ sphere = 0.1 }}
stiffness = 1e7
exponent = {exponent}
"""


def chain(exponent):
    """Velocities after a first of three balls in a row struck the others at 1 m/s: m ẍ = ±k dⁿ of both gaps."""
    k, m = 1e7 / 2.0**exponent, 2.0  # two surfaces in series share the overlap

    def rates(_, y):
        one, two = (k * max(y[i] - y[i + 1], 0.0) ** exponent / m for i in (0, 1))
        return [*y[3:], -one, one - two, two]

    found = solve_ivp(rates, (0.0, 0.05), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], rtol=1e-11, atol=1e-14, max_step=1e-4)
    return found.y[3:, -1]


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_cradle_is_a_chain_of_springs(exponent):
    """Of springs by Hertz the last ball takes nearly all; of hard balls with one coefficient it would take 2/3."""
    balls = zip("abc", (0.0, 0.2, 0.4), (1.0, 0.0, 0.0), strict=True)
    text = "".join(CRADLE.format(name=name, x=x, speed=v, exponent=exponent) for name, x, v in balls)
    sol = run(scene_of_text(HEAD.format(gravity=0.0) + text), 0.05)
    found = [sol.body(name).velocity[-1, 0] for name in "abc"]
    assert found == pytest.approx(chain(exponent), abs=1e-5)
    assert found[2] > (0.9 if exponent == 1.0 else 0.98)
    assert np.abs(sol.energy_error).max() <= 1e-11


BLOCK = """
[bodies.block]
mass = 2.0
inertia = [0.01, 0.01, 0.01]
position = [{x}, 0.0, {z}]
rotation = [{c}, 0.0, {s}, 0.0]
[surfaces.block]
body = "block"
shape = {{ box = [0.4, 0.3, 0.02] }}
stiffness = 1e5
loss = 1.0
friction = {mu}
slip = 1e-3
[surfaces.slope]
body = "ground"
shape = {{ plane = {{}} }}
rotation = [{c}, 0.0, {s}, 0.0]
"""


@pytest.mark.parametrize(("mu", "sliding"), [(0.2, True), (0.6, False)])
def test_a_block_on_a_slope_slides_or_sticks(mu, sliding):
    m, g, theta = 2.0, 9.81, 0.3
    sunk = 0.01 - m * g * np.cos(theta) / 4e5  # four corners carry it
    up = np.array([np.sin(theta), 0.0, np.cos(theta)])
    x, _, z = sunk * up
    scene = scene_of(BLOCK, gravity=-g, mu=mu, x=x, z=z, c=np.cos(theta / 2.0), s=np.sin(theta / 2.0))
    sol = run(scene, 0.4, rtol=1e-7, save_at=[0.2, 0.4])
    down = np.array([np.cos(theta), 0.0, -np.sin(theta)])
    speed = sol.body("block").velocity @ down
    if sliding:
        assert speed[1] - speed[0] == pytest.approx(0.2 * g * (np.sin(theta) - mu * np.cos(theta)), rel=1e-3)
    else:
        steep = np.tan(theta)
        assert speed[1] == pytest.approx(1e-3 * steep / np.sqrt(mu**2 - steep**2), rel=0.05)


ROCKING = """
[bodies.block]
mass = 2.0
inertia = [0.1, {inertia}, 0.09]
position = [{x}, 0.0, {z}]
rotation = [{c}, 0.0, {s}, 0.0]
[surfaces.block]
body = "block"
shape = {{ box = [0.2, 0.3, 0.6] }}
stiffness = 1e7
loss = 20.0
friction = 2.0
slip = 1e-4
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
"""


def test_a_rocking_block_loses_what_housner_says():
    """About one edge, then about the other: of its energy (1 − 3/2 sin² α)² is left, p² = 3 g/(4 R)."""
    m, g, b, h = 2.0, 9.81, 0.1, 0.3
    r, alpha = np.hypot(b, h), np.arctan(b / h)
    rate, tilt = np.sqrt(0.75 * g / r), 0.5 * alpha
    c, s = np.cos(tilt), np.sin(tilt)
    place = {"x": h * s - b * c, "z": b * s + h * c - m * g / 2e7, "c": np.cos(tilt / 2.0), "s": np.sin(tilt / 2.0)}
    scene = scene_of(ROCKING, gravity=-g, inertia=m / 3.0 * r**2, **place)
    quarter = np.arccosh(1.0 / (1.0 - tilt / alpha)) / rate
    sol = run(scene, 1.2 * quarter, "radau", rtol=1e-6, atol=1e-8, save_at=[0.5 * quarter, 1.2 * quarter])
    rotation = sol.body("block").quaternion[:, [0, 2]]
    angles, rates = 2.0 * np.arctan2(rotation[:, 1], rotation[:, 0]), sol.body("block").angular_velocity[:, 1]

    def squared(angle):
        """What falling to upright adds to the square of the rate."""
        return 2.0 * rate**2 * (np.cos(alpha - angle) - np.cos(alpha))

    slow = alpha - (alpha - tilt) * np.cosh(0.5 * rate * quarter)  # sin x ≈ x
    assert angles[0] == pytest.approx(slow, rel=alpha**2 / 6.0)
    assert rates[0] ** 2 == pytest.approx(squared(tilt) - squared(angles[0]), rel=1e-3)
    left = (1.0 - 1.5 * np.sin(alpha) ** 2) ** 2
    assert angles[1] < 0.0
    assert rates[1] ** 2 == pytest.approx(left * squared(tilt) - squared(-angles[1]), rel=5e-3)
    assert np.abs(sol.energy_error).max() <= 1e-11
