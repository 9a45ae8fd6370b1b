"""`simulate`: from a system or a scene to its motion."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.build import component_path, drive_ports, initial_state, scene_inputs, scene_system, wrench_port
from ephs.mechanics.motion import SceneMotion
from ephs.mechanics.reduced import EXPLICIT
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.model import Marker, Scene
from ephs.mechanics.solve.adaptive import ADAPTIVE, Control, integrate_adaptive
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.integrate import METHODS, Grid, integrate
from ephs.mechanics.solve.problem import Problem, Signal
from ephs.mechanics.solve.solution import Solution
from ephs.operad import Path
from ephs.semantics.bundle import POSITIVE, Array, Reference
from ephs.semantics.errors import AssemblyError
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.system import System

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["load_solution", "problem_of_scene", "problem_of_system", "simulate"]

STEPS = 1000
"""Number of steps where neither a step nor anything else says how many."""
FORMS = ("paper", "folded", "reduced")


def simulate(
    model: System | Scene,
    until: float,
    *,
    t0: float = 0.0,
    initial: Mapping[str, "ArrayLike"] | None = None,
    method: str = "auto",
    rtol: float = 1e-6,
    atol: float = 1e-9,
    step: float | None = None,
    max_step: float | None = None,
    min_step: float | None = None,
    max_steps: int | None = None,
    save_at: "ArrayLike | None" = None,
    form: str = "reduced",
    inputs: Mapping[str, Any] | None = None,
    events: Sequence[Any] | None = None,
    options: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
    progress: Callable[[float, float, Mapping[str, Any]], None] | None = None,
) -> Solution:
    """Simulate a system or a scene.

    Parameters
    ----------
    until, t0
        End and start in s.
    initial
        Values of states by path; a system's others at the identity, a scene's as it says.
    method
        ``"natural"``, which ``"auto"`` chooses too; ``"radau"``: order 5, stiff and adaptive, for systems whose states
        are on vector spaces; ``"rk54"``, ``"rk87"``: explicit and adaptive, for scenes, on their reduced form.
    rtol, atol
        Of adaptive methods: each state x is wanted to atol + rtol·|x| a step, atol in the state's own unit.
    step
        The grid is t₀ + k·step, the last step shortened to end on ``until``. Without it (until − t₀)/1000, or
        ``max_step`` where that is smaller. The natural method's steps are constant: rtol, atol and min_step steer
        adaptive methods only, and those only without ``step``.
    save_at
        Times to keep, met by dense output; every step where None.
    form
        Equations as flattened, ``"paper"``, are what the natural method solves; ``"reduced"``, the default, is the
        least that a method can use.
    inputs
        ``{port: {"effort": f}}`` or ``{"flow": f}`` at outer ports; of a scene also ``{"joints.pin": f}``, a
        generalised force on u_r, ``{"bodies.crank": f}``, a wrench in the body frame, and ``{"markers.tip": f}``, a
        force in world axes; f a constant, f(t), or f(t, state).
    reference
        The reference environment of a system; a scene's world gives its own.
    progress
        Called as progress(t, until, stats) a few times a second.

    Raises
    ------
    SimulationError
        The run failed part-way; ``.partial`` is the solution up to there.
    SemanticsError
        The model has no square system of equations, a state or an input does not fit.
    OptionError
        An option is not known, or not possible with the method; a ValueError.
    """
    chosen = _method(method)
    if form not in FORMS:
        raise OptionError("form", form, f"one of {', '.join(FORMS)}")
    if form == "folded":
        raise OptionError("form", form, f"paper or reduced, which the method {chosen} solves")
    for name, value in (("events", events), ("options", options)):
        if value:
            raise OptionError(name, value, f"none: the method {chosen} takes no {name}")
    if isinstance(model, Scene):
        if reference is not None:
            raise OptionError("reference", reference, "none: a scene's [world] has its own")
        problem = problem_of_scene(model, initial, inputs)
    else:
        problem = problem_of_system(model, initial, inputs, reference)
    times = _times(save_at, t0, until)
    if chosen in (*ADAPTIVE, *EXPLICIT):
        most = np.inf if max_step is None else float(max_step)
        least = 0.0 if min_step is None else float(min_step)
        control = Control(float(rtol), float(atol), None if step is None else float(step), least, most, max_steps)
        if chosen in EXPLICIT:
            if problem.scene is None:
                raise OptionError("method", chosen, "natural or radau: explicit methods are for scenes")
            if form != "reduced":
                raise OptionError("form", form, f"reduced, which the method {chosen} solves")
            from ephs.mechanics.reduced.run import integrate_reduced  # its kernels take a quarter of a second to load

            return integrate_reduced(
                problem, float(t0), float(until), method=chosen, control=control, save_at=times, progress=progress
            )
        return integrate_adaptive(
            problem, float(t0), float(until), method=chosen, control=control, save_at=times, progress=progress
        )
    span = float(until) - float(t0)
    h = float(step) if step is not None else min(span / STEPS, float(max_step) if max_step is not None else np.inf)
    return integrate(
        problem,
        Grid(float(t0), float(until), h),
        method=chosen,
        save_at=times,
        max_steps=max_steps,
        progress=progress,
    )


def problem_of_system(
    system: System,
    initial: Mapping[str, "ArrayLike"] | None = None,
    inputs: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
    *,
    name: str = "system",
) -> Problem:
    """The initial value problem of a system."""
    descriptor = system.descriptor()
    signals: dict[Path, Signal] = {}
    for port, given in (inputs or {}).items():
        if not isinstance(given, Mapping) or len(given) != 1 or not set(given) <= {"effort", "flow"}:
            raise AssemblyError("input", port, found=given, expected="{'effort': f} or {'flow': f}")
        ((side, value),) = given.items()
        signals[Path.of(port)] = signal(value, effort=side == "effort")
    state = system.state(initial)
    for slot in descriptor.states:
        if slot.quantity.kind in POSITIVE and not np.all(state[slot.path] > 0.0):
            raise AssemblyError("positive", slot.path, quantity=slot.quantity.kind, found=float(state[slot.path][0]))
    return Problem(name, system, descriptor, state, signals, reference or Reference())


def problem_of_scene(
    scene: Scene, initial: Mapping[str, "ArrayLike"] | None = None, inputs: Mapping[str, Any] | None = None
) -> Problem:
    """The initial value problem of a scene."""
    forces, wrenches = _scene_inputs(scene, inputs or {})
    system = scene_system(scene, driven=frozenset(forces), wrenches=frozenset(wrenches))
    state = initial_state(scene)
    if initial:
        changed = system.state(initial)
        state |= {Path.of(path): changed[Path.of(path)] for path in initial}
    signals = {path: Signal(given.value, given.effort) for path, given in scene_inputs(scene).items()}
    for name, force in forces.items():
        for port, where in drive_ports(scene.joint(name)):
            extra = _part(force, where)
            if port in signals and signals[port].effort:
                raise AssemblyError(
                    "input", f"joints.{name}", found="a force", expected="none: its motion is prescribed"
                )
            signals[port] = _sum(signals[port], extra) if port in signals else extra
    signals |= {wrench_port(body): wrench for body, wrench in wrenches.items()}
    world = scene.world
    return Problem(
        scene.name,
        system,
        system.descriptor(),
        state,
        signals,
        Reference(world.temperature, world.pressure),
        motion=lambda solution: SceneMotion(scene, solution),
        scene=scene,
        document=scene_to_text(scene),
    )


def load_solution(path: str | File) -> Solution:
    """Read a solution that `Solution.save` wrote; of a scene with everything that reads its motion.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such file, or it is not a solution.
    """
    from ephs.mechanics.solve.file import load

    return load(path, lambda text: problem_of_scene(scene_from_text(text)))


def signal(value: Any, *, effort: bool) -> Signal:
    """A signal from a constant, f(t), or f(t, state)."""
    if not callable(value):
        return Signal(np.atleast_1d(np.asarray(value, dtype=float)), effort)
    function: Any = value
    if _takes_state(function):
        return Signal(function, effort)
    return Signal(lambda t, _state: function(t), effort)


def _takes_state(function: Callable[..., Any]) -> bool:
    """Whether it wants a second argument: one that must be given, or is called state."""
    import inspect

    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # functions in C tell no signature; those of mathematics take one argument
        return False
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    given = [p for p in parameters if p.kind in places and (p.default is p.empty or p.name == "state")]
    return len(given) >= 2 and not isinstance(function, np.ufunc)


def _part(whole: Signal, where: slice) -> Signal:
    if whole.constant:
        return Signal(whole.at(0.0, {})[where])
    return Signal(lambda t, state: whole.at(t, state)[where])


def _sum(one: Signal, other: Signal) -> Signal:
    if one.constant and other.constant:
        return Signal(one.at(0.0, {}) + other.at(0.0, {}))
    return Signal(lambda t, state: one.at(t, state) + other.at(t, state))


def _scene_inputs(scene: Scene, inputs: Mapping[str, Any]) -> tuple[dict[str, Signal], dict[str, Signal]]:
    forces: dict[str, Signal] = {}
    wrenches: dict[str, Signal] = {}
    joints, bodies, markers = dict(scene.all_joints()), dict(scene.all_bodies()), dict(scene.all_markers())
    for key, value in inputs.items():
        kind, _, name = key.partition(".")
        given = signal(value, effort=False)
        if kind == "joints" and name in joints:
            forces[name] = given
        elif kind == "bodies" and name in bodies:
            wrenches[name] = _sum(wrenches[name], given) if name in wrenches else given
        elif kind == "markers" and name in markers and markers[name].body in bodies:
            body, push = markers[name].body, _at_marker(markers[name], given)
            wrenches[body] = _sum(wrenches[body], push) if body in wrenches else push
        else:
            known = (
                [f"joints.{n}" for n in joints] + [f"bodies.{n}" for n in bodies] + [f"markers.{n}" for n in markers]
            )
            raise AssemblyError("unknown-input", key, expected=", ".join(known))
    return forces, wrenches


def _at_marker(marker: Marker, force: Signal) -> Signal:
    """A force in world axes at a marker as a wrench in the body's frame."""
    pose = component_path("bodies", marker.body) / "pe" / "q"

    def wrench(t: float, state: Mapping[Path, Array]) -> Array:
        own = quaternion_to_matrix(state[pose][:4]).T @ force.at(t, state)
        return np.concatenate([np.cross(marker.at, own), own])

    return Signal(wrench)


def _method(name: str) -> str:
    if name == "auto":
        return "natural"
    if name not in (*METHODS, *ADAPTIVE, *EXPLICIT):
        raise OptionError("method", name, f"one of auto, {', '.join([*METHODS, *ADAPTIVE, *EXPLICIT])}")
    return name


def _times(save_at: "ArrayLike | None", t0: float, until: float) -> Array | None:
    if save_at is None:
        return None
    times = np.atleast_1d(np.asarray(save_at, dtype=float))
    if times.ndim != 1 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise OptionError("save_at", save_at, "ascending times in s")
    if times.size and not (t0 <= times[0] and times[-1] <= until):
        raise OptionError("save_at", save_at, f"times in [{t0!r}, {until!r}] s")
    return times
