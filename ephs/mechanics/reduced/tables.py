"""The tables of a mechanism, and the scratch memory of one evaluation, as compiled code takes them."""

from functools import cache
from typing import NamedTuple

import numpy as np

from ephs.mechanics.solve.sparse import Index
from ephs.semantics.bundle import Array
from ephs.semantics.linear.rows import row_program

__all__ = [
    "CHOLESKY",
    "CORRECT",
    "CUT",
    "MULTIPLIERS",
    "ORTHONORMALISE",
    "SOLVE",
    "SPRING",
    "TREE",
    "Mechanism",
    "Workspace",
    "row_addresses",
]

TREE, CUT, SPRING = 0, 1, 2
"""Kinds of edges."""
CHOLESKY, SOLVE, ORTHONORMALISE, CORRECT, MULTIPLIERS = range(5)
"""Functions of `ephs.semantics.linear.rows` by their place among the addresses of a workspace."""


@cache
def row_addresses() -> Index:
    """Return the addresses of these functions in machine code."""
    calls = row_program().compiled()
    names = ("cholesky", "solve", "orthonormalise", "correct", "multipliers")
    return np.array([calls[name].address for name in names])


class Mechanism(NamedTuple):
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
    friction: Index  # (edges,): component, −1: none
    heat: Index  # (edges,): entropy that takes the friction's heat
    driven: Index  # (tree freedoms,): 1 where the rate is prescribed
    node: Index  # (entropies,): component of the storage, −1: the environment
    conduction: Index  # (conductions, 3): component, entropy, entropy
    sink: Index  # (frictions, 2): place of what it makes, entropy that takes its heat
    address: Index  # (components,)
    dims: Index  # (components, 4)
    parameters: Array
    parameter_at: Index
    made_at: Index  # (components,): place of what it makes, −1


class Workspace(NamedTuple):
    """Scratch memory for one evaluation."""

    pose: Array  # (links, 7) in the world
    inner: Array  # (links, 7) in the parent
    twist: Array  # (links, 6)
    bias: Array  # (links, 6)
    load: Array  # (links, 6)
    composite: Array  # (links, 6, 6)
    motion: Array  # (edges, 6, 6): S, columns
    relative: Array  # (edges, 7) pose of C2 in C1, of cut edges and springs
    rate: Array  # (edges, 6): r of cut edges and springs
    mass: Array  # (n, n)
    factor: Array  # (n, n)
    force: Array  # (n,)
    row: Array  # (m, n): constraints
    size: Array  # (m,): what the rows could be if nothing cancelled, in the mass metric
    target: Array  # (m,)
    scaled: Array  # (m, n): rows in the mass metric, orthonormalised
    plain: Array  # (m, n): rows without masses, orthonormalised
    triangle: Array  # (m, m)
    chosen: Index  # (m,)
    step: Array  # (n,)
    temperature: Array  # (entropies,): effort of each
    multiplier: Array  # (m,)
    linear: Index  # addresses of `row_addresses`
    small: Array  # (512,)
    matrix: Array  # (6, 6)
    scratch: Array  # (2048,)
    e: Array
    f: Array
    c: Array
    jac: Array
