"""Solutions read from files, of scenes with everything that reads their motion."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as File

import numpy as np

from ephs.mechanics.build import drive_ports, scene_inputs, wrench_port
from ephs.mechanics.scene.document import scene_from_text
from ephs.mechanics.simulate import problem_of_scene
from ephs.mechanics.solve.problem import Problem, Signal
from ephs.mechanics.solve.solution import Solution
from ephs.operad import Path
from ephs.semantics.bundle import Array

__all__ = ["load_solution"]


def load_solution(path: str | File) -> Solution:
    """Read a solution that `Solution.save` wrote; of a scene with everything that reads its motion.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such file, or it is not a solution.
    """
    from ephs.mechanics.solve.file import load

    return load(path, _problem_again)


def _problem_again(text: str, t: Array, inputs: Mapping[Path, Array]) -> Problem:
    """The problem of a scene, with inputs as they were at some instants."""
    scene = scene_from_text(text)
    forced = [f"joints.{name}" for name, j in scene.all_joints() if any(p in inputs for p, _ in drive_ports(j))]
    pushed = [f"bodies.{name}" for name, _ in scene.all_bodies() if wrench_port(name) in inputs]
    own = scene_inputs(scene)
    driven = {f"joints.{name}" for name, j in scene.all_joints() if any(p in own for p, _ in drive_ports(j))}
    zeros = {key: np.zeros(scene.joint(key.partition(".")[2]).dim) for key in forced if key not in driven}
    problem = problem_of_scene(scene, None, {**zeros, **{key: np.zeros(6) for key in pushed}})
    signals = {path: _kept(t, values, problem.signals[path].effort) for path, values in inputs.items() if t.size}
    return replace(problem, signals={**problem.signals, **signals})


def _kept(t: Array, values: Array, effort: bool) -> Signal:
    """A signal that is known at some instants, exactly, and between them by straight lines."""
    if np.all(values == values[0]):
        return Signal(values[0], effort)
    order = np.argsort(t)
    times, columns = t[order], values[order].T
    return Signal(lambda time, _state: np.array([np.interp(time, times, column) for column in columns]), effort)
