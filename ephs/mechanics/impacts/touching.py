"""Points of hard contact and hard stops in joint coordinates: gaps, and velocities at closed ones as rows on the tree's
rates. Stops come after the points; of their three rows two are zero."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.elements.contact import lever
from ephs.mechanics.shapes.gap import Gap
from ephs.mechanics.shapes.impact import Halt, Impact, Meeting
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.finding.frames import GROUND
from ephs.mechanics.tree.finding.tables import CUT
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible
from ephs.semantics.spaces import SE3, se3
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.solve.equations.sparse import Index

POSES: Final[Any] = se3
"""Formulas of poses, for arrays of many."""
BENT = 1e-5
"""Largest change, in rad or m, over which rows are differentiated: its square and rounding over it are 1e-10."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class _ImpactPoint:
    """Bodies of both frames, their offsets, the gap, and the process for the heat."""

    bodies: tuple[int, int]
    offsets: tuple[Array, Array]
    gap: Gap
    law: Impact
    path: Path


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Stop:
    """The same of a stop: the coordinate's place, and the wrench of a unit force on body 2 away from it, in C2."""

    bodies: tuple[int, int]
    offsets: tuple[Array, Array]
    place: int
    side: float
    bound: float
    wrench: Array
    law: Impact
    path: Path


@final
class Touching:
    """The points of hard contact and the hard stops of one mechanism. It shares the equations' scratch memory.

    Attributes
    ----------
    laws, paths
        (points + stops,).
    makers
        (points + stops,) places of their processes among those that make entropy.
    """

    def __init__(self, equations: ReducedEquations) -> None:
        self._eq = equations
        reduced, t = equations.reduced, equations.reduced.tables
        components = equations.model.descriptor.components
        self._points: list[_ImpactPoint] = []
        self._stops: list[_Stop] = []
        self._cut = False
        self._seen: tuple[Array, Array, tuple[Array, Array]] | None = None
        for i, edge in enumerate(reduced.edges):
            if edge.friction < 0:
                continue
            slot = components[edge.friction]
            law = slot.primitive.impulse if isinstance(slot.primitive, Irreversible) else None
            ends, offsets = (int(t.first[i]), int(t.second[i])), (edge.offset1, edge.offset2)
            if isinstance(law, Meeting):
                self._points.append(_ImpactPoint(ends, offsets, law.gap, law.law, slot.path))
            elif isinstance(law, Halt):
                self._cut = self._cut or t.kind[i] == CUT
                place, along = int(t.q_at[i]), t.left[i, 0]
                for side, bound in law.stops:
                    self._stops.append(_Stop(ends, offsets, place, side, bound, side * along, law.law, slot.path))
        self._spots = [*self._points, *self._stops]
        self.laws: list[Impact] = [spot.law for spot in self._spots]
        self.paths = [spot.path for spot in self._spots]
        self._places = np.array([stop.place for stop in self._stops], dtype=np.int64)
        self._sides, self._bounds = np.array([[stop.side, stop.bound] for stop in self._stops]).reshape(-1, 2).T
        self._along = np.array([stop.wrench for stop in self._stops]).reshape(-1, 6)
        self.makers = np.array([reduced.made.index(path) for path in self.paths], dtype=np.int64)
        groups: dict[Any, list[int]] = {}
        for i, point in enumerate(self._points):
            groups.setdefault((point.gap.name, point.gap.numbers), []).append(i)
        self._groups = [(self._points[group[0]].gap, group) for group in groups.values()]
        self._ends = [
            (
                np.array([spot.bodies[side] for spot in self._spots], dtype=np.int64),
                np.array([spot.offsets[side] for spot in self._spots]).reshape(-1, 7).T,
            )
            for side in (0, 1)
        ]

    def __len__(self) -> int:
        return len(self._spots)

    def gaps(self, q: Array, r: Array) -> Array:
        """(points + stops,) in m, or in rad."""
        relative = self._relative(q, r)
        out = np.zeros(len(self))
        for gap, group in self._groups:
            out[group] = gap.distance(relative[:, group])
        out[len(self._points) :] = self._left(q, r)
        return out

    def motion(self, q: Array, r: Array) -> tuple[Array, Array]:
        """(points + stops,) gaps in m and their rates in m/s, or in rad and rad/s; of the same state at once."""
        if self._seen is None or self._seen[0] is not q or self._seen[1] is not r:
            self._seen = q, r, self._motion(q, r)
        return self._seen[2]

    def _motion(self, q: Array, r: Array) -> tuple[Array, Array]:
        relative, residual = self._relative(q, r), self._eq.dense.residual
        twists = np.array([residual.twist(i) for i in range(self._eq.reduced.links)] + [np.zeros(6)]).T
        (first, near), (second, far) = self._ends
        ahead = POSES.compose(np, list(near), list(relative))
        one = POSES.adjoint(POSES.inverse(ahead), list(twists[:, first]))
        two = POSES.adjoint(POSES.inverse(list(far)), list(twists[:, second]))
        twist = np.array(two) - np.array(one)
        gaps, rates = np.zeros((2, len(self)))
        first_stop = len(self._points)
        gaps[first_stop:] = self._left(q, r)
        rates[first_stop:] = np.einsum("ij,ji->i", self._along, twist[:, first_stop:])
        for gap, group in self._groups:
            pose, moving = relative[:, group], twist[:, group]
            gaps[group] = gap.distance(pose)
            wrench = lever(*gap.contact(pose))
            rates[group] = sum(w * u for w, u in zip(wrench, moving, strict=True))
        return gaps, rates

    def speed(self, q: Array, r: Array, accelerations: Array) -> float:
        """The mechanism's own speed in m/s: that of a gap, or of a fall through its length by weight or by the
        accelerations (n,) of the tree's rates; one length a second where all vanish."""
        length = self._eq.problem.length
        _, pulls = self.motion(q, accelerations)
        pull = max(float(np.linalg.norm(self._eq.reduced.gravity)), float(np.abs(pulls).max(initial=0.0)))
        return max(float(np.sqrt(pull * length)), float(np.abs(self.motion(q, r)[1]).max(initial=0.0))) or length

    def rows(self, q: Array, r: Array, which: Index, axes: Index | None = None) -> tuple[Array, Index]:
        """(3k, n) of some points and stops: the velocity with which they part, and two along the surfaces.

        These are orthogonal to an axis (k,) of the world, which is chosen where none is given.
        """
        eq, residual = self._eq, self._eq.dense.residual
        relative = self._relative(q, r)
        out, chosen = np.zeros((3 * which.size, eq.n)), np.zeros(which.size, dtype=np.int64)
        for k, i in enumerate(which.tolist()):
            point, pose = self._spots[i], relative[:, i]
            wrenches = np.zeros((3, 6))
            if isinstance(point, _Stop):
                wrenches[0] = point.wrench
            else:
                normal, at = point.gap.on_second(pose)
                second = SE3.identity() if point.bodies[1] == GROUND else residual.pose(point.bodies[1])
                turn = quaternion_to_matrix(SE3.compose(second, point.offsets[1])[:4])
                chosen[k] = np.argmin(np.abs(turn @ normal)) if axes is None else axes[k]
                ways = _ways(np.array(normal), turn[chosen[k]])
                wrenches = np.hstack([np.cross(np.array(at), ways), ways])
            for sign, body, offset in (
                (1.0, point.bodies[1], point.offsets[1]),
                (-1.0, point.bodies[0], SE3.compose(point.offsets[0], pose)),
            ):
                if body != GROUND:
                    seen = SE3.adjoint(SE3.inverse(offset))
                    out[3 * k : 3 * k + 3] += sign * wrenches @ seen @ residual.twists(body)
        return out, chosen

    def bending(self, q: Array, r: Array, which: Index, axes: Index) -> Array:
        """(3k,) accelerations along the rows that are due to their change, J̇ r; zero of stops of the tree's joints."""
        if not self._cut and which.size and which.min() >= len(self._points):
            return np.zeros(3 * which.size)
        part = BENT / max(float(np.abs(r).max(initial=0.0)), TINY)
        ahead, back = (self.rows(self._eq.moved(q, by * r), r, which, axes)[0] for by in (part, -part))
        return (ahead - back) @ r / (2.0 * part)

    def ways(self, i: int, axis: int) -> Array:
        """(3, 3) world directions of the rows of a point, where the links were placed last; zeros of a stop."""
        point, residual = self._spots[i], self._eq.dense.residual
        if isinstance(point, _Stop):
            return np.zeros((3, 3))
        one, two = (
            SE3.compose(SE3.identity() if body == GROUND else residual.pose(body), offset)
            for body, offset in zip(point.bodies, point.offsets, strict=True)
        )
        normal, _ = point.gap.contact(SE3.compose(SE3.inverse(one), two))
        turn = quaternion_to_matrix(two[:4])
        ways = _ways(np.array(normal), turn[axis])
        return ways @ turn.T

    def acting(self, i: int, axis: int, force: Array) -> tuple[tuple[int, Array, Array], ...]:
        """Bodies that a force (3,) along the rows of a point acts on, each with the force and its moment about the
        world's origin in world axes, where the links were placed last; none of a stop."""
        spot = self._spots[i]
        if isinstance(spot, _Stop):
            return ()
        one, two = (
            SE3.compose(SE3.identity() if body == GROUND else self._eq.dense.residual.pose(body), offset)
            for body, offset in zip(spot.bodies, spot.offsets, strict=True)
        )
        _, at = spot.gap.on_second(SE3.compose(SE3.inverse(one), two))
        place = two[4:] + quaternion_to_matrix(two[:4]) @ np.array(at)
        pressed = force @ self.ways(i, axis)
        moment = np.cross(place, pressed)
        ends = ((spot.bodies[0], -1.0), (spot.bodies[1], 1.0))
        return tuple((body, sign * pressed, sign * moment) for body, sign in ends if body != GROUND)

    def pulling(self, i: int) -> tuple[Path, float] | None:
        """Process of a stop's joint, and the side to which it presses the coordinate; None of a point."""
        spot = self._spots[i]
        return (spot.path, spot.side) if isinstance(spot, _Stop) else None

    def _left(self, q: Array, r: Array) -> Array:
        """(stops,) gaps, where the links were placed; cut joints are where their bodies put them."""
        coordinates = self._eq.fitted(q, r) if self._cut else q
        return self._sides * (coordinates[self._places] - self._bounds)

    def _relative(self, q: Array, r: Array) -> Array:
        """(7, points + stops) poses of second frames in first ones; the links are placed at q and r."""
        residual = self._eq.dense.residual
        residual.place(q, r)
        poses = np.array([residual.pose(i) for i in range(self._eq.reduced.links)] + [SE3.identity()]).T
        one, two = (POSES.compose(np, list(poses[:, bodies]), list(offsets)) for bodies, offsets in self._ends)
        return np.array(POSES.between(np, one, two))


def _ways(normal: Array, axis: Array) -> Array:
    """(3, 3) a unit normal and two directions across, the first of which is orthogonal to an axis."""
    one = np.cross(normal, axis)
    one /= np.linalg.norm(one)
    return np.array([normal, one, np.cross(normal, one)])
