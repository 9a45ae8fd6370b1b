"""Equations of a system by numbers: states, but energies of stores of heat, in which conduction is linear.

Its rates are those of the numbers. Where every effort is that of one storage, conduction between stores of heat is one
sparse matrix, and its components are not called.
"""

from typing import final

import numpy as np
from scipy.sparse import csc_array

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.model import Model
from ephs.solve.methods.conduction import ConductionMatrix
from ephs.solve.methods.continuous import AccumulatorRates, Continuous, Matrices
from ephs.solve.methods.integral import Integral
from ephs.solve.methods.solvers import DENSE
from ephs.solve.methods.stores import HeatStores


@final
class EnergyEquations:
    """The equations g(y, z) = 0 of one model; z are the rates of the numbers y, and other unknowns.

    Attributes
    ----------
    within
        The equations by states.
    conduction
        Linear conduction that is taken out of them; None where there is none.
    linear
        Whether all components are stores of heat and linear conduction.
    """

    def __init__(self, model: Model, stores: HeatStores) -> None:
        t, conduction = model.tables, ConductionMatrix(model, stores)
        integral = Integral.of(model, conduction.components)
        self.stores = stores
        self.within: Integral | Continuous = integral or Continuous(model)
        self.conduction = conduction if integral is not None and conduction.components.size else None
        self.unknowns, self.pivots = self.within.unknowns, self.within.pivots
        parts = np.unique(np.concatenate([stores.components, conduction.components]))
        self.linear = self.conduction is not None and parts.size == t.kind.size and not t.outer.size
        self._conducting = csc_array(conduction.rates)
        self._rates, self._components = int(t.counts[0]), t.kind.size

    def guess(self, y: Array) -> Array:
        """Unknowns from which to begin."""
        return self.within.guess(self.stores.entropies(y))

    def residuals(self, ys: Array, zs: Array, inputs: Array) -> Array:
        """(stages, unknowns) g.

        Raises
        ------
        SolveError
            A component cannot be evaluated there.
        """
        if self.linear and self.conduction is not None:
            return zs - self.conduction.of(ys)
        if not self.stores.warm.size:
            return self.within.residuals(ys, zs, inputs)
        xs, slopes = self.stores.entropies(ys), self.stores.slopes(ys)
        if not isinstance(self.within, Integral):
            return self.within.residuals(xs, self._turned(zs, slopes), inputs)
        found = zs - slopes * self.within.rates(xs, inputs)
        return found if self.conduction is None else found - self.conduction.of(ys)

    def matrices(self, y: Array, z: Array, inputs: Array) -> Matrices:
        """The derivatives of g at (y, z), dense of small systems."""
        found = self._derivatives(y, z, inputs)
        if self.unknowns > DENSE:
            return found
        return Matrices(found.unknowns.toarray(), found.states.toarray())

    def _derivatives(self, y: Array, z: Array, inputs: Array) -> Matrices:
        if not self.stores.warm.size:
            return self.within.matrices(y, z, inputs)
        if self.linear and self.conduction is not None:
            return Matrices(_diagonal(np.ones(y.size)), -self._conducting)
        x, slopes, bend = self.stores.entropies(y), self.stores.slopes(y), self.stores.bends
        if not isinstance(self.within, Integral):
            inner = self._turned(z, slopes)
            found, over = self.within.matrices(x, inner, inputs), np.ones(z.size)
            over[: y.size] /= slopes
            turn = np.zeros(z.size)
            turn[: y.size] = inner[: y.size] / slopes * bend
            states = _by_columns(found.states, over) - _by_columns(found.unknowns, turn)
            return Matrices(_by_columns(found.unknowns, over), states)
        found = self.within.matrices(x, z, inputs)
        states, rates = _by_columns(found.states, 1.0 / slopes), self.within.rates(x[None], inputs[None])[0]
        states.data *= slopes[states.indices]
        states = states - _diagonal(rates * bend)
        return Matrices(found.unknowns, states if self.conduction is None else states - self._conducting)

    def instants(self, ys: Array, zs: Array, inputs: Array) -> list[AccumulatorRates]:
        """Powers and energies at stages (y, z), those of conduction aside; the unknowns are those by states."""
        if self.linear:
            none = AccumulatorRates(
                np.zeros(4 + self._components), np.zeros(0), np.zeros(0), np.zeros(self._components)
            )
            return [none] * len(ys)
        xs = self.stores.entropies(ys)
        if self.stores.warm.size and not isinstance(self.within, Integral):
            zs = self._turned(zs, self.stores.slopes(ys))
        return [self.within.instant(x, z, given) for x, z, given in zip(xs, zs, inputs, strict=True)]

    def _turned(self, zs: Array, slopes: Array) -> Array:
        """Unknowns by states."""
        out = zs.copy()
        out[..., : self._rates] /= slopes
        return out


def _by_columns(matrix: csc_array, factors: Array) -> csc_array:
    """A matrix with its columns multiplied."""
    data = matrix.data * np.repeat(factors, np.diff(matrix.indptr))
    return csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def _diagonal(values: Array) -> csc_array:
    places = np.arange(values.size + 1)
    return csc_array((values, places[:-1], places), shape=(values.size, values.size))
