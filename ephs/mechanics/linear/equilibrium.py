"""Equilibria: of mechanisms by their forces, of other systems by artificial time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.gears import Gear
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.state import resumed
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError, no_model
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


SAMPLES = 257
"""Number of instants of the first second at which a prescribed motion is asked for its rate."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """An equilibrium.

    Parameters
    ----------
    model
        The scene at rest there; or the system, which has no state of its own.
    states
        Path -> value of all states: ``initial`` of `simulate`.
    residual
        Of a scene: the part of the forces that is not balanced. Of a system: the largest rate, per second, relative
        to the state.
    steps
        How many steps led there.
    shares
        (n,) of a scene with loads: the parts of them at the equilibria on the way, which fall beyond limit points.
    critical
        Parts of the loads on the way at which it becomes unstable, or stable again: limit points and bifurcations.
    """

    model: Scene | System
    states: Mapping[Path, Array]
    residual: float
    steps: int
    shares: Array = field(default_factory=lambda: np.ones(1))
    critical: tuple[float, ...] = ()

    def __repr__(self) -> str:
        name = f" of {self.model.name}" if isinstance(self.model, Scene) else ""
        return f"Equilibrium{name}: {len(self.states)} states, residual {self.residual:.1e}, after {self.steps} steps"

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show.notebook import equilibrium_html

        return equilibrium_html(self)


@in_one_thread
def equilibrium(
    model: System | Scene,
    *,
    initial: "Mapping[str, ArrayLike] | None" = None,
    inputs: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
) -> Equilibrium:
    """An equilibrium near the initial state.

    For a mechanism, the search starts at its initial state with zero rates, and ends at a balance of gravity, springs
    and drives. It takes steps along the eigenvectors of the stiffness, downhill in unstable directions, too; unless the
    initial state is balanced, the result is a minimum of the energy. Where soft parts move too far for that, the forces
    at the start are held and let go little by little, and the steps follow from there. A system without
    joints, with attachments that have states, or where heat flows on, settles by implicit Euler steps of growing
    length, which preserve its linear invariants (charges, volumes, entropies of isolated parts). In a scene's own
    system, a joint with a prescribed motion is free unless its port has the effort 0.

    Parameters
    ----------
    initial
        Initial states of a system by path, others at the identity.
    inputs
        Of a system: ``{port: {"effort": e}}`` or ``{"flow": f}``, constant; zero flow at all other ports.
    reference
        The reference environment of a system.

    Raises
    ------
    SimulationError
        No equilibrium was found; the message names what still moves.
    """
    from ephs.mechanics.linear.balance import restless

    try:
        if isinstance(model, System):
            from ephs.mechanics.linear.pencil import system_problem
            from ephs.mechanics.linear.settling import settled

            return Equilibrium(model, *settled(system_problem(model, initial, inputs, reference)))
        if not isinstance(model, Scene):
            raise no_model(model)
        for key, value in (("initial", initial), ("inputs", inputs), ("reference", reference)):
            if value is not None:
                raise OptionError(key, value, "none, of a scene: vary the scene instead")
        return _of_scene(model)
    except ArithmeticError as error:  # an eigenvalue or a rate that is no number
        raise restless("", str(error)) from error


def _keeps(of: Element) -> bool:
    """Whether an attachment has states beside those of its joints."""
    return bool(of.stiffness) if isinstance(of, Gear) else not isinstance(of, Actuator)


def _of_scene(scene: Scene) -> Equilibrium:
    from ephs.mechanics.dynamics import dynamics
    from ephs.mechanics.linear.balance import balanced, restless

    if own := [f"{section}.{name}" for section, name, each in scene.all_attachments() if _keeps(each)]:
        found = f"a scene with {own[0]}"
        raise OptionError("model", found, "a scene without attachments with states, or its system")
    sprung = [f"tendons.{name}" for name, each in scene.all_tendons() if each.stiffness]
    if sprung and any(True for _ in scene.all_loads()):
        found = f"a scene with {sprung[0]} and loads"
        raise OptionError("model", found, "a scene with only one of both, or its system")
    for name, joint in scene.all_joints():
        if joint.motion is not None and any(map(joint.motion.rate, np.linspace(0.0, 1.0, SAMPLES).tolist())):
            raise restless(f"joints.{name}", "its motion is prescribed")
    joints = {name: joint.dim for name, joint in [*scene.all_joints(), *scene.implicit_joints()]}
    still = scene.with_state(rates={name: np.zeros(dim) for name, dim in joints.items()})
    model = dynamics(still)
    at, left, steps, path = balanced(model)
    known = joints.keys() - set(model.cut)
    coordinates = {name: value for name, value in at.coordinates.items() if name in known and value.size}
    states = model.states(at)
    rest = resumed(still.with_state(coordinates, adjust=True), states)
    if path is None:
        return Equilibrium(rest, states, left, steps)
    return Equilibrium(rest, states, left, steps, path.shares, path.critical)
