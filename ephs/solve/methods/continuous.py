"""The equations of a model at one instant, compiled: residual, matrix, powers; what methods of Runge and Kutta use.

They are the kernels of the natural discretisation at increments of length zero, where every discrete relation is the
continuous one, and half of the derivative by the increment is the derivative by the state.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.sparse import csc_array

from ephs.semantics.bundle import Array
from ephs.solve.errors import SolveError
from ephs.solve.methods.records import STORING
from ephs.solve.model import Evaluation, Model

__all__ = ["Continuous", "Matrices"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Matrices:
    """Derivatives of the residual g(x, z), z = (rates, efforts, multipliers, outer flows).

    Parameters
    ----------
    unknowns
        (n, n) ∂g/∂z.
    states
        (n, n) ∂g/∂x, left-trivialised, in the columns of the rates.
    """

    unknowns: csc_array
    states: csc_array


@final
class Continuous:
    """The equations of one model. It keeps scratch memory: use one for each thread."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._evaluation = Evaluation(model)
        self._memory = self._evaluation.memory

    def residual(self, x: Array, z: Array, inputs: Array) -> Array:
        """g(x, z), (n,).

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        self._evaluate(x, z, 0.0, inputs)
        return self._memory.residual.copy()

    def matrices(self, x: Array, z: Array, inputs: Array) -> Matrices:
        """The derivatives of g at (x, z)."""
        t = self.model.tables
        n = z.size

        def whole(data: Array) -> csc_array:
            return csc_array((data, (t.row, t.column)), shape=(n, n))

        self._evaluate(x, z, 0.0, inputs)
        unknowns = self._memory.data.copy()
        # Increments of unit length but zero size: what is added are derivatives by the increments.
        rest = z.copy()
        rest[: t.counts[0]] = 0.0
        self._evaluate(x, rest, 1.0, inputs)
        states = 2.0 * (self._memory.data - unknowns)
        return Matrices(whole(unknowns), whole(states))

    def powers(self, x: Array, z: Array, inputs: Array) -> tuple[Array, Array]:
        """Rates of the ledgers, per second, (4 + components,): heat, energy, exergy supplied, entropy made, and
        the entropy made by each component; and the flows into the ports of all components but storages."""
        self._evaluate(x, z, 0.0, inputs)
        return self._evaluation.ledgers(1.0), self._memory.flows.copy()

    def energies(self, x: Array, z: Array, inputs: Array) -> Array:
        """(components,): energy of each storage at the states x, zero elsewhere."""
        self._evaluate(x, z, 0.0, inputs)
        return np.where(self.model.tables.kind == STORING, self._memory.energy, 0.0)

    def _evaluate(self, x: Array, z: Array, h: float, inputs: Array) -> None:
        status, component = self._evaluation.at(x, z, h, inputs)
        if status:
            raise SolveError.of_component(status, self.model, component)
