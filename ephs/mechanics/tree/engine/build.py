"""From the tables of a reduced scene to those of the engine: links at their joints, rigid groups merged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.tree.engine.attachment import attachment_of
from ephs.mechanics.tree.engine.closing import Closing, closing
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.islands import islands_of
from ephs.mechanics.tree.engine.links import Frames, links_of
from ephs.mechanics.tree.engine.tables import Forces, table_of
from ephs.mechanics.tree.finding.tables import CUT, SPRING, TREE, Mechanism
from ephs.mechanics.tree.sweeps.acting import ON_BODIES, ON_CUT, ON_TREE, Component, Own
from ephs.mechanics.tree.sweeps.balances import network_program
from ephs.mechanics.tree.sweeps.charts import TIE, Chart
from ephs.mechanics.tree.sweeps.cuts import Cut, Relative
from ephs.mechanics.tree.sweeps.loops import kinds_of, loop_program
from ephs.mechanics.tree.sweeps.programs import PLACE, Sweeps, sweeps
from ephs.mechanics.tree.sweeps.rigid import SUMS
from ephs.semantics.bundle import Array
from ephs.semantics.kept import once
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage import Program, Table
from ephs.solve.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced

__all__ = ["engine_of", "whole_tables"]


def engine_of(
    reduced: "Reduced",
    gravity: Array,
    drive: Array,
    wrench: Array,
    scal: Array,
    supply: Array,
    lead: Array,
    acted: tuple[frozenset[int], frozenset[int]] = (frozenset(), frozenset()),
    kept: Sequence[Array] | None = None,
    *,
    apart: bool = False,
    momenta: bool = False,
) -> Engine:
    """The engine of a reduced scene.

    Parameters
    ----------
    gravity
        (3,) in world axes.
    drive, wrench, scal
        Given forces (joints' degrees of freedom,), given wrenches (bodies, 6), and (h, θ₀, π₀), which are read where
        they are.
    supply, lead
        What is given to what is attached, and accelerations (degrees of freedom,) of prescribed motions, read there,
        too.
    acted
        Edges and bodies on which given forces act.
    kept
        Of each cut joint, then of each gear, which of its rows are kept: those that others imply are left out. None:
        all.
    apart
        Whether each body is a link of its own, in space: `links_of`.
    momenta
        Whether steps keep the momenta of islands.
    """
    rows = None if kept is None else tuple(tuple(each.tolist()) for each in kept)
    key = "engine", gravity.tobytes(), acted, rows, apart, momenta
    plan = once(reduced, key, lambda: _plan(reduced, gravity, drive.size, acted, kept, apart=apart, momenta=momenta))
    tables = {**plan.tables, "drive": drive, "wrench": wrench, "scal": scal, "supply": supply, "lead": lead}
    work: dict[str, Any] = {name: np.zeros(shape) for name, shape in plan.shapes.items()}
    work["fault"] = np.zeros(1, dtype=np.int64)
    return Engine(tables, work, plan.closing, plan.sizes, plan.reached, looped=plan.looped)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """The shared part of engines: all but inputs and memory.

    Parameters
    ----------
    shapes
        Of the arrays of its memory.
    """

    tables: Mapping[str, Any]
    shapes: Mapping[str, tuple[int, ...]]
    closing: Closing
    sizes: tuple[int, int]
    reached: Mapping[str, tuple[Program, str]]
    looped: bool


def _plan(
    reduced: "Reduced",
    gravity: Array,
    rates: int,
    acted: tuple[frozenset[int], frozenset[int]],
    kept: Sequence[Array] | None,
    *,
    apart: bool,
    momenta: bool,
) -> _Plan:
    """The plan of an engine, ``rates`` the number of all joints' rates."""
    found = links_of(reduced, apart=apart)
    bodies, ground = found.bodies, found.ground
    cut, cut_frame, cut_basis, ends = _cut(reduced, bodies, ground, kept)
    charts = _chart(reduced, cut)
    forces = _forces(reduced, bodies, ground, cut, acted)
    net = attachment_of(reduced, reduced.tables.resting)
    attached = reduced.attaching.network.acts
    forced = bool(forces.edge.size or forces.conduction.size or np.any(forces.body != -1) or attached)
    driven = any(part.joint.driven for part in found.parts)
    between = bool(np.any((forces.edge[:, 0] == ON_BODIES) & (forces.part[:, 0] >= 0)))
    island, bases = islands_of(reduced, found, acted)
    records = found.packed(gravity)
    program = sweeps(records.kind, general=bool(forced or driven or len(cut) or apart))
    eliminated = closing([part.parent for part in found.parts], ends)
    joints = kinds_of([*charts[:, [0, 3, 1]].tolist(), *cut[:, [2, 5, 3]].tolist()])
    reached = _reached(program.program, loop_program(joints))
    if attached:
        reached["attach"] = network_program(), "solve"
    tables: dict[str, Any] = {
        "own": _own(
            (len(found.parts), len(bases) if momenta else 0),
            reached,
            forced=forced,
            driven=driven,
            attached=attached,
            between=between,
        ),
        "integers": records.integers,
        "reals": records.reals,
        "gravity": records.gravity,
        "chart": table_of(Chart, charts),
        "cut": cut[:, :-1].ravel(),
        "cut_numbers": np.hstack([cut_frame, cut_basis]).ravel(),
        **{name: getattr(eliminated, name).ravel() for name in ("at", "slot", "row", "flat", "end")},
        **forces.tables(),
        "island": island,
        "bases": bases.ravel(),
        "net": net.integers,
        "numbers": net.reals,
    }
    freedoms, entropies = sum(part.joint.dim for part in found.parts), len(reduced.entropies)
    sizes = reduced.coordinates, rates + freedoms + entropies + 2 + len(reduced.made)
    booked = entropies, entropies + 2 + len(reduced.made)
    shapes = _shapes(program, (len(found.parts), len(bases)), freedoms, rates, len(cut), booked, eliminated)
    return _Plan(tables, shapes, eliminated, sizes, reached, len(cut) > 0)


def _reached(sweeps: Program, loops: Program) -> dict[str, tuple[Program, str]]:
    """Function of `Own` -> the program and the entry that it is; sweeps of a free tree have one of their own."""
    own = ("accelerations", "move", "fold", "unfold", "resolve", "spread", "power", "dependent", "energy", "rigid")
    cut = ("rows", "poses", "fit", "gaps", "relative_rates", "across", "advance", "velocities")
    found = {name: (sweeps, name) for name in own if name in sweeps.entries}
    return found | {name: (loops, name) for name in cut} | {"displace": (loops, "move")}


def _own(
    groups: tuple[int, int],
    reached: Mapping[str, tuple[Program, str]],
    *,
    forced: bool,
    driven: bool,
    attached: bool,
    between: bool,
) -> Table[Own]:
    made = Own.table(1)
    own = made[0]
    own.links, own.islands = groups
    own.forced, own.driven, own.falls = int(forced), int(driven), int("accelerations" in reached)
    own.attached, own.between = int(attached), int(between)
    for name, (program, entry) in reached.items():
        setattr(own, name, program.compiled()[entry].address)
    return made


def _shapes(
    program: Sweeps, groups: tuple[int, int], freedoms: int, joints: int, cuts: int, booked: tuple[int, int],
    closing: Closing,
) -> dict[str, tuple[int, ...]]:  # fmt: skip
    """Shapes of the memory of one thread, by numbers of links and islands, of entropies, and with totals."""
    (links, islands), (entropies, totals) = groups, booked
    rows, slots = len(closing.row), len(closing.slot)
    return {
        "work": ((links + 1) * program.width,), "place": (links + 1, PLACE), "change": (links + 1, 6),
        "pushed": (links, 6), "force": (freedoms,), "zero": (freedoms,), "attached": (joints,), "pulled": (joints,),
        "relative": (cuts, Relative.real_width),
        "value": (rows, 4), "entry": (closing.entries,), "covector": (slots, 6), "along": (slots, 12),
        "largest": (max(closing.blocks, 1),), "temperature": (max(entropies, 1),), "entropy": (entropies,),
        "x": (16,), "v": (64,), "e": (16,), "lam": (64,), "f": (256,), "c": (16,), "jac": (512,), "scratch": (2048,),
        "alter": (freedoms,), "moved": (joints,), "answer": (1,),
        "momenta": (links, 6), "spin": (freedoms,), "direction": (freedoms,), "descent": (freedoms,),
        "kept": (6 * islands,), "released": (6 * islands,), "found": (6 * islands,), "torque": (6 * islands,),
        "sums": (islands, SUMS), "still": (joints,), "idle": (totals,), "spare": (totals,),
    }  # fmt: skip


def whole_tables(reduced: "Reduced", bodies: Frames, ground: Array) -> tuple[Index, Index, Array, Forces]:
    """Charts, cut joints with all their rows, and the tables of forces where anything may act."""
    cut, frames, basis, _ = _cut(reduced, bodies, ground, None)
    every = frozenset(range(len(reduced.edges))), frozenset(range(reduced.links))
    forces = _forces(reduced, bodies, ground, cut, every)
    return _chart(reduced, cut), cut[:, :-1], np.hstack([frames, basis]), forces


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
) -> tuple[Index, Array, Array, list[tuple[int, ...]]]:
    t = reduced.tables
    found = [i for i in range(len(reduced.edges)) if t.kind[i] == CUT]
    cut: list[tuple[int, ...]] = []
    frames: list[Array] = []
    numbers: list[Array] = []
    ends: list[tuple[int, ...]] = []
    for k, i in enumerate(found):
        one, two, frame = _ends(reduced, bodies, ground, i)
        chosen = np.arange(int(t.rows[i])) if kept is None else kept[k]
        if one == two:
            chosen = chosen[:0]
        covectors = np.zeros((6, 6))
        covectors[: chosen.size] = t.normal[i][chosen]
        numbers.append(np.concatenate([t.basis[i].ravel(), t.left[i].ravel(), covectors.ravel(), [0.0]]))
        cut.append((
            one, two, t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], len(ends), chosen.size, 2 * len(ends), i
        ))  # fmt: skip
        frames.append(frame)
        ends += [(one, two)] * chosen.size
    size = 2 * len(ends)
    for number, tie in enumerate(reduced.attaching.ties):
        if kept is not None and not kept[len(found) + number].size:
            continue
        at = size
        links: list[int] = []
        for i, freedom, ratio in tie.terms:
            one, two, frame = _ends(reduced, bodies, ground, i)
            numbers.append(_geared(reduced, i, freedom, ratio))
            cut.append((one, two, TIE, 0, t.q_at[i] + freedom, 1, t.r_at[i], len(ends), 1, size + len(links), -1))
            frames.append(frame)
            links += [one, two]
        size = at + len(links)
        ends.append(tuple(links))
    return (
        np.array(cut, dtype=np.int64).reshape(-1, Cut.integer_width + 1), np.array(frames).reshape(-1, 24),
        np.array(numbers).reshape(-1, Cut.real_width - 24), ends,
    )  # fmt: skip


def _geared(reduced: "Reduced", edge: int, freedom: int, ratio: float) -> Array:
    """B, its inverse, row and element of a joint that a gear ties to others; see `Cut`."""
    t = reduced.tables
    basis, left, normal = np.zeros((3, 6, 6))
    basis[:, 0], left[0], normal[0] = t.basis[edge][:, freedom], t.left[edge][freedom], ratio * t.left[edge][freedom]
    start = reduced.edges[edge].coordinate[freedom]
    return np.concatenate([basis.ravel(), left.ravel(), normal.ravel(), [start]])


def _chart(reduced: "Reduced", cut: Index) -> Index:
    t = reduced.tables
    joints = [i for i in range(len(reduced.edges)) if t.kind[i] != SPRING]
    number = {int(i): k for k, i in enumerate(cut[:, -1])}
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
    number = {int(i): k for k, i in enumerate(cut[:, -1])}
    edges: list[list[int]] = []
    parts: list[list[int]] = []
    frames: list[Array] = []
    left: list[Array] = []
    reach: list[Array] = []
    port: dict[int, list[int]] = {}
    for i in range(len(reduced.edges)):
        friction = int(t.friction[i])
        if t.dim[i] == 0 or (t.spring[i] < 0 and friction < 0 and i not in acted[0]):
            continue
        one, two, frame = _ends(reduced, bodies, ground, i)
        if t.kind[i] != SPRING:
            port |= {int(t.r_at[i]) + j: [int(t.r_at[i]) + j, len(edges), j] for j in range(int(t.dim[i]))}
        kind = {TREE: ON_TREE, CUT: ON_CUT, SPRING: ON_BODIES}[int(t.kind[i])]
        edges.append(
            [kind, one, two, int(t.dim[i]), int(t.q_at[i]), int(t.q_size[i]), int(t.r_at[i]), number.get(i, -1)]
        )
        parts.append([int(t.spring[i]), friction, int(t.heat[i]), int(t.support[i])])
        reach.append(t.reach[i])
        frames.append(frame)
        left.append(t.left[i].ravel())
    return Forces(
        edge=np.array(edges, dtype=np.int64).reshape(-1, 8),
        part=np.array(parts, dtype=np.int64).reshape(-1, 4),
        frame=np.array(frames).reshape(-1, 24),
        left=np.array(left).reshape(-1, 36),
        reach=np.array(reach).reshape(-1, 8),
        body=np.array([bodies.link[b] if b in acted[1] else -1 for b in range(reduced.links)], dtype=np.int64),
        body_frame=np.array([_matrix(inside) for inside in bodies.inside]).reshape(-1, 12),
        node=reduced.nodes,
        conduction=t.conduction,
        sink=t.sink,
        port=np.array([port[int(place)] for place in reduced.attaching.ports], dtype=np.int64).reshape(-1, 3),
        component=_components(t, t.address),
        resting=_components(t, t.resting),
        parameters=t.parameters,
    )


def _components(t: Mechanism, address: Index) -> Table[Component]:
    """Components whose relations are at addresses."""
    rows = np.hstack([address[:, None], t.dims, t.parameter_at[: len(address), None], t.made_at[:, None]])
    return table_of(Component, rows)
