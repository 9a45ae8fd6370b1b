"""The tables of a mechanism in joint coordinates."""

from typing import NamedTuple

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index

TREE, CUT, SPRING = 0, 1, 2
"""Kinds of edges."""


class MechanismTables(NamedTuple):
    """Tables of a mechanism. Links are bodies, parents first; edges are joints of the tree, then cut ones, springs."""

    parent: Index  # (links,): −1 for the ground
    inertia: Array  # (links, 6, 6)
    weight: Index  # (links,): component of the potential, −1: none
    kind: Index  # (edges,)
    first: Index  # (edges,): link of body 1, −1 for the ground; of a tree edge the parent in walking order
    second: Index
    forward: Index  # (edges,): 1 where walked from body 1 to body 2
    code: Index  # (edges,)
    dim: Index
    q_at: Index
    q_size: Index
    r_at: Index  # tree edges: place in r; others: place in what is derived from it
    offset1: Array  # (edges, 7)
    offset2: Array
    basis: Array  # (edges, 6, 6): B in its first dim columns
    left: Array  # (edges, 6, 6): (BᵀB)⁻¹Bᵀ in its first dim rows
    normal: Array  # (edges, 6, 6): rows that are constrained, of cut edges
    rows: Index  # (edges,): how many
    spring: Index  # (edges,): component of the potential, −1: none
    several: Index  # (edges,): component whose energy is of its relative pose and others', −1: none
    poses: Index  # (edges,): how many relative poses that has, in this edge and those that follow; 0 in the latter
    friction: Index  # (edges,): component, −1: none; of several relative poses at the first one
    heat: Index  # (edges,): entropy that takes the friction's heat
    support: Index  # (edges,): 0, or where both components vanish, see `ephs.mechanics.tree.sweeps.acting.Acting`
    reach: Array  # (edges, 9): from which height or distance on; margin, half lengths of the boxes, angle of segments
    driven: Index  # (tree degrees of freedom,): 1 where the rate is prescribed
    armature: Array  # (tree degrees of freedom,): inertia on the rate itself
    node: Index  # (entropies,): component of the storage, −1: the environment, −2: a state of an attachment
    conduction: Index  # (conductions, 3): component, entropy, entropy
    sink: Index  # (sinks, 4): see `ephs.mechanics.tree.sweeps.acting.Sink`
    address: Index  # (components,): of its relation over a step
    resting: Index  # (components,): at rest, of what acts
    dims: Index  # (components, 4)
    parameters: Array
    parameter_at: Index
    made_at: Index  # (components,): place of what it makes, −1

    @property
    def evaluated(self) -> Index:
        """(components, 4) dimensions of those that act on the motion or store its heat, zeros of others."""
        acting = [self.spring, self.several, self.friction, self.node, self.conduction[:, :1]]
        found = np.unique(np.concatenate([part.ravel() for part in acting]))
        out = np.zeros_like(self.dims)
        out[found[found >= 0]] = self.dims[found[found >= 0]]
        return out
