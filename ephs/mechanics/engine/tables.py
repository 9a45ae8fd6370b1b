"""The tables of a mechanism as the compiled engine takes them, and the memory of one evaluation."""

from typing import NamedTuple

from ephs.mechanics.engine.closing import Closing
from ephs.mechanics.solve.sparse import Index
from ephs.semantics.bundle import Array

__all__ = [
    "COLUMNS",
    "DIM",
    "DRIVEN",
    "FORCED",
    "PARENT",
    "R_AT",
    "WIDTH",
    "Engine",
    "Forces",
    "Memory",
    "Scheme",
    "State",
]

PARENT, R_AT, DIM, COLUMNS = range(4)
"""Columns of links."""
FORCED, DRIVEN, WIDTH = range(3)
"""What of a mechanism is said in a number: more than gravity acts, joints are driven, numbers of memory of a link."""


class Forces(NamedTuple):
    """What acts besides inertia and gravity: components of joints and springs, entropies, wrenches on bodies."""

    edge: Index  # (edges, 8): kind, link of body 1, of body 2, freedoms, place of q, its size, place of r, cut joint
    part: Index  # (edges, 3): component of the potential, of friction, entropy that takes its heat; −1: none
    frame: Array  # (edges, 24): rows of R and p of both joint frames in their links' frames
    left: Array  # (edges, 36): (BᵀB)⁻¹Bᵀ, row by row
    body: Index  # (bodies,): link on which the wrench acts, −1: none does
    body_frame: Array  # (bodies, 12): R and p of the body in its link's frame
    node: Index  # (entropies,): component of the storage, −1: the environment
    conduction: Index  # (conductions, 3): component, entropy, entropy
    sink: Index  # (frictions, 2): place of what it makes, entropy that takes its heat
    address: Index  # (components,)
    dims: Index  # (components, 4)
    parameters: Array
    parameter_at: Index
    made_at: Index  # (components,): place of what it makes, −1


class Engine(NamedTuple):
    """A mechanism. Links are groups of bodies, parents first, in frames at their tree joints."""

    flag: Index  # (3,): see above
    address: Index  # (8,): the staged functions, see `engine_kernels`; 0: not needed
    link: Index  # (links, 3): see above
    integers: Index  # (links · width,): records of the sweeps, see `ephs.mechanics.tree.records`
    reals: Array  # (links · width,)
    gravity: Array  # (3,) in the ground's frame
    loops: Index  # addresses of `ephs.mechanics.tree.loops`
    chart: Index  # (joints · width,): records of `ephs.mechanics.tree.cuts.Chart`
    cut: Index  # (cut joints · width,): records of `ephs.mechanics.tree.cuts.Cut`, their integers
    cut_numbers: Array  # (cut joints · width,): their numbers
    closing: Closing
    forces: Forces


class Memory(NamedTuple):
    """What one evaluation writes."""

    work: Array  # ((links + 1) · width,): the sweeps' own
    place: Array  # (links + 1, 24): R and p in the world, twist, bias; the ground's last
    wrench: Array  # (links, 6): on links, in their frames
    change: Array  # (links + 1, 6): accelerations beyond the bias; the ground's last
    force: Array  # (n,)
    zero: Array  # (n,): stays zero
    relative: Array  # (cut joints, 25): see `ephs.mechanics.tree.cuts.Relative`
    row_value: Array  # (rows, 4): target, multiplier, size, pivot
    entry: Array  # (entries,): what couples rows
    covector: Array  # (slots, 6)
    along: Array  # (slots, 12)
    largest: Array  # (blocks,)
    temperature: Array  # (entropies,)
    entropy: Array  # (entropies,)
    small: Array  # (512,)
    e: Array
    f: Array
    c: Array
    jac: Array
    scratch: Array


class Scheme(NamedTuple):
    """An explicit method: stages, weights, estimates of the error."""

    a: Array  # (stages, stages)
    b: Array  # (stages,)
    error: Array  # (stages + 1,)
    coarse: Array  # (stages + 1,): of order 8 only
    order8: int


class State(NamedTuple):
    """The state of a run of explicit steps, and memory for its next one."""

    q: Array
    y: Array  # (size,): v = 0, rates, entropies, books
    k: Array  # (stages + 1, size): rates at the stages
    y1: Array
    q1: Array
    k2: Array
    y2: Array
    q2: Array
    b: Array
    atol: Array  # (2 n + entropies,)
    rtol: Array
    allowed: Array
    fine: Array
    coarse: Array
    change: Array  # (n,)
    moved: Array  # (size of v,)
    rows_t: Array  # (rows, 2): time from the start, the step's least production
    rows_q: Array
    rows_y: Array
