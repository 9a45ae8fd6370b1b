"""From the tables of a reduced scene to those of the engine: links at their joints, rigid groups merged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, final

import numpy as np

from ephs.mechanics.road.charts import TIE, Chart, GroupKind
from ephs.mechanics.road.cuts import Cut, Relative
from ephs.mechanics.road.elimination import ClosingProgram, closing
from ephs.mechanics.road.loops import kinds_of, loop_program
from ephs.mechanics.road.pack import STANDARD, Packed
from ephs.mechanics.road.programs import sweeps
from ephs.mechanics.road.rigid import SUMS
from ephs.mechanics.tree.engine.attachment import Attachment, attachment_of, with_derivatives
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.islands import islands_of
from ephs.mechanics.tree.engine.links import Found, links_of
from ephs.mechanics.tree.engine.tables import Forces, table_of
from ephs.mechanics.tree.finding.tables import CUT, SPRING, TREE, MechanismTables
from ephs.mechanics.tree.sweeps.acting import ON_BODIES, ON_CUT, ON_TREE, TOTALS, CompiledComponent, Own
from ephs.mechanics.tree.sweeps.balances import network_program
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage import Program, Table
from ephs.semantics.systems.kept import once
from ephs.solve.equations.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced


def engine_of(
    reduced: "Reduced",
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
    key = "engine", acted, rows, apart, momenta
    plan = once(reduced, key, lambda: _plan(reduced, drive.size, acted, kept, apart=apart, momenta=momenta))
    tables = {**plan.tables, "drive": drive, "wrench": wrench, "scal": scal, "supply": supply, "lead": lead}
    tables |= {name: plan.tables[name].copy() for name in ("net", "numbers")}  # they hold the network's memory, too
    work: dict[str, Any] = {name: np.zeros(shape) for name, shape in plan.shapes.items()}
    work["fault"] = np.zeros(1, dtype=np.int64)
    return Engine(tables, work, plan.closing, plan.sizes, plan.reached, looped=plan.looped)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _EnginePlan:
    """The shared part of engines: all but inputs and memory.

    Parameters
    ----------
    shapes
        Of the arrays of its memory.
    """

    tables: Mapping[str, Any]
    shapes: Mapping[str, tuple[int, ...]]
    closing: ClosingProgram
    sizes: tuple[int, int]
    reached: Mapping[str, tuple[Program, str]]
    looped: bool


def _plan(
    reduced: "Reduced",
    rates: int,
    acted: tuple[frozenset[int], frozenset[int]],
    kept: Sequence[Array] | None,
    *,
    apart: bool,
    momenta: bool,
) -> _EnginePlan:
    """The plan of an engine, ``rates`` the number of all joints' rates."""
    found = links_of(reduced, apart=apart)
    cut, cut_numbers, ends = _cut(reduced, found, kept)
    charts = _chart(reduced, cut)
    forces = _forces(reduced, found, cut, acted)
    net = attachment_of(reduced)
    attached = reduced.attaching.network.acts
    forced = bool(forces.edge.size or forces.conduction.size or np.any(forces.body != -1) or attached)
    driven = any(part.joint.driven for part in found.parts)
    island, bases = islands_of(reduced, found, acted)
    records = found.packed(reduced.gravity)
    program = sweeps(records.kind, general=bool(forced or driven or len(cut) or apart))
    eliminated = closing([part.parent for part in found.parts], ends)
    reached = _reached(program.program, loop_program(_kinds(charts, cut)))
    if attached:
        reached["attach"] = network_program(), "solve"
    own = _own(
        (len(found.parts), program.width, len(bases) if momenta else 0),
        reached,
        forced=forced,
        driven=driven,
        attached=attached,
    )
    links = {"own": own, "island": island, "bases": bases.ravel(), **_links(records)}
    tables = {**links, **_joints(charts, cut, cut_numbers, eliminated), **forces.tables(), **_attached(net)}
    freedoms, entropies = sum(part.joint.dim for part in found.parts), len(reduced.entropies)
    sizes = reduced.coordinates, rates + freedoms + entropies + TOTALS + len(reduced.made)
    booked = entropies, entropies + TOTALS + len(reduced.made)
    shapes = _shapes(program.width, (len(found.parts), len(bases)), freedoms, rates, len(cut), booked, eliminated)
    shapes["located"] = tables["middle"].size, 6
    return _EnginePlan(tables, shapes, eliminated, sizes, reached, len(cut) > 0)


class WholeMechanism(NamedTuple):
    """A mechanism with all rows of its loops, and with all its joints and bodies acted on."""

    found: Found
    records: Packed
    kinds: tuple[GroupKind, ...]  # of its joints
    usual: bool  # whether its joints are standard ones, which all are in its class
    body_frame: Array  # (bodies, 12): see `Forces`
    tables: dict[str, Any]
    shapes: dict[str, tuple[int, ...]]  # of its memory, without what the class's program takes for links


def whole_of(reduced: "Reduced") -> WholeMechanism:
    """A reduced scene, for equations over dense matrices.

    What acts is evaluated with derivatives. Prescribed motions are rows, and nothing is eliminated.
    """
    found, t = links_of(reduced), reduced.tables
    parts = [
        replace(part, joint=replace(part.joint, driven=False, armature=part.armature > 0.0)) for part in found.parts
    ]
    usual = {part.joint for part in parts} <= set(STANDARD)  # others have programs of their own class
    records = replace(found, parts=parts, planar=False).packed(reduced.gravity, among=STANDARD if usual else ())
    cut, cut_numbers, ends = _cut(reduced, found, None)
    charts, size = _chart(reduced, cut), 2 * int(cut[:, 8].sum())
    joints = frozenset(range(len(reduced.joints)))
    forces = _forces(reduced, found, cut, (joints, frozenset(range(reduced.links))))
    net, none = attachment_of(reduced), np.zeros(0, dtype=np.int64)
    attached = reduced.attaching.network.acts
    reached = {"attach": (network_program(), "solve")} if attached else {}
    whole = ClosingProgram(none, none, np.arange(size), none, none, 0, 0)
    own = _own((len(parts), 0, 0), reached, forced=True, driven=False, attached=attached)
    links = {"own": own, "island": none, "bases": np.zeros(0), **_links(records)}
    tables = {**links, **_joints(charts, cut, cut_numbers, whole), **forces.tables(), **_attached(net)}
    tables = with_derivatives(tables, t.address)
    booked = len(reduced.entropies), len(reduced.entropies) + TOTALS + len(reduced.made)
    shapes = _shapes(0, (len(parts), 0), reduced.freedoms, int(t.dim[: len(joints)].sum()), len(cut), booked, whole)
    shapes["located"] = tables["middle"].size, 6
    shapes |= {"value": (len(ends), 4), "covector": (size, 6), "e": (64,), "jac": (1024,), "scratch": (4096,)}
    return WholeMechanism(
        found, records, _kinds(charts, cut), usual, forces.body_frame, tables, shapes
    )  # fmt: skip


def _links(records: Packed) -> dict[str, Any]:
    return {"integers": records.integers, "reals": records.reals, "gravity": records.gravity}


def _joints(charts: Index, cut: Index, numbers: Array, closing: ClosingProgram) -> dict[str, Any]:
    return {
        "chart": table_of(Chart, charts), "cut": cut[:, :-1].ravel(), "cut_numbers": numbers.ravel(),
        **{name: getattr(closing, name).ravel() for name in ("at", "slot", "row", "flat", "end")},
    }  # fmt: skip


def _attached(net: Attachment) -> dict[str, Any]:
    return {"net": net.integers, "numbers": net.reals}


def _kinds(charts: Index, cut: Index) -> tuple[GroupKind, ...]:
    return kinds_of([*charts[:, [0, 3, 1]].tolist(), *cut[:, [2, 5, 3]].tolist()])


def _reached(sweeps: Program, loops: Program) -> dict[str, tuple[Program, str]]:
    """Function of `Own` -> the program and the entry that it is; sweeps of a free tree have one of their own."""
    own = (
        "accelerations",
        "move",
        "fold",
        "unfold",
        "resolve",
        "spread",
        "axes",
        "power",
        "dependent",
        "energy",
        "rigid",
    )
    cut = ("rows", "poses", "fit", "gaps", "relative_rates", "across", "advance", "velocities")
    found = {name: (sweeps, name) for name in own if name in sweeps.entries}
    return found | {name: (loops, name) for name in cut} | {"displace": (loops, "move")}


def _own(
    sizes: tuple[int, int, int],
    reached: Mapping[str, tuple[Program, str]],
    *,
    forced: bool,
    driven: bool,
    attached: bool,
) -> Table[Own]:
    made = Own.table(1)
    own = made[0]
    own.links, own.width, own.islands = sizes
    own.forced, own.driven, own.falls = int(forced), int(driven), int("accelerations" in reached)
    own.attached = int(attached)
    for name, (program, entry) in reached.items():
        setattr(own, name, program.compiled()[entry].address)
    return made


def _shapes(
    width: int, groups: tuple[int, int], freedoms: int, joints: int, cuts: int, booked: tuple[int, int],
    closing: ClosingProgram,
) -> dict[str, tuple[int, ...]]:  # fmt: skip
    """Shapes of the memory of one thread, by a link's width, numbers of links and islands, of entropies, and with
    totals.
    """
    (links, islands), (entropies, totals) = groups, booked
    rows, slots = len(closing.row), len(closing.slot)
    return {
        "work": ((links + 1) * width,),
        "pushed": (links, 6), "force": (freedoms,), "zero": (freedoms,), "attached": (joints,), "pulled": (joints,),
        "relative": (cuts, Relative.real_width),
        "value": (rows, 4), "entry": (closing.entries,), "covector": (slots, 6), "along": (slots, 12),
        "largest": (max(closing.blocks, 1),), "temperature": (max(entropies, 1),), "entropy": (entropies,),
        "x": (32,), "v": (64,), "e": (32,), "lam": (64,), "f": (512,), "c": (16,), "jac": (512,), "scratch": (2048,),
        "alter": (freedoms,), "moved": (joints,), "answer": (1,),
        "momenta": (links, 6), "spin": (freedoms,), "direction": (freedoms,), "descent": (freedoms,),
        "kept": (6 * islands,), "released": (6 * islands,), "found": (6 * islands,), "torque": (6 * islands,),
        "sums": (islands, SUMS), "still": (joints,), "idle": (totals,), "spare": (totals,),
    }  # fmt: skip


def _matrix(pose: Array) -> Array:
    """(12,): rows of R, and p, of a pose."""
    return np.concatenate([quaternion_to_matrix(pose[:4]).ravel(), pose[4:]])


def _ends(reduced: "Reduced", found: Found, i: int) -> tuple[int, int, Array]:
    """Links of an edge, and (24,) its frames there."""
    t = reduced.tables
    links, frames = [], []
    for body, offset in ((int(t.first[i]), t.offset1[i]), (int(t.second[i]), t.offset2[i])):
        link, inside = (found.link[body], found.inside[body]) if body >= 0 else (-1, found.ground)
        links.append(link)
        frames.append(_matrix(SE3.compose(inside, offset)))
    return links[0], links[1], np.concatenate(frames)


def _cut(reduced: "Reduced", found: Found, kept: Sequence[Array] | None) -> tuple[Index, Array, list[tuple[int, ...]]]:
    """Cut joints with the numbers of their edges behind them, their numbers, and the links of each row."""
    t = reduced.tables
    closing = [i for i in range(len(reduced.edges)) if t.kind[i] == CUT]
    cut: list[tuple[int, ...]] = []
    numbers: list[Array] = []
    ends: list[tuple[int, ...]] = []
    for k, i in enumerate(closing):
        one, two, frame = _ends(reduced, found, i)
        chosen = np.arange(int(t.rows[i])) if kept is None else kept[k]
        if one == two:
            chosen = chosen[:0]
        covectors = np.zeros((6, 6))
        covectors[: chosen.size] = t.normal[i][chosen]
        numbers.append(np.concatenate([frame, t.basis[i].ravel(), t.left[i].ravel(), covectors.ravel(), [0.0]]))
        cut.append((
            one, two, t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], len(ends), chosen.size, 2 * len(ends), i
        ))  # fmt: skip
        ends += [(one, two)] * chosen.size
    size = 2 * len(ends)
    for number, tie in enumerate(reduced.attaching.ties):
        if kept is not None and not kept[len(closing) + number].size:
            continue
        at = size
        links: list[int] = []
        for i, freedom, ratio in tie.terms:
            one, two, frame = _ends(reduced, found, i)
            numbers.append(np.concatenate([frame, _geared(reduced, i, freedom, ratio)]))
            cut.append((one, two, TIE, 0, t.q_at[i] + freedom, 1, t.r_at[i], len(ends), 1, size + len(links), -1))
            links += [one, two]
        size = at + len(links)
        ends.append(tuple(links))
    return (
        np.array(cut, dtype=np.int64).reshape(-1, Cut.integer_width + 1),
        np.array(numbers).reshape(-1, Cut.real_width),
        ends,
    )


def _geared(reduced: "Reduced", edge: int, freedom: int, ratio: float) -> Array:
    """B, its inverse, row and element of a joint that a gear ties to others; see `Cut`."""
    t = reduced.tables
    basis, left, normal = np.zeros((3, 6, 6))
    basis[:, 0], left[0], normal[0] = t.basis[edge][:, freedom], t.left[edge][freedom], ratio * t.left[edge][freedom]
    start = reduced.elements[edge][freedom]
    return np.concatenate([basis.ravel(), left.ravel(), normal.ravel(), [start]])


def _chart(reduced: "Reduced", cut: Index) -> Index:
    t = reduced.tables
    number = {int(i): k for k, i in enumerate(cut[:, -1])}
    found = [
        [t.code[i], t.dim[i], t.q_at[i], t.q_size[i], t.r_at[i], t.r_at[i], number.get(i, -1)]
        for i in range(len(reduced.joints))
        if t.dim[i]
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 7)


def _forces(reduced: "Reduced", found: Found, cut: Index, acted: tuple[frozenset[int], frozenset[int]]) -> Forces:
    t = reduced.tables
    number = {int(i): k for k, i in enumerate(cut[:, -1])}
    edges: list[list[int]] = []
    parts: list[list[int]] = []
    shared: list[list[int]] = []
    frames: list[Array] = []
    left: list[Array] = []
    reach: list[Array] = []
    port: dict[int, list[int]] = {}
    for i in range(len(reduced.edges)):
        friction = int(t.friction[i])
        if t.dim[i] == 0 or (max(t.spring[i], t.several[i], friction) < 0 and i not in acted[0]):
            continue
        one, two, frame = _ends(reduced, found, i)
        if t.kind[i] != SPRING:
            port |= {int(t.r_at[i]) + j: [int(t.r_at[i]) + j, len(edges), j] for j in range(int(t.dim[i]))}
        kind = {TREE: ON_TREE, CUT: ON_CUT, SPRING: ON_BODIES}[int(t.kind[i])]
        edges.append(
            [kind, one, two, int(t.dim[i]), int(t.q_at[i]), int(t.q_size[i]), int(t.r_at[i]), number.get(i, -1)]
        )
        resisted = int(t.dims[friction, 0]) - 1 if friction >= 0 else 0  # rates
        shared.append([int(t.several[i]), int(t.poses[i]), resisted // 6 if resisted > t.dim[i] else 0])
        parts.append([int(t.spring[i]), friction, int(t.heat[i]), int(t.support[i])])
        reach.append(t.reach[i])
        frames.append(frame)
        left.append(t.left[i].ravel())
    return Forces(
        edge=np.array(edges, dtype=np.int64).reshape(-1, 8),
        part=np.array(parts, dtype=np.int64).reshape(-1, 4),
        shared=np.array(shared, dtype=np.int64).reshape(-1, 3),
        frame=np.array(frames).reshape(-1, 24),
        left=np.array(left).reshape(-1, 36),
        reach=np.array(reach).reshape(-1, 9),
        body=np.array([found.link[b] if b in acted[1] else -1 for b in range(reduced.links)], dtype=np.int64),
        body_frame=np.array([_matrix(inside) for inside in found.inside]).reshape(-1, 12),
        node=reduced.nodes,
        conduction=t.conduction,
        sink=t.sink,
        port=np.array([port[int(place)] for place in reduced.attaching.ports], dtype=np.int64).reshape(-1, 3),
        component=_components(t),
        parameters=t.parameters,
    )


def _components(t: MechanismTables) -> Table[CompiledComponent]:
    """Components with their relations at rest."""
    none = np.zeros_like(t.resting[:, None])
    rows = np.hstack([t.resting[:, None], t.dims, t.parameter_at[: len(t.resting), None], t.made_at[:, None], none])
    return table_of(CompiledComponent, rows)
