"""Efforts of an attached network that no balance determines: relations that depend on states hold a rate there.

Such a rate is a constraint on the rates of joints that changes with their positions, as of a rod between two points.
"""

from collections.abc import Sequence

import numpy as np

from ephs.mechanics.tree.finding.frames import Unplaced
from ephs.mechanics.tree.finding.network import Network
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.relations import ReversibleStep
from ephs.semantics.derive.tape import pieced
from ephs.semantics.descriptor.descriptor import ComponentSlot
from ephs.semantics.primitives.primitives import Reversible
from ephs.semantics.verdicts.checks import random_point


def check_determined(network: Network, components: Sequence[ComponentSlot]) -> None:
    """Look for an unknown effort that is in none of the balances.

    Raises
    ------
    Unplaced
        The component there would hold a rate.
    """
    first = network.known
    found = np.abs(network.skew[first:, first:])
    for one in network.attached:
        rows = np.abs(one.rows[:, first:])
        found = found + rows.T @ _pattern(components[one.component], len(rows)) @ rows
    for at in np.flatnonzero(~found.any(axis=1) & ~found.any(axis=0)).tolist():
        owner = next((one.component for one in network.attached if one.rows[:, first + at].any()), None)
        if owner is not None:
            raise Unplaced(components[owner].path, "holds a rate by a relation that depends on positions")


def _pattern(slot: ComponentSlot, size: int) -> Array:
    """(size, size) 1 where a flow depends on an effort or a multiplier.

    An analytic entry that vanishes at three drawn states is zero; one of several pieces counts, see `pieced`.
    """
    of = slot.primitive
    if not isinstance(of, Reversible):
        return np.ones((size, size))
    rng, found = np.random.default_rng(1), np.zeros((size, of.bundle.size), dtype=bool)
    for _ in range(3):
        found |= np.vstack([np.asarray(part) for part in of.structure(random_point(of.bundle, of.reads, rng))]) != 0.0
    relation = None if of.kernel is None else of.kernel.relation
    if isinstance(relation, ReversibleStep) and relation.maps is None:
        found |= np.reshape(pieced(relation.structure), found.shape)
    left, constraint = np.vsplit(found, [of.bundle.size])
    return np.block([[left, constraint.T], [constraint, np.zeros((len(constraint), len(constraint)))]]).astype(float)
