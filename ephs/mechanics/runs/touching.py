"""Runs of a scene without the contacts that stay open in them: the motion is the same, and far fewer equations."""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from ephs.mechanics.motion.batch import compose, inverse
from ephs.mechanics.motion.batch import gap as change
from ephs.mechanics.motion.motion import SceneMotion
from ephs.mechanics.motion.moving import Moving
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.contacts import Contact, contact_points
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import Problem
from ephs.solve.result.solution import Solution


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
