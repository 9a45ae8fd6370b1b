"""Steps that pass through a thin surface, or through the middle of an overlap, without an instant inside.

The way of the second surface through the axes of the first is straight within a step that is long for them. Gaps of
convex shapes are convex along it, so that a search by thirds finds the least: contact, where both ends are outside; and
where they are not, an overlap beyond the depth at which a contact has no direction and a run ends.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.shapes.gap import PENETRATED, Gap
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor, StateSlot
from ephs.semantics.systems.kept import once
from ephs.solve.auditing.audit import LEAP
from ephs.solve.equations.sparse import Index
from ephs.solve.result.states import RecordedStates
from ephs.solve.running.control import SLIVER

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

THIRDS = 48
"""Iterations of the search, each reducing the interval by two thirds: (2/3)⁴⁸ is 4e-9."""


@final
@dataclass(frozen=True, slots=True)
class ThinContact:
    """A contact with its points at which a surface may be passed.

    Parameters
    ----------
    path
        Of the box that its points lie in.
    states, gaps
        Relative pose of each point, and its gap.
    places
        (points, 3) where the states have the places of points.
    short
        (points,) ways in m within a step that pass nothing.
    """

    path: Path
    states: tuple[StateSlot, ...]
    gaps: tuple[Gap, ...]
    places: Index
    short: Array

    @staticmethod
    def of(path: Path, points: Sequence[tuple[StateSlot, Gap]]) -> "ThinContact":
        """Of the states and gaps of its points."""
        states, gaps = zip(*points, strict=True)
        places = np.array([np.arange(state.point.stop - 3, state.point.stop) for state in states])
        return ThinContact(
            path, states, gaps, places, np.array([min(LEAP * gap.thickness, _middle(gap)) for gap in gaps])
        )

    def ways(self, solution: "Solution") -> Array:
        """(n − 1, points) of the points between instants, in m."""
        if isinstance(solution.states, RecordedStates):
            places = solution.states.x[:, self.places]
        else:
            places = np.stack([_poses(solution, state)[:, 4:] for state in self.states], axis=1)
        return np.linalg.norm(np.diff(places, axis=0), axis=2)


def thin_contacts(descriptor: Descriptor) -> tuple[ThinContact, ...]:
    """The contacts of a flat system that steps may pass: those of surfaces behind which there is room."""

    def read() -> tuple[ThinContact, ...]:
        found: dict[Path, list[tuple[StateSlot, Gap]]] = {}
        for slot, storage in descriptor.storages:
            gap = storage.gap
            if isinstance(gap, Gap) and gap.thickness < np.inf:
                whole = Path(slot.path[: max(1, len(slot.path) - 2)])
                found.setdefault(whole, []).append((slot.reads[0], gap))
        return tuple(ThinContact.of(path, points) for path, points in found.items())

    return once(descriptor, "thin contacts", read)


def leaps(solution: "Solution", h: float) -> Iterator[tuple[Path, int, float]]:
    """Contacts that a step of at most h s passed: path of the box, instant after the longest such step, and its size.

    The size is the step's way in thicknesses; through the middle of an overlap it is in parts of the layer beyond the
    depth, times `LEAP`.

    Where fewer instants are kept than steps, the way between two is divided among its steps.
    """
    t, problem = solution.t, solution.problem
    if len(t) < 2 or problem is None:
        return
    share = np.minimum(1.0, h / np.maximum(np.abs(np.diff(t)), float(np.finfo(float).tiny)))
    whole = share > 1.0 - SLIVER  # of a way that several steps went the middle is not known
    for contact in thin_contacts(problem.descriptor):
        longest = contact.path, 0, 0.0
        every = contact.ways(solution)
        for k in np.flatnonzero(~np.all(share[:, None] * every <= contact.short, axis=0)):
            gap, pose, ways = contact.gaps[k], _poses(solution, contact.states[k]), every[:, k]
            outside = np.asarray(gap.distance(pose.T))
            near = np.minimum(outside[:-1], outside[1:])
            for possible, limit, long in (
                ((near >= 0.0) & (near <= ways), 0.0, share * ways / gap.thickness),
                (whole & (near >= -gap.support.depth) & (near < 0.0), -gap.support.depth, LEAP * ways / _middle(gap)),
            ):
                at = np.flatnonzero(possible & (long > LEAP))
                passed = at[_least(gap.distance, pose[at], pose[at + 1]) < limit]
                if passed.size:
                    worst = int(passed[np.argmax(long[passed])])
                    longest = max(longest, (contact.path, worst + 1, float(long[worst])), key=lambda leap: leap[2])
        if longest[2]:
            yield longest


def _poses(solution: "Solution", slot: StateSlot) -> Array:
    """(n, 7) relative poses that a solution has as elements, or as the coordinates that users read."""
    if isinstance(solution.states, RecordedStates):
        return solution.states.x[:, slot.point]
    return np.array([slot.element(value) for value in solution[slot.path]]).reshape(-1, 7)


def _middle(gap: Gap) -> float:
    """Way in m through what lies beyond the depth, from one side of the middle to the other."""
    return 2.0 * gap.support.depth * (1.0 / PENETRATED - 1.0)


def _least(distance: Callable[[Array], Array], start: Array, end: Array) -> Array:
    """(k,) least gaps on straight ways between poses (k, 7), which keep the turning of the start."""
    low, high = np.zeros(len(start)), np.ones(len(start))

    def gaps(share: Array) -> Array:
        places = start[:, 4:] + share[:, None] * (end - start)[:, 4:]
        return np.asarray(distance(np.column_stack([start[:, :4], places]).T))

    for _ in range(THIRDS if len(start) else 0):
        one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
        left = gaps(one) < gaps(two)
        low, high = np.where(left, low, one), np.where(left, two, high)
    return gaps(0.5 * (low + high)) if len(start) else np.zeros(0)
