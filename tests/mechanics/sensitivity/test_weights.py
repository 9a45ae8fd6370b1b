"""Masses and moments of inertia change the links' numbers and nothing else that steps of a tree read."""

import pytest

from ephs.mechanics.scene.parameters import names, read
from ephs.mechanics.sensitivity.explicit import ExplicitTangent
from tests.mechanics.sensitivity.test_places import tangent
from tests.numerics import largest
from tests.scenes import shipped
from tests.written import scene_of_text

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
