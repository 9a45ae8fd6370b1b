"""Joints, bodies and entropies of the components of the reduced form."""

import numpy as np

from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import LARGEST, Outcome, SolveError
from ephs.solve.running.control import Tolerance


def within(reduced: Reduced, q: Array, r: Array, heats: Array) -> None:
    """Hold elements, rates and heats against the range of numbers.

    Raises
    ------
    SolveError
        It names what has left it.
    """
    if all(np.abs(values).max(initial=0.0) < LARGEST for values in (q, r, heats)):
        return
    t = reduced.tables
    for link in range(reduced.links):
        for values, first, size in ((q, t.q_at, t.q_size), (r, t.r_at, t.dim)):
            if not np.abs(values[int(first[link]) : int(first[link] + size[link])]).max(initial=0.0) < LARGEST:
                raise SolveError(Outcome.RANGE, str(reduced.path(link)), "")
    for path, value in zip(reduced.entropies, heats, strict=True):
        if not abs(value) < LARGEST:
            raise SolveError(Outcome.RANGE, str(path), "")
    raise SolveError(Outcome.RANGE, "", "")


def counted(reduced: Reduced, entry: int) -> tuple[str, str]:
    """Path and words for an entry of what counts in errors: the tree's increments, its rates, the heats."""
    n = reduced.freedoms
    if entry >= 2 * n:
        return str(reduced.entropies[entry - 2 * n]), "its heat" if reduced.tables.node[
            entry - 2 * n
        ] >= -1 else "its state"
    link = int(np.flatnonzero(reduced.tables.r_at[: reduced.links] <= entry % n)[-1])
    return str(reduced.path(link)), "its position" if entry < n else "its rate"


def tolerances(reduced: Reduced, tolerance: Tolerance, heat: float) -> Array:
    """A tolerance of what counts in errors: increments and rates of the tree, heats, in ``heat`` J per J/K, states."""
    of_joints: list[float] = []
    for edge in reduced.edges[: reduced.links]:
        path, kind = edge.state or Path(), "pose" if edge.path is None else "relative_pose"
        of_joints += [tolerance.at(path, kind)] * edge.pair.dim
    states = reduced.attaching.network.states
    booked = reduced.entropies[: len(reduced.entropies) - len(states)]
    heats = [heat * tolerance.at(path, "entropy") for path in booked]
    plain = [tolerance.at(state.path, state.quantity.kind) for state in states]
    return np.array([*of_joints, *of_joints, *heats, *plain])
