"""Checks of a model, not of a trajectory: types, structure, assembly, laws, mobility."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.constraints.plausible import doubts
from ephs.mechanics.constraints.redundancy import dependences, in_words, indeterminate, wrenches_in_words
from ephs.mechanics.motion.batch import compose, inverse
from ephs.mechanics.motion.batch import gap as change
from ephs.mechanics.motion.motion import SceneMotion
from ephs.mechanics.motion.moving import Moving
from ephs.mechanics.runs.running import by_constant_steps
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.contacts import Contact, contact_points
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.own_units import in_own_units, mobility_of
from ephs.operad import ROOT, Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.semantics.systems.laws import Probe, system_law
from ephs.semantics.systems.report import DOUBTS, CheckItem, CheckReport, check_assembly, check_structure, check_types
from ephs.semantics.systems.system import System
from ephs.solve.auditing.audit import LAWFUL
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.solution import Solution
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


# Runs of a scene without the contacts that stay open in them: the motion is the same, and far fewer equations.


def without_contacts(problem: Problem, names: Collection[str]) -> Problem:
    """The problem of a scene without the contacts of these (dotted) names; its inputs are the scene's own."""
    small = problem_of_scene(_without(problem.scene, names))
    return replace(small, initial={slot.path: problem.initial[slot.path] for slot in small.descriptor.states})


def run_of_touching(
    problem: Problem, names: Collection[str], run: Callable[[Problem], Solution]
) -> tuple[Solution, int]:
    """The run of a scene without those of the named contacts that stay open in it, and how many these are.

    Raises
    ------
    SimulationError
        The run of the whole failed.
    """
    contacts = {name: contact for name, contact in problem.scene.all_contacts() if name in names}
    while contacts:
        try:
            found = run(without_contacts(problem, contacts))
        except (SolveError, RuntimeError):
            break
        assert isinstance(found.motion, SceneMotion)
        met = [name for name, contact in contacts.items() if not stays_open(problem.scene, contact, found.motion)]
        if not met:
            return found, len(contacts)
        for name in met:
            del contacts[name]
    return run(problem), 0


def stays_open(scene: Scene, contact: Contact, read: Moving) -> bool:
    """Whether a contact is open at all instants and between: where its gap is larger than the way to the next one.

    Notes
    -----
    A gap changes by no more than the second surface moves, and that is within its support about its frame.
    """
    relative: dict[tuple[str, str], Array] = {}
    for point in contact_points(scene, contact):
        (frame1, frame2), gap = point.frames, point.gap
        if point.bodies not in relative:
            one, other = (read.poses(body) for body in point.bodies)
            relative[point.bodies] = compose(inverse(one), other)
        pose = compose(compose(inverse(frame1[None]), relative[point.bodies]), frame2[None])
        turned, moved = change(pose[:-1].T, pose[1:].T)
        way = moved + gap.support.limit * turned
        outside = np.asarray(gap.distance(pose.T))
        if not (np.all(outside > 0.0) and np.all(np.minimum(outside[:-1], outside[1:]) > way)):
            return False
    return True


def _without(scene: Scene, names: Collection[str], path: str = "") -> Scene:
    kept = {name: contact for name, contact in scene.contacts.items() if path + name not in names}
    parts = {name: _without(part, names, f"{path}{name}.") for name, part in scene.parts.items()}
    return replace(scene, contacts=kept, parts=parts)


__all__ = ["CheckItem", "CheckReport", "check_model"]

LARGEST = 600
"""Rows of the largest relation that is composed by both routes; the work grows with the third power."""
ALIKE = 20
"""Subsystems of one pattern with components of the same names that are composed by both routes, where the whole is
larger: they differ in numbers only."""
STEP, STEPS = 1e-3, 100
"""Seconds and number of the steps over which balances are measured: in the first ones little may have moved yet."""
ROUNDING = 1e-13
"""Relative rounding of the sum of energies over these steps."""


@in_one_thread
def check_model(model: System | Scene, initial: Mapping[str, "ArrayLike"] | None = None) -> CheckReport:
    """Check a system or a scene in its initial state.

    A system's open ports are held at zero flow.

    Parameters
    ----------
    initial
        Values of states by path; a system's others at the identity, a scene's as it says.
    """
    return CheckReport(tuple(_items(model, initial)))


def _items(model: System | Scene, initial: Mapping[str, "ArrayLike"] | None) -> Iterator[CheckItem]:
    try:
        problem = problem_of_scene(model, initial) if isinstance(model, Scene) else _closed(model, initial)
    except SemanticsError as error:
        yield CheckItem("assembly", False, str(error))
        return
    system, d = problem.system, problem.descriptor
    yield check_types(d.system)
    yield check_structure(system)
    yield check_assembly(d, problem.inputs(0.0, problem.initial))
    if problem.scene is not None and problem.scene.adjusted is not None:
        yield CheckItem("adjusted", True, str(problem.scene.adjusted).removeprefix("adjusted: "))
    if problem.scene is not None and (doubted := doubts(problem.scene)):
        yield CheckItem(DOUBTS, True, "; ".join(doubted))
    probe = Probe(system, problem.initial, reference=problem.reference)
    yield _law("Tellegen", probe)
    if not _is_large(problem):
        yield _law("functoriality", probe)
    else:
        yield from _parts(problem)
    yield from _motion(problem, frozenset(map(str, initial or ())))


def _is_large(problem: Problem) -> bool:
    d = problem.descriptor
    return d.rate_size + d.effort_size + d.multiplier_size > LARGEST


def _closed(system: System, initial: Mapping[str, "ArrayLike"] | None) -> Problem:
    ports = [port for port, t in system.interface.items() if t.power] if isinstance(system, System) else []
    inputs = {str(port): {"flow": np.zeros(system.interface[port].quantity.space.dim)} for port in ports}
    return problem_of_system(system, initial, inputs)


def _law(name: str, probe: Probe) -> CheckItem:
    law = system_law(name)
    verdict = law(probe)
    return CheckItem(f"{name}: {law.statement}", verdict.holds, verdict.detail)


def _parts(problem: Problem) -> Iterator[CheckItem]:
    """Functoriality of subsystems by themselves, where the whole is large."""
    law = system_law("functoriality")
    count, failed, alike = 0, 0, dict[object, list[tuple[Path, System]]]()
    for path, part in _composed(problem.system):
        kind = part.pattern, tuple((inner, primitive.name) for inner, primitive in part.leaves())
        alike.setdefault(kind, []).append((path, part))
        count += 1
    chosen = {path: part for of in alike.values() for path, part in of[:: -(-len(of) // ALIKE)]}
    states: dict[Path, dict[Path, Array]] = {path: {} for path in chosen}
    for path, value in problem.initial.items():
        for box in (Path(path[:length]) for length in range(1, len(path))):
            if box in states:
                states[box][path.relative_to(box)] = value
    for path, part in chosen.items():
        verdict = law(Probe(part, states[path], reference=problem.reference))
        if not verdict.holds:
            failed += 1
            yield CheckItem(f"functoriality: {law.statement}", False, f"{path}: {verdict.detail}")
    of = f"each of {count} subsystems" if len(chosen) == count else f"{len(chosen)} of {count} subsystems"
    agree = f"not for {failed} of what was compared" if failed else "both relations agree"
    detail = f"{agree}: {of}, as the whole is large"
    if len(chosen) < count:
        detail += f"; at most {ALIKE} of those that differ in numbers only"
    yield CheckItem(f"functoriality: {law.statement}", not failed, detail)


def _composed(system: System, at: Path = ROOT) -> Iterator[tuple[Path, System]]:
    """Subsystems with power ports only; of a large one, those inside of it."""
    for box, part in system.fillings.items():
        if isinstance(part, System):
            if sum(primitive.bundle.size for _, primitive in part.leaves()) > LARGEST:
                yield from _composed(part, at / box)
            elif all(t.power for t in part.interface.values()):
                yield at / box, part


def _motion(problem: Problem, given: Collection[str]) -> Iterator[CheckItem]:
    """Mobility, redundancy, closure, and the balances over some steps; ``given`` are states with values of a user."""
    own, touching = in_own_units(problem), frozenset[str]()
    if problem.scene is not None and _is_large(problem) and not any("contacts" in path for path in given):
        touching = frozenset(name for name, _ in problem.scene.all_contacts())
    found = mobility_of(without_contacts(problem, touching) if touching else problem)  # contacts constrain nothing
    motions = f"{found.mobility or 'no'} independent motion{'s' if found.mobility != 1 else ''}"
    yield CheckItem("mobility", True, f"{motions} in this configuration")
    yield from _redundancy(problem, found.redundant)
    try:
        start, left = run_of_touching(problem, touching, _few_steps) if touching else (_few_steps(problem), 0)
    except (SolveError, RuntimeError) as error:
        yield CheckItem("motion", False, str(error))
        return
    gap, slip = float(start.constraint_error[0]), float(start.velocity_error[0])
    if problem.mechanical:
        detail = f"largest gap {gap:.1e} m or rad, largest velocity residual {slip:.1e}"
        yield CheckItem("closure", gap < ASSEMBLY * problem.length, detail)
    error, ledgers = float(start.energy_error.max()), start.ledgers
    stored = float(np.max(np.sum([np.abs(energy) for energy in ledgers.storages.values()], axis=0), initial=0.0))
    stored += _weight(problem.scene) if problem.scene is not None else 0.0
    detail = f"relative error of the energy over {STEPS} steps of {STEP * own.seconds:g} s: {error:.1e}"
    balanced = error < LAWFUL or error * ledgers.scale < ROUNDING * stored
    if error >= LAWFUL and balanced:  # next to nothing moves
        detail += f", {error * ledgers.scale / stored:.1e} of the stored energy"
    if left:
        detail += f"; {left} contacts stay open, and are left out"
    yield CheckItem("power balance", balanced, detail)
    least = float(start.stats["least_production"])
    least = min(least, 0.0) if left else least  # what is left out produces nothing
    yield CheckItem("entropy production", least >= 0.0, f"least of a component in these steps: {least:.1e} J/K")


def _few_steps(problem: Problem) -> Solution:
    return by_constant_steps(in_own_units(problem), STEPS * STEP, STEP)


def _weight(scene: Scene) -> float:
    """The energy, in J, of all masses lifted by the longest arm of a joint: the size of energies where all are zero."""
    arms = [
        float(np.linalg.norm(frame[4:])) for _, joint in scene.all_joints() for frame in (joint.frame1, joint.frame2)
    ]
    mass = sum(body.mass for _, body in scene.all_bodies())
    return mass * float(np.linalg.norm(scene.world.gravity)) * max(arms, default=0.0)


def _redundancy(problem: Problem, count: int) -> Iterator[CheckItem]:
    """Dependent constraints; of a system without joints, only their number."""
    if problem.constraints is None:
        detail = f"{count} of the constraint equations depend on others"
        if count:
            detail += "; the motion is unique, their multipliers are not"
        yield CheckItem("redundant constraints", True, detail)
        return
    mechanism = problem.constraints()
    repeated = dependences(mechanism)
    detail = in_words(repeated) or "none"
    if repeated and not any(each.here for each in repeated):  # where motions part, none is unique
        detail += "; the motion is still unique"
    yield CheckItem("redundant constraints", True, detail)
    yield CheckItem("joint wrenches", True, wrenches_in_words(indeterminate(mechanism)))
