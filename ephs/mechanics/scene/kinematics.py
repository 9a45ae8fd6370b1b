"""Joints between bodies in a configuration: gaps, joint elements, joint rates.

A configuration is the bodies' poses ``(n, 7)`` and body-frame twists ``(n, 6)``; index -1 is the ground.
The joint relation is ``q1 o1 I(x) = q2 o2``, and of twists ``Ad(o2⁻¹) u2 = Ad(I⁻¹) Ad(o1⁻¹) u1 + B u_r``.

Source: Lohmayer, Capobianco, Leyendecker, "Exergetic Port-Hamiltonian Systems for Multibody Dynamics".
"""

from collections import deque
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.scene.bodies import IDENTITY_POSE
from ephs.mechanics.scene.geometry import JointCoupling, coupling_of
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces import rotations as so3

if TYPE_CHECKING:
    from ephs.mechanics.scene.joints import Joint


@final
@dataclass(frozen=True, slots=True)
class Scale:
    """The mechanism's own length in m and rate in 1/s: gaps and velocities are measured in them."""

    length: float
    rate: float

    @property
    def weights(self) -> Array:
        """(6, 6) diagonal: takes the lengths of twists as parts of the scale's."""
        return np.diag([1.0] * 3 + [1.0 / self.length] * 3)

    @staticmethod
    def of(links: "Sequence[AssemblyJoint]", poses: Array, twists: Array, gyration: float, gravity: Array) -> "Scale":
        """Of a configuration; ``gyration`` is the bodies' largest radius of gyration in m, gravity (3,) in m/s².

        The length is the radius about the mechanism's centre within which its joints and bodies lie, at least the
        radius of gyration; the rate is the fastest at which a body turns or crosses this length, a joint is driven,
        or a pendulum of this length swings.
        """
        length = max(extent(links, poses)[1], gyration) or 1.0
        turns = [float(np.linalg.norm(u[:3])) for u in twists] + [float(np.linalg.norm(u[3:])) / length for u in twists]
        driven = [
            abs(link.motion) / (1.0 if np.any(link.coupling.basis(link.coupling.identity())[:3]) else length)
            for link in links
            if link.motion is not None
        ]
        swing = float(np.sqrt(np.linalg.norm(gravity) / length))
        return Scale(length, max([swing, *turns, *driven], default=0.0) or 1.0)


ABSOLUTE = Scale(1.0, 1.0)
"""Gaps in m and rad, velocities in m/s and rad/s."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class AssemblyJoint:
    """A joint of the assembly: two bodies by index, the joint frame in each, and the permitted twists.

    ``coordinates`` (d,) and ``rate`` (d,) are those that the initial state must have, or None; ``motion`` a
    prescribed rate. ``near`` (size,) is the element of the state before, so that whole turns are kept.
    """

    name: str
    body1: int
    body2: int
    frame1: Array
    frame2: Array
    coupling: JointCoupling
    coordinates: Array | None = None
    rate: Array | None = None
    motion: float | None = None
    near: Array | None = None

    @staticmethod
    def of(joint: "Joint", index: Mapping[str, int], **more: Any) -> "AssemblyJoint":
        """A scene's joint between bodies of these numbers, its start not given; ``more`` are other attributes."""
        found = AssemblyJoint(
            joint.name, index[joint.body1], index[joint.body2], joint.frame1, joint.frame2, coupling_of(joint),
            motion=None if joint.motion is None else joint.motion.rate(0.0),
        )  # fmt: skip
        return replace(found, **more)

    def first(self, poses: Array) -> Array:
        """The pose of C1 in the world."""
        return SE3.compose(pose_at(poses, self.body1), self.frame1)

    def second(self, poses: Array) -> Array:
        """The pose of C2 in the world."""
        return SE3.compose(pose_at(poses, self.body2), self.frame2)

    def relative(self, poses: Array) -> Array:
        """The pose of C2 in C1."""
        return SE3.compose(SE3.inverse(self.first(poses)), self.second(poses))

    def element(self, poses: Array) -> Array:
        """The joint's element: of the coordinates where they are given, else the nearest to the bodies'
        poses."""
        if self.coordinates is not None:
            return self.coupling.element(self.coordinates)
        return self.coupling.fit(self.relative(poses), self.near)

    def error(self, poses: Array, x: Array) -> Array:
        """The logarithm (6,) of C2 relative to its frame by the joint's element."""
        return SE3.log(SE3.compose(SE3.inverse(self.coupling.include(x)), self.relative(poses)))

    def gap(self, poses: Array, x: Array) -> tuple[float, float]:
        """The gap of the joint: distance in m, angle in rad."""
        gap = SE3.compose(SE3.inverse(self.coupling.include(x)), self.relative(poses))
        return float(np.linalg.norm(gap[4:])), so3.turn_of(gap[:4])

    def rows(self, x: Array) -> tuple[Array, Array]:
        """The matrices (6, 6) from the twists of body 1 and body 2 to the relative twist of C2 in C1, in
        the axes of C2."""
        to1 = SE3.compose(self.frame1, self.coupling.include(x))
        return -SE3.adjoint(SE3.inverse(to1)), SE3.adjoint(SE3.inverse(self.frame2))

    def slip(self, twists: Array, x: Array) -> tuple[Array, Array]:
        """The joint's rate (d,) by least squares, and the part (6,) of the relative twist that the joint
        does not allow."""
        rows1, rows2 = self.rows(x)
        relative = rows1 @ twist(twists, self.body1) + rows2 @ twist(twists, self.body2)
        basis = self.coupling.basis(x)
        rate = self.coupling.left_inverse(basis) @ relative
        return rate, relative - basis @ rate

    def other(self, body: int) -> int:
        """The body at its other end."""
        return self.body1 if self.body2 == body else self.body2

    def placed(self, body: int, poses: Array, x: Array) -> Array:
        """Pose of one of its bodies from that of the other and the joint's element."""
        between = self.coupling.include(x)
        if self.body2 == body:
            there = SE3.compose(SE3.compose(self.first(poses), between), SE3.inverse(self.frame2))
        else:
            there = SE3.compose(SE3.compose(self.second(poses), SE3.inverse(between)), SE3.inverse(self.frame1))
        return SE3.normalise(there)

    def moved(self, body: int, twists: Array, x: Array, rate: Array) -> Array:
        """Twist of one of its bodies from that of the other and the joint's rate."""
        rows1, rows2 = self.rows(x)
        own = self.coupling.basis(x) @ rate
        if self.body2 == body:
            return SE3.adjoint(self.frame2) @ (own - rows1 @ twist(twists, self.body1))
        to1 = SE3.compose(self.frame1, self.coupling.include(x))
        return SE3.adjoint(to1) @ (rows2 @ twist(twists, self.body2) - own)


def pose_at(poses: Array, body: int) -> Array:
    """A body's pose; the ground's is the identity."""
    return IDENTITY_POSE if body < 0 else poses[body]


def twist(twists: Array, body: int) -> Array:
    """A body's twist; the ground's is 0."""
    return np.zeros(6) if body < 0 else twists[body]


def elements(links: Sequence[AssemblyJoint], poses: Array) -> list[Array]:
    """Every joint's element in a configuration."""
    return [link.element(poses) for link in links]


def extent(links: Sequence[AssemblyJoint], poses: Array) -> tuple[Array, float]:
    """The centre (3,) of the joints and bodies in m, and the radius of their enclosing sphere about it."""
    points = np.array([*(link.second(poses)[4:] for link in links), *poses[:, 4:]]).reshape(-1, 3)
    centre = points.mean(axis=0) if len(points) else np.zeros(3)
    return centre, float(np.linalg.norm(points - centre, axis=1).max(initial=0.0))


def largest_gap(links: Sequence[AssemblyJoint], poses: Array, xs: Sequence[Array], scale: Scale = ABSOLUTE) -> float:
    """The largest gap of any joint: a part of the length, or rad."""
    gaps = (link.gap(poses, x) for link, x in zip(links, xs, strict=True))
    return max((max(distance / scale.length, angle) for distance, angle in gaps), default=0.0)


def largest_slip(links: Sequence[AssemblyJoint], twists: Array, xs: Sequence[Array], scale: Scale = ABSOLUTE) -> float:
    """The largest velocity residual of any joint, a part of the rate; wanted rates count."""
    found = 0.0
    for link, x in zip(links, xs, strict=True):
        rate, residual = link.slip(twists, x)
        wanted = link.rate if link.motion is None else np.array([link.motion])
        for off in (residual, np.zeros(6) if wanted is None else link.coupling.basis(x) @ (rate - wanted)):
            spin, speed = float(np.linalg.norm(off[:3])), float(np.linalg.norm(off[3:]))
            found = max(found, spin / scale.rate, speed / (scale.length * scale.rate))
    return found


@final
@dataclass(frozen=True, slots=True)
class Hop:
    """One step outwards: through link number ``link`` (of this name) to ``body``."""

    link: int
    name: str
    body: int


def spanning_hops(links: Sequence[AssemblyJoint], count: int, preferred: Container[str]) -> list[Hop]:
    """The steps of a spanning forest, from the ground outwards: each of ``count`` bodies once, from one reached before.

    Named links come into the tree before others, then those in front. A group of bodies without a way to
    the ground is reached from its first body, which no step leads to.
    """
    sets = DisjointSets[int]()
    neighbours: dict[int, list[int]] = {body: [] for body in range(-1, count)}
    for number in sorted(range(len(links)), key=lambda i: links[i].name not in preferred):
        if sets.join(links[number].body1, links[number].body2):
            neighbours[links[number].body1].append(number)
            neighbours[links[number].body2].append(number)

    hops: list[Hop] = []
    reached: set[int] = set()
    for root in range(-1, count):
        if root in reached:
            continue
        reached.add(root)
        queue = deque([root])
        while queue:
            here = queue.popleft()
            for number in neighbours[here]:
                link = links[number]
                there = link.other(here)
                if there not in reached:
                    reached.add(there)
                    queue.append(there)
                    hops.append(Hop(number, link.name, there))
    return hops
