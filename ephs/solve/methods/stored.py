"""Energies of a model's storages, and their efforts, from which methods guess unknowns."""

from contextlib import suppress
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.model import Evaluation, Model
from ephs.solve.methods.records import STORING, efforts_of, rates_of
from ephs.solve.posing.errors import SolveError


@final
class StoredEnergies:
    """Energies and efforts of a model's storages. It keeps memory: use one for each thread."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._storages, t = Evaluation(model.only(np.flatnonzero(model.tables.kind == STORING))), model.tables
        own = self._storages.model.tables
        self._efforts, self._rates = t.counts[0] + efforts_of(own, slice(None)), rates_of(own, slice(None))
        self._whole: Evaluation | None = None

    def efforts(self, x: Array) -> Array:
        """(unknowns,) at the states x: the efforts of storages, zero where one has none; all else zero."""
        model = self.model
        d, n_rate = model.descriptor, int(model.tables.counts[0])
        z = np.zeros(model.unknowns)
        status, _ = self._storages.at(x, z, 0.0)
        if not status:
            z[self._efforts] = -self._storages.memory.residual[self._rates]
            return z
        for slot, storage in d.storages:  # one after the other, as one of them has no effort there
            with suppress(Exception):
                z[[n_rate + i for i in slot.efforts]] = storage.effort(d.point(slot, x), model.reference)
        return z

    def energies(self, x: Array) -> Array:
        """(components,) energy of each storage at the states x, zero elsewhere.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        found = self._whole = self._whole or Evaluation(self.model)
        status, component = found.at(x, self.efforts(x), 0.0)
        if status:
            raise SolveError.of_component(status, self.model, component)
        return found.memory.energy.copy()
