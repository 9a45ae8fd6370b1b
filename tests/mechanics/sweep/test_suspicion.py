"""Members of an ensemble that compiled code runs together have the findings of their audit, too."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.sweep import ensemble, job
from ephs.show.charts import family_scenes as scenes
from ephs.solve.posing.errors import Outcome
from examples.failing import pendulum

BRAKE = pendulum(6.0, "friction = 20.0")
FRICTIONS = [0.1, 0.5, 5.0, 10.0, 15.0, 20.0]


@pytest.fixture
def alone(monkeypatch):
    """Values of the members that are run on their own."""
    found, run = [], job._Prepared._alone

    def kept(self, values):
        found.append(values.tolist())
        return run(self, values)

    monkeypatch.setattr(job._Prepared, "_alone", kept)
    return found


def status(scene, vary, until, **options):
    return ephs.sweep(scene, vary, until, workers=1, **options)["status"].values.tolist()


def test_members_that_break_a_law_are_run_on_their_own_and_say_so(alone):
    """The limit of stability at this step is at a friction of about 10 N m s."""
    found = status(BRAKE, {"joints.pin.friction": FRICTIONS}, 2.0, method="rk54", step=0.1)
    assert found[0] == "done"
    assert all("energy: " in text or Outcome.LAWLESS in text for text in found[3:])
    for friction, text in zip(FRICTIONS, found, strict=True):
        scene = pendulum(6.0, f"friction = {friction}")
        try:
            passed = ephs.simulate(scene, 2.0, method="rk54", step=0.1, audit="off").audit.passed
        except ephs.SimulationError as error:
            passed = error.outcome is not Outcome.LAWLESS
        assert (text == "done") == passed
    assert {values[0] for values in alone} >= set(FRICTIONS[3:])
    assert len(alone) < len(FRICTIONS)


def test_without_a_look_they_are_silent(alone, monkeypatch):
    monkeypatch.setattr(ensemble, "suspicious", lambda _, held, *rest: np.zeros(len(held), dtype=bool))
    monkeypatch.setattr(ensemble, "resolved", lambda _, x, other: np.ones(len(x), dtype=bool))
    found = status(BRAKE, {"joints.pin.friction": FRICTIONS}, 2.0, method="rk54", step=0.1)
    assert all(text == "done" or Outcome.LAWLESS in text for text in found)
    refused = [friction for friction, text in zip(FRICTIONS, found, strict=True) if text != "done"]
    assert [friction for group in alone for friction in group] == refused, (
        "what ends early is run once more, to say why"
    )


@pytest.mark.parametrize("path", ["joints.pin.friction", "bodies.rod.mass", "joints.pin.stiffness"])
def test_sound_members_stay_together(path, alone):
    """Energies are those of the member: those of another would not be in balance."""
    scene = pendulum(6.0, "friction = 0.3\nstiffness = 2.0")
    assert set(status(scene, {path: [0.5, 1.3, 2.0, 3.1]}, 1.0, rtol=1e-7)) == {"done"}
    assert not alone


def test_steps_that_do_not_resolve_a_motion_are_found():
    """Energy is kept well enough; steps of four times the length lead elsewhere."""
    scene = scenes.double_pendulum(2.5)
    name = next(iter(scene.bodies))
    found = status(scene, {f"bodies.{name}.mass": np.linspace(1.0, 1.1, 4)}, 8.0, method="rk54", step=0.03)
    assert all("accuracy: " in text or "energy: " in text for text in found)
