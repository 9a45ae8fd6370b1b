"""Runs whose steps rounding holds short say so; others, as long or as light, do not."""

import re
from dataclasses import replace

import pytest

from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.methods.rounding import held_by_rounding, rate_rounding
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.simulate import control_of
from ephs.mechanics.tree.equations.equations import ReducedEquations
from tests.scenes import shipped


def equations_of(part):
    """Equations of a shipped mechanism whose second body has a part of its mass, and their start."""
    scene = shipped("mbs")
    name = list(scene.bodies)[1]
    body = scene.bodies[name]
    light = replace(body, mass=part * body.mass, inertia=part * body.inertia)
    equations = ReducedEquations(problem_of_scene(replace(scene, bodies={**scene.bodies, name: light})), 0.0)
    return equations, equations.start(0.0)


def test_rounding_of_rates_grows_as_a_body_between_heavy_ones_gets_light():
    sizes = [float(rate_rounding(*equations_of(part)).max()) for part in (1.0, 1e-5, 1e-9)]
    assert sizes[0] < 0.01 * sizes[1] < 1e-4 * sizes[2] < 1e-4


def looked_at(part, rtol, *, steps):
    """A run of 1 s by rk87 at a thousandth of it, after so many steps of a microsecond."""
    equations, start = equations_of(part)
    control = control_of(equations.problem, 8, rtol, 0.01 * rtol, None, None, None, None, (0.0, 1.0))
    return held_by_rounding(Explicit(equations, control, tableau("rk87")), start, 1e-6, 1.0, 1e3 * steps)


def test_rounding_that_holds_steps_short_is_told():
    told = looked_at(1e-9, 1e-12, steps=1000)
    assert told is not None and re.match(r"rk87 will take about 1e\+06 steps: rounding of the rate of ", told)


@pytest.mark.parametrize(("part", "rtol", "steps"), [(1e-9, 1e-3, 1000), (1.0, 1e-12, 1000), (1e-9, 1e-12, 10)])
def test_other_runs_are_silent(part, rtol, steps):
    assert not looked_at(part, rtol, steps=steps)
