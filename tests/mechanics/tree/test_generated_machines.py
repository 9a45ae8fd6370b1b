"""Generated machines (bodies, joints, springs, circuits, gases and heat under any names and nesting) in both forms."""

import pytest

from ephs.mechanics.tree.equations.equations import ReducedEquations
from tests.mechanics.drawn_scenes import drawn, toml
from tests.mechanics.methods.systems import renamed
from tests.mechanics.tree.general import held_to_the_general_form
from tests.written import scene_of_text


@pytest.mark.parametrize("seed", range(24))
def test_joint_coordinates_and_the_general_form_are_one(seed):
    scene = scene_of_text(toml(drawn(seed) | {"loads": {}}))  # which turn with bodies, or not
    problem, _ = renamed(scene, "x", seed)
    equations = ReducedEquations(problem, 0.0)
    held_to_the_general_form(equations, problem, equations.start(0.0))
