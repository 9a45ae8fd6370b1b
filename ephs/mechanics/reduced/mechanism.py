"""From a scene to the tables of its reduced form: a spanning tree of joints, the rest cut."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import networkx as nx
import numpy as np

from ephs.mechanics.build import component_path
from ephs.mechanics.reduced.tables import CUT, SPRING, TREE, Mechanism, Workspace
from ephs.mechanics.reduction.subgroup import generated
from ephs.mechanics.scene.model import GROUND, IDENTITY_POSE, Scene
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.model import Model
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible, Storage
from ephs.semantics.spaces import SE3, Pair, pair

__all__ = ["Edge", "Reduced", "reduce_scene"]

FREE = pair("free")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A joint between two links, or a spring.

    Parameters
    ----------
    name
        Of the joint, as inputs and messages call it.
    path
        Of its box in the system; None for the free joint that no box stands for.
    body1, body2
        Numbers of the links, −1 for the ground.
    freedoms
        Which of the joint's freedoms this edge has: a universal joint is two edges.
    """

    name: str
    path: Path | None
    body1: int
    body2: int
    offset1: Array
    offset2: Array
    pair: Pair
    motion: float | None
    coordinate: Array
    freedoms: slice


@final
@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """A scene in joint coordinates.

    Parameters
    ----------
    edges
        Tree joints in walking order, each of which leads to the link of its number; cut joints; springs.
    bodies
        Link -> name of the body, None for the frame inside a universal joint.
    entropies
        Paths of the states of entropy, in the order of s.
    made
        Paths of the components that make entropy.
    unknowns
        How many numbers have to be found.
    twists
        Of each edge, (6, d): its freedoms in the world, at the initial configuration.
    """

    tables: Mechanism
    edges: tuple[Edge, ...]
    bodies: tuple[str | None, ...]
    links: int
    entropies: tuple[Path, ...]
    made: tuple[Path, ...]
    unknowns: int
    twists: tuple[Array, ...]

    @property
    def cut(self) -> tuple[Edge, ...]:
        """The joints at which loops are closed by constraints."""
        return tuple(e for e, kind in zip(self.edges, self.tables.kind, strict=True) if kind == CUT)

    @property
    def coordinates(self) -> int:
        """How many numbers the joints' elements are stored as."""
        return sum(int(size) for size, kind in zip(self.tables.q_size, self.tables.kind, strict=True) if kind != SPRING)

    @property
    def freedoms(self) -> int:
        """The number of the tree's freedoms."""
        return int(self.tables.driven.size)

    def workspace(self, *, dense: bool) -> Workspace:
        """Scratch memory for one thread; dense: with the matrices of all freedoms and constraints."""
        t = self.tables
        links, edges, n, m = self.links, len(self.edges), self.freedoms, int(t.rows.sum()) + int(t.driven.sum())
        n, m = (n, m) if dense else (0, 0)
        shapes: dict[str, tuple[int, ...]] = {
            "pose": (links, 7), "inner": (links, 7), "twist": (links, 6), "bias": (links, 6), "load": (links, 6),
            "composite": (links, 6, 6), "motion": (edges, 6, 6), "relative": (edges, 7), "rate": (edges, 6),
            "mass": (n, n), "factor": (n, n), "force": (n,), "row": (m, n), "size": (m,), "target": (m,),
            "scaled": (m, n),
            "triangle": (m, m), "step": (max(n, m),), "temperature": (max(t.node.size, 1),), "multiplier": (m,),
            "small": (512,), "matrix": (6, 6), "scratch": (2048,), "e": (16,), "f": (256,), "c": (16,), "jac": (512,),
        }  # fmt: skip
        arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
        return Workspace(**arrays, chosen=np.zeros(m, dtype=np.int64))


def reduce_scene(scene: Scene, problem: Problem, model: Model) -> Reduced:
    """The tables of a scene's reduced form; the kernels of its components are those of the compiled model."""
    names = [name for name, _ in scene.all_bodies()]
    number = {name: i for i, name in enumerate(names)} | {GROUND: -1}
    masses = [body.mass for _, body in scene.all_bodies()]
    joints = _joints(scene, number, masses)
    poses = [np.array(body.pose) for _, body in scene.all_bodies()]
    tree, cut = _spanning(joints, masses)
    over = [edge.name for edge in cut if edge.motion is not None]
    if over:  # prescribed joints are cut last: only a loop of nothing else is left over
        found = f"that of {', '.join(over)}, which closes a loop of prescribed joints"
        raise OptionError("motion", found, "one joint of each loop without prescribed motion, or the method natural")
    order = [child for _, child, _ in tree]
    place = {body: i for i, body in enumerate(order)} | {-1: -1}
    springs = _springs(scene, number)
    edges = [edge for edge, _, _ in tree] + cut + springs
    twists = _twists(edges, len(tree) + len(cut), poses)
    kinds = [TREE] * len(tree) + [CUT] * len(cut) + [SPRING] * len(springs)
    component = {slot.path: i for i, slot in enumerate(problem.descriptor.components)}
    entropies = _entropies(problem)
    made = tuple(slot.path for slot in problem.descriptor.components if isinstance(slot.primitive, Irreversible))
    parents = [place[edge.body1 if forward else edge.body2] for edge, _, forward in tree]
    mechanism = _tables(
        scene,
        model,
        edges,
        kinds,
        [f for *_, f in tree],
        parents,
        order,
        place,
        component,
        entropies,
        made,
        names,
        twists,
    )
    bodies = tuple(names[b] if b < len(names) else None for b in order)
    n = int(mechanism.driven.size)
    rows = int(mechanism.rows.sum())
    return Reduced(mechanism, tuple(edges), bodies, len(order), tuple(entropies), made, 2 * n + rows, tuple(twists))


def _twists(edges: list[Edge], joints: int, poses: list[Array]) -> list[Array]:
    """The freedoms of all joints in the world, where bodies have these poses; none of springs."""
    ground = SE3.identity()
    known = dict(enumerate(poses)) | {-1: ground}
    out: list[Array] = []
    for edge in edges[:joints]:
        if edge.body2 in known:  # a frame inside a universal joint has no pose, but one of its joints' bodies does
            frame = SE3.compose(known[edge.body2], edge.offset2)
        else:
            frame = SE3.compose(SE3.compose(known[edge.body1], edge.offset1), edge.pair.include(edge.coordinate))
        out.append(SE3.adjoint(frame) @ edge.pair.basis)
    return out + [np.zeros((6, 0))] * (len(edges) - joints)


def _joints(scene: Scene, number: Mapping[str, int], masses: list[float]) -> list[Edge]:
    """All joints as edges; universal ones as two, with a frame without mass between them."""
    out: list[Edge] = []
    own = {name for name, _ in scene.all_joints()}
    for name, j in [*scene.all_joints(), *scene.implicit_joints()]:
        at = component_path("joints", name) if name in own else None
        first, second = number[j.body1], number[j.body2]
        if j.middle is None:
            kind = pair(j.kind, pitch=j.pitch) if j.kind == "screw" else pair(j.kind)
            out.append(
                Edge(
                    name, at, first, second, np.array(j.frame1), np.array(j.frame2), kind, j.motion,
                    np.array(j.coordinate), slice(0, kind.dim),
                )
            )  # fmt: skip
            continue
        between = len(masses)
        masses.append(0.0)
        revolute, unit = pair("revolute"), np.array(IDENTITY_POSE)
        halves = ((first, between, np.array(j.frame1), unit), (between, second, np.array(j.middle), np.array(j.frame2)))
        for i, (one, two, frame1, frame2) in enumerate(halves):
            path = None if at is None else at / ("first", "second")[i]
            where = slice(i, i + 1)
            given = np.array(j.coordinate)[where]
            out.append(Edge(name, path, one, two, frame1, frame2, revolute, j.motion, given, where))
    reached = _islands(len(masses), out)
    poses = {number[name]: body.pose for name, body in scene.all_bodies()}
    for body in reached:  # a group of bodies that nothing ties to the ground moves with its first one
        out.append(
            Edge("", None, -1, body, np.array(IDENTITY_POSE), np.array(IDENTITY_POSE), FREE, None,
                 np.array(poses[body]), slice(0, 6))
        )  # fmt: skip
    return out


def _graph(count: int, edges: list[Edge]) -> nx.Graph:
    """Bodies and the ground, −1, with an edge where there is a joint."""
    graph = nx.Graph()
    graph.add_nodes_from(range(-1, count))
    graph.add_edges_from((edge.body1, edge.body2) for edge in edges)
    return graph


def _islands(count: int, edges: list[Edge]) -> list[int]:
    """The first body of each group that has no joint with the ground."""
    return sorted(min(group) for group in nx.connected_components(_graph(count, edges)) if -1 not in group)


def _spanning(joints: list[Edge], masses: list[float]) -> tuple[list[tuple[Edge, int, bool]], list[Edge]]:
    """The tree as (edge, body that it leads to, walked forward), parents first; and the edges left.

    Prescribed joints and those of frames without mass come into the tree first, then those of few freedoms: a joint of
    many freedoms costs the fewest constraints where it is cut. Among equals those near the ground come first: then
    branches are short, and few loops are open at one body.
    """
    depth = nx.single_source_shortest_path_length(_graph(len(masses), joints), -1)
    groups = nx.utils.UnionFind(range(-1, len(masses)))

    def cost(edge: Edge) -> tuple[bool, bool, int, int]:
        light = any(body >= 0 and masses[body] == 0.0 for body in (edge.body1, edge.body2))
        return (edge.motion is None, not light, edge.pair.dim, min(depth[edge.body1], depth[edge.body2]))

    kept: list[Edge] = []
    cut: list[Edge] = []
    for edge in sorted(joints, key=cost):
        if groups[edge.body1] == groups[edge.body2]:
            cut.append(edge)
        else:
            groups.union(edge.body1, edge.body2)
            kept.append(edge)
    at: dict[int, list[Edge]] = {}
    for edge in kept:
        at.setdefault(edge.body1, []).append(edge)
        at.setdefault(edge.body2, []).append(edge)
    out: list[tuple[Edge, int, bool]] = []
    queue, reached = deque([-1]), {-1}
    while queue:
        here = queue.popleft()
        for edge in at.get(here, []):
            there = edge.body2 if edge.body1 == here else edge.body1
            if there not in reached:
                reached.add(there)
                queue.append(there)
                out.append((edge, there, edge.body1 == here))
    return out, cut


def _springs(scene: Scene, number: Mapping[str, int]) -> list[Edge]:
    out: list[Edge] = []
    for name, s in scene.all_springs():
        frames = [np.concatenate([[1.0, 0.0, 0.0, 0.0], np.asarray(at, dtype=float)]) for at in (s.at1, s.at2)]
        path, ends = component_path("springs", name), (number[s.body1], number[s.body2])
        one, two = frames
        out.append(Edge(name, path, *ends, one, two, FREE, None, SE3.identity(), slice(0, 6)))
    return out


def _entropies(problem: Problem) -> dict[Path, tuple[int, int]]:
    """State of an entropy -> (component that stores it, effort at its junction)."""
    return {
        slot.path / port: (number, slot.efforts[where.start])
        for number, slot in enumerate(problem.descriptor.components)
        if isinstance(slot.primitive, Storage)
        for port, where, quantity in slot.primitive.bundle.items()
        if quantity.kind == "entropy"
    }


def _tables(
    scene: Scene,
    model: Model,
    edges: list[Edge],
    kinds: list[int],
    forward: list[bool],
    parents: list[int],
    order: list[int],
    place: Mapping[int, int],
    component: Mapping[Path, int],
    entropies: Mapping[Path, tuple[int, int]],
    made: tuple[Path, ...],
    names: list[str],
    twists: list[Array],
) -> Mechanism:
    links, count = len(order), len(edges)
    inertia = np.zeros((links, 6, 6))
    weight = np.full(links, -1)
    bodies = dict(scene.all_bodies())
    for i, body in enumerate(order):
        if body < len(names):
            b = bodies[names[body]]
            inertia[i, :3, :3], inertia[i, 3:, 3:] = b.inertia, b.mass * np.eye(3)
            if b.mass > 0.0 and np.any(scene.world.gravity):
                weight[i] = component[component_path("bodies", names[body]) / "pe"]
    basis, left, normal = (np.zeros((count, 6, 6)) for _ in range(3))
    rows, q_at, r_at = np.zeros(count, dtype=int), np.zeros(count, dtype=int), np.zeros(count, dtype=int)
    length = _length(edges)
    place_of = {effort: i for i, (_, effort) in enumerate(entropies.values())}
    at_q = at_r = 0
    driven: list[int] = []
    spring, friction, resisting, heat = (np.full(count, -1) for _ in range(4))
    for i, (edge, kind) in enumerate(zip(edges, kinds, strict=True)):
        b, d = edge.pair.basis, edge.pair.dim
        basis[i, :, :d], left[i, :d] = b, np.linalg.pinv(b)
        if kind == CUT:
            found = _complement(b, _loop(i, edges, parents, place, twists, scene), length)
            rows[i] = len(found)
            normal[i, : len(found)] = found
        if kind != SPRING:
            q_at[i], r_at[i] = at_q, at_r
            at_q, at_r = at_q + edge.pair.size, at_r + d
        if kind == TREE:
            driven += [int(edge.motion is not None)] * d
        if edge.path is not None:
            spring[i], resisting[i], heat[i] = _parts(model, component, place_of, edge.path)
            friction[i] = -1 if _idle(model, resisting[i]) else resisting[i]
    conduction = [
        (i, *(place_of[effort] for effort in slot.efforts))
        for i, slot in enumerate(model.descriptor.components)
        if isinstance(slot.primitive, Irreversible) and len(slot.efforts) == 2 and i not in resisting
    ]
    t = model.tables
    storages = [(i, model.descriptor.components[i].primitive) for i, _ in entropies.values()]
    return Mechanism(
        parent=np.array(parents, dtype=np.int64),
        inertia=inertia,
        weight=weight.astype(np.int64),
        kind=np.array(kinds, dtype=np.int64),
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
        friction=friction,
        heat=heat,
        driven=np.array(driven, dtype=np.int64),
        node=np.array([-1 if isinstance(p, Storage) and p.environment else i for i, p in storages], dtype=np.int64),
        conduction=np.array(conduction, dtype=np.int64).reshape(-1, 3),
        address=t.address,
        dims=t.dims,
        parameters=t.parameters,
        parameter_at=t.parameter_at,
        made_at=np.array(
            [made.index(s.path) if s.path in made else -1 for s in model.descriptor.components], dtype=np.int64
        ),
    )


def _length(edges: list[Edge]) -> float:
    """How far joints are from their bodies' centres, on the average: what makes rotations comparable to distances."""
    far = [float(np.linalg.norm(offset[4:])) for edge in edges for offset in (edge.offset1, edge.offset2)]
    return float(np.mean([x for x in far if x > 0.0])) if any(x > 0.0 for x in far) else 1.0


def _complement(basis: Array, group: Array, length: float) -> Array:
    """Rows (k − d, 6) that vanish on the columns of B, d of k in a group's algebra; rotations count times a length."""
    scale = np.array([length] * 3 + [1.0] * 3)
    whole = np.linalg.qr(scale[:, None] * group)[0] if group.shape[1] < 6 else np.eye(6)
    if basis.shape[1]:
        left, sizes, _ = np.linalg.svd(whole.T @ (scale[:, None] * basis), full_matrices=True)
        whole = whole @ left[:, sizes.size :]
    return scale * whole.T


def _loop(
    cut: int, edges: list[Edge], parents: list[int], place: Mapping[int, int], twists: list[Array], scene: Scene
) -> Array:
    """(6, k): the algebra, in the frame C2 of a cut joint, of the group that the joints of its loop generate.

    The bodies of the loop never leave it relative to each other, so rows beyond it would say nothing.
    """
    ends = [place[edges[cut].body1], place[edges[cut].body2]]
    passed: list[int] = []
    while ends[0] != ends[1]:
        later = int(ends[1] > ends[0])
        passed.append(ends[later])
        ends[later] = parents[ends[later]]
    bodies = list(scene.all_bodies())
    edge = edges[cut]
    if 0 <= edge.body2 < len(bodies):
        frame = SE3.compose(np.array(bodies[edge.body2][1].pose), edge.offset2)
    else:  # the ground
        frame = edge.offset2
    seen = SE3.adjoint(SE3.inverse(frame)) @ np.column_stack([twists[i] for i in [*passed, cut]])
    return generated(seen.T).basis


def _idle(model: Model, component: int) -> bool:
    """Whether a joint's friction or a damper resists nothing."""
    entries: dict[str, Any] = dict(model.descriptor.components[component].primitive.parameters)
    given = entries.get("mu", entries.get("damping"))
    return given is not None and not isinstance(given, str) and not np.any(given)


def _parts(model: Model, component: Mapping[Path, int], efforts: Mapping[int, int], path: Path) -> tuple[int, int, int]:
    """(potential, friction, entropy that takes its heat) of a joint; −1 where there is no potential."""
    energy, friction = component[path / "pe"], component[path / "mf"]
    primitive = model.descriptor.components[energy].primitive
    idle = primitive.kernel is not None and primitive.kernel.name == "no_effort"
    return -1 if idle else energy, friction, efforts[model.descriptor.components[friction].efforts[-1]]
