"""From the tables of a reduced scene to those of the compiled engine: links at their joints, rigid groups merged."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.engine.closing import closing
from ephs.mechanics.engine.force_kernels import ON_BODIES, ON_CUT, ON_TREE
from ephs.mechanics.engine.links import Frames, links_of
from ephs.mechanics.engine.tables import COLUMNS, DIM, WIDTH, Engine, Forces, Memory
from ephs.mechanics.reduced.tables import CUT, SPRING, TREE
from ephs.mechanics.solve.sparse import Index
from ephs.mechanics.tree.cuts import Cut, Relative
from ephs.mechanics.tree.loops import kinds_of, loop_addresses
from ephs.mechanics.tree.programs import PLACE, sweeps
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

if TYPE_CHECKING:
    from ephs.mechanics.reduced.mechanism import Reduced

__all__ = ["engine_of", "memory_of"]


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
    found = links_of(reduced)
    bodies, ground = found.bodies, found.ground
    cut, cut_frame, cut_basis, ends = _cut(reduced, bodies, ground, kept)
    charts = _chart(reduced, cut)
    forces = _forces(reduced, bodies, ground, cut, acted)
    forced = bool(forces.edge.size or forces.conduction.size or np.any(forces.body != -1))
    driven = any(part.joint.driven for part in found.parts)
    records = found.packed(gravity)
    program = sweeps(records.kind, general=bool(forced or driven or len(cut)))
    table = np.array([(part.parent, part.r_at, part.joint.dim) for part in found.parts], dtype=np.int64)
    return Engine(
        flag=np.array([forced, driven, program.width], dtype=np.int64),
        address=program.addresses(),
        link=table.reshape(-1, COLUMNS),
        integers=records.integers,
        reals=records.reals,
        gravity=records.gravity,
        loops=loop_addresses(kinds_of([*charts[:, [0, 3, 1]].tolist(), *cut[:, [2, 5, 3]].tolist()])),
        chart=charts.ravel(),
        cut=cut[:, :-1].ravel(),
        cut_numbers=np.hstack([cut_frame, cut_basis]).ravel(),
        closing=closing([part.parent for part in found.parts], ends),
        forces=forces,
    )


def memory_of(engine: Engine, entropies: int) -> Memory:
    """Memory for one thread."""
    links, m = engine.link.shape[0], len(engine.closing.row)
    n = int(engine.link[:, DIM].sum())
    slots = len(engine.closing.slot)
    shapes: dict[str, tuple[int, ...]] = {
        "work": ((links + 1) * int(engine.flag[WIDTH]),), "place": (links + 1, PLACE), "wrench": (links, 6),
        "change": (links + 1, 6), "force": (n,), "zero": (n,),
        "relative": (engine.cut.size // Cut.integer_width, Relative.real_width), "row_value": (m, 4),
        "entry": (engine.closing.entries,),
        "covector": (slots, 6), "along": (slots, 12), "largest": (max(engine.closing.blocks, 1),),
        "temperature": (max(entropies, 1),), "entropy": (entropies,), "small": (512,), "e": (16,), "f": (256,),
        "c": (16,), "jac": (512,),
        "scratch": (2048,),
    }  # fmt: skip
    return Memory(**{name: np.zeros(shape) for name, shape in shapes.items()})


def _matrix(pose: Array) -> Array:
    """(12,): rows of R, and p, of a pose."""
    return np.concatenate([quaternion_to_matrix(pose[:4]).ravel(), pose[4:]])


def _ends(reduced: "Reduced", bodies: Frames, ground: Array, i: int) -> tuple[int, int, Array]:
    """Links of an edge, and (24,) its frames there."""
    t = reduced.tables
    links, frames = [], []
    for body, offset in ((int(t.first[i]), t.offset1[i]), (int(t.second[i]), t.offset2[i])):
        link, inside = (bodies.link[body], bodies.inside[body]) if body >= 0 else (-1, ground)
        links.append(link)
        frames.append(_matrix(SE3.compose(inside, offset)))
    return links[0], links[1], np.concatenate(frames)


def _cut(
    reduced: "Reduced", bodies: Frames, ground: Array, kept: Sequence[Array] | None
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
    return cut, frames, np.array(numbers).reshape(-1, 108), ends


def _chart(reduced: "Reduced", cut: Index) -> Index:
    t = reduced.tables
    joints = [i for i in range(len(reduced.edges)) if t.kind[i] != SPRING]
    number = {int(i): k for k, i in enumerate(cut[:, 9])}
    found = [
        [t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], t.r_at[i], number.get(i, -1)]
        for i in joints
        if t.dim[i]
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 7)


def _forces(
    reduced: "Reduced", bodies: Frames, ground: Array, cut: Index, acted: tuple[frozenset[int], frozenset[int]]
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
