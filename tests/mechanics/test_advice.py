"""Advice to take another method: one that is not in use, and that accepts the model."""

import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.running import Course
from tests.written import scene_of_text

CHAIN = """
format = 1
[bodies.arm]
mass = 1.0
inertia = [0.01, 0.02, 0.03]
position = [1.0, 0.0, 0.0]
[bodies.tip]
mass = 0.1
inertia = [0.001, 0.002, 0.003]
position = [2.5, 0.0, 0.0]
[joints.stiff]
type = "revolute"
bodies = ["arm", "tip"]
at = [2.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
stiffness = 4000.0
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
"""
STOP = "limits = [-3.0, 0.5]\nlimit_restitution = 0.5\n"
"""A hard stop, which the natural methods refuse."""


@pytest.fixture(params=["", STOP], ids=["free", "stopped"])
def chain(request):
    return scene_of_text(CHAIN + request.param)


def accepts(scene, method):
    try:
        ephs.simulate(scene, 0.002, method=method, step=0.001, audit="off")
    except ephs.SimulationError:  # of the run, not of the choice
        return True
    except ephs.OptionError:
        return False
    return True


def test_a_method_serves_if_it_is_another_one_and_runs(chain, monkeypatch):
    courses = []
    run = Course.run
    monkeypatch.setattr(Course, "run", lambda self, *given, **named: courses.append(self) or run(self, *given, **named))
    ephs.simulate(chain, 0.002, method="rk54", step=0.001, audit="off")
    course = courses[0]
    found = {name for name in METHODS if course.serves(name)}
    assert found == {name for name in METHODS if name != "rk54" and accepts(chain, name)}
    assert ("natural" in found) == (chain.joint("pin").limits is None)


def test_the_audit_advises_what_serves(chain):
    """Steps of 50 ms leave out what the stiff joint does: energy is missed with the stop by radau, without by rk54."""
    stopped = chain.joint("pin").limits is not None
    run = ephs.simulate(chain, 0.5, method="radau" if stopped else "rk54", step=0.05, audit="off")
    (found,) = (each for each in run.audit.findings if each.law == "energy")
    assert found.advice == "take a smaller step" + ("" if stopped else ", or take natural, which keeps the balance")
