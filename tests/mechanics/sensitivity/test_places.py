"""Numbers of bodies that change little: places in degree two, of two neighbours; masses and moments of none."""

import numpy as np
import pytest

from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.scene.parameters import names, read
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
        for reading in (_whole, lambda of, _: stepper._numbers(of, "reals")):
            with monkeypatch.context() as two:
                two.setattr(ExplicitTangent, "_stencil", lambda self, number: OUTER)
                near = stepper._by(j, reading)
            six = other._by(j, reading)
            sizes = np.abs(reading(*stepper._other(j, OUTER[1][0] * stepper.family.parameters[j].step)[1:]))
            rounding = 8.0 * EPS * sizes.max() / stepper.family.parameters[j].step
            assert largest(near - six) <= rounding


def test_what_is_of_no_low_degree_takes_six():
    """A spring's length is a root of places; coordinates of loops follow from each other; a ball's are a turn."""
    hung, closed, top = scene_of_text(HUNG), shipped("four-bar"), shipped("heavy-top")
    assert tangent(hung, ["springs.hold.at2[0]"])._stencil(0) is CENTRAL
    assert tangent(closed, ["bodies.coupler.position[0]"])._stencil(0) is CENTRAL
    assert tangent(top, ["joints.tip.coordinate[0]"])._stencil(0) is CENTRAL


# ---- masses and moments: links' numbers and nothing else that steps of a tree read -------------------------------

TREES = ("chain", "heavy-top", "hot-brake", "body")
FUSED = """
format = 1
name = "fused"
[bodies.arm]
mass = 2.0
inertia = [0.2, 0.3, 0.4, 0.01, 0.02, 0.03]
position = [0.3, 0.1, 0.2]
rotation = { axis = [1.0, 2.0, 3.0], angle = 0.7 }
[bodies.tool]
mass = 0.5
inertia = [0.02, 0.03, 0.04]
position = [0.8, 0.2, 0.1]
rotation = { axis = [3.0, 1.0, 2.0], angle = 0.4 }
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.hold]
type = "fixed"
bodies = ["arm", "tool"]
at = [0.5, 0.0, 0.0]
"""


def weights(scene):
    found = [path for path in names(scene) if path.startswith("bodies.") and ("mass" in path or "inertia" in path)]
    return [path for path in found if read(scene, path) > 0.0 and path[-3:] not in ("[3]", "[4]", "[5]")]


@pytest.mark.parametrize("name", [*TREES, "fused"])
def test_they_are_exact_and_all_that_matters(name, monkeypatch):
    """Tables, and two steps with their derivatives, are those that neighbours of the model give."""
    scene = scene_of_text(FUSED) if name == "fused" else shipped(name)
    paths = weights(scene)[-5:]
    stepper, other = tangent(scene, paths), tangent(scene, paths)
    assert paths
    for j in range(len(paths)):
        near, weight = stepper._by(j, lambda of, _: stepper._numbers(of, "reals")), stepper._weighed(j)
        assert weight is not None and weight.shape == near.shape
        assert largest(weight - near) <= 1e-12 * max(1.0, float(largest(near)))
    point = stepper.start()
    monkeypatch.setattr(ExplicitTangent, "_weighed", lambda self, number: None)
    beside = other.start()
    for _ in range(2):
        point, beside = stepper.step(point, 0.01), other.step(beside, 0.01)
    for one, two in ((point.q, beside.q), (point.y, beside.y)):
        assert largest(one - two) <= 1e-9 * max(1.0, float(largest(two)))


def test_what_changes_more_is_left_to_neighbours():
    chain, closed = shipped("chain"), shipped("four-bar")
    assert tangent(chain, ["bodies.rod1.position[0]"])._weighed(0) is None
    assert tangent(closed, ["bodies.coupler.mass"])._weighed(0) is None
