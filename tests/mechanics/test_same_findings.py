"""A system has the findings of the scene that it is built from: none asks whether there is a scene."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.build import scene_inputs
from ephs.mechanics.scene.rescaled import rescaled
from tests.scenes import shipped
from tests.written import scene_of_text

NAMES = ("biped", "body", "chain", "four-bar", "heavy-top", "hot-brake")
SETTINGS = (
    {"method": "natural", "step": 0.05},
    {"method": "rk54", "step": 0.02},
    {"method": "rk54", "rtol": 0.1, "atol": 0.1},
)
"""So coarse that some are found wrong, or end early, and some are right."""


def findings(model, setting, inputs=None):
    """Laws and places of the findings of a run, or the kind and place of its failure."""
    try:
        found = ephs.simulate(model, 1.0, audit="off", inputs=inputs, **setting).audit.findings
    except ephs.SimulationError as error:
        return [(error.outcome, error.path)]
    return sorted((each.law, str(each.path)) for each in found)


def both(name, setting):
    """Findings of a scene and of its system."""
    scene = shipped(name)
    inputs = {str(p): {"effort" if x.effort else "flow": x.value} for p, x in scene_inputs(scene).items()}
    return findings(scene, setting), findings(scene.system(), setting, inputs)


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda of: f"{of['method']}-{of.get('step', 'chosen')}")
@pytest.mark.parametrize("name", NAMES)
def test_a_system_has_the_findings_of_its_scene(name, setting):
    one, other = both(name, setting)
    assert one == other


def test_some_of_these_runs_are_found_wrong_and_some_are_not():
    found = [bool(both(name, SETTINGS[0])[0]) for name in ("body", "chain")]
    assert found == [True, False]


@pytest.mark.parametrize("size", [2.0**-20, 2.0**10])
def test_a_system_moves_alike_at_any_size(size):
    """By natural, which decides the rank of its constraints by numbers; masses grow as volumes do.

    Its error at these steps is 1e-4, and parts of it depend on the unit of length.
    """
    scene = scene_of_text("""
        format = 1
        [assembly]
        adjust = true
        [bodies.a]
        mass = 1.0
        inertia = [0.1, 0.1, 0.02]
        position = [0.0, 0.0, -0.5]
        [bodies.b]
        mass = 1.0
        inertia = [0.1, 0.1, 0.02]
        position = [0.0, 0.0, -1.5]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "a"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 1.0, 0.0]
        rate = 1.5
        friction = 0.05
        [joints.knee]
        type = "revolute"
        bodies = ["a", "b"]
        at = [0.0, 0.0, -1.0]
        axis = [1.0, 0.0, 0.0]
        rate = 2.0
        stiffness = 0.3
        """)
    small = rescaled(scene, size, size**3, 1.0)
    setting = {"method": "natural", "step": 0.01, "audit": "off"}
    one, other = (ephs.simulate(each.system(), 0.2, **setting) for each in (scene, small))
    for name in ("joints.pin", "joints.knee"):
        np.testing.assert_allclose(other.joint(name).coordinate, one.joint(name).coordinate, atol=1e-5)
