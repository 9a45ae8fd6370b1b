"""Storages of heat of a mechanism in joint coordinates, and heat transferred to them by components."""

import numpy as np

from ephs.mechanics.tree.finding.mechanism import Reduced
from ephs.mechanics.tree.sweeps.acting import Node
from ephs.semantics.bundle import Array
from ephs.solve.heats import PLAIN, Heats

__all__ = ["heats_of"]


def heats_of(reduced: Reduced, theta: float) -> Heats:
    """The storages of heat of a mechanism; flows are by its components that make entropy.

    Parameters
    ----------
    theta
        Temperature of the environment in K.
    """
    t, table = reduced.tables, reduced.nodes

    def laws() -> tuple[Array, Array]:
        rows = table.arrays[1].reshape(-1, Node.real_width)[t.node >= 0]
        return rows[:, Node.c1.offset], rows[:, Node.c2.offset]

    flows, sinks, owners = t.sink.T
    incidence = np.zeros((t.node.size, len(reduced.made)))
    incidence[sinks[sinks >= 0], flows[sinks >= 0]] = 1.0
    owner = np.arange(len(reduced.made))
    owner[flows] = owners
    booked = (sinks >= 0) & (t.node[sinks] != PLAIN) if sinks.size else np.zeros(0, dtype=bool)
    frictions = flows[booked & (np.bincount(owners, minlength=owner.size)[owners] == 1)]
    for component, one, two in t.conduction.tolist():
        incidence[one, t.made_at[component]], incidence[two, t.made_at[component]] = -1.0, 1.0
    return Heats(reduced.entropies, t.node, laws, incidence, frictions, theta, owner)
