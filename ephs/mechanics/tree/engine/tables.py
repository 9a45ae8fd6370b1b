"""Forces on a mechanism as arrays: from the tables of a reduced scene to the records of the engine."""

from typing import Any, NamedTuple

import numpy as np

from ephs.mechanics.tree.sweeps.acting import Acting, Body, Component, Conduction, Node, Port, Sink
from ephs.semantics.bundle import Array
from ephs.semantics.stage import Record, Table
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals
from ephs.solve.sparse import Index


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
    sink: Index  # (sinks, 3): place of what it makes, entropy that takes it or −1, first place of its component
    port: Index  # (rates, 3): place of the freedom, edge, freedom in it
    component: Table[Component]  # with their relations over a step
    resting: Table[Component]  # with those at rest, without derivatives
    parameters: Array

    def tables(self) -> dict[str, Any]:
        """Return the records of the engine, by name."""
        inner, inner_at, outer, outer_at = np.split(self.frame, [9, 12, 21], axis=1)
        return {
            "acting": table_of(
                Acting,
                np.hstack([self.edge[:, :1], self.part[:, 3:], self.edge[:, 1:], self.part[:, :3]]),
                np.hstack([inner_at, outer_at, self.reach[:, :2], inner, outer, self.reach[:, 2:], self.left]),
            ),
            "body": table_of(Body, self.body[:, None], self.body_frame),
            "node": self.node,
            "conduction": table_of(Conduction, self.conduction),
            "sink": table_of(Sink, self.sink),
            "port": table_of(Port, self.port),
            "component": self.resting,
            "parameters": self.parameters,
        }


def table_of(record: type[Record], integers: Index, reals: Array | None = None) -> Table[Any]:
    """Return a table of records whose fields, in their order, are the columns of arrays."""
    size, numbers = len(integers), np.zeros(0) if reals is None else np.ascontiguousarray(reals).ravel()
    whole = np.ascontiguousarray(integers, dtype=np.int64).ravel()
    return Table(record, ArrayIntegers(whole), ArrayReals(numbers), size)
