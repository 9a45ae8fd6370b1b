"""Steps that pass through a thin surface, or through the middle of an overlap, without an instant inside.

The way of the second surface through the axes of the first is straight within a step that is long for them. Gaps of
convex shapes are convex along it, so that a search by thirds finds the least: contact, where both ends are outside; and
where they are not, an overlap beyond the depth at which a contact has no direction and a run ends.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.motion.batch import compose, inverse
from ephs.mechanics.motion.batch import gap as change
from ephs.mechanics.motion.moving import Moving
from ephs.mechanics.scene.contacts import contact_points
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.shapes.gap import PENETRATED, Gap
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.audit import LEAP
from ephs.solve.control import SLIVER

THIRDS = 48
"""Iterations of the search, each reducing the interval by two thirds: (2/3)⁴⁸ is 4e-9."""


@final
@dataclass(frozen=True, slots=True)
class Leap:
    """A contact that a step passed.

    Parameters
    ----------
    name, instant
        The contact, and the index of the instant after it.
    size
        The step's way in thicknesses; through the middle of an overlap in parts of the layer beyond the depth, times
        `LEAP`.
    """

    name: str
    instant: int
    size: float


def leaps(scene: Scene, read: Moving, t: Array, h: float) -> Iterator[Leap]:
    """The longest leap over each contact between instants t (n,) in s of a run whose steps are at most h s long.

    Where fewer instants are kept than steps, the way between two is divided among its steps.
    """
    share = np.minimum(1.0, h / np.maximum(np.abs(np.diff(t)), float(np.finfo(float).tiny)))
    for name, contact in scene.all_contacts():
        bodies, touches = contact_points(scene, contact)
        longest, thin = Leap(name, 0, 0.0), [touch for touch in touches if touch[2].thickness < np.inf]
        if not thin or len(t) < 2:
            continue
        one, other = (read.poses(body) for body in bodies)
        relative = compose(inverse(one), other)
        turned, moved = change(relative[:-1].T, relative[1:].T)
        arm = max(float(np.linalg.norm(frame[4:])) for _, frame, _ in thin)
        if np.all(share * (moved + arm * turned) <= min(min(LEAP * gap.thickness, _middle(gap)) for _, _, gap in thin)):
            continue
        for frame1, frame2, gap in thin:
            pose = compose(compose(inverse(frame1[None]), relative), frame2[None])
            ways = np.linalg.norm(np.diff(pose[:, 4:], axis=0), axis=1)
            outside = np.asarray(gap.distance(pose.T))
            near = np.minimum(outside[:-1], outside[1:])
            whole = share > 1.0 - SLIVER  # of a way that several steps went the middle is not known
            for possible, limit, long in (
                ((near >= 0.0) & (near <= ways), 0.0, share * ways / gap.thickness),
                (whole & (near >= -gap.support.depth) & (near < 0.0), -gap.support.depth, LEAP * ways / _middle(gap)),
            ):
                at = np.flatnonzero(possible & (long > LEAP))
                passed = at[_least(gap.distance, pose[at], pose[at + 1]) < limit]
                if passed.size:
                    worst = int(passed[np.argmax(long[passed])])
                    longest = max(longest, Leap(name, worst + 1, float(long[worst])), key=lambda leap: leap.size)
        if longest.size:
            yield longest


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
