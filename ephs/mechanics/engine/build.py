"""From the tables of a reduced scene to those of the compiled engine: links at their joints, rigid groups merged."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.engine import row_kernels as rows
from ephs.mechanics.engine import tree_kernels as tree
from ephs.mechanics.engine.closing import closing
from ephs.mechanics.engine.force_kernels import ON_BODIES, ON_CUT, ON_TREE
from ephs.mechanics.engine.planar_kernels import P_CONSTANTS, P_MEMORY
from ephs.mechanics.engine.tables import Engine, Forces, Memory
from ephs.mechanics.reduced.tables import CUT, SPRING, TREE
from ephs.mechanics.reduction.subgroup import Subgroup, generated
from ephs.mechanics.solve.sparse import Index
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.codes import SO3
from ephs.semantics.spaces.rotations import matrix_to_quaternion, quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.reduced.mechanism import Reduced

__all__ = ["engine_of", "memory_of", "plane_of"]


@final
@dataclass(slots=True)
class _Frames:
    """Poses of bodies in the frames of the links that they belong to, found outwards along the tree."""

    link: list[int]
    inside: list[Array]


def plane_of(twists: Array) -> Array | None:
    """The normal (3,) of the plane parallel to which world twists (n, 6) move, None where there is no such plane."""
    group = generated(twists)
    if not _planar(group):
        return None
    return group.turning[:, 0]


def _planar(group: Subgroup) -> bool:
    if group.turning.shape[1] != 1 or group.dim > 3 or abs(group.pitch()) > 1e-9:
        return False
    return not np.any(np.abs(group.turning[:, 0] @ group.translations) > 1e-9)


def engine_of(
    reduced: "Reduced",
    gravity: Array,
    acted: tuple[frozenset[int], frozenset[int]] = (frozenset(), frozenset()),
    kept: Sequence[Array] | None = None,
) -> Engine:
    """The engine of a reduced scene.

    Parameters
    ----------
    gravity
        (3,) in world axes.
    acted
        Edges and bodies on which given forces act.
    kept
        Of each cut joint, which of its rows are kept: those that others imply are left out. None: all.
    """
    t = reduced.tables
    joints = [i for i in range(len(reduced.edges)) if t.kind[i] != SPRING]
    normal = _plane(reduced, joints)
    ground = SE3.identity() if normal is None else np.concatenate([matrix_to_quaternion(_onto(normal)), np.zeros(3)])
    bodies = _Frames([], [])
    links: list[list[int]] = []
    const: list[Array] = []
    basis: list[Array] = []
    for i in range(reduced.links):
        parent = int(t.parent[i])
        above, inside = (bodies.link[parent], bodies.inside[parent]) if parent >= 0 else (-1, ground)
        forward = bool(t.forward[i])
        near, far = (t.offset1[i], t.offset2[i]) if forward else (t.offset2[i], t.offset1[i])
        edge = reduced.edges[i]
        if edge.pair.dim == 0:
            bodies.link.append(above)
            bodies.inside.append(SE3.compose(SE3.compose(inside, near), SE3.inverse(far)))
            if above >= 0:
                const[above] += _inertia(t.inertia[i], bodies.inside[i])
            continue
        turn = SE3.identity()
        joint = SE3.compose(inside, near)
        if normal is not None:
            turn = np.concatenate([matrix_to_quaternion(_flat(joint, edge.pair.name)), np.zeros(3)])
        joint = SE3.compose(joint, turn)
        bodies.link.append(len(links))
        bodies.inside.append(SE3.compose(SE3.inverse(turn), SE3.inverse(far)))
        sign = 1 if forward else -1
        driven = int(t.driven[t.r_at[i]])
        if normal is not None:
            turning = edge.pair.name == "revolute"
            kind = tree.REVOLUTE if turning else tree.SLIDING
            sign *= -1 if turning and quaternion_to_matrix(turn[:4])[2, 2] < 0.0 else 1
        else:
            kind = _kind(edge.pair.name, edge.pair.code) if not driven else tree.GENERAL
        dense = len(basis) if kind == tree.GENERAL else -1
        if kind == tree.GENERAL:
            basis.append(np.concatenate([edge.pair.basis.T.ravel(), np.zeros(36 - 6 * edge.pair.dim)]))
        links.append(
            [above, kind, int(t.q_at[i]), int(t.r_at[i]), sign, edge.pair.dim, driven, dense, edge.pair.code,
             edge.pair.size]
        )  # fmt: skip
        matrix = quaternion_to_matrix(joint[:4])
        const.append(
            np.concatenate([matrix.ravel(), joint[4:], _inertia(t.inertia[i], bodies.inside[-1])[tree.C_MASS :]])
        )
    table = np.array(links, dtype=np.int64).reshape(-1, tree.COLUMNS)
    numbers = np.array(const).reshape(-1, tree.CONSTANTS)
    cut, cut_frame, cut_basis, ends = _cut(reduced, bodies, ground, kept)
    forces = _forces(reduced, bodies, ground, cut, acted)
    forced = bool(forces.edge.size or forces.conduction.size or np.any(forces.body != -1))
    driven = bool(table[:, tree.DRIVEN].any())
    world = bool(len(cut) or forces.edge.size or np.any(forces.body != -1))
    pull = quaternion_to_matrix(ground[:4]) @ np.asarray(gravity, dtype=float)
    return Engine(
        flag=np.array([normal is not None, forced, driven, world], dtype=np.int64),
        link=table,
        const=numbers if normal is None else _flat_constants(numbers, table),
        basis=np.array(basis).reshape(-1, 36),
        gravity=pull,
        chart=_chart(reduced, joints, cut),
        cut=cut[:, :9],
        cut_frame=cut_frame,
        cut_basis=cut_basis,
        closing=closing(table[:, tree.PARENT].tolist(), ends),
        forces=forces,
    )


def memory_of(engine: Engine, entropies: int) -> Memory:
    """Memory for one thread."""
    links, m = engine.link.shape[0], len(engine.closing.row)
    n = int(engine.link[:, tree.DIM].sum())
    slots = len(engine.closing.slot)
    shapes: dict[str, tuple[int, ...]] = {
        "work": (links, P_MEMORY if engine.flag[0] else tree.MEMORY),
        "dense": (len(engine.basis), tree.GENERAL_SIZE), "force": (n,), "zero": (n,),
        "relative": (len(engine.cut), rows.M_SIZE), "row_value": (m, 4), "entry": (engine.closing.entries,),
        "covector": (slots, 6), "along": (slots, 12), "largest": (max(engine.closing.blocks, 1),),
        "temperature": (max(entropies, 1),), "entropy": (entropies,), "small": (512,), "e": (16,), "f": (256,),
        "c": (16,), "jac": (512,),
        "scratch": (2048,),
    }  # fmt: skip
    return Memory(**{name: np.zeros(shape) for name, shape in shapes.items()})


def _inertia(own: Array, inside: Array) -> Array:
    """(22,): the inertia of a body at a pose in its link; zeros where the pose stands."""
    turn, at, m = quaternion_to_matrix(inside[:4]), inside[4:], float(own[3, 3])
    about = turn @ own[:3, :3] @ turn.T + m * (float(at @ at) * np.eye(3) - np.outer(at, at))
    upper = about[np.triu_indices(3)]
    return np.concatenate([np.zeros(tree.C_MASS), [m], m * at, upper])


def _plane(reduced: "Reduced", joints: list[int]) -> Array | None:
    """The normal of the plane in which everything moves, for mechanisms of pins and slides only."""
    kinds = {reduced.edges[i].pair.name for i in joints if reduced.tables.kind[i] == TREE and reduced.tables.dim[i]}
    if not kinds or not kinds <= {"revolute", "prismatic"}:
        return None
    return plane_of(np.concatenate([reduced.twists[i].T for i in joints]))


def _onto(normal: Array) -> Array:
    """The rotation that takes world axes to those of a plane, its normal to z."""
    least = np.eye(3)[int(np.argmin(np.abs(normal)))]
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


def _flat_constants(numbers: Array, table: Index) -> Array:
    angle: Array = np.arctan2(numbers[:, 3], numbers[:, 0])
    height = np.zeros(len(numbers) + 1)  # the last one is the ground's
    for i, parent in enumerate(table[:, tree.PARENT].tolist()):
        height[i] = height[parent] + numbers[i, 11]
    columns: list[Array] = [numbers[:, 9], numbers[:, 10], angle, *numbers[:, 12:15].T, numbers[:, 21]]
    columns += [numbers[:, 0], numbers[:, 3], height[:-1]]
    return np.ascontiguousarray(np.column_stack(columns).reshape(-1, P_CONSTANTS))


def _kind(name: str, code: int) -> int:
    if name == "revolute":
        return tree.REVOLUTE
    return tree.SPHERICAL if code == SO3 else tree.GENERAL


def _matrix(pose: Array) -> Array:
    """(12,): rows of R, and p, of a pose."""
    return np.concatenate([quaternion_to_matrix(pose[:4]).ravel(), pose[4:]])


def _ends(reduced: "Reduced", bodies: _Frames, ground: Array, i: int) -> tuple[int, int, Array]:
    """Links of an edge, and (24,) its frames there."""
    t = reduced.tables
    links, frames = [], []
    for body, offset in ((int(t.first[i]), t.offset1[i]), (int(t.second[i]), t.offset2[i])):
        link, inside = (bodies.link[body], bodies.inside[body]) if body >= 0 else (-1, ground)
        links.append(link)
        frames.append(_matrix(SE3.compose(inside, offset)))
    return links[0], links[1], np.concatenate(frames)


def _cut(
    reduced: "Reduced", bodies: _Frames, ground: Array, kept: Sequence[Array] | None
) -> tuple[Index, Array, Array, list[tuple[int, int]]]:
    t = reduced.tables
    found = [i for i in range(len(reduced.edges)) if t.kind[i] == CUT]
    cut, frames, numbers = np.zeros((len(found), 10), dtype=np.int64), np.zeros((len(found), 24)), []
    ends: list[tuple[int, int]] = []
    for k, i in enumerate(found):
        one, two, frames[k] = _ends(reduced, bodies, ground, i)
        chosen = np.arange(int(t.rows[i])) if kept is None else kept[k]
        if one == two:
            chosen = chosen[:0]
        covectors = np.zeros((6, 6))
        covectors[: chosen.size] = t.normal[i][chosen]
        numbers.append(np.concatenate([t.basis[i].ravel(), t.left[i].ravel(), covectors.ravel()]))
        cut[k] = (
            one, two, t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], len(ends), chosen.size, i
        )  # fmt: skip
        ends += [(one, two)] * chosen.size
    return cut, frames, np.array(numbers).reshape(-1, rows.B_SIZE), ends


def _chart(reduced: "Reduced", joints: list[int], cut: Index) -> Index:
    t = reduced.tables
    number = {int(i): k for k, i in enumerate(cut[:, 9])}
    found = [
        [t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], t.r_at[i], number.get(i, -1)]
        for i in joints
        if t.dim[i]
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 7)


def _forces(
    reduced: "Reduced", bodies: _Frames, ground: Array, cut: Index, acted: tuple[frozenset[int], frozenset[int]]
) -> Forces:
    t = reduced.tables
    number = {int(i): k for k, i in enumerate(cut[:, 9])}
    edges: list[list[int]] = []
    parts: list[list[int]] = []
    frames: list[Array] = []
    left: list[Array] = []
    for i in range(len(reduced.edges)):
        friction = int(t.friction[i])
        if t.dim[i] == 0 or (t.spring[i] < 0 and friction < 0 and i not in acted[0]):
            continue
        one, two, frame = _ends(reduced, bodies, ground, i)
        kind = {TREE: ON_TREE, CUT: ON_CUT, SPRING: ON_BODIES}[int(t.kind[i])]
        edges.append(
            [kind, one, two, int(t.dim[i]), int(t.q_at[i]), int(t.q_size[i]), int(t.r_at[i]), number.get(i, -1)]
        )
        parts.append([int(t.spring[i]), friction, int(t.heat[i])])
        frames.append(frame)
        left.append(t.left[i].ravel())
    return Forces(
        edge=np.array(edges, dtype=np.int64).reshape(-1, 8),
        part=np.array(parts, dtype=np.int64).reshape(-1, 3),
        frame=np.array(frames).reshape(-1, 24),
        left=np.array(left).reshape(-1, 36),
        body=np.array([bodies.link[b] if b in acted[1] else -1 for b in range(reduced.links)], dtype=np.int64),
        body_frame=np.array([_matrix(inside) for inside in bodies.inside]).reshape(-1, 12),
        node=t.node,
        conduction=t.conduction,
        sink=t.sink,
        address=t.address,
        dims=t.dims,
        parameters=t.parameters,
        parameter_at=t.parameter_at,
        made_at=t.made_at,
    )
