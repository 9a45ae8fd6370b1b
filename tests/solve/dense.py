"""Counts of motions and redundant constraints by one dense matrix."""

import numpy as np

from ephs.semantics.spaces.decompositions import singular_values
from ephs.semantics.spaces.rank import CONSTRAINT, rank_of
from ephs.solve.equations.instant import constraints_of, is_velocity, rate_balances
from ephs.solve.equations.mobility import Mobility


def dense_mobility(descriptor, x, prescribed=()):
    units = np.eye(descriptor.effort_size)
    held = [units[slot.efforts] for slot in descriptor.outer if slot.path in prescribed]
    balances = [sum(by * units[i] for i, by in row.items()) for row in rate_balances(descriptor, x)]
    velocities = np.zeros(descriptor.effort_size, dtype=bool)
    for slot in descriptor.junctions:
        velocities[slot.efforts] = is_velocity(slot.quantity)
    matrix = np.vstack([constraints_of(descriptor, x), *held, *balances])[:, velocities]
    norms = np.linalg.norm(matrix, axis=1)
    matrix = matrix[norms > 0.0] / norms[norms > 0.0, None]
    rank = rank_of(singular_values(matrix), CONSTRAINT) if matrix.size else 0
    return Mobility(int(velocities.sum()) - rank, len(matrix) - rank)
