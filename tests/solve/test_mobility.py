"""Counts of motions and redundant constraints: along the constraints as on one dense matrix."""

import pytest
from hypothesis import given, settings

import ephs
from benchmarks import families
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.solve.equations.mobility import mobility
from ephs.testing import mechanisms
from tests.scenes import ROOT, shipped
from tests.solve.dense import dense_mobility
from tests.written import scene_of_text

FILES = sorted([*ROOT.glob("scenes/*.toml"), *ROOT.glob("benchmarks/scenes/*.toml")])


def both(scene):
    problem = problem_of_scene(scene)
    x = problem.descriptor.pack(problem.initial)
    return tuple(count(problem.descriptor, x, problem.prescribed) for count in (mobility, dense_mobility))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_counts_of_shipped_scenes_are_those_of_the_dense_matrix(file):
    found, expected = both(ephs.load(file))
    assert found == expected


@settings(max_examples=40)
@given(mechanisms())
def test_counts_of_drawn_mechanisms_are_those_of_the_dense_matrix(scene):
    found, expected = both(scene)
    assert found == expected


def test_surfaces_that_may_touch_restrict_no_motion():
    bodies = "".join(
        f'[bodies.{name}]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\n[joints.{name}]\ntype = "{kind}"\n'
        f'bodies = ["ground", "{name}"]\nframe1 = {{ position = [0.0, 0.0, {height}] }}\nframe2 = {{}}\n'
        f'[surfaces.{name}]\nbody = "{name}"\nshape = {{ {shape} }}\nstiffness = 1e4\n'
        for name, kind, height, shape in (
            ("one", "free", 1.0, "box = [0.2, 0.2, 0.2]"),
            ("two", "revolute", 2.0, "sphere = 0.1"),
        )
    )
    floor = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\n'
    found, expected = both(scene_of_text(f'format = 1\nname = "boxes"\n{bodies}{floor}'))
    assert found == expected and (found.mobility, found.redundant) == (7, 0)


@pytest.mark.parametrize(
    ("family", "size", "expected"),
    [
        ("revolute-chain", 200, (200, 0)),
        ("spherical-chain", 100, (300, 0)),
        ("four-bar-windows", 60, (1, 180)),
    ],
)
def test_counts_of_large_mechanisms(family, size, expected):
    problem = problem_of_scene(families.scene(family, size))
    found = mobility(problem.descriptor, problem.descriptor.pack(problem.initial))
    assert (found.mobility, found.redundant) == expected


def test_currents_and_rotors_on_gears_are_no_motions():
    motor, bare = (both(shipped(name))[0] for name in ("motor-four-bar", "four-bar"))
    assert motor == bare
