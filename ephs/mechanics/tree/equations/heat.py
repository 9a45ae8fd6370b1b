"""Storages of heat of a mechanism in joint coordinates, and heat transferred to them by components."""

import numpy as np

from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.sweeps.acting import EntropyNode
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.heats import Heats


def heats_of(reduced: Reduced, theta: float) -> Heats:
    """The storages of heat of a mechanism; flows are by its components that make entropy.

    Parameters
    ----------
    theta
        Temperature of the environment in K.
    """
    t, table = reduced.tables, reduced.nodes

    def laws() -> tuple[Array, Array]:
        rows = table.arrays[1].reshape(-1, EntropyNode.real_width)[t.node >= 0]
        return rows[:, EntropyNode.c1.offset], rows[:, EntropyNode.c2.offset]

    flows, sinks = t.sink.T[:2]
    ends = np.full((len(reduced.made), 2), -1, dtype=np.int64)
    ends[flows, 1] = sinks
    for component, one, two in t.conduction.tolist():
        ends[t.made_at[component]] = one, two
    return Heats(reduced.entropies, t.node, laws, ends, theta)
