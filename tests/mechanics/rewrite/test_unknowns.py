"""The first count of unknowns is that of the compiled model, also where something is prescribed."""

import pytest

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from tests.scenes import equations_of, model_of, of_all_scenes
from tests.written import scene_of_text

SCENE = """format = 1
name = "driven"

[bodies.wheel]
mass = 2.0
inertia = [0.6, 0.7, 0.8]
angular_velocity = [0.0, 0.0, 1.0]

[joints.axle]
type = "revolute"
bodies = ["ground", "wheel"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
{motion}
"""


@pytest.mark.parametrize("motion", ["", "motion = { rate = 1.0 }"])
def test_the_first_step_begins_with_all_unknowns(motion):
    scene = scene_of_text(SCENE.format(motion=motion))
    problem = problem_of_scene(scene)
    model = model_of(problem)
    assert ephs.reduce(scene).before == model.unknowns
    assert bool(motion) == bool(problem.prescribed)


@of_all_scenes
def test_the_last_step_ends_with_the_unknowns_of_a_run(file):
    scene = ephs.load(file)
    equations = equations_of(scene)
    equations.start(0.0)
    assert ephs.reduce(scene).steps[-1].after == equations.stats()["unknowns"]
