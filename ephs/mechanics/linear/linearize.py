"""`linearize`: from a model to its linear system about a state."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ephs.mechanics.linear.statespace import StateSpace
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.systems.system import System
from ephs.solve.errors import OptionError
from ephs.solve.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.dynamics import State
    from ephs.mechanics.linear.equilibrium import Equilibrium


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
        one. Default: the initial state of a scene, the identity for states of a system. In a moving state, the linear
        system holds at that instant.
    inputs
        Names of inputs of a scene: ``"joints.pin"``, a force on its twist u_r, ``"bodies.crank"``, a wrench
        in the body frame, ``"markers.tip"``, a force in world axes; all joints by default. For a system
        ``{port: {"effort": e}}`` or ``{"flow": f}``, the prescribed quantity at its outer ports and its value; zero
        flow at all other ports.
    outputs
        Default: the power conjugates of the inputs. For a scene, names as for inputs give rates and twists; with
        ``.coordinate`` (joints) and ``.position`` (bodies, markers) positions. For a system, ports and paths of states.
    form
        ``"reduced"``: a scene in independent joint coordinates; ``"paper"``: the states of its system.
    reference
        The reference environment of a system.

    Raises
    ------
    OptionError
        There is no such port, or the state does not fit.
    SimulationError
        No equilibrium was found, or the motion is not determined in the state.
    """
    from ephs.mechanics.linear.equilibrium import Equilibrium, equilibrium
    from ephs.mechanics.linear.system import linear_system

    if form not in ("reduced", "paper"):
        raise OptionError("form", form, "reduced or paper")
    if state == "equilibrium":
        state = equilibrium(model, inputs=inputs if isinstance(inputs, Mapping) else None, reference=reference)
    elif isinstance(state, str):
        raise OptionError("state", state, "a state, or the word equilibrium")
    if isinstance(model, System):
        given: Any = state.states if isinstance(state, Equilibrium) else state
        return linear_system(model, given, inputs, outputs, reference)
    if reference is not None:
        raise OptionError("reference", reference, "none: a scene's [world] has its own")
    if isinstance(inputs, Mapping):
        raise OptionError("inputs", inputs, "names of joints, bodies and markers")
    from ephs.mechanics.dynamics import State, dynamics
    from ephs.mechanics.linear.scene import linear_scene

    if isinstance(state, Equilibrium):
        assert isinstance(state.model, Scene)
        model, state = state.model, None
    if isinstance(state, Mapping):
        raise OptionError(
            "state", "a mapping", "a State of ephs.dynamics, for a scene; or scene.with_state(…) as model"
        )
    if form == "reduced":
        return linear_scene(model, state, inputs, outputs)
    mechanism = dynamics(model)
    at = mechanism.state0 if state is None else state
    assert isinstance(at, State)
    from ephs.mechanics.runs.simulate import problem_of_scene

    return linear_system(
        problem_of_scene(model).system, mechanism.states(at), _driven(model), outputs, _reference(model), model.name
    )


def _driven(scene: Scene) -> dict[str, Any]:
    """Values that a scene prescribes at the outer ports of its system."""
    from ephs.mechanics.scene.build import scene_inputs

    return {
        str(path): {"effort" if given.effort else "flow": given.value} for path, given in scene_inputs(scene).items()
    }


def _reference(scene: Scene) -> Reference:
    return Reference(scene.world.temperature, scene.world.pressure)
