"""From a flat system to the tables of its reduced form: a spanning tree of joints, the rest cut."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.mechanics.shapes.gap import HEIGHT, PLACE
from ephs.mechanics.shapes.impact import Meeting
from ephs.mechanics.tree.finding.attaching import Attaching, attaching_of, makers_of
from ephs.mechanics.tree.finding.frames import GROUND, Frame, Link, Unplaced
from ephs.mechanics.tree.finding.loose import loose_links
from ephs.mechanics.tree.finding.network import Network
from ephs.mechanics.tree.finding.parts import Parts, WrenchPort, determined_by, parts_of
from ephs.mechanics.tree.finding.spanning import Edge, frames_of_joints, loop_algebra, spanning_tree, twists_of
from ephs.mechanics.tree.finding.tables import CUT, SPRING, TREE, MechanismTables
from ephs.mechanics.tree.sweeps.acting import ABOVE, ALONG, APART, BEYOND, EntropyNode
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.pairs import left_inverse
from ephs.semantics.stage import Table
from ephs.semantics.systems.kept import Kept, once
from ephs.solve.equations.heats import PLAIN, exponential_law
from ephs.solve.equations.model import Model
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import OptionError
from ephs.solve.posing.problem import Problem


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """A flat system in joint coordinates.

    Parameters
    ----------
    edges
        Tree joints in walking order, each of which leads to the link of its number; cut joints; springs.
    spans
        Edges among the cut joints that hold nothing: relative poses that something attached reads.
    bodies
        Link -> name of the body, None for a frame without one, as inside a universal joint.
    places
        The links in that order.
    entropies
        Paths of the states in s: of heat that is booked as energy, then of what is attached.
    made
        Paths of the components that make entropy; one for each further port of entropy of what is attached.
    nodes
        What stores s, in its order.
    unknowns
        How many numbers have to be found.
    elements
        Of the joints: where loops close or gears tie rates, the initial ones, else those of the identity.
    twists
        Of each joint, (6, d): its degrees of freedom in the world at these elements.
    gravity
        (3,) in world axes, m/s².
    acting
        The outer ports at which wrenches act on links.
    attaching
        What is attached.
    loose
        Links without mass that move while all others rest.
    """

    tables: MechanismTables
    edges: tuple[Edge, ...]
    spans: frozenset[int]
    bodies: tuple[str | None, ...]
    places: tuple[Link, ...]
    entropies: tuple[Path, ...]
    made: tuple[Path, ...]
    nodes: Table[EntropyNode]
    unknowns: int
    elements: tuple[Array, ...]
    twists: tuple[Array, ...]
    gravity: Array
    acting: tuple[WrenchPort, ...]
    attaching: Attaching
    loose: tuple[int, ...]
    _kept: Kept = field(default_factory=Kept, init=False, repr=False)

    @property
    def links(self) -> int:
        """The number of links."""
        return len(self.places)

    def path(self, link: int) -> Path:
        """Of the joint that leads to a link; of a free one the body's."""
        edge = self.edges[link]
        return edge.path or self.places[link].path or Path()

    @property
    def joints(self) -> tuple[Edge, ...]:
        """The edges that are joints: springs come behind them."""
        return self.edges[: len(self.elements)]

    @property
    def cut(self) -> tuple[Edge, ...]:
        """The joints at which loops are closed by constraints."""
        return self.joints[self.links :]

    @property
    def gears(self) -> tuple[Path, ...]:
        """Paths of the components that tie rates of joints to each other, one for each equation."""
        return tuple(tie.path for tie in self.attaching.ties)

    @property
    def coordinates(self) -> int:
        """Number of reals that store the joints' elements."""
        return int(self.tables.q_size[: len(self.elements)].sum())

    @property
    def freedoms(self) -> int:
        """The number of the tree's freedoms."""
        return int(self.tables.driven.size)


def reduce_system(problem: Problem, model: Model) -> Reduced:
    """The tables of a problem's reduced form; the kernels of its components are those of the compiled model.

    They are made once for all configurations of a tree, and for each one where loops close or gears tie rates: the
    algebras that joints of a tree generate are the same in all of them.

    Raises
    ------
    Unplaced
        A component has no place in joint coordinates.
    OptionError
        A loop of prescribed joints.
    """
    if model.callbacks:
        return _reduced(problem, model)  # tables hold addresses of functions that go with their model
    placed = b"".join(map(bytes, _placed(problem).values()))
    key = "reduced", model.reference, determined_by(problem), placed
    return once(problem.descriptor, key, lambda: _reduced(problem, model))


def _placed(problem: Problem) -> dict[Path | None, Array]:
    """Initial elements of joints and poses of links, by their states; none where tables do not depend on them."""
    parts = parts_of(problem)
    if len(parts.joints) == len(parts.links) and not parts.network.ties:
        return {}
    states = [edge.state for edge in (*parts.joints, *parts.spans)]
    states += [link.pose.path for link in parts.links if link.pose is not None]
    return {path: np.array(problem.initial[path]) for path in states if path is not None}


def _reduced(problem: Problem, model: Model) -> Reduced:
    parts, placed = parts_of(problem), _placed(problem)
    inertial = [parts.attached[parts.network.rates[one.rate][0]] for one in parts.network.inertias]
    tree, cut = spanning_tree(parts.joints, [link.light for link in parts.links], inertial)
    for one, edge in zip(parts.network.inertias, inertial, strict=True):
        if any(edge is other for other in cut):
            raise Unplaced(model.descriptor.components[one.component].path, "is inertia of a joint that closes a loop")
    cut += parts.spans
    over = [edge.name for edge in cut if edge.motion is not None]
    if over:  # prescribed joints are cut last: only a loop of nothing else is left over
        found = f"that of {', '.join(over)}, which closes a loop of prescribed joints"
        raise OptionError("motion", found, "one joint of each loop without prescribed motion, or the method natural")
    order = [child for _, child, _ in tree]
    edges = (*(edge for edge, _, _ in tree), *cut, *parts.forces)
    count = len(tree) + len(cut)
    elements = [placed.get(edge.state, edge.pair.manifold.identity()) for edge in edges[:count]]
    poses = [None if link.pose is None else placed.get(link.pose.path) for link in parts.links]
    frames = frames_of_joints(edges[:count], elements, poses)
    twists = twists_of(edges, frames)
    slots = problem.descriptor.components
    made, flows = makers_of(slots, parts.network)
    kinds = np.array([TREE] * len(tree) + [CUT] * len(cut) + [SPRING] * len(parts.forces), dtype=np.int64)
    mechanism = _tables(model, parts, edges, kinds, [f for *_, f in tree], order, made, flows, frames, twists)
    links = [parts.links[body] for body in order]
    names = tuple(parts.names[body] for body in order)
    place = {body: i for i, body in enumerate(order)} | {GROUND: GROUND}
    acting = tuple(WrenchPort(one.port, Frame(place[one.frame.link], one.frame.offset)) for one in parts.acting)
    stored = (*parts.entropies, *(state.path for state in parts.network.states))
    attaching = attaching_of(slots, parts, edges[:count], mechanism, stored, flows, model.reference)
    unknowns = 2 * int(mechanism.driven.size) + int(mechanism.rows.sum()) + len(attaching.ties)
    spans = frozenset(range(count - len(parts.spans), count))
    return Reduced(
        mechanism, edges, spans, names, tuple(links), stored, made, _nodes(model, parts), unknowns,
        tuple(elements), tuple(twists), parts.gravity, acting, attaching,
        tuple(place[link] for link in _loose(parts, edges[:count], mechanism, attaching, twists, frames, problem.length,
                                             alone=not placed)),
    )  # fmt: skip


def _loose(
    parts: Parts, edges: Sequence[Edge], mechanism: MechanismTables, attaching: Attaching, twists: Sequence[Array],
    frames: Sequence[Array], length: float, *, alone: bool,
) -> list[int]:  # fmt: skip
    """Links without mass whose motion no mass determines, where nothing else may."""
    light = {i for i, link in enumerate(parts.links) if not np.any(link.inertia)}
    light -= {body for edge in (*parts.spans, *parts.forces) for body in (edge.body1, edge.body2)}
    if not light:
        return []
    known = {(edge, k) for tie in attaching.ties for edge, k, _ in tie.terms}
    for i in range(len(parts.links)):
        own = range(int(mechanism.dim[i]))
        known |= {(i, k) for k in own if (at := int(mechanism.r_at[i]) + k) < len(mechanism.driven)
                  and (mechanism.driven[at] or mechanism.armature[at] > 0.0)}  # fmt: skip
    free = [np.delete(of, [k for edge, k in known if edge == i], axis=1) for i, of in enumerate(twists)]
    return loose_links(edges, free, frames, light, length, alone=alone)


def _nodes(model: Model, parts: Parts) -> Table[EntropyNode]:
    nodes = EntropyNode.table(len(parts.entropies) + len(parts.network.states))
    for k, state in enumerate(parts.network.states, start=len(parts.entropies)):
        nodes[k].component, nodes[k].free = PLAIN, int(state.quantity.kind != "entropy")
    for k, number in enumerate(parts.entropies.values()):
        primitive, node = model.descriptor.components[number].primitive, nodes[k]
        node.component = -1 if isinstance(primitive, Storage) and primitive.environment else number
        if node.component >= 0 and (law := exponential_law(primitive)) is not None:
            node.c1, node.c2 = law
    return nodes


def _tables(
    model: Model,
    parts: Parts,
    edges: tuple[Edge, ...],
    kinds: Index,
    forward: list[bool],
    order: list[int],
    made: tuple[Path, ...],
    flows: tuple[Index, ...],
    frames: list[Array],
    twists: list[Array],
) -> MechanismTables:
    links, count = len(order), len(edges)
    place = {body: i for i, body in enumerate(order)} | {GROUND: GROUND}
    parents = [place[e.body1 if f else e.body2] for e, f in zip(edges[:links], forward, strict=True)]
    basis, left, normal = (np.zeros((count, 6, 6)) for _ in range(3))
    rows, q_at, r_at = np.zeros(count, dtype=int), np.zeros(count, dtype=int), np.zeros(count, dtype=int)
    length = _length(edges)
    at_q = at_r = 0
    driven: list[int] = []
    spring, several, friction, heat = (np.full(count, -1) for _ in range(4))
    shared = np.zeros(count, dtype=np.int64)
    support, reach = np.zeros(count, dtype=np.int64), np.zeros((count, 9))
    for i, (edge, kind) in enumerate(zip(edges, kinds, strict=True)):
        b, d = edge.pair.basis, edge.pair.dim
        basis[i, :, :d], left[i, :d] = b, left_inverse(edge.pair)
        if kind == CUT:
            found = _complement(b, loop_algebra(i, edges, parents, place, twists, frames[i]), length)
            rows[i] = len(found)
            normal[i, : len(found)] = found
        if kind != SPRING:
            q_at[i], r_at[i] = at_q, at_r
            at_q, at_r = at_q + edge.pair.size, at_r + d
        if kind == TREE:
            driven += [int(edge.motion is not None)] * d
        heat[i] = edge.heat
        stored = 0 if edge.spring < 0 else len(model.descriptor.components[edge.spring].reads)
        spring[i] = -1 if stored != 1 or _stores_nothing(model, edge.spring) else edge.spring
        several[i], shared[i] = (edge.spring, 0 if edge.place else stored) if stored > 1 else (-1, 0)
        idle = edge.friction < 0 or _idle(model, edge.friction) or (edge.place > 0 and _shared(model, edge.friction))
        friction[i] = -1 if idle else edge.friction
        if kind == SPRING:
            support[i], reach[i] = _support(model, [c for c in (spring[i], friction[i]) if c >= 0])
    t, components = model.tables, model.descriptor.components
    armature = np.zeros(len(driven))
    for one in parts.network.inertias:
        edge = parts.attached[parts.network.rates[one.rate][0]]
        armature[r_at[next(i for i, other in enumerate(edges) if other is edge)]] += one.inertia * one.ratio**2
    making = {path: i for i, path in reversed(list(enumerate(made)))}
    sinks = [
        [making[components[e.friction].path], e.heat, making[components[e.friction].path]]
        for e, c in zip(edges, friction.tolist(), strict=True)
        if c >= 0 or _strikes(model, e.friction)
    ]
    for called, mine in zip(parts.network.attached, flows, strict=True):
        sinks += [[int(flow), taken, int(mine[0])] for flow, (_, taken) in zip(mine, called.heated, strict=True)]
    storages = [(number, components[number].primitive) for number in parts.entropies.values()]
    owners = Counter(owner for _, _, owner in sinks)
    rubs = [0 <= taken < len(storages) and owners[owner] == 1 for _, taken, owner in sinks]
    acting = np.unique([*spring, *several, *friction, *_called(parts.network)]).astype(np.int64)
    return MechanismTables(
        parent=np.array(parents, dtype=np.int64),
        inertia=np.array([parts.links[body].inertia for body in order]).reshape(links, 6, 6),
        weight=np.array([parts.weights[body] for body in order], dtype=np.int64),
        kind=kinds,
        first=np.array([place[e.body1] for e in edges], dtype=np.int64),
        second=np.array([place[e.body2] for e in edges], dtype=np.int64),
        forward=np.array([*forward, *[True] * (count - links)], dtype=np.int64),
        code=np.array([e.pair.code for e in edges], dtype=np.int64),
        dim=np.array([e.pair.dim for e in edges], dtype=np.int64),
        q_at=q_at,
        q_size=np.array([e.pair.size for e in edges], dtype=np.int64),
        r_at=r_at,
        offset1=np.array([e.offset1 for e in edges]).reshape(count, 7),
        offset2=np.array([e.offset2 for e in edges]).reshape(count, 7),
        basis=basis,
        left=left,
        normal=normal,
        rows=rows,
        spring=spring,
        several=several,
        poses=shared,
        friction=friction,
        heat=heat,
        support=support,
        reach=reach,
        driven=np.array(driven, dtype=np.int64),
        armature=armature,
        node=np.array(
            [-1 if isinstance(p, Storage) and p.environment else i for i, p in storages]
            + [PLAIN] * len(parts.network.states),
            dtype=np.int64,
        ),
        conduction=np.array(parts.conduction, dtype=np.int64).reshape(-1, 3),
        sink=np.column_stack([np.array(sinks, dtype=np.int64).reshape(-1, 3), np.array(rubs, dtype=np.int64)]),
        address=t.address,
        resting=model.resting(acting[acting >= 0]),
        dims=t.dims,
        parameters=t.parameters,
        parameter_at=t.parameter_at,
        made_at=np.array([making.get(s.path, -1) for s in components], dtype=np.int64),
    )


def _called(network: Network) -> list[int]:
    """Components whose derivatives the network's flows do not need."""
    every = [number for number, _ in network.storages] + [one.component for one in network.attached]
    return [] if network.unknown else every


def _support(model: Model, parts: list[int]) -> tuple[int, Sequence[float]]:
    """Where what acts in a spring vanishes, and from where on (9,); 0 where that is not said, or not alike by all."""
    primitives = [model.descriptor.components[part].primitive for part in parts]
    said = {p.support if isinstance(p, Storage | Irreversible) else None for p in primitives}
    found = said.pop() if len(said) == 1 else None
    if found is None:
        return 0, [0.0] * 9
    boxes = found.halves or (0.0,) * 6
    across = boxes[0], boxes[1], boxes[3], boxes[4]
    distant = (APART if any(across) else ALONG) if found.halves else BEYOND
    kind = {HEIGHT: ABOVE, PLACE: distant}.get(found.places, 0)
    return kind, [found.limit, found.margin, *boxes, found.parallel]


def _length(edges: tuple[Edge, ...]) -> float:
    """Mean distance of joints from their bodies' centres: the length that makes rotations comparable to distances."""
    far = [float(np.linalg.norm(offset[4:])) for edge in edges for offset in (edge.offset1, edge.offset2)]
    return float(np.mean([x for x in far if x > 0.0])) if any(x > 0.0 for x in far) else 1.0


def _complement(basis: Array, group: Array, length: float) -> Array:
    """Rows (k − d, 6) that vanish on the columns of B, d of k in a group's algebra; rotations count times a length."""
    scale = np.array([length] * 3 + [1.0] * 3)
    whole = np.linalg.qr(scale[:, None] * group)[0] if group.shape[1] < 6 else np.eye(6)
    if basis.shape[1]:
        left, sizes, _ = svd(whole.T @ (scale[:, None] * basis))
        whole = whole @ left[:, sizes.size :]
    return scale * whole.T


def _idle(model: Model, component: int) -> bool:
    """Whether a joint's friction or a damper resists nothing, as a hard contact between its impulses."""
    primitive = model.descriptor.components[component].primitive
    if isinstance(primitive, Irreversible) and isinstance(primitive.impulse, Meeting):
        return True
    entries: dict[str, Any] = dict(primitive.parameters)
    given = entries.get("mu", entries.get("damping"))
    return given is not None and not isinstance(given, str) and not np.any(given)


def _shared(model: Model, component: int) -> bool:
    """Whether it resists the rates of several joints."""
    return len(model.descriptor.components[component].reads) > 1


def _strikes(model: Model, component: int) -> bool:
    """Whether a process has impulses."""
    primitive = None if component < 0 else model.descriptor.components[component].primitive
    return isinstance(primitive, Irreversible) and primitive.impulse is not None


def _stores_nothing(model: Model, component: int) -> bool:
    kernel = model.descriptor.components[component].primitive.kernel
    return kernel is not None and kernel.name == "no_effort"
