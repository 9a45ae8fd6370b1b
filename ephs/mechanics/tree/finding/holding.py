"""Efforts of an attached network that no balance determines: relations that depend on states hold a rate there.

Such a rate is a constraint on the rates of joints that changes with their positions, as of a rod between two points.
"""

from collections.abc import Sequence

import numpy as np

from ephs.mechanics.tree.finding.frames import Unplaced
from ephs.mechanics.tree.finding.network import Network
from ephs.semantics.descriptor.descriptor import ComponentSlot
from ephs.semantics.descriptor.sparsity import jacobian_mask


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
        size = len(rows)  # flows and conditions by efforts and multipliers
        found = found + rows.T @ jacobian_mask(components[one.component].primitive)[:size, :size] @ rows
    for at in np.flatnonzero(~found.any(axis=1) & ~found.any(axis=0)).tolist():
        owner = next((one.component for one in network.attached if one.rows[:, first + at].any()), None)
        if owner is not None:
            raise Unplaced(components[owner].path, "holds a rate by a relation that depends on positions")
