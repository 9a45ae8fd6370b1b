"""`dynamics`: a scene or a system compiled to functions of its state."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from ephs.mechanics.dynamics.model import Dynamics
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import varied
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError
from ephs.solve.posing.sampled import Sampled


def dynamics(
    scene: Scene | System,
    *,
    initial: Mapping[str, ArrayLike] | None = None,
    inputs: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
) -> Dynamics:
    """A scene, or a system with bodies in it, compiled to functions of its state.

    Parameters
    ----------
    scene
        With its drives, springs, friction and prescribed motions; its initial state is ``state0``. The names of bodies
        and joints of a system are the paths of their boxes.
    initial, reference
        Of a system, as in `simulate`.
    inputs
        As in `simulate`; those of a scene are constants by the names of joints, bodies, markers or actuators.

    Raises
    ------
    OptionError
        The reduced form does not support the model (a loop of prescribed joints), or an argument is part of the scene.
    Unplaced
        A component of a system is not supported in joint coordinates.
    SimulationError
        The initial state contradicts the joints.
    """
    if not isinstance(scene, Scene):
        problem = problem_of_system(scene, initial, inputs, reference)
        for port, signal in problem.signals.items():
            if not signal.constant and str(port) in (inputs or {}):
                raise OptionError(f"inputs[{str(port)!r}]", "a function", "a number or numbers: dynamics have no time")
        return Dynamics(problem)
    if given := [name for name, of in (("initial", initial), ("reference", reference)) if of]:
        raise OptionError(given[0], "a value", "none: a scene has its own")
    for name, value in (inputs or {}).items():
        if callable(value) or isinstance(value, Sampled):
            raise OptionError(f"inputs[{name!r}]", value, "a number or numbers: dynamics have no time")
    sheets = {f"shells.{name}": sheet for name, sheet in scene.all_shells() if sheet.pressure is not None}
    blown, markers = sheets.keys(), dict(scene.all_markers())
    pressed = {f"bodies.{sheet.node(i)}" for sheet in sheets.values() for i in sheet.moving()}
    pressed |= {f"markers.{name}" for name, marker in markers.items() if f"bodies.{marker.body}" in pressed}
    if at := next((name for name in inputs or {} if name in pressed), None):
        raise OptionError(f"inputs[{at!r}]", "a node of a sheet with a pressure", "a [loads] table in its place")
    pressures = {f"{name}.pressure": value for name, value in (inputs or {}).items() if name in blown}
    others = {name: value for name, value in (inputs or {}).items() if name not in blown}
    return Dynamics(problem_of_scene(varied(scene, pressures) if pressures else scene, None, others))
