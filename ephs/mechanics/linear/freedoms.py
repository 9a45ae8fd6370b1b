"""The independent degrees of freedom of a mechanism at a state, and the balance of the forces on them."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.dynamics import Dynamics, State
from ephs.mechanics.tree.finding.frames import frames_of
from ephs.mechanics.tree.finding.tendons import tendon_lengths
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index

MASSLESS = 1e-14
"""Inertia, as a part of the largest, below which it is rounding: rows determine what has none."""
LEAST = 1e-2
"""Substitute inertia of massless freedoms, relative to the least one: pivoting takes them as dependent first."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Freedoms:
    """The independent degrees of freedom at a state.

    Parameters
    ----------
    which
        (k,) their places among the tree's n freedoms.
    Z
        (n, k) what they do to all: the identity on ``which``, zero for the rows of the constraints.
    """

    which: Index
    Z: Array


def freedoms_of(model: Dynamics, state: State) -> Freedoms:
    """Independent degrees of freedom, by pivoting in the mass metric."""
    from scipy.linalg import qr, solve_triangular

    found, n = model.constraints(state), model.layout.n
    if not found.rank:
        return Freedoms(np.arange(n), np.eye(n))
    inertia = np.diag(model.mass_matrix(state))
    heavy = inertia > MASSLESS * inertia.max()
    light = 1.0 / np.sqrt(np.where(heavy, inertia, LEAST * inertia[heavy].min()))
    factors: Any = qr(found.rows * light, mode="economic", pivoting=True)
    upper, order, rank = np.asarray(factors[1]), np.asarray(factors[2], dtype=np.int64), found.rank
    dependent, which = order[:rank], np.sort(order[rank:])
    place = {int(j): i for i, j in enumerate(order[rank:])}
    rest = -np.asarray(solve_triangular(upper[:rank, :rank], upper[:rank, rank:]), dtype=float)[
        :, [place[int(j)] for j in which]
    ]
    Z = np.zeros((n, which.size))
    Z[which, np.arange(which.size)] = 1.0
    Z[dependent] = light[dependent][:, None] * rest / light[which]
    return Freedoms(which, Z)


def lengths_of(model: Dynamics) -> list[int]:
    """Places of tendons' lengths among the entropies."""
    found = tendon_lengths(frames_of(model.problem.descriptor), model.problem.initial)
    return [model.layout.entropies.index(path) for path, _ in found]


def resting(model: Dynamics, state: State, lengths: list[int]) -> State:
    """The state without rates, with tendons as long as they are where the joints put their points."""
    q, r, s = model.layout.split(state.array)
    if lengths:
        found = tendon_lengths(frames_of(model.problem.descriptor), model.states(state))
        s = s.copy()
        s[lengths] = [length for _, length in found]
    return model.unpack(np.concatenate([q, np.zeros_like(r), s]))


def unbalanced(model: Dynamics, state: State, free: Freedoms, stiffness: Array) -> float:
    """Unbalanced fraction of the forces at rest in a state; 0 without forces.

    Weights act at their arms, and all else counts with what ``stiffness`` (n, n) makes of it over 1 rad or m: forces
    that balance each other may vanish one by one.
    """
    q, r, s = model.layout.split(state.array)
    rest = model.unpack(np.concatenate([q, np.zeros_like(r), s]))
    gravity, applied = model.gravity(rest), model.applied(rest)
    terms = np.abs(applied) + np.abs(stiffness).sum(axis=1)
    for name, weight in model.weights.items():
        terms += weight * np.linalg.norm(model.jacobian(rest, name)[3:], axis=0)
    left, terms = free.Z.T @ (applied - gravity), np.abs(free.Z.T) @ terms
    return float(np.abs(left).max(initial=0.0) / (terms.max(initial=0.0) or 1.0))
