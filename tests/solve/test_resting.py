"""What rests exactly has no energy to compare its rounding with, and is right all the same."""

import pytest

import ephs
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
