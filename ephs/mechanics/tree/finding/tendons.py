"""Tendons of a flat system: the lengths that their springs store, by those of their segments."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.tree.finding.frames import Frames, frames_of
from ephs.mechanics.tree.finding.roles import Role
from ephs.mechanics.tree.finding.wiring import Incidence
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Reversible

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

TENSION_SPRINGS = ("tension_spring", "slack_spring")
"""Storages of the length of a tendon."""


def length_errors(solution: "Solution") -> Iterator[tuple[Path, int, float]]:
    """Tendons: path, instant at which the state is farthest from the points' distances, part of the length."""
    problem = solution.problem
    if problem is None:
        return
    for path, length in tendon_lengths(frames_of(problem.descriptor), solution.states):
        apart = np.abs(solution[path].ravel() - length)
        worst = int(np.argmax(apart))
        yield path, worst, float(apart[worst]) / problem.length


def tendon_lengths(frames: Frames, state: Mapping[Path, Array]) -> Iterator[tuple[Path, Array]]:
    """Lengths (…) that springs of tendons store, from the relative poses (…, ·) of their points, which end in places.

    All segments share a junction, a gyrator leads from there to the rate of the whole length, and another one from that
    to what stores it.
    """
    wiring = frames.wiring
    whole: dict[int, Array] = {}
    for number in (number for number, role in enumerate(frames.roles) if role is Role.OTHER):
        slot = wiring.components[number]
        if slot.primitive.kernel is not None and slot.primitive.kernel.name == "point_stretch":
            at = wiring.ports[number]["e"]
            whole[at] = whole.get(at, 0.0) + np.linalg.norm(state[slot.reads[0].path][..., -3:], axis=-1)
    for at, length in whole.items():
        for rate, turn in _coupled(wiring, at):
            for end, back in _coupled(wiring, rate):
                found = wiring.stored(end)
                if found is not None and wiring.components[found[0]].primitive.name in TENSION_SPRINGS:
                    yield found[1].path, length * back / turn


def _coupled(wiring: Incidence, junction: int) -> Iterator[tuple[int, float]]:
    """Other junctions of constant gyrators of two scalar ports on a junction, each with its flow by the effort here."""
    for number, port in wiring.on[junction]:
        primitive, ports = wiring.components[number].primitive, wiring.ports[number]
        if isinstance(primitive, Reversible) and not primitive.reads and primitive.bundle.size == 2 == len(ports):
            skew, rows = primitive.structure({})
            (other,) = (name for name in ports if name != port)
            flow = float(skew[list(ports).index(other), list(ports).index(port)])
            if flow and not rows.size:
                yield ports[other], flow
