"""Conduction between stores of heat as one sparse matrix: what is linear in their temperatures is so in energies."""

from typing import Any, final

import numpy as np
from scipy.sparse import csr_array

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.verdicts.conduction import conductances
from ephs.solve.equations.model import Model
from ephs.solve.methods.records import IRREVERSIBLE
from ephs.solve.methods.stores import HeatStores


@final
class ConductionMatrix:
    """Irreversible components between stores of heat whose powers are linear in temperatures.

    Attributes
    ----------
    components
        Their numbers.
    ports
        (ports,) places of their flows among those of all components.
    powers, rest
        (ports, states) in 1/s and (ports,) in W: the heat that each port passes to its store, ``powers @ y + rest`` of
        the numbers y of `HeatStores`.
    rates, constant
        (states, states) and (states,): the change of the numbers by it is ``rates @ y + constant``.
    """

    def __init__(self, model: Model, stores: HeatStores) -> None:
        t, n = model.tables, model.descriptor.numbering
        offset = np.full(stores.states.size, model.reference.temperature)
        slope = np.zeros(stores.states.size)
        offset[stores.hot], slope[stores.hot] = stores.c1 / stores.c2, 1.0 / stores.c2
        processes = np.flatnonzero(t.kind == IRREVERSIBLE) if stores.warm.size else np.zeros(0, dtype=np.int64)
        order = processes[np.argsort(n.primitive[processes], kind="stable")]
        parts: list[tuple[Any, ...]] = []
        for these in np.split(order, 1 + np.flatnonzero(np.diff(n.primitive[order]))) if order.size else ():
            k = conductances(n.primitives[n.primitive[these[0]]])
            if k is None:
                continue
            ports = t.e_at[these][:, None] + np.arange(len(k))
            at = stores.at[t.e_index[ports]]
            among = (at >= 0).all(axis=1)
            at = at[among]
            entries = -k * slope[at][:, None, :]  # (components, port, by the store at each port)
            states = np.broadcast_to(stores.states[at][:, None, :], entries.shape)
            parts.append((these[among], ports[among].ravel(), at.ravel(), (-k @ offset[at].T).T.ravel(),
                          np.full(at.size, len(k)), entries.ravel(), states.ravel()))  # fmt: skip
        none = np.zeros(0, dtype=np.int64)
        joined = [np.concatenate([none, *column]) for column in zip(*parts, strict=True)] if parts else [none] * 7
        self.components, self.ports, at, rest, widths, entries, states = joined
        size, count = int(t.counts[0]), self.ports.size
        self.rest = rest.astype(float)
        self.powers = csr_array((entries.astype(float), states, np.append(0, np.cumsum(widths))), shape=(count, size))
        into = csr_array((1.0 / stores.units[at], (stores.states[at], np.arange(count))), shape=(size, count))
        self.rates, self.constant = csr_array(into @ self.powers), into @ self.rest
        self.rates.sum_duplicates()

    def of(self, ys: Array) -> Array:
        """(stages, states) changes of numbers by conduction, per second."""
        return (self.rates @ ys.T).T + self.constant
