"""Solutions read from files, of scenes with everything that reads their motion."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np

from ephs.mechanics.rewrite.folded import folded_problem
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.runs.system_text import is_system_text, read_system_text
from ephs.mechanics.scene.build import drive_ports, scene_inputs, wrench_port
from ephs.mechanics.scene.document import scene_from_text
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.own_units import in_own_units
from ephs.mechanics.scene.soundness import check_scene, meshes_within
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.posing.problem import Problem, Signal
from ephs.solve.result.guard import check_file
from ephs.solve.result.record import RowBlocks
from ephs.solve.result.solution import Solution
from ephs.solve.running.ending import solution_of
from ephs.solve.running.journal import MAGIC, read_journal


def load_solution(path: str | File, model: System | Scene | None = None) -> Solution:
    """Read a solution that `Solution.save` wrote, or the part of a run in its journal.

    Parameters
    ----------
    model
        Of a journal, the system that ran, if it cannot be written (`System.to_dict`); others are in it. Results are
        read without: of a system that cannot be written they have states and ledgers alone.

    The file may come from anybody: it is read as data, and names no other files but meshes, which are drawn where they
    lie in its folder, in the working folder, or below one of them.

    Warns
    -----
    ModelWarning
        Meshes lie elsewhere.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such file, or it is not a solution.
    """
    file = File(path)
    if file.exists() and not file.is_file():
        raise ValueError(f"{file}: not a file")
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    homes = (file.resolve().parent, File.cwd())
    try:
        with open(file, "rb") as opened:
            first = opened.read(len(MAGIC))
        # The journal of a run stopped at once may be empty.
        written_down = first == MAGIC or (file.suffix == ".journal" and MAGIC.startswith(first))
        if model is not None and not written_down:
            raise ValueError(f"{file}: a result and no journal; expected no model=")
        found = _of_journal(file, model, homes) if written_down else _of_result(file, homes)
        _check_states(found)
    except OptionError:  # of a journal
        raise
    except Exception as error:  # a crafted file may fail anywhere
        if str(error).startswith(f"{file}: "):
            raise
        raise ValueError(f"{file}: not a solution of this program ({type(error).__name__}: {error})") from error
    return found


def _of_result(file: File, homes: tuple[File, ...]) -> Solution:
    from ephs.solve.result.file import load

    check_file(file)
    return load(file, lambda text, t, inputs: _problem_again(text, t, inputs, homes))


def _of_journal(file: File, model: System | Scene | None, homes: tuple[File, ...]) -> Solution:
    found = read_journal(file)
    run = found.heading["run"]
    text = found.heading["model"]
    if model is None and not text:
        raise ValueError(f"{file}: a journal of {found.heading['name']}, a system; give it as model=")
    model = model or (read_system_text(text)[0] if is_system_text(text) else _scene(text, homes))
    if isinstance(model, Scene):
        inputs = {key: _known(given) for key, given in (run["inputs"] or {}).items()}
        problem = in_own_units(problem_of_scene(model, None, inputs))
    else:
        sides = {port: {side: _known(x) for side, x in given.items()} for port, given in (run["inputs"] or {}).items()}
        problem = problem_of_system(model, None, sides, assemble=False)
    sizes = {slot.path: slot.quantity.space.dim for slot in problem.descriptor.outer}
    unknown = {
        path: Signal(np.full(sizes[path], np.nan), given.effort)
        for path, given in problem.signals.items()
        if not given.constant
    }
    problem = replace(problem, signals={**problem.signals, **unknown})
    if run["form"] == "folded":
        problem = folded_problem(problem)
    record = found.rows or RowBlocks().whole(problem.descriptor)
    size, count = problem.descriptor.point_size, len(problem.descriptor.components)
    rows = record.t.size
    if (record.x.shape, record.energies.shape, record.ledgers.shape) != ((rows, size), (rows, count), (rows, 5)):
        raise ValueError(f"{file}: its rows are not of {problem.name}; expected {size} states of {count} components")
    return solution_of(problem, record, found.stats)


def _known(given: Any) -> Any:
    """An input from a journal; of a function only the name is stored, so any function replaces it."""
    return (lambda _: 0.0) if isinstance(given, str) else given


def _check_states(found: Solution) -> None:
    """Kernels trust the shapes of states."""
    if found.problem is None:
        return
    for slot in found.problem.descriptor.states:
        values, sizes = found.states[slot.path], {slot.quantity.space.size, slot.quantity.space.dim}
        numbers = values.shape[1] if values.ndim == 2 else 1 if values.ndim == 1 else None
        if len(values) != len(found.t) or numbers not in sizes or values.dtype != np.float64:
            raise ValueError(f"state {slot.path} is {values.shape}, expected {len(found.t)} times {max(sizes)} numbers")


def _scene(text: str, homes: tuple[File, ...]) -> Scene:
    """The scene of an untrusted file."""
    scene = scene_from_text(text)
    check_scene(scene)
    return meshes_within(scene, homes)


def _problem_again(text: str, t: Array, inputs: Mapping[Path, Array], homes: tuple[File, ...]) -> Problem:
    """The problem of a model, with inputs as they were at some instants."""
    if is_system_text(text):
        return _system_again(text, t, inputs)
    scene = _scene(text, homes)
    forced = [f"joints.{name}" for name, j in scene.all_joints() if any(p in inputs for p, _ in drive_ports(j))]
    pushed = [f"bodies.{name}" for name, _ in scene.all_bodies() if wrench_port(name) in inputs]
    own = scene_inputs(scene)
    driven = {f"joints.{name}" for name, j in scene.all_joints() if any(p in own for p, _ in drive_ports(j))}
    zeros = {key: np.zeros(scene.joint(key.partition(".")[2]).dim) for key in forced if key not in driven}
    problem = problem_of_scene(scene, None, {**zeros, **{key: np.zeros(6) for key in pushed}})
    changing = {path for path, given in own.items() if isinstance(given.value, MotionLaw)}  # known between instants
    signals = {
        path: _kept(t, values, problem.signals[path].effort)
        for path, values in inputs.items()
        if t.size and path not in changing
    }
    return replace(problem, signals={**problem.signals, **signals})


def _system_again(text: str, t: Array, inputs: Mapping[Path, Array]) -> Problem:
    """The problem of a system, with inputs as they were at some instants."""
    system, efforts, laws, reference = read_system_text(text)
    given: dict[str, Any] = {}
    for path, port in system.interface.items():
        if port.power and (path in inputs or str(path) in laws):
            side = "effort" if str(path) in efforts else "flow"
            given[str(path)] = {side: laws.get(str(path), np.zeros(port.quantity.space.dim))}
    problem = problem_of_system(system, None, given, reference, assemble=False)
    kept = {path: signal for path, signal in problem.signals.items() if str(path) not in laws and t.size}
    return replace(
        problem,
        signals={**problem.signals, **{path: _kept(t, inputs[path], signal.effort) for path, signal in kept.items()}},
    )


def _kept(t: Array, values: Array, effort: bool) -> Signal:
    """A signal by its values at some instants, linearly interpolated."""
    if np.all(values == values[0]):
        return Signal(values[0], effort)
    order = np.argsort(t)
    times, columns = t[order], values[order].T
    return Signal(lambda time, _state: np.array([np.interp(time, times, column) for column in columns]), effort)
