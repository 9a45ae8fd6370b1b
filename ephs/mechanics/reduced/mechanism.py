"""From a scene to the tables of its reduced form: a spanning tree of joints, the rest cut."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.build import component_path
from ephs.mechanics.engine.records import Node
from ephs.mechanics.reduced.spanning import Edge, joints_of, loop_algebra, spanning_tree, springs_of, twists_of
from ephs.mechanics.reduced.tables import CUT, SPRING, TREE, Mechanism, Workspace, row_addresses
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.heats import exponential_law
from ephs.mechanics.solve.model import Model
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible, Storage
from ephs.semantics.spaces import pair
from ephs.semantics.stage import Table

__all__ = ["Reduced", "reduce_scene"]

FREE = pair("free")


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
    nodes
        What stores entropy, in the order of s.
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
    nodes: Table[Node]
    unknowns: int
    twists: tuple[Array, ...]

    @property
    def cut(self) -> tuple[Edge, ...]:
        """The joints at which loops are closed by constraints."""
        return tuple(e for e, kind in zip(self.edges, self.tables.kind, strict=True) if kind == CUT)

    @property
    def coordinates(self) -> int:
        """Number of reals that store the joints' elements."""
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
            "scaled": (m, n), "plain": (m, n),
            "triangle": (m, m), "step": (max(n, m),), "temperature": (max(t.node.size, 1),), "multiplier": (m,),
            "small": (512,), "matrix": (6, 6), "scratch": (2048,), "e": (16,), "f": (256,), "c": (16,), "jac": (512,),
        }  # fmt: skip
        arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
        linear = row_addresses() if dense else np.zeros(0, dtype=np.int64)
        return Workspace(**arrays, chosen=np.zeros(m, dtype=np.int64), linear=linear)


def reduce_scene(scene: Scene, problem: Problem, model: Model) -> Reduced:
    """The tables of a scene's reduced form; the kernels of its components are those of the compiled model."""
    names = [name for name, _ in scene.all_bodies()]
    number = {name: i for i, name in enumerate(names)} | {GROUND: -1}
    masses = [body.mass for _, body in scene.all_bodies()]
    joints = joints_of(scene, number, masses)
    poses = [np.array(body.pose) for _, body in scene.all_bodies()]
    tree, cut = spanning_tree(joints, masses)
    over = [edge.name for edge in cut if edge.motion is not None]
    if over:  # prescribed joints are cut last: only a loop of nothing else is left over
        found = f"that of {', '.join(over)}, which closes a loop of prescribed joints"
        raise OptionError("motion", found, "one joint of each loop without prescribed motion, or the method natural")
    order = [child for _, child, _ in tree]
    place = {body: i for i, body in enumerate(order)} | {-1: -1}
    springs = springs_of(scene, number)
    edges = [edge for edge, _, _ in tree] + cut + springs
    twists = twists_of(edges, len(tree) + len(cut), poses)
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
        poses,
    )
    bodies = tuple(names[b] if b < len(names) else None for b in order)
    n = int(mechanism.driven.size)
    rows = int(mechanism.rows.sum())
    return Reduced(
        mechanism,
        tuple(edges),
        bodies,
        len(order),
        tuple(entropies),
        made,
        _nodes(model, entropies),
        2 * n + rows,
        tuple(twists),
    )


def _nodes(model: Model, entropies: Mapping[Path, tuple[int, int]]) -> Table[Node]:
    nodes = Node.table(len(entropies))
    for k, (path, (number, _)) in enumerate(entropies.items()):
        primitive, node = model.descriptor.components[number].primitive, nodes[k]
        if isinstance(primitive, Storage) and primitive.environment:
            node.component = -1
            continue
        node.component = number
        law = exponential_law(primitive)
        if law is None:
            found = f"heat of {path} with the law of {primitive.name}"
            raise OptionError("method", found, "natural, or capacities whose energies are exponential")
        node.c1, node.c2 = law
    return nodes


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
    poses: list[Array],
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
            found = _complement(b, loop_algebra(i, edges, parents, place, twists, poses), length)
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
    resists = set(resisting.tolist())
    conduction = [
        (i, *(place_of[effort] for effort in slot.efforts))
        for i, slot in enumerate(model.descriptor.components)
        if isinstance(slot.primitive, Irreversible) and len(slot.efforts) == 2 and i not in resists
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
        sink=np.array(
            [
                [made.index(model.descriptor.components[c].path), taking]
                for c, taking in zip(friction.tolist(), heat.tolist(), strict=True)
                if c >= 0
            ],
            dtype=np.int64,
        ).reshape(-1, 2),
        address=t.address,
        dims=t.dims,
        parameters=t.parameters,
        parameter_at=t.parameter_at,
        made_at=np.array(
            [made.index(s.path) if s.path in made else -1 for s in model.descriptor.components], dtype=np.int64
        ),
    )


def _length(edges: list[Edge]) -> float:
    """Mean distance of joints from their bodies' centres: the length that makes rotations comparable to distances."""
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
