"""Links of a reduced scene: frames at their joints, bodies that are fixed to each other as one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.constraints.subgroup import Subgroup, generated
from ephs.mechanics.road.pack import SLIDE, TURN, Packed, PackedLink, packed
from ephs.mechanics.road.records import JointKind
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced

FLAT = 1e-9
"""Pitch in m, and cosine of axis and translations, of motions in a plane: rounding of axes over `ASSEMBLY`."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The links of a reduced scene, parents first.

    Attributes
    ----------
    parts
        What the sweeps' records are made of.
    link, inside
        Link that each body belongs to, and the body's pose in its frame, found outwards along the tree.
    ground
        Pose of the world in the ground's frame, whose z axis is the normal of a planar mechanism.
    planar
        Whether everything moves in that plane.
    """

    parts: Sequence[PackedLink]
    link: list[int]
    inside: list[Array]
    ground: Array
    planar: bool

    def packed(self, gravity: Array, among: Sequence[JointKind] = ()) -> Packed:
        """The sweeps' records under gravity (3,) in world axes; ``among``: further kinds of joints of their class."""
        pull = quaternion_to_matrix(self.ground[:4]) @ np.asarray(gravity, dtype=float)
        return packed(self.parts, pull, planar=self.planar, among=among)


def links_of(reduced: "Reduced", *, apart: bool = False) -> Found:
    """The links of a reduced scene.

    With ``apart`` each body is a link, also of planar mechanisms and where bodies are fixed to each other: what joints
    transmit is then known of all of them, in all six directions.
    """
    t = reduced.tables
    normal = None if apart else _plane(reduced)
    ground = SE3.identity() if normal is None else np.concatenate([matrix_to_quaternion(_onto(normal)), np.zeros(3)])
    links, places, parts = list[int](), list[Array](), list[PackedLink]()
    for i in range(reduced.links):
        parent = int(t.parent[i])
        above, inside = (links[parent], places[parent]) if parent >= 0 else (-1, ground)
        forward = bool(t.forward[i])
        near, far = (t.offset1[i], t.offset2[i]) if forward else (t.offset2[i], t.offset1[i])
        edge = reduced.edges[i]
        if edge.pair.dim == 0 and not apart:
            links.append(above)
            places.append(SE3.compose(SE3.compose(inside, near), SE3.inverse(far)))
            if above >= 0:
                parts[above].numbers[:] += _inertia(t.inertia[i], places[i])
            continue
        turn = SE3.identity()
        joint = SE3.compose(inside, near)
        if normal is not None:
            turn = np.concatenate([matrix_to_quaternion(_flat(joint, edge.pair.name)), np.zeros(3)])
        joint = SE3.compose(joint, turn)
        links.append(len(parts))
        places.append(SE3.compose(SE3.inverse(turn), SE3.inverse(far)))
        sign, driven = 1 if forward else -1, edge.pair.dim > 0 and bool(t.driven[t.r_at[i]])
        if normal is not None:
            kind = replace(TURN if edge.pair.name == "revolute" else SLIDE, driven=driven)
            sign *= -1 if kind.revolute and quaternion_to_matrix(turn[:4])[2, 2] < 0.0 else 1
        else:
            columns = tuple(tuple(column) for column in edge.pair.basis.T.tolist())
            inverted = not forward and edge.pair.code != VECTOR
            kind, sign = JointKind(edge.pair.code, edge.pair.size, columns, inverted, driven), 1 if inverted else sign
        matrix = quaternion_to_matrix(joint[:4])
        numbers = np.concatenate([matrix.ravel(), joint[4:], np.zeros(10)])
        numbers += _inertia(t.inertia[i], places[-1])
        own = float(t.armature[t.r_at[i]]) if edge.pair.dim else 0.0
        kind = replace(kind, armature=own > 0.0 and not driven)
        parts.append(PackedLink(kind, above, int(t.q_at[i]), int(t.r_at[i]), sign, numbers, own))
    return Found(parts, links, places, ground, normal is not None)


def plane_of(twists: Array) -> Array | None:
    """The normal (3,) of the plane parallel to which world twists (n, 6) move, None where there is no such plane.

    Its largest component is positive.
    """
    group = generated(twists)
    if not _planar(group):
        return None
    normal = group.turning[:, 0]
    return normal * np.sign(normal[int(np.argmax(np.abs(normal)))])


def _planar(group: Subgroup) -> bool:
    if group.turning.shape[1] != 1 or group.dim > 3 or abs(group.pitch()) > FLAT:
        return False
    return not np.any(np.abs(group.turning[:, 0] @ group.translations) > FLAT)


def _inertia(own: Array, inside: Array) -> Array:
    """(22,): the inertia of a body at a pose in its link; zeros where the pose stands."""
    turn, at, m = quaternion_to_matrix(inside[:4]), inside[4:], float(own[3, 3])
    about = turn @ own[:3, :3] @ turn.T + m * (float(at @ at) * np.eye(3) - np.outer(at, at))
    out = np.zeros(22)
    out[12], out[13:16] = m, m * at
    out[16:19], out[19:21], out[21] = about[0], about[1, 1:], about[2, 2]
    return out


def _plane(reduced: "Reduced") -> Array | None:
    """The normal of the plane in which everything moves, for mechanisms of pins and slides only."""
    kinds = {edge.pair.name for edge in reduced.edges[: reduced.links] if edge.pair.dim}
    if not kinds or not kinds <= {"revolute", "prismatic"}:
        return None
    return plane_of(np.concatenate([twists.T for twists in reduced.twists]))


def _onto(normal: Array) -> Array:
    """The rotation that takes world axes to those of a plane, its normal to z."""
    least = np.eye(3)[int(np.argmin(np.abs(normal).round(6)))]  # the same one for all that differ by rounding
    x = np.cross(normal, least)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(normal, x), normal], dtype=float)


def _flat(joint: Array, kind: str) -> Array:
    """The frame, its axes as columns in those of a joint, that has the plane's normal as z and what slides as x."""
    matrix = quaternion_to_matrix(joint[:4])
    if kind == "revolute":
        return np.eye(3) if matrix[2, 2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    slide, normal = np.array([0.0, 0.0, 1.0]), matrix[2]
    return np.column_stack([slide, np.cross(normal, slide), normal])
