"""What rests exactly has no energy to compare its rounding with, and is right all the same."""

import pytest
from scipy.special import beta

import ephs
from ephs import quantity as Q
from tests.oscillator import rubbed_oscillator
from tests.semantics.zoo import drag
from tests.written import scene_of_text

SCENE = """
format = 1
name = "rest"
[bodies.ball]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, {height}]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
restitution = 0.5
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
position = [0.0, 0.0, {floor}]
"""


@pytest.mark.parametrize("height", [0.0, 0.1, 3.0])
@pytest.mark.parametrize("method", ["rk87", "auto"])
def test_a_ball_at_rest_passes_the_audit_at_any_height(method, height):
    """At height 0 weight has no energy either."""
    sol = ephs.simulate(scene_of_text(SCENE.format(height=height, floor=height - 0.1)), 0.5, method=method)
    assert sol.audit.passed
    assert abs(sol.body("ball").position[-1, 2] - height) < 1e-12


METHODS = [("radau", {}), ("rk87", {}), ("natural4", {"step": 0.01}), ("natural", {"step": 0.01})]


@pytest.mark.parametrize(("method", "steps"), METHODS)
@pytest.mark.parametrize("power", [1.2, 2.5])
def test_springs_of_any_power_swing_from_where_their_derivatives_are_roots(method, steps, power):
    """½ p² + |q|ᵃ from q = 0: p = 0 after a quarter of a period, at |q|ᵃ = ½. A drag as |v|ᵇ v begins at rest, too."""
    quarter = 0.5 ** (1.0 / power) * beta(1.0 / power, 0.5) / power
    found = ephs.simulate(swinging(power, 0.0), quarter, initial={"ke.p": 1.0}, method=method, **steps)
    order = 1e-3 if method == "natural" else 1e-5
    assert abs(found["ke.p"][-1]) < order and abs(found["pe.q"][-1] - 0.5 ** (1.0 / power)) < order
    dragged = swinging(2.0, 0.5 * power)
    one, other = (
        ephs.simulate(dragged, 1.0, initial={"pe.q": 1.0}, method=name, **more)
        for name, more in ((method, steps), ("rk87", {"rtol": 1e-10, "atol": 1e-12}))
    )
    assert abs(one["ke.p"][-1] - other["ke.p"][-1]) < order


def swinging(power, b):
    """A mass on a spring of the energy |q|ᵃ, with a drag as |v|ᵇ v if b > 0."""
    coefficient = 0.5 if b else 0.0
    spring = ephs.storage({"q": Q.displacement}, lambda q: abs(q) ** power)
    return rubbed_oscillator(pe=spring, mf=drag(lambda p, s: coefficient * abs(p) ** b)())
