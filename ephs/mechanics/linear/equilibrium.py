"""Equilibria: of a scene by its forces, of a system by artificial time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.scene.actuators import Actuator
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.gears import Gear
from ephs.mechanics.scene.model import Scene
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.decompositions import metric_eigen
from ephs.semantics.spaces.rank import ELIMINATION, TINY
from ephs.semantics.systems.system import System
from ephs.solve.errors import OptionError, Outcome, SimulationError, SolveError
from ephs.solve.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.dynamics import Dynamics, State
    from ephs.mechanics.runs.assembling import FlatJoints
    from ephs.semantics.descriptor.descriptor import Descriptor

SAMPLES = 257
"""Number of instants of the first second at which a prescribed motion is asked for its rate."""
STALLED = 1e-9
"""Allowed unbalanced fraction of the forces where iterations stagnate."""
UNFELT = 1e-9
"""Fraction of the forces along directions without stiffness that counts as rounding."""
SHORTEST, LEAST, SETTLED, CLOSES = 1e-12, 1e-9, 1e-12, 1e-10
"""Artificial time: the shortest step, the least scale of states, the residual and the gaps of joints at the end."""
ENOUGH = 1e-12
"""Allowed unbalanced fraction of the applied forces."""
STRIDE = 0.3
"""Largest change of a mechanism in one step, in rad or m."""
STEPS = 200
HALVINGS = 8
"""Reduction of a step after which loops do not close."""


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

    For a scene, the search starts at its initial state with zero rates, and ends at a balance of gravity, springs and
    drives. It takes steps along the eigenvectors of the stiffness in the mass metric, downhill in unstable directions,
    too; unless the initial state is balanced, the result is a minimum of the energy. A system settles by implicit Euler
    steps of growing length, which preserve its linear invariants (charges, volumes, entropies of isolated parts). In a
    scene's own system, a joint with a prescribed motion is free unless its port has the effort 0.

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
    try:
        return _equilibrium(model, initial, inputs, reference)
    except ArithmeticError as error:  # an eigenvalue or a rate that is no number
        raise _none("", str(error)) from error


def _equilibrium(
    model: System | Scene,
    initial: "Mapping[str, ArrayLike] | None",
    inputs: Mapping[str, Any] | None,
    reference: Reference | None,
) -> Equilibrium:
    if isinstance(model, System):
        return _of_system(model, initial, inputs, reference)
    for key, value in (("initial", initial), ("inputs", inputs), ("reference", reference)):
        if value is not None:
            raise OptionError(key, value, "none, of a scene: vary the scene instead")
    return _of_scene(model)


# ---- scenes ------------------------------------------------------------------------------------------------------


def _keeps(of: Element) -> bool:
    """Whether an attachment has states beside those of its joints."""
    return bool(of.stiffness) if isinstance(of, Gear) else not isinstance(of, Actuator)


def _of_scene(scene: Scene) -> Equilibrium:
    from ephs.mechanics.dynamics import dynamics

    if own := [f"{section}.{name}" for section, name, each in scene.all_attachments() if _keeps(each)]:
        found = f"a scene with {own[0]}"
        raise OptionError("model", found, "a scene without attachments with states, or its system")
    sprung = [f"tendons.{name}" for name, each in scene.all_tendons() if each.stiffness]
    if sprung and any(True for _ in scene.all_loads()):
        found = f"a scene with {sprung[0]} and loads"
        raise OptionError("model", found, "a scene with only one of both, or its system")
    laws = {name: joint.motion for name, joint in scene.all_joints() if joint.motion is not None}
    moving = [name for name, law in laws.items() if any(map(law.rate, np.linspace(0.0, 1.0, SAMPLES).tolist()))]
    if moving:
        raise _none(f"joints.{moving[0]}", "its motion is prescribed")
    model = dynamics(_resting(scene))
    if model.loading:
        return _loaded(model)
    state, left, steps = _settled(model)
    found = _at(model, state)
    return Equilibrium(found, model.states(state), left, steps)


def _loaded(model: "Dynamics") -> Equilibrium:
    """Equilibrium under loads: first without them, then along the path of increasing loads."""
    from ephs.mechanics.linear.continuation import follow
    from ephs.mechanics.linear.scene import freedoms_of, unbalanced
    from ephs.mechanics.scene.state import Snapshot

    model.loading.share = 0.0
    try:
        start, _, _ = _settled(model)
    finally:
        model.loading.share = 1.0
    path = follow(model, start, Snapshot.of(model.scene).scale(model.scene.world.gravity).length)
    if path is None:
        raise _none(*_culprit(model, start))
    state = path.states[-1]
    left = unbalanced(model, state, freedoms_of(model, state), model.derivatives(state).force_q)
    return Equilibrium(_at(model, state), model.states(state), left, len(path.shares) - 1, path.shares, path.critical)


def _resting(scene: Scene) -> Scene:
    """The scene with all rates zero."""
    joints = [*scene.all_joints(), *scene.implicit_joints()]
    return scene.with_state(rates={name: np.zeros(joint.dim) for name, joint in joints})


def _settled(model: "Dynamics") -> "tuple[State, float, int]":
    """The equilibrium, its unbalanced fraction of the forces, and the number of steps."""
    from ephs.mechanics.linear.scene import freedoms_of, unbalanced

    lengths = _lengths(model)
    state, shift, before = _followed(model, model.state0, lengths), 0.0, np.inf
    best, stalled = np.inf, 0
    for step in range(STEPS):
        free = freedoms_of(model, state)
        by, Z = model.derivatives(state), free.Z
        left = unbalanced(model, state, free, by.force_q)
        if left <= ENOUGH or (left <= STALLED and stalled >= 3):
            return state, left, step
        best, stalled = (left, 0) if left < 0.5 * best else (best, stalled + 1)
        if left > before:
            shift = max(4.0 * shift, 1e-3)
        else:
            shift *= 0.1
        before = left
        M = Z.T @ by.force_a @ Z
        force = M @ _still(model, state)[free.which]
        pulled = by.acceleration_s[:, list(lengths)] @ by.entropy_r[list(lengths)]
        K = -M @ ((by.acceleration_q + pulled) @ Z)[free.which]
        values, ways = metric_eigen(0.5 * (K + K.T), 0.5 * (M + M.T))
        size = np.abs(values)
        flat = size <= ELIMINATION * size.max(initial=0.0)
        push = ways.T @ force
        push[flat & (np.abs(push) <= UNFELT * np.abs(push).max(initial=0.0))] = 0.0
        stretch = push / np.where(flat, max(float(size.max(initial=0.0)), TINY), size + shift * size.max(initial=0.0))
        change = Z @ (ways @ stretch)
        change /= max(1.0, float(np.abs(change).max(initial=0.0)) / STRIDE)
        state = _followed(model, _nearest(model, state, change), lengths)
    raise _none(*_culprit(model, state))


def _lengths(model: "Dynamics") -> dict[int, list[Path]]:
    """Places of tendons' lengths among the entropies, and the relative poses of their segments."""
    found: dict[int, list[Path]] = {}
    for name, tendon in model.scene.all_tendons():
        at = component_path("tendons", name)
        if tendon.stiffness:
            segments = [at / f"segment{k}" / "pe" / "q_r" for k in range(1, len(tendon.segments) + 1)]
            found[model.layout.entropies.index(at / "spring" / "q")] = segments
    return found


def _followed(model: "Dynamics", state: "State", lengths: Mapping[int, list[Path]]) -> "State":
    """The state with tendons as long as they are where the joints put their points."""
    q, r, s = model.layout.split(state.array)
    states = model.states(state)
    for place, segments in lengths.items():
        s[place] = sum(float(np.linalg.norm(states[path][4:])) for path in segments)
    return model.unpack(np.concatenate([q, r, s])) if lengths else state


def _nearest(model: "Dynamics", state: "State", change: Array) -> "State":
    """The state without rates after a change, or the largest half, quarter, … of it after which loops close."""
    for halvings in range(HALVINGS):
        try:
            return _without_rates(model, model.closed(model.moved(state, 0.5**halvings * change)))
        except SimulationError:
            continue
    return _without_rates(model, model.closed(model.moved(state, 0.5**HALVINGS * change)))


def _still(model: "Dynamics", state: "State") -> Array:
    """(n,) accelerations from rest."""
    found = model.acceleration(state)
    out = np.zeros(model.layout.n)
    for name, where in model.freedoms.items():
        out[where] = found[name][: where.size]
    return out


def _without_rates(model: "Dynamics", state: "State") -> "State":
    q, r, s = model.layout.split(state.array)
    return model.unpack(np.concatenate([q, np.zeros_like(r), s]))


def _culprit(model: "Dynamics", state: "State") -> tuple[str, str]:
    """The joint that accelerates most from rest, and how."""
    found = {name: float(np.abs(a).max(initial=0.0)) for name, a in model.acceleration(state).items()}
    name = max(found, key=lambda n: found[n])
    what = f"from rest it still accelerates by {found[name]:.3g} rad/s² or m/s²"
    driven = [n for n, joint in model.scene.all_joints() if np.any(joint.drive) and not np.any(joint.stiffness)]
    if driven:
        what += f"; the constant drive of {', '.join(driven)} is balanced nowhere"
    return f"joints.{name}", what


def _at(model: "Dynamics", state: "State") -> Scene:
    """The scene in a state."""
    coordinates = {name: state.coordinates[name] for name in model.joints if state.coordinates[name].size}
    known = {name for name, _ in [*model.scene.all_joints(), *model.scene.implicit_joints()]}
    return model.scene.with_state(
        {name: value for name, value in coordinates.items() if name in known and name not in model.cut}, adjust=True
    )


# ---- systems -----------------------------------------------------------------------------------------------------


def _of_system(
    system: System,
    initial: "Mapping[str, ArrayLike] | None",
    inputs: Mapping[str, Any] | None,
    reference: Reference | None,
) -> Equilibrium:
    from ephs.mechanics.linear.pencil import Pencil, system_problem
    from ephs.mechanics.runs.assembling import flat_joints

    problem = system_problem(system, initial, inputs, reference)
    pencil, d = Pencil(problem), problem.descriptor
    joints = flat_joints(d)
    x, h = d.pack(problem.initial), 1e-3
    z, size, left, done = np.zeros(pencil.model.unknowns), 0.0, np.inf, 0
    try:
        for step in range(STEPS):
            done = step
            found = pencil.implicit_step(x, z, h)
            if found is None or _beyond_half_a_turn(d, h * found[: pencil.n_w]):
                h *= 0.25
                if h < SHORTEST:
                    break
                continue
            z, before = found, x
            x = d.advance(x, h * z[: pencil.n_w])
            size = max(float(np.abs(x).max(initial=0.0)), LEAST)
            moved = float(np.abs(x - before).max(initial=0.0)) / size
            left = float(np.abs(z[: pencil.n_w][pencil.counted]).max(initial=0.0)) / size
            if not np.isfinite(left) or size > 1e12:
                break
            if h >= 1e6 and left <= SETTLED:
                closed = d.pack(_closed(joints, d.unpack(x)))
                if float(np.abs(closed - x).max(initial=0.0)) <= CLOSES * size:
                    return Equilibrium(system, d.unpack(closed), left, step)
                x, z, h = closed, np.zeros_like(z), 1e-3
                continue
            h = min(h * (4.0 if moved < 0.5 else 1.5), 1e12)
    except SolveError as error:
        raise _none(error.path, error.equation or error.outcome.value) from error.cause
    fastest = max(d.states, key=lambda slot: float(np.abs(z[slot.rates]).max(initial=0.0)))
    rate = float(np.abs(z[fastest.rates]).max(initial=0.0))
    raise _none(str(fastest.path), f"after {done} steps it still changes by {rate:.3g} a second")


def _closed(joints: "FlatJoints", states: dict[Path, Array]) -> dict[Path, Array]:
    """The states with bodies where the joints put them: steps follow the rates of the joints, which open them.

    Raises
    ------
    SimulationError
        A loop is open.
    """
    from ephs.mechanics.runs.assembling import assembled, tendon_lengths

    if not joints.links:
        return states
    try:
        states = assembled(joints, states, joints.relative)
    except AssemblyError as error:
        raise _none("", f"{error}: the way there is too far for its loops") from error
    return states | dict(tendon_lengths(joints.frames, states))


def _beyond_half_a_turn(d: "Descriptor", change: Array) -> bool:
    """Whether a change of the states goes around: steps of whole turns solve the equations without coming to rest."""
    for slot in d.states:
        group, v = manifold(slot.quantity.space), change[slot.rates]
        if group.code != VECTOR and float(np.abs(group.log(group.exp(v)) - v).max(initial=0.0)) > 1.0:
            return True
    return False


def _none(path: str, what: str) -> SimulationError:
    return SimulationError(Outcome.RESTLESS, 0.0, path, what, None)
