"""The scenes of the checkout, and the equations that tests make of scenes."""

from pathlib import Path

import pytest

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.solve.equations.model import Model, compile_model
from ephs.solve.posing.problem import Problem

__all__ = ["ROOT", "SCENES", "equations_of", "model_of", "of_all_scenes", "shipped"]

ROOT = Path(__file__).resolve().parents[1]

SCENES = sorted((ROOT / "scenes").glob("*.toml"))
"""Their files."""

of_all_scenes = pytest.mark.parametrize("file", SCENES, ids=lambda file: file.stem)
"""Marks a test of each of them."""


def shipped(name: str) -> ephs.Scene:
    """The scene of this name."""
    return ephs.load(ROOT / f"scenes/{name}.toml")


def equations_of(scene: ephs.Scene) -> ReducedEquations:
    """In the coordinates of its joints, at the time 0."""
    return ReducedEquations(problem_of_scene(scene), 0.0)


def model_of(problem: Problem) -> Model:
    """Of a problem as it begins."""
    return compile_model(problem.descriptor, problem.reference, problem.inputs(0.0, problem.initial))
