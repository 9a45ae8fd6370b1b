"""What the reduced form says of the paper's states: at the start they are those that were given, in all directions."""

import numpy as np
import pytest

import ephs
from tests.numerics import largest
from tests.written import scene_of_text

SCENE = """format = 1
name = "thrown"

[assembly]
adjust = true

[world]
gravity = [0.1, 0.2, -9.81]

[bodies.base]
mass = 2.0
inertia = [0.6, 0.7, 0.8, 0.05, -0.04, 0.03]
position = [0.3, -0.2, 0.5]
rotation = [0.5, 0.5, -0.5, 0.5]
velocity = [1.0, -2.0, 3.0]
angular_velocity = [0.4, 0.5, -0.6]

[bodies.arm]
mass = 1.0
inertia = [0.3, 0.4, 0.5]
position = [1.3, -0.2, 0.5]
rotation = [SIGN, 0.0, 0.0, 0.0]

[joints.wrist]
type = "spherical"
bodies = ["base", "arm"]
at = [0.8, -0.2, 0.5]
"""


@pytest.fixture(scope="module", params=["1.0", "-1.0"])
def scene(request):
    """With either of the two quaternions of the arm's rotation."""
    return scene_of_text(SCENE.replace("SIGN", request.param))


@pytest.mark.parametrize("method", ["rk54", "radau", "variational"])
def test_a_run_begins_at_what_was_given(scene, method):
    sol = ephs.simulate(scene, 0.002, method=method, step=0.001)
    reference = ephs.simulate(scene, 0.002, method="natural", step=0.001)
    for path, value in reference.state_at(0).items():
        assert largest(sol.state_at(0)[path] - value, initial=0.0) <= 1e-12, path
    for path, value in reference.state_at(2).items():
        assert largest(sol.state_at(2)[path] - value, initial=0.0) <= 1e-4, path
    momentum = np.ravel(sol.state_at(0)[ephs.Path.of("bodies.base.ke.p")])
    inertia = np.array([[0.6, 0.05, -0.04], [0.05, 0.7, 0.03], [-0.04, 0.03, 0.8]])
    twist = sol.body("base").twist[0]
    assert np.allclose(momentum, np.r_[inertia @ twist[:3], 2.0 * twist[3:]], atol=1e-12)
    assert np.abs(twist).min() > 0.1
