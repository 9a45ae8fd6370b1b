"""Position residuals over a motion: joint frames by coordinates against those by bodies, and lengths of tendons."""

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np

from ephs.mechanics.motion.batch import compose, gap, product
from ephs.mechanics.scene.model import Joint
from ephs.mechanics.scene.tendons import Tendon
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import translation


class Read(Protocol):
    """Poses (n, 7) of bodies, and of C2 in C1 by the coordinates of a joint."""

    def poses(self, name: str) -> Array:
        """(n, 7) of a body, or of the ground."""
        ...

    def inclusion(self, name: str) -> Array:
        """(n, 7) of a joint."""
        ...


def open_by(joints: Mapping[str, Joint], read: Read, chunks: Iterable[slice]) -> Array:
    """(2, joints, instants) angles in rad and distances in m, all joints at once, chunk after chunk of instants."""
    each = list(joints.values())
    if not each:
        return np.zeros((2, 0, 0))
    poses = [
        [read.poses(joint.body1) for joint in each],
        [read.poses(joint.body2) for joint in each],
        [read.inclusion(name) for name in joints],
    ]
    frame1, frame2 = (np.array(frames).T[:, :, None] for frames in ([j.frame1 for j in each], [j.frame2 for j in each]))
    out: list[Array] = []
    for at in chunks:
        body1, body2, moved = (np.stack([pose[at].T for pose in of], axis=1) for of in poses)
        out.append(np.array(gap(product(body1, product(frame1, moved)), product(body2, frame2))))
    return np.concatenate(out, axis=2) if out else np.zeros((2, len(each), 0))


def span_of(tendon: Tendon, read: Read) -> Array:
    """(n,) sum of the distances between the points of each segment, in m, by the poses of the bodies."""

    def point(end: tuple[str, list[float]]) -> Array:
        poses = read.poses(end[0])
        return compose(poses, np.broadcast_to(translation(end[1]), poses.shape))[:, 4:]

    return np.sum([np.linalg.norm(point(two) - point(one), axis=1) for one, two in tendon.segments], axis=0)
