"""Places of bodies enter the links of trees in degree two: two neighbours of the model tell all that six do."""

import numpy as np
import pytest

from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.scene.parameters import names
from ephs.mechanics.sensitivity.explicit import ExplicitTangent, _whole
from ephs.mechanics.sensitivity.family import CENTRAL, OUTER, ParameterFamily
from tests.numerics import EPS, largest
from tests.scenes import shipped
from tests.written import scene_of_text

HUNG = """
format = 1
name = "hung"
[bodies.arm]
mass = 2.0
inertia = [0.2, 0.3, 0.4]
position = [0.3, 0.1, 0.2]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[springs.hold]
bodies = ["ground", "arm"]
at1 = [0.5, 0.3, 0.4]
at2 = [0.2, 0.1, 0.3]
stiffness = 40.0
length = 0.3
"""


def tangent(scene, paths):
    return ExplicitTangent(ParameterFamily(scene, paths, None, None, None, joints=True), 0.0, tableau("rk54"))


def placed(scene):
    ends = ("position[0]", "position[1]", "position[2]", "coordinate")
    return [path for path in names(scene) if path.startswith(("bodies.", "joints.")) and path.endswith(ends)]


@pytest.mark.parametrize("name", ["chain", "heavy-top", "hot-brake"])
def test_two_neighbours_tell_what_six_do(name, monkeypatch):
    """Of initial states and of the links' numbers, to rounding."""
    scene = shipped(name)
    paths = placed(scene)[:6]
    stepper, other = tangent(scene, paths), tangent(scene, paths)
    assert any(stepper._stencil(j) is OUTER for j in range(len(paths)))
    monkeypatch.setattr(ExplicitTangent, "_stencil", lambda self, number: self.family.parameters[number].tables)
    for j in range(len(paths)):
        for read in (_whole, lambda of, _: stepper._numbers(of, "reals")):
            with monkeypatch.context() as two:
                two.setattr(ExplicitTangent, "_stencil", lambda self, number: OUTER)
                near = stepper._by(j, read)
            six = other._by(j, read)
            sizes = np.abs(read(*stepper._other(j, OUTER[1][0] * stepper.family.parameters[j].step)[1:]))
            rounding = 8.0 * EPS * sizes.max() / stepper.family.parameters[j].step
            assert largest(near - six) <= rounding


def test_what_is_of_no_low_degree_takes_six():
    """A spring's length is a root of places; coordinates of loops follow from each other; a ball's are a turn."""
    hung, closed, top = scene_of_text(HUNG), shipped("four-bar"), shipped("heavy-top")
    assert tangent(hung, ["springs.hold.at2[0]"])._stencil(0) is CENTRAL
    assert tangent(closed, ["bodies.coupler.position[0]"])._stencil(0) is CENTRAL
    assert tangent(top, ["joints.tip.coordinate[0]"])._stencil(0) is CENTRAL
