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
        self._storages: Evaluation | None = None
        self._whole: Evaluation | None = None

    def efforts(self, x: Array) -> Array:
        """(unknowns,) at the states x: the efforts of storages, zero where one has none; all else zero."""
        model = self.model
        d, n_rate = model.descriptor, int(model.tables.counts[0])
        z = np.zeros(model.unknowns)
        found = self._storages = self._storages or Evaluation(model.only(np.flatnonzero(model.tables.kind == STORING)))
        status, _ = found.at(x, z, 0.0)
        if not status:
            t = found.model.tables
            z[n_rate + efforts_of(t, slice(None))] = -found.memory.residual[rates_of(t, slice(None))]
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
