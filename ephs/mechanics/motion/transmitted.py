"""Wrenches in the joints of a mechanism at an instant, from its accelerations.

Each link with all that it carries needs a wrench W. A joint of the tree transmits it, less what the cut joints on these
links do; along the joint's degrees of freedom it is the force in the joint:

    s_jᵀ (W_i − Σ_c σ_ic N_c μ_c) = f_j − a_j ṙ_j,

with twists s of the degrees of freedom, their forces f and armatures a, wrenches N that a cut joint can hold, and σ =
±1 where it acts on link i or what that carries as its second or first body. This is solved for all of N, not only for
the rows by which methods close loops: what it leaves free is statically indeterminate.
"""

from collections.abc import Mapping
from typing import final

import numpy as np

from ephs.mechanics.constraints.holding import annihilator
from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.finding.tables import CUT, TREE
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import CONSTRAINT, SPANNED, rank_of
from ephs.semantics.spaces.rotations import quaternion_to_matrix

TURN, PLACE, TWIST, BIAS = slice(0, 9), slice(9, 12), slice(12, 18), slice(18, 24)
"""Columns of a link's place: frame in the world; in world axes about its origin, twist, and acceleration where no rate
changes, gravity in it."""


@final
class Transmission:
    """The joints' wrenches of a mechanism whose links are its bodies.

    Parameters
    ----------
    inside
        (links, 7) poses of the bodies in their links' frames.
    inertia
        (links, 6, 6) in the links' frames.

    Attributes
    ----------
    slip_at
        (edges,) rows of `slips`, −1 of joints of the tree.
    """

    def __init__(self, reduced: Reduced, inside: Array, inertia: Array) -> None:
        t = reduced.tables
        self._reduced, self.inertia = reduced, inertia
        turn = np.array([quaternion_to_matrix(pose[:4]) for pose in inside]).reshape(-1, 3, 3)
        self._ends = []  # of each joint: the link of body 2, and C2 in that link's frame
        for i, edge in enumerate(reduced.edges):
            link, own = int(t.second[i]), quaternion_to_matrix(edge.offset2[:4])
            here = (own, edge.offset2[4:])
            if link >= 0:
                here = turn[link] @ own, turn[link] @ edge.offset2[4:] + inside[link, 4:]
            self._ends.append((link, *here))
        self._cut = [i for i in range(len(reduced.edges)) if t.kind[i] == CUT]
        self._apart = np.flatnonzero(t.kind != TREE)
        self.slip_at = np.where(t.kind == TREE, -1, np.cumsum(t.kind != TREE) - 1)
        ends = [self._ends[i] for i in self._apart]
        self._turns = np.array([turn for _, turn, _ in ends]).reshape(-1, 3, 3)
        self._places = np.array([at for *_, at in ends]).reshape(-1, 3)
        self._held = {i: annihilator(reduced.edges[i].pair.basis) for i in self._cut}
        self._link = np.repeat(np.arange(reduced.links), t.dim[: reduced.links])
        self._signs = np.zeros((reduced.links, len(self._cut)))
        for k, i in enumerate(self._cut):
            for end, sign in ((int(t.first[i]), -1.0), (int(t.second[i]), 1.0)):
                while end >= 0:
                    self._signs[end, k] += sign
                    end = int(t.parent[end])
        self._ratios = np.zeros((reduced.freedoms, len(reduced.attaching.ties)))
        for number, gear in enumerate(reduced.attaching.ties):
            for i, freedom, ratio in gear.terms:
                if t.kind[i] == TREE:
                    self._ratios[int(t.r_at[i]) + freedom, number] += ratio

    def carried(self, places: Array, twists: Array) -> Array:
        """(links, 6) momenta of the links with twists (links, 6), as those of their places."""
        turn = places[:, TURN].reshape(-1, 1, 3, 3)
        inside = np.einsum("lhij,lhi->lhj", turn, twists.reshape(-1, 2, 3)).reshape(-1, 6)
        own = np.einsum("lij,lj->li", self.inertia, inside).reshape(-1, 2, 3)
        return np.einsum("lhij,lhj->lhi", turn, own).reshape(-1, 6)

    def slips(self, places: Array) -> Array:
        """(joints apart from the tree, 6) their rates by the links' places (links, …), with zeros after the last."""
        t, ground = self._reduced.tables, np.zeros((1, places.shape[1]))
        ground[0, TURN] = np.eye(3).ravel()
        whole = np.concatenate([places, ground])  # the last row is the ground's, number −1
        angular = whole[:, TWIST][:, :3]
        outward = np.hstack([angular, whole[:, TWIST][:, 3:] + np.cross(whole[:, PLACE], angular)])
        one, two = t.first[self._apart], t.second[self._apart]
        own, relative = whole[two, TURN].reshape(-1, 3, 3), outward[two] - outward[one]
        turn, at = own @ self._turns, whole[two, PLACE] + np.einsum("eij,ej->ei", own, self._places)
        moving = relative[:, 3:] - np.cross(at, relative[:, :3])
        inside = np.hstack([np.einsum("eji,ej->ei", turn, part) for part in (relative[:, :3], moving)])
        return np.einsum("eij,ej->ei", t.left[self._apart], inside)

    def wrenches(self, places: Array, accelerations: Array, pushed: Array, force: Array, pulled: Array) -> Array:
        """(edges, 6) λ of the joints on their bodies 2 in C2, NaN in components that are indeterminate.

        Parameters
        ----------
        places
            (links, …), as `ephs.mechanics.road.records.LinkPlace`.
        accelerations, force
            (n,) of the tree's degrees of freedom, and forces on them.
        pushed
            (links, 6) wrenches on the links, in world axes about their frames' origins, of all but the constraints.
        pulled
            Forces on the degrees of freedom of all joints.
        """
        reduced, t = self._reduced, self._reduced.tables
        frames = {i: self._second(i, places) for i in range(len(reduced.joints))}
        freedoms = self._freedoms(frames)
        needed = self._needed(places, accelerations, freedoms, pushed)
        if not self._cut:
            return self._on_second(frames, needed[:, :, None])[:, :, 0]
        held = [_wrench_outward(*frames[i], self._held[i]) for i in self._cut]
        columns = np.repeat(np.arange(len(self._cut)), [one.shape[1] for one in held])
        geared = [
            (k, t.left[i, freedom] * ratio, number)
            for number, gear in enumerate(reduced.attaching.ties)
            for i, freedom, ratio in gear.terms
            for k in range(len(self._cut))
            if self._cut[k] == i
        ]  # a gear's multiplier acts on a cut joint as a force along it does
        gears = [_wrench_outward(*frames[self._cut[k]], row[:, None]) for k, row, _ in geared]
        of = np.concatenate([np.arange(columns.size), [columns.size + n for *_, n in geared]]).astype(np.int64)
        whole = np.hstack([*held, *gears])
        acting = self._signs[:, [*columns, *(k for k, *_ in geared)]]
        free = np.flatnonzero(t.driven == 0)
        link = self._link[free]
        right = np.einsum("fi,fi->f", freedoms[free], needed[link]) - force[free]
        right += t.armature[free] * accelerations[free]
        size = np.linalg.norm(freedoms[free], axis=1)
        rows = np.zeros((free.size, columns.size + len(reduced.attaching.ties)))
        np.add.at(rows.T, of, (acting[link] * (freedoms[free] @ whole)).T)
        rows[:, columns.size :] += self._ratios[free]
        found, unknown = _solved(rows / size[:, None], right / size)
        multipliers = np.column_stack([found, unknown])
        carried = -np.einsum("lm,im,mk->lik", acting, whole, multipliers[of])
        carried[:, :, 0] += needed
        out = self._on_second(frames, carried)
        for k, i in enumerate(self._cut):
            out[i] = self._held[i] @ multipliers[: columns.size][columns == k]
            d, at = int(t.dim[i]), int(t.r_at[i])
            out[i, :, 0] += t.left[i, :d].T @ pulled[at : at + d]
        for k, row, number in geared:
            out[self._cut[k]] += np.outer(row, multipliers[columns.size + number])
        return _masked(out)

    def _second(self, i: int, places: Array) -> tuple[Array, Array]:
        """Frame C2 of a joint in the world."""
        link, turn, at = self._ends[i]
        if link < 0:
            return turn, at
        own = places[link, TURN].reshape(3, 3)
        return own @ turn, places[link, PLACE] + own @ at

    def _freedoms(self, frames: Mapping[int, tuple[Array, Array]]) -> Array:
        """(n, 6) world twists of the tree's degrees of freedom."""
        t = self._reduced.tables
        out = np.zeros((self._reduced.freedoms, 6))
        for i in range(self._reduced.links):
            d, at = int(t.dim[i]), int(t.r_at[i])
            turn, place = frames[i]
            angular, linear = turn @ t.basis[i, :3, :d], turn @ t.basis[i, 3:, :d]
            sign = 1.0 if t.forward[i] else -1.0
            out[at : at + d, :3] = sign * angular.T
            out[at : at + d, 3:] = sign * (linear.T + np.cross(place, angular.T))
        return out

    def _needed(self, places: Array, accelerations: Array, freedoms: Array, pushed: Array) -> Array:
        """(links, 6) wrench about the world's origin on each link and its descendants."""
        t = self._reduced.tables
        at = places[:, PLACE]
        grown = np.zeros((self._reduced.links, 6))
        np.add.at(grown, self._link, freedoms * accelerations[:, None])
        for i in range(self._reduced.links):
            if t.parent[i] >= 0:
                grown[i] += grown[int(t.parent[i])]
        changed = places[:, BIAS].copy()
        changed[:, :3] += grown[:, :3]
        changed[:, 3:] += grown[:, 3:] - np.cross(at, grown[:, :3])
        twist = places[:, TWIST]
        momentum = self.carried(places, twist)
        own = self.carried(places, changed) - pushed
        own[:, :3] += np.cross(twist[:, :3], momentum[:, :3]) + np.cross(twist[:, 3:], momentum[:, 3:])
        own[:, 3:] += np.cross(twist[:, :3], momentum[:, 3:])
        own[:, :3] += np.cross(at, own[:, 3:])
        out = own
        for i in range(self._reduced.links - 1, -1, -1):
            if t.parent[i] >= 0:
                out[int(t.parent[i])] += out[i]
        return out

    def _on_second(self, frames: Mapping[int, tuple[Array, Array]], carried: Array) -> Array:
        """(edges, 6, k) in C2 on body 2, of wrenches (links, 6, k) that the tree's joints transmit outwards."""
        t = self._reduced.tables
        out = np.zeros((len(self._reduced.edges), *carried.shape[1:]))
        for i in range(self._reduced.links):
            turn, at = frames[i]
            wrench = carried[i] if t.forward[i] else -carried[i]
            out[i, :3] = turn.T @ (wrench[:3] - np.cross(at, wrench[3:], axisb=0, axisc=0))
            out[i, 3:] = turn.T @ wrench[3:]
        return out


def _wrench_outward(turn: Array, at: Array, wrenches: Array) -> Array:
    """(6, k) wrenches in a frame, about the world's origin."""
    force = turn @ wrenches[3:]
    return np.vstack([turn @ wrenches[:3] + np.cross(at, force, axisb=0, axisc=0), force])


def _solved(rows: Array, right: Array) -> tuple[Array, Array]:
    """Least-norm solution of equations and their null space: (m,) and orthonormal columns (m, k)."""
    left, sigma, columns = svd(rows)
    rank = rank_of(sigma, CONSTRAINT, 1.0)
    return columns[:rank].T @ ((left.T @ right)[:rank] / sigma[:rank]), columns[rank:].T


def _masked(wrenches: Array) -> Array:
    """(edges, 6) the first columns of (edges, 6, 1 + k), NaN in components that the others, orthonormalised, reach."""
    out, others = wrenches[:, :, 0].copy(), wrenches[:, :, 1:].reshape(6 * len(wrenches), -1)
    if others.shape[1]:
        basis, _ = np.linalg.qr(others)
        out[np.abs(basis).max(axis=1).reshape(-1, 6) > SPANNED] = np.nan
    return out
