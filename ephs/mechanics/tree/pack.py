"""From the engine's tables of a mechanism to the records of the sweeps, and to what is known of its class."""

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.engine import tree_kernels as tree
from ephs.mechanics.engine.tables import Engine
from ephs.mechanics.tree.records import Joint, Link
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import codes
from ephs.semantics.stage import Table

__all__ = ["Class", "Packed", "packed"]

TURN = ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0),)
SLIDE = ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0),)
BALL = tuple(tuple(float(i == j) for i in range(6)) for j in range(3))


@final
@dataclass(frozen=True, slots=True)
class Class:
    """Mechanisms that one looped program serves.

    Attributes
    ----------
    joints
        The kinds of joints.
    constants
        Of each kind, what its links have in common: offset in `Link` and the value, 0, 1 or −1.
    gravity
        What gravity's components are known to be, 0, or None.
    planar
        All moves parallel to the plane of x and y.
    """

    joints: tuple[Joint, ...]
    constants: tuple[tuple[tuple[int, float], ...], ...]
    gravity: tuple[float | None, ...]
    planar: bool


@final
@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """A mechanism's records: its class, constants of its links, gravity (3,) in the ground's frame."""

    kind: Class
    links: Table[Link]
    gravity: Array


def packed(engine: Engine) -> Packed:
    """The records of a mechanism's tree."""
    planar, count = bool(engine.flag[0]), len(engine.link)
    joints: dict[Joint, int] = {}
    links = Link.table(count)
    height = np.append(engine.const[:, 9], 0.0) if planar else np.zeros(count + 1)
    for i in range(count):
        row, joint = engine.link[i], _joint(engine, i)
        link, parent = links[i], int(row[tree.PARENT])
        link.parent = parent if parent >= 0 else count
        link.kind = joints.setdefault(joint, len(joints))
        link.q_at, link.r_at = int(row[tree.Q_AT]), int(row[tree.R_AT])
        link.sense = float(row[tree.FORWARD]) if joint.code == codes.VECTOR else 1.0
        c = [float(x) for x in engine.const[i]]
        if planar:
            turning = joint.revolute
            link.shift = c[2] if turning else 0.0
            link.rotation = _about_z(0.0 if turning else c[2])
            link.place = [c[0], c[1], float(height[i] - height[parent])]
            link.mass, link.moment, link.inertia = c[3], [c[4], c[5], 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, c[6]]
        else:
            link.shift, link.rotation, link.place = 0.0, [_clean(c[k : k + 3]) for k in (0, 3, 6)], _clean(c[9:12])
            link.mass, link.moment, link.inertia = c[12], _clean(c[13:16]), _clean(c[16:22])
    width = Link.real_width
    numbers = np.array([links.reals.load(k) for k in range(count * width)], dtype=float).reshape(count, width)
    kinds = np.array([links[i].kind for i in range(count)], dtype=int)
    constants = tuple(tuple(sorted(_constants(numbers[kinds == k]).items())) for k in range(len(joints)))
    gravity = np.array(engine.gravity, dtype=float)
    known = tuple(0.0 if x == 0.0 else None for x in gravity.tolist())
    return Packed(Class(tuple(joints), constants, known, planar), links, gravity)


def _joint(engine: Engine, i: int) -> Joint:
    row = engine.link[i]
    driven = bool(row[tree.DRIVEN])
    if engine.flag[0]:
        return Joint(codes.VECTOR, 1, TURN if row[tree.KIND] == tree.REVOLUTE else SLIDE, driven=driven)
    if row[tree.KIND] == tree.REVOLUTE:
        return Joint(codes.VECTOR, 1, TURN, driven=driven)
    code, dim = int(row[tree.CODE]), int(row[tree.DIM])
    backward = bool(row[tree.FORWARD] < 0) and code != codes.VECTOR
    if row[tree.KIND] == tree.SPHERICAL:
        return Joint(codes.SO3, 4, BALL, backward, driven)
    columns = engine.basis[row[tree.DENSE]].reshape(6, 6)[:dim]
    return Joint(code, int(row[tree.Q_SIZE]), tuple(tuple(column) for column in columns.tolist()), backward, driven)


def _constants(rows: Array) -> dict[int, float]:
    """Columns (n, width) that are zero in all rows, or 1 or −1 in rotations and senses, and that number."""
    turn = Link.rotation.offset
    signs = [Link.sense.offset, *range(turn, turn + 9)]
    same = np.all(rows == rows[0], axis=0) & (
        (rows[0] == 0.0) | (np.abs(rows[0]) == 1.0) & np.isin(np.arange(rows.shape[1]), signs)
    )
    return {int(k): float(rows[0, k]) for k in np.flatnonzero(same)}


def _clean(numbers: list[float]) -> list[float]:
    """Numbers with those that are rounding beside the others, or beside 1, as zeros and ones."""
    near = 4.0 * float(np.finfo(float).eps) * max(abs(x) for x in numbers)
    return [0.0 if abs(x) <= near else math.copysign(1.0, x) if abs(abs(x) - 1.0) <= near else x for x in numbers]


def _about_z(angle: float) -> list[list[float]]:
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
