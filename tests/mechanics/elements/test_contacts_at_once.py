"""Several contacts at once: three balls in a row, a block on a slope, a block that rocks."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.mechanics.elements.test_contact import HEAD, run, scene_of
from tests.mechanics.impacts.test_hard_contact import inclined
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
    (c, _, s, _), up, down = inclined(theta)
    x, _, z = sunk * up
    scene = scene_of(BLOCK, gravity=-g, mu=mu, x=x, z=z, c=c, s=s)
    sol = run(scene, 0.4, rtol=1e-7, save_at=[0.2, 0.4])
    speed = sol.body("block").velocity @ down
    if sliding:
        assert speed[1] - speed[0] == pytest.approx(0.2 * g * (np.sin(theta) - mu * np.cos(theta)), rel=1e-3)
    else:
        steep = np.tan(theta)
        assert speed[1] == pytest.approx(1e-3 * steep / np.sqrt(mu**2 - steep**2), rel=0.05)
