"""A system has the findings of the scene that it is built from: none asks whether there is a scene."""

from pathlib import Path

import pytest

import ephs
from ephs.mechanics.scene.build import scene_inputs

SCENES = Path(__file__).parents[2] / "scenes"
NAMES = ("biped", "body", "cardan-shaft", "chain", "dzhanibekov", "four-bar", "heavy-top", "hot-brake", "slider-crank")
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
    scene = ephs.load(SCENES / f"{name}.toml")
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
