"""`linearize`: from a model to its linear system about a state."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.linear.statespace import StateSpace
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.dynamics import State
    from ephs.mechanics.linear.equilibrium import Equilibrium
    from ephs.operad import Path
    from ephs.semantics.bundles.bundle import Array
    from ephs.solve.posing.problem import Problem


@in_one_thread
def linearize(
    model: System | Scene,
    state: "State | Equilibrium | Mapping[str, ArrayLike] | str | None" = None,
    *,
    inputs: "Sequence[str] | Mapping[str, Any] | None" = None,
    outputs: Sequence[str] | None = None,
    form: str = "reduced",
    reference: Reference | None = None,
) -> StateSpace:
    """A model linearised about a state: state space, modes, and at an equilibrium its structure.

    Parameters
    ----------
    state
        A `State` of `ephs.dynamics`, values of states by path, an `Equilibrium`, or ``"equilibrium"``, which finds
        one. Default: the initial state of a scene; of a system what its components carry. In a moving state, the
        linear system holds at that instant.
    inputs
        Names of inputs of a scene: ``"joints.pin"``, a force on its twist u_r, ``"bodies.crank"``, a wrench
        in the body frame, ``"markers.tip"``, a force in world axes; all joints by default. For a system
        ``{port: {"effort": e}}`` or ``{"flow": f}``, the prescribed quantity at its outer ports and its value; zero
        flow at all other ports. A system with joints takes names, too, of which the paths of boxes are part; its
        prescribed motions are followed, and are no inputs.
    outputs
        Default: the power conjugates of the inputs. For a scene, names as for inputs give rates and twists; with
        ``.coordinate`` (joints) and ``.position`` (bodies, markers) positions. For a system, ports and paths of states.
    form
        ``"reduced"``: a mechanism in independent joint coordinates; ``"paper"``: the states of its system.
    reference
        The reference environment of a system.

    Raises
    ------
    OptionError
        There is no such port, the state does not fit, or a component has no place in joint coordinates.
    SimulationError
        No equilibrium was found, or the motion is not determined in the state.
    """
    from ephs.mechanics.dynamics import State, dynamics
    from ephs.mechanics.linear.equilibrium import Equilibrium, equilibrium

    if form not in ("reduced", "paper"):
        raise OptionError("form", form, "reduced or paper")
    for key, names in (("inputs", inputs), ("outputs", outputs)):
        listed = isinstance(names, Sequence | Mapping) and not isinstance(names, str)
        if names is not None and not (listed and all(isinstance(name, str) for name in names)):
            raise OptionError(key, names, "names, as a list")
    if not isinstance(state, State | Equilibrium | Mapping | str | None):
        raise OptionError("state", state, "a state, values of states by path, an equilibrium, or the word equilibrium")
    if state == "equilibrium":
        state = equilibrium(model, inputs=inputs if isinstance(inputs, Mapping) else None, reference=reference)
    elif isinstance(state, str):
        raise OptionError("state", state, "a state, or the word equilibrium")
    if isinstance(model, System):
        return _of_system(model, state, inputs, outputs, form, reference)
    if reference is not None:
        raise OptionError("reference", reference, "none: a scene's [world] has its own")
    if isinstance(inputs, Mapping):
        raise OptionError("inputs", inputs, "names of joints, bodies and markers")
    from ephs.mechanics.linear.mechanism import linear_mechanism

    if isinstance(state, Equilibrium):
        assert isinstance(state.model, Scene)
        model, state = state.model, None
    if isinstance(state, Mapping):
        raise OptionError(
            "state", "a mapping", "a State of ephs.dynamics, for a scene; or scene.with_state(…) as model"
        )
    mechanism = dynamics(model)
    if form == "reduced":
        points = {
            str(name): (str(marker.body), np.asarray(marker.at))
            for name, marker in model.all_markers()
            if marker.body != GROUND
        }
        at = mechanism.state0 if state is None else mechanism.closed(state)
        return linear_mechanism(mechanism, at, inputs, outputs, points)
    if inputs:
        raise OptionError("inputs", inputs, "none in the paper's form of a scene; form reduced has them")
    at = mechanism.state0 if state is None else state
    assert isinstance(at, State)
    from ephs.mechanics.linear.system import linear_system

    problem, states = mechanism.problem, mechanism.states(at)
    return linear_system(problem.system, states, _driven(problem, states), outputs, _reference(model), model.name)


def _of_system(
    system: System,
    state: Any,
    inputs: "Sequence[str] | Mapping[str, Any] | None",
    outputs: Sequence[str] | None,
    form: str,
    reference: Reference | None,
) -> StateSpace:
    from ephs.mechanics.dynamics import State
    from ephs.mechanics.linear.equilibrium import Equilibrium
    from ephs.mechanics.linear.mechanism import linear_mechanism
    from ephs.mechanics.linear.pencil import mechanism_of, system_problem
    from ephs.mechanics.linear.system import linear_system

    given: Any = state.states if isinstance(state, Equilibrium) else None if isinstance(state, State) else state
    prescribed, names = (inputs, None) if isinstance(inputs, Mapping) else (None, inputs)
    model = mechanism_of(system_problem(system, given, prescribed, reference)) if form == "reduced" else None
    if model is not None:
        at = model.closed(state) if isinstance(state, State) else model.state0
        return linear_mechanism(model, at, names, outputs, None)
    if isinstance(state, State):
        raise OptionError("state", "a State", "values of states by path, of a system without joints or in paper form")
    return linear_system(system, given, inputs, outputs, reference)


def _driven(problem: "Problem", states: "Mapping[Path, Array]") -> dict[str, Any]:
    """Values that a scene prescribes at the outer ports of its system, loads among them.

    Raises
    ------
    OptionError
        A load turns beside its body: what it adds to the stiffness is in joint coordinates alone.
    """
    for path, given in problem.signals.items():
        if not (given.constant or given.timed):
            raise OptionError("form", "paper", f"reduced, as the load at {path} depends on the states")
    return {
        str(path): {"effort" if given.effort else "flow": given.at(0.0, states)}
        for path, given in problem.signals.items()
    }


def _reference(scene: Scene) -> Reference:
    return Reference(scene.world.temperature, scene.world.pressure)
