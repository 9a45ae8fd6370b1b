"""Joints as edges between links, the spanning tree of least cost, and what carries the motion of a loop."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.constraints.subgroup import generated
from ephs.operad import Path
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3, Pair
from ephs.solve.posing.motion_law import MotionLaw


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
    motion
        The motion law of a single degree of freedom, or None.
    freedoms
        Which of the joint's degrees of freedom this edge has: a universal joint is two edges.
    state
        Of its element: the joint's relative pose, or the pose of a body that is free; None where that is not stored.
    port
        Outer port of its momentum, or None.
    spring, friction, heat
        Components of its potential and its friction, and the entropy that the latter heats; −1 where there is none.
    place
        Place of the edge's relative pose among those that its potential stores.
    """

    name: str
    path: Path | None
    body1: int
    body2: int
    offset1: Array
    offset2: Array
    pair: Pair
    motion: MotionLaw | None
    freedoms: slice
    state: Path | None
    port: Path | None
    spring: int
    friction: int
    heat: int
    place: int = 0


def frames_of_joints(edges: Sequence[Edge], elements: Sequence[Array], poses: Sequence[Array | None]) -> list[Array]:
    """The pose in the world of each joint's frame on body 2, where joints have these elements and bodies these poses.

    A frame without one follows from the other body of a joint.
    """
    known = {body: pose for body, pose in enumerate(poses) if pose is not None} | {-1: SE3.identity()}
    out: dict[int, Array] = {}
    left = deque(range(len(edges)))
    while left:
        before = len(left)
        for _ in range(before):
            i = left.popleft()
            edge = edges[i]
            relative = edge.pair.include(elements[i])
            if edge.body2 in known:
                out[i] = edge.offset2 if edge.body2 < 0 else SE3.compose(known[edge.body2], edge.offset2)
            elif edge.body1 in known:
                first = edge.offset1 if edge.body1 < 0 else SE3.compose(known[edge.body1], edge.offset1)
                out[i] = SE3.compose(first, relative)
                known[edge.body2] = SE3.compose(out[i], SE3.inverse(edge.offset2))
            else:
                left.append(i)
                continue
            if edge.body1 not in known:
                first = SE3.compose(out[i], SE3.inverse(relative))
                known[edge.body1] = SE3.compose(first, SE3.inverse(edge.offset1))
        if len(left) == before:  # bodies that nothing ties to one with a pose
            known[edges[left[0]].body1] = SE3.identity()
    return [out[i] for i in range(len(edges))]


def twists_of(edges: Sequence[Edge], frames: Sequence[Array]) -> list[Array]:
    """The degrees of freedom of joints in the world, where these have such frames; springs come behind them."""
    return [SE3.adjoint(frame) @ edge.pair.basis for edge, frame in zip(edges, frames, strict=False)]


def _depths(start: int, edges: Sequence[Edge]) -> dict[int, int]:
    """Least number of joints from a body, or the ground −1, to each body that is connected with it."""
    beside: dict[int, list[int]] = {}
    for edge in edges:
        beside.setdefault(edge.body1, []).append(edge.body2)
        beside.setdefault(edge.body2, []).append(edge.body1)
    depth, queue = {start: 0}, deque([start])
    while queue:
        here = queue.popleft()
        for there in beside.get(here, []):
            if there not in depth:
                depth[there] = depth[here] + 1
                queue.append(there)
    return depth


def islands(count: int, edges: Sequence[Edge]) -> list[list[int]]:
    """The bodies of each group that has no joint with the ground, in order."""
    groups = DisjointSets[int]()
    for edge in edges:
        groups.join(edge.body1, edge.body2)
    found: dict[int, list[int]] = {}
    for body in range(count):
        if groups.leader(body) != groups.leader(-1):
            found.setdefault(groups.leader(body), []).append(body)
    return sorted(found.values())


def spanning_tree(
    joints: Sequence[Edge], light: Sequence[bool], inertial: Sequence[Edge] = ()
) -> tuple[list[tuple[Edge, int, bool]], list[Edge]]:
    """The tree as (edge, body that it leads to, walked forward), parents first; and the edges left.

    Prescribed joints, those of frames without mass and those with inertia of their own come into the tree first, then
    those of few degrees of freedom: a joint of many degrees of freedom costs the fewest constraints where it is cut.
    Among equals those near the ground come first: then branches are short, and few loops are open at one body.
    """
    depth = _depths(-1, joints)
    groups = DisjointSets[int]()

    weighty = {id(edge) for edge in inertial}

    def cost(edge: Edge) -> tuple[bool, bool, bool, int, int]:
        beside = any(body >= 0 and light[body] for body in (edge.body1, edge.body2))
        near = min(depth[edge.body1], depth[edge.body2])
        return edge.motion is None, not beside, id(edge) not in weighty, edge.pair.dim, near

    kept: list[Edge] = []
    cut: list[Edge] = []
    for edge in sorted(joints, key=cost):
        (kept if groups.join(edge.body1, edge.body2) else cut).append(edge)
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


def loop_algebra(
    cut: int, edges: Sequence[Edge], parents: list[int], place: Mapping[int, int], twists: list[Array], frame: Array
) -> Array:
    """(6, k): the algebra, in the ``frame`` C2 of a cut joint, of the group that the joints of its loop generate.

    The bodies of the loop never leave it relative to each other, so rows beyond it would say nothing.
    """
    ends = [place[edges[cut].body1], place[edges[cut].body2]]
    passed: list[int] = []
    while ends[0] != ends[1]:
        later = int(ends[1] > ends[0])
        passed.append(ends[later])
        ends[later] = parents[ends[later]]
    seen = SE3.adjoint(SE3.inverse(frame)) @ np.column_stack([twists[i] for i in [*passed, cut]])
    return generated(seen.T).basis
