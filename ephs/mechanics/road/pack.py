"""From a mechanism's links to the records of the sweeps, and to the constants of its class."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.road.records import JointKind, LinkConstants
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import codes, pair
from ephs.semantics.stage import Table

TURN = JointKind(codes.VECTOR, 1, ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0),))
"""A joint that turns about z."""
SLIDE = JointKind(codes.VECTOR, 1, ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0),))
"""A joint that slides along x, as planar mechanisms have it."""


def _joint_kind(name: str, *, backward: bool) -> JointKind:
    found = pair(name)
    return JointKind(found.code, found.size, tuple(tuple(column) for column in found.basis.T.tolist()), backward)


STANDARD: tuple[JointKind, ...] = (
    TURN,
    SLIDE,
    *(_joint_kind(name, backward=False) for name in ("prismatic", "cylindrical", "planar", "spherical", "free")),
    *(_joint_kind(name, backward=True) for name in ("planar", "spherical", "free")),
)
"""Joints without parameters: one looped program serves all mechanisms of these."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class PackedLink:
    """A link on its way into the records.

    Attributes
    ----------
    joint
        Its tree joint.
    parent
        Number of the parent, −1 for the ground.
    q_at, r_at, sense
        As in `LinkConstants`.
    numbers
        (22,): rows of R and p of the joint in the parent's frame, mass, first moments, inertia about the frame (upper
        triangle).
    armature
        Inertia of its joint's rate itself.
    """

    joint: JointKind
    parent: int
    q_at: int
    r_at: int
    sense: int
    numbers: Array
    armature: float = 0.0


@final
@dataclass(frozen=True, slots=True)
class Class:
    """Mechanisms that one looped program serves.

    Attributes
    ----------
    joints
        The kinds of joints.
    planar
        All moves parallel to the plane of x and y.
    """

    joints: tuple[JointKind, ...]
    planar: bool

    def constants(self, kind: int) -> dict[int, float]:
        """Constants of all links with a kind of joints: offset in `LinkConstants` and the value, 0 or 1."""
        turn, moment, inertia = LinkConstants.rotation.offset, LinkConstants.moment.offset, LinkConstants.inertia.offset
        own = {} if self.joints[kind].armature else {LinkConstants.armature.offset: 0.0}
        if not self.planar:
            return own | {LinkConstants.shift.offset: 0.0}
        out = own | {turn + k: float(k == 8) for k in (2, 5, 6, 7, 8)}
        if self.joints[kind].revolute:
            out |= {turn + k: float(k in (0, 4)) for k in (0, 1, 3, 4)}
        else:
            out[LinkConstants.shift.offset] = 0.0
        return out | {moment + 2: 0.0} | {inertia + k: 0.0 for k in range(5)}


@final
@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """A mechanism's records: its class, constants of its links, gravity (3,) in the ground's frame."""

    kind: Class
    links: Table[LinkConstants]
    gravity: Array

    @property
    def size(self) -> int:
        """Number of links."""
        return int(self.integers.size // LinkConstants.integer_width)

    @property
    def integers(self) -> NDArray[np.int64]:
        """(links · width,) their integers."""
        return self.links.arrays[0]

    @property
    def reals(self) -> Array:
        """(links · width,) their numbers."""
        return self.links.arrays[1]


def packed(parts: Sequence[PackedLink], gravity: Array, *, planar: bool, among: Sequence[JointKind] = ()) -> Packed:
    """The records of a mechanism's tree, whose parts stand after their parents.

    Parameters
    ----------
    gravity
        (3,) in the ground's frame.
    planar
        All joints turn about z or slide along x, and all z axes are parallel.
    among
        Further kinds of joints that the class has.
    """
    count, joints = len(parts), tuple(sorted({part.joint for part in parts} | set(among), key=repr))
    links, kinds = LinkConstants.table(count), {joint: k for k, joint in enumerate(joints)}
    of = LinkConstants
    integers, reals = links.arrays[0].reshape(count, of.integer_width), links.arrays[1].reshape(count, of.real_width)
    for field, each in (
        (of.parent, [part.parent if part.parent >= 0 else count for part in parts]),
        (of.kind, [kinds[part.joint] for part in parts]),
        (of.q_at, [part.q_at for part in parts]),
        (of.r_at, [part.r_at for part in parts]),
    ):
        integers[:, field.offset] = each
    numbers = np.array([part.numbers for part in parts]).reshape(count, 22)
    for field, columns in (
        (of.rotation, np.hstack([_clean(numbers[:, k : k + 3]) for k in (0, 3, 6)])),
        (of.place, _clean(numbers[:, 9:12])),
        (of.mass, numbers[:, 12:13]),
        (of.moment, _clean(numbers[:, 13:16])),
        (of.inertia, _clean(numbers[:, 16:22])),
        (of.sense, np.array([[float(part.sense)] for part in parts]).reshape(count, 1)),
        (of.armature, np.array([[part.armature] for part in parts]).reshape(count, 1)),
    ):
        reals[:, field.offset : field.offset + columns.shape[1]] = columns
    for i, part in enumerate(parts if planar else ()):
        link, c = links[i], part.numbers.tolist()
        angle, turning = math.atan2(c[3], c[0]), part.joint.revolute
        link.shift = angle if turning else 0.0
        link.rotation = _about_z(0.0 if turning else angle)
        link.moment, link.inertia = [c[13], c[14], 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, c[21]]
    return Packed(Class(joints, planar), links, np.array(gravity, dtype=float))


def _clean(rows: Array) -> Array:
    """Rows of numbers with those that are rounding beside the others, or beside 1, as zeros and ones."""
    near = 4.0 * float(np.finfo(float).eps) * np.abs(rows).max(axis=1, initial=0.0, keepdims=True)
    unit = np.where(np.abs(np.abs(rows) - 1.0) <= near, np.copysign(1.0, rows), rows)
    return np.where(np.abs(rows) <= near, 0.0, unit)


def _about_z(angle: float) -> list[list[float]]:
    c, s = math.cos(angle), math.sin(angle)
    return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
