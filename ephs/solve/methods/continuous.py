"""Compiled equations of a model at one instant: residual, matrix, powers; for Runge–Kutta methods.

They are the kernels of the natural discretisation at increments of length zero, where every discrete relation is the
continuous one, and half of the derivative by the increment is the derivative by the state.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

import numpy as np
from scipy.sparse import csc_array

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.model import Evaluation, Model, cancelled
from ephs.solve.methods.records import STORING
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import SolveError


@final
@dataclass(frozen=True, slots=True, eq=False)
class Matrices:
    """Derivatives of the residual g(x, z), z = (rates, efforts, multipliers, outer flows); sparse or dense.

    Parameters
    ----------
    unknowns
        (n, n) ∂g/∂z.
    states
        (n, n) ∂g/∂x, left-trivialised, in the columns of the rates.
    """

    unknowns: Any
    states: Any


@final
@dataclass(frozen=True, slots=True, eq=False)
class AccumulatorRates:
    """Rates of the accumulators at one instant.

    Parameters
    ----------
    sums
        (4 + components,) rates of the ledgers, per second: heat, energy, exergy supplied, entropy made, and the entropy
        made by each component.
    flows
        Into the ports of irreversible components, at least.
    unknowns
        Rates, efforts, multipliers, outer flows.
    energies
        (components,) of each storage, zero elsewhere.
    """

    sums: Array
    flows: Array
    unknowns: Array
    energies: Array


@final
class Continuous:
    """The equations of one model. It keeps scratch memory: use one for each thread.

    Attributes
    ----------
    pivots
        How SuperLU is to choose pivots of their matrices, options of `scipy.sparse.linalg.splu`.
    """

    pivots: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, model: Model) -> None:
        self.model = model
        self._evaluation = Evaluation(model)
        self._memory = self._evaluation.memory

    @property
    def unknowns(self) -> int:
        """Number of unknowns z."""
        return self.model.unknowns

    def guess(self, x: Array) -> Array:
        """Unknowns from which to begin: the storages' efforts."""
        return StoredEnergies(self.model).efforts(x)

    def residual(self, x: Array, z: Array, inputs: Array) -> Array:
        """g(x, z), (n,).

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        self._evaluate(x, z, 0.0, inputs)
        return self._memory.residual.copy()

    def residuals(self, xs: Array, zs: Array, inputs: Array) -> Array:
        """g(x, z) row by row, (stages, n)."""
        return np.array([self.residual(x, z, given) for x, z, given in zip(xs, zs, inputs, strict=True)])

    def matrices(self, x: Array, z: Array, inputs: Array) -> Matrices:
        """The derivatives of g at (x, z)."""
        t = self.model.tables
        n = z.size

        def whole(data: Array) -> csc_array:
            return csc_array((data, (t.row, t.column)), shape=(n, n))

        self._evaluate(x, z, 0.0, inputs)
        unknowns = self._memory.data.copy()
        self._evaluate(x, z, 0.0, inputs, 1.0)
        states = 2.0 * (self._memory.data - unknowns)
        entries, empty = cancelled(self.model, x)
        unknowns[entries] = states[entries] = 0.0
        unknowns[t.row.size - n + empty] = 1.0  # no equation: the multiplier stays
        return Matrices(whole(unknowns), whole(states))

    def instant(self, x: Array, z: Array, inputs: Array) -> AccumulatorRates:
        """Powers and energies at (x, z)."""
        self._evaluate(x, z, 0.0, inputs)
        m = self._memory
        energies = np.where(self.model.tables.kind == STORING, m.energy, 0.0)  # ledgers write to unused memory
        return AccumulatorRates(self._evaluation.ledgers(1.0), m.flows.copy(), z, energies)

    def _evaluate(self, x: Array, z: Array, h: float, inputs: Array, weight: float | None = None) -> None:
        status, component = self._evaluation.at(x, z, h, inputs, weight)
        if status:
            raise SolveError.of_component(status, self.model, component)
