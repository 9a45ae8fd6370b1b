"""Forces on a mechanism as arrays: from the tables of a reduced scene to the records of the engine."""

from typing import Any, Final, NamedTuple

import numpy as np

from ephs.mechanics.tree.sweeps.acting import (
    ABOVE,
    BEYOND,
    Acting,
    AttachedRate,
    CompiledComponent,
    ConductingComponent,
    EntropyNode,
    PushedBody,
    Sink,
)
from ephs.mechanics.tree.sweeps.grouping import Group, Middle
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Record, Table
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals
from ephs.solve.equations.sparse import Index

ROUNDING: Final = 1e-12
"""Relative error of coordinates in the distance beyond which no point of a contact acts."""


class Forces(NamedTuple):
    """Forces besides inertia and gravity: components of joints and springs, entropies, wrenches on bodies."""

    edge: Index  # (edges, 8): kind, link of body 1, of body 2, freedoms, place of q, its size, place of r, cut joint
    part: Index  # (edges, 4): component of the potential, of friction, entropy that takes its heat, −1: none; support
    shared: Index  # (edges, 3): component of a potential of several relative poses, −1: none; how many poses that
    # has, and how many friction resists, from here on
    frame: Array  # (edges, 24): rows of R and p of both joint frames in their links' frames
    left: Array  # (edges, 36): (BᵀB)⁻¹Bᵀ, row by row
    reach: Array  # (edges, 9): from where on nothing acts; margin and half lengths of boxes, angle of segments
    body: Index  # (bodies,): link on which the wrench acts, −1: none does
    body_frame: Array  # (bodies, 12): R and p of the body in its link's frame
    node: Table[EntropyNode]
    conduction: Index  # (conductions, 3): component, entropy, entropy
    sink: Index  # (sinks, 4): see `ephs.mechanics.tree.sweeps.acting.Sink`
    port: Index  # (rates, 3): place of the freedom, edge, freedom in it
    component: Table[CompiledComponent]  # with their relations at rest, without derivatives
    parameters: Array

    def tables(self) -> dict[str, Any]:
        """Return the records of the engine, by name."""
        inner, inner_at, outer, outer_at = np.split(self.frame, [9, 12, 21], axis=1)
        ends = np.hstack([self.edge[:, :3], self.part[:, 3:]])
        group, middle = groups_of(ends, inner.reshape(-1, 3, 3)[:, :, 2], inner_at, outer_at, self.reach[:, 0])
        return {
            "acting": table_of(
                Acting,
                np.hstack([self.edge[:, :1], self.part[:, 3:], self.edge[:, 1:], self.part[:, :3], self.shared]),
                np.hstack([inner_at, outer_at, self.reach[:, :2], inner, outer, self.reach[:, 2:], self.left]),
            ),
            "group": group,
            "middle": middle,
            "body": table_of(PushedBody, self.body[:, None], self.body_frame),
            "node": self.node,
            "conduction": table_of(ConductingComponent, self.conduction),
            "sink": table_of(Sink, self.sink),
            "port": table_of(AttachedRate, self.port),
            "component": self.component,
            "parameters": self.parameters,
        }


def groups_of(edge: Index, axis: Array, inner: Array, outer: Array, reach: Array) -> tuple[Table[Group], Table[Middle]]:
    """Groups of consecutive edges, with their points, each point once.

    Parameters
    ----------
    edge
        (edges, 4): kind, links and support of `Acting`.
    axis, inner, outer
        (edges, 3): z axis and place of the first frame in the first link, place of the second one in the second.
    reach
        (edges,), of `Acting`.
    """
    count, support = len(edge), np.minimum(edge[:, 3], BEYOND)
    bounded, plane = support[:, None] > 0, support[:, None] == ABOVE
    upwards = np.where(plane, axis, 0.0)
    key = np.hstack([support[:, None], np.where(bounded, edge[:, :3], 0), upwards, np.where(plane, inner, 0.0)])
    starts = np.flatnonzero(np.any(np.diff(key, axis=0, prepend=np.nan) != 0.0, axis=1))
    ends = np.append(starts[1:], count)[: starts.size]
    far, rows = np.asarray(reach, dtype=float).copy(), list[Array]()
    for link, at, along in ((edge[:, 1:2], inner, upwards), (edge[:, 2:3], outer, np.zeros((count, 3)))):
        middles = 0.5 * (np.minimum.reduceat(at, starts) + np.maximum.reduceat(at, starts)) if count else at
        far += np.linalg.norm(at - np.repeat(middles, ends - starts, axis=0), axis=1)
        rows.append(np.where(bounded[starts], np.hstack([link[starts], middles, along[starts]]), 0.0) + 0.0)
    spread = (1.0 + ROUNDING) * (np.maximum.reduceat(far, starts) if count else far)
    found, which = np.unique(np.concatenate(rows), axis=0, return_inverse=True)
    numbers = np.column_stack([support[starts], starts, ends, *np.split(which.ravel(), 2)])
    return table_of(Group, numbers, spread), table_of(Middle, found[:, :1].astype(np.int64), found[:, 1:])


def table_of(record: type[Record], integers: Index, reals: Array | None = None) -> Table[Any]:
    """Return a table of records whose fields, in their order, are the columns of arrays."""
    size, numbers = len(integers), np.zeros(0) if reals is None else np.ascontiguousarray(reals).ravel()
    whole = np.ascontiguousarray(integers, dtype=np.int64).ravel()
    return Table(record, ArrayIntegers(whole), ArrayReals(numbers), size)


def copied(rows: Table[Any]) -> Table[Any]:
    """Return a table with integers of its own, and the same numbers."""
    return Table(rows.record, ArrayIntegers(rows.arrays[0].copy()), rows.reals, rows.size)
