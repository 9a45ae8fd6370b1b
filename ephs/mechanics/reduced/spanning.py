"""Joints as edges between links, the spanning tree of least cost, and what carries the motion of a loop."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import networkx as nx
import numpy as np

from ephs.mechanics.build import component_path, contact_points
from ephs.mechanics.reduction.subgroup import generated
from ephs.mechanics.scene.model import IDENTITY_POSE, Scene
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import SE3, Pair, pair

__all__ = ["Edge", "joints_of", "loop_algebra", "spanning_tree", "springs_of", "twists_of"]

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


def _frame2(edge: Edge, poses: list[Array]) -> Array:
    """The pose in the world of a joint's frame on body 2, where bodies have these poses."""
    if edge.body2 < 0:
        return edge.offset2
    if edge.body2 < len(poses):
        return SE3.compose(poses[edge.body2], edge.offset2)
    # a frame inside a universal joint has no pose, but the other body of its joint does
    one = edge.offset1 if edge.body1 < 0 else SE3.compose(poses[edge.body1], edge.offset1)
    return SE3.compose(one, edge.pair.include(edge.coordinate))


def twists_of(edges: list[Edge], joints: int, poses: list[Array]) -> list[Array]:
    """The freedoms of all joints in the world, where bodies have these poses; none of springs."""
    out: list[Array] = []
    for edge in edges[:joints]:
        out.append(SE3.adjoint(_frame2(edge, poses)) @ edge.pair.basis)
    return out + [np.zeros((6, 0))] * (len(edges) - joints)


def joints_of(scene: Scene, number: Mapping[str, int], masses: list[float]) -> list[Edge]:
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


def spanning_tree(joints: list[Edge], masses: list[float]) -> tuple[list[tuple[Edge, int, bool]], list[Edge]]:
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


def springs_of(scene: Scene, number: Mapping[str, int]) -> list[Edge]:
    """Springs between points and contacts, as edges with all freedoms."""
    out: list[Edge] = []
    for name, s in scene.all_springs():
        frames = [np.concatenate([[1.0, 0.0, 0.0, 0.0], np.asarray(at, dtype=float)]) for at in (s.at1, s.at2)]
        path, ends = component_path("springs", name), (number[s.body1], number[s.body2])
        one, two = frames
        out.append(Edge(name, path, *ends, one, two, FREE, None, SE3.identity(), slice(0, 6)))
    for name, c in scene.all_contacts():
        bodies, points = contact_points(scene, c)
        ends = number[bodies[0]], number[bodies[1]]
        for i, (one, two, _) in enumerate(points):
            path = component_path("contacts", name) / f"point{i}"
            out.append(Edge(name, path, *ends, one, two, FREE, None, SE3.identity(), slice(0, 6)))
    return out


def loop_algebra(
    cut: int, edges: list[Edge], parents: list[int], place: Mapping[int, int], twists: list[Array], poses: list[Array]
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
    seen = SE3.adjoint(SE3.inverse(_frame2(edges[cut], poses))) @ np.column_stack([twists[i] for i in [*passed, cut]])
    return generated(seen.T).basis
