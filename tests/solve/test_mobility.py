"""Counts of motions and redundant constraints: along the constraints as on one dense matrix."""

from pathlib import Path

import pytest
from hypothesis import given, settings

import ephs
from benchmarks import families
from ephs.mechanics.runs.simulate import problem_of_scene
from ephs.solve import instant
from ephs.solve.mobility import mobility
from ephs.testing import mechanisms

ROOT = Path(__file__).parents[2]
FILES = sorted([*ROOT.glob("scenes/*.toml"), *ROOT.glob("benchmarks/scenes/*.toml")])


def both(scene):
    problem = problem_of_scene(scene)
    x = problem.descriptor.pack(problem.initial)
    return tuple(count(problem.descriptor, x, problem.prescribed) for count in (mobility, instant.mobility))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_counts_of_shipped_scenes_are_those_of_the_dense_matrix(file):
    found, expected = both(ephs.load(file))
    assert found == expected


@settings(deadline=None, max_examples=40)
@given(mechanisms())
def test_counts_of_drawn_mechanisms_are_those_of_the_dense_matrix(scene):
    found, expected = both(scene)
    assert found == expected


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
    motor, bare = (both(ephs.load(ROOT / "scenes" / f"{name}.toml"))[0] for name in ("motor-four-bar", "four-bar"))
    assert motor == bare
