"""Stores of heat of a system, which are advanced by energy: storages of entropy alone, by an exponential law."""

from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import spans
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.solve.equations.heats import exponential_law
from ephs.solve.equations.model import Model
from ephs.solve.methods.records import REVERSIBLE, STORING, WORKING, efforts_of


@final
class HeatStores:
    """Stores of heat, of entropy alone: those with E = c1 (exp(s/c2) − 1), and the environment, where E = θ₀ s.

    A storage that anything else than an irreversible component passes entropy to, as a reversible one or an outer port,
    is not one of them: what is passed there is an amount, which no other sum may replace.

    Numbers y are the states x of a system, but of stores with an exponential law their energies in J.

    Attributes
    ----------
    components, states
        (stores,) numbers of the storages, and entries of the state vector.
    at
        (efforts,) the store at each effort, −1 where there is none.
    hot
        (stores,) whether the law is exponential.
    warm, c1, c2
        Of those stores: the entries of their states, and their laws in J and J/K.
    bends
        (states,) d²y/dx² / (dy/dx): what a temperature rises by energy, in K/J.
    units
        (stores,) J by which a number counts: θ₀ of the environment, else 1.
    """

    def __init__(self, model: Model) -> None:
        t, d = model.tables, model.descriptor
        taken = np.zeros(int(t.counts[1]) + 1, dtype=np.int64)
        np.add.at(taken, spans(t.outer[:, 0], t.outer[:, 1]), 2)
        passing = np.flatnonzero((t.kind == REVERSIBLE) | (t.kind == WORKING))
        np.add.at(taken, efforts_of(t, passing), 2)
        stored = np.flatnonzero(t.kind == STORING)
        np.add.at(taken, efforts_of(t, stored), 1)
        laws = [_law(primitive) for primitive in d.numbering.primitives]
        known = np.array([law is not None for law in laws], dtype=bool)[d.numbering.primitive[stored]]
        chosen = stored[known]
        efforts = t.e_index[t.e_at[chosen]]
        alone = (t.entropy[efforts] == 1.0) & (taken[efforts] == 1)
        self.components = chosen[alone]
        self.at = np.full(int(t.counts[1]), -1)
        self.at[efforts[alone]] = np.arange(self.components.size)
        self.states = t.read_x[t.read_x_at[self.components]]
        found = np.array([laws[number] for number in d.numbering.primitive[self.components]]).reshape(-1, 2)
        self.hot = found[:, 1] > 0.0
        self.warm, (self.c1, self.c2) = self.states[self.hot], found[self.hot].T
        self.bends = np.zeros(int(t.counts[0]))
        self.bends[self.warm] = 1.0 / self.c2
        self.units = np.where(self.hot, 1.0, model.reference.temperature)

    def numbers(self, x: Array) -> Array:
        """(…, states) numbers of states."""
        y = np.array(x, dtype=float)
        y[..., self.warm] = self.c1 * np.expm1(x[..., self.warm] / self.c2)
        return y

    def entropies(self, y: Array) -> Array:
        """(…, states) states of numbers; not a number where a temperature is not positive."""
        if not self.warm.size:
            return y
        x = y.copy()
        with np.errstate(invalid="ignore", divide="ignore"):
            x[..., self.warm] = self.c2 * np.log1p(y[..., self.warm] / self.c1)
        return x

    def slopes(self, y: Array) -> Array:
        """(…, states) dy/dx: temperatures in K of stores of heat, else 1."""
        out = np.ones_like(y)
        out[..., self.warm] = (self.c1 + y[..., self.warm]) / self.c2
        return out

    def terms(self, y: Array) -> Array:
        """(…, states) sizes of the terms that numbers, and temperatures, are made of."""
        out = np.abs(y)
        out[..., self.warm] += self.c1
        return out


def _law(primitive: Primitive) -> tuple[float, float] | None:
    """The exponential law of a storage of one state; the environment's is linear."""
    if not isinstance(primitive, Storage) or len(primitive.interface) != 1:
        return None
    return (1.0, 0.0) if primitive.environment else exponential_law(primitive)
