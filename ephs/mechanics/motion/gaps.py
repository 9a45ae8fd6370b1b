"""Position residuals over a motion: joint frames by coordinates against those by bodies."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, TypeAlias

import numpy as np

from ephs.mechanics.motion.batch import gap, product
from ephs.semantics.bundles.bundle import Array

CHUNK: Final = 512
"""Instants that are treated together; bounds the memory."""
MANY: Final = 40
"""Joints beyond which fewer instants are."""
Opening: TypeAlias = tuple[Array, Array, Array, Array, Array]
"""Poses (n, 7) of body 1, frame (7,) of the joint in it, poses (n, 7) of C2 in C1, then poses of body 2, and frame."""


def largest_opening(joints: Callable[[slice], Sequence[Opening]], instants: int, count: int) -> Array:
    """(n,) largest angle in rad or distance in m of about so many joints, which are asked for chunk by chunk."""
    each = [_openings(found).max(axis=(0, 1)) for at in chunks_of(instants, count) if (found := joints(at))]
    return np.concatenate(each) if each else np.zeros(instants)


def relative_openings(joints: Sequence[Opening], length: float) -> Array:
    """(joints, n) angles in rad or parts of a length."""
    if not joints:
        return np.zeros((0, 0))
    angles, distances = _openings(joints)
    return np.maximum(angles, distances / length)


def _openings(joints: Sequence[Opening]) -> Array:
    """(2, joints, n) angles in rad and distances in m."""
    poses1, frames1, inside, poses2, frames2 = zip(*joints, strict=True)
    body1, moved, body2 = (np.stack([pose.T for pose in of], axis=1) for of in (poses1, inside, poses2))
    frame1, frame2 = (np.array(frames).T[:, :, None] for frames in (frames1, frames2))
    return np.array(gap(product(body1, product(frame1, moved)), product(body2, frame2)))


def chunks_of(instants: int, joints: int) -> Iterator[slice]:
    """Instants that are treated together, which bounds the memory."""
    size = max(1, CHUNK * MANY // max(MANY, joints))
    for start in range(0, instants, size):
        yield slice(start, min(instants, start + size))
