"""Forces on a mechanism as arrays: from the tables of a reduced scene to the records of the engine."""

from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from ephs.mechanics.tree.sweeps.acting import BEYOND, Acting, Body, Component, Conduction, Node, Port, Sink
from ephs.semantics.bundle import Array
from ephs.semantics.stage import Record, Table
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals
from ephs.solve.sparse import Index

ROUNDING: Final = 1e-12
"""Relative error of coordinates in the distance beyond which no point of a contact acts."""


class Forces(NamedTuple):
    """Forces besides inertia and gravity: components of joints and springs, entropies, wrenches on bodies."""

    edge: Index  # (edges, 8): kind, link of body 1, of body 2, freedoms, place of q, its size, place of r, cut joint
    part: Index  # (edges, 4): component of the potential, of friction, entropy that takes its heat, −1: none; support
    frame: Array  # (edges, 24): rows of R and p of both joint frames in their links' frames
    left: Array  # (edges, 36): (BᵀB)⁻¹Bᵀ, row by row
    reach: Array  # (edges, 9): from where on nothing acts; margin and half lengths of boxes, angle of segments
    body: Index  # (bodies,): link on which the wrench acts, −1: none does
    body_frame: Array  # (bodies, 12): R and p of the body in its link's frame
    node: Table[Node]
    conduction: Index  # (conductions, 3): component, entropy, entropy
    sink: Index  # (sinks, 4): see `ephs.mechanics.tree.sweeps.acting.Sink`
    port: Index  # (rates, 3): place of the freedom, edge, freedom in it
    component: Table[Component]  # with their relations over a step
    resting: Table[Component]  # with those at rest, without derivatives
    parameters: Array

    def tables(self) -> dict[str, Any]:
        """Return the records of the engine, by name."""
        inner, inner_at, outer, outer_at = np.split(self.frame, [9, 12, 21], axis=1)
        points, around = contacts(np.hstack([self.edge[:, :3], self.part[:, 3:]]), inner_at, outer_at, self.reach[:, 0])
        return {
            "acting": table_of(
                Acting,
                np.hstack([self.edge[:, :1], self.part[:, 3:], self.edge[:, 1:], self.part[:, :3], points]),
                np.hstack([inner_at, outer_at, self.reach[:, :2], inner, outer, self.reach[:, 2:], self.left, around]),
            ),
            "body": table_of(Body, self.body[:, None], self.body_frame),
            "node": self.node,
            "conduction": table_of(Conduction, self.conduction),
            "sink": table_of(Sink, self.sink),
            "port": table_of(Port, self.port),
            "component": self.resting,
            "parameters": self.parameters,
        }


def contacts(edge: Index, inner: Array, outer: Array, reach: Array) -> tuple[Index, Array]:
    """``points`` (edges, 1), and ``middles`` and ``spread`` (edges, 7), of `Acting`, by kind, links and support."""
    points, around = np.zeros((len(edge), 1), dtype=np.int64), np.zeros((len(edge), 7))
    key = np.hstack([edge[:, :3], edge[:, 3:] >= BEYOND])
    starts = np.flatnonzero(np.any(np.diff(key, axis=0, prepend=-2), axis=1)).tolist()
    for start, end in pairwise([*starts, len(edge)]):
        if edge[start, 3] >= BEYOND and end - start > 1:
            ends = inner[start:end], outer[start:end]
            middles = [0.5 * (each.min(axis=0) + each.max(axis=0)) for each in ends]
            far = [np.linalg.norm(each - middle, axis=1) for each, middle in zip(ends, middles, strict=True)]
            spread = (1.0 + ROUNDING) * (far[0] + far[1] + reach[start:end]).max()
            points[start], around[start] = end - start, [*middles[0], *middles[1], spread]
    return points, around


def table_of(record: type[Record], integers: Index, reals: Array | None = None) -> Table[Any]:
    """Return a table of records whose fields, in their order, are the columns of arrays."""
    size, numbers = len(integers), np.zeros(0) if reals is None else np.ascontiguousarray(reals).ravel()
    whole = np.ascontiguousarray(integers, dtype=np.int64).ravel()
    return Table(record, ArrayIntegers(whole), ArrayReals(numbers), size)


def copied(rows: Table[Any]) -> Table[Any]:
    """Return a table with integers of its own, and the same numbers."""
    return Table(rows.record, ArrayIntegers(rows.arrays[0].copy()), rows.reals, rows.size)
