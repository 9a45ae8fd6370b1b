"""The initial value problem of a system."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from ephs.mechanics.runs.signals import signal
from ephs.operad import Path, Pattern, Quantity, quantity
from ephs.operad.collector import paused_collector
from ephs.semantics.bundles import extents
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.systems.system import System
from ephs.solve.posing.errors import OptionError, no_model
from ephs.solve.posing.problem import Problem, Signal

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@paused_collector()
def problem_of_system(
    system: System,
    initial: Mapping[str, "ArrayLike"] | None = None,
    inputs: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
    *,
    name: str = "system",
    assemble: bool = True,
) -> Problem:
    """The initial value problem of a system.

    ``assemble``: bodies and joints whose poses are not given are put where the others want them.
    """
    if isinstance(system, Pattern):
        raise AssemblyError("unfilled", "model")
    if not isinstance(system, System):
        raise no_model(system)
    if not isinstance(reference, Reference | None):
        raise OptionError("reference", reference, "ephs.Reference(temperature=…, pressure=…)")
    descriptor, signals, state = system.descriptor(), system_signals(system, inputs), system.state(initial)
    counters = {slot.path for slot in descriptor.components if slot.primitive.kind == "environment"}
    for slot in descriptor.states:
        given, of = state[slot.path], slot.quantity
        if not extents.inside(of, given) and Path(slot.path[:-1]) not in counters:
            found = float(given[0]) if given.size == 1 else given
            raise AssemblyError("outside", slot.path, quantity=of.kind, found=found, expected=extents.expected(of))
    given = reference or Reference()

    def text() -> str:
        from ephs.mechanics.runs.system_text import system_text  # only files need it

        return system_text(system, signals, given)

    made = Problem(name, system, descriptor, state, signals, given, document=cache(text))
    if not any(map(is_posed, descriptor.numbering.quantities)):
        return made
    return _of_mechanism(made, {path: state[path] for path in map(Path.of, initial or {})}, assemble=assemble)


def system_signals(system: System, inputs: Mapping[str, Any] | None) -> dict[Path, Signal]:
    """Inputs at a system's outer ports as signals.

    Raises
    ------
    AssemblyError
        One says neither effort nor flow, or is no number.
    """
    signals: dict[Path, Signal] = {}
    for port, given in (inputs or {}).items():
        if not isinstance(given, Mapping) or len(given) != 1 or not set(given) <= {"effort", "flow"}:
            raise AssemblyError("input", port, found=given, expected="{'effort': f} or {'flow': f}")
        ((side, value),) = given.items()
        path = Path.of(port)
        size = system.interface[path].quantity.space.dim if path in system.interface else None
        signals[path] = signal(value, effort=side == "effort", name=str(path), size=size)
    return signals


def is_posed(of: Quantity) -> bool:
    """Whether a quantity is of a body or a joint: the momentum of a body, or a relative pose."""
    body = quantity.body_momentum
    return of.kind == "relative_pose" or (of.kind == body.kind and of.space == body.space)


def _of_mechanism(problem: Problem, given: Mapping[Path, Array], *, assemble: bool) -> Problem:
    """A problem with bodies: assembled, with the motion of its links and what its joints hold."""
    from ephs.mechanics.constraints.redundancy import dependences, in_words
    from ephs.mechanics.motion.links import LinkMotion
    from ephs.mechanics.runs.assembling import constraints_of, flat_joints, length_of, start_of

    joints = flat_joints(problem.descriptor)
    state = start_of(joints, problem.system, given) if assemble and joints.links else problem.initial
    linked = (lambda solution: LinkMotion(joints.frames, joints.links, solution)) if joints.frames.links else None
    length = length_of(joints, state) if linked else 1.0
    made = replace(problem, initial=state, linked=linked, length=length)
    if not joints.holding:
        return made
    held = cache(lambda: constraints_of(joints, made))
    return replace(made, constraints=held, dependences=lambda: in_words(dependences(held())))
