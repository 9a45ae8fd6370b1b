"""States from coordinates and rates of joints, without building another scene."""

from collections.abc import Mapping
from typing import TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.dynamics.state import State
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.finding.layout import Layout
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import OptionError

ByJoint: TypeAlias = Mapping[str, ArrayLike] | ArrayLike
"""Numbers of joints by name, or (n,) of all of the tree in the order of its freedoms."""


@final
class Placing:
    """Elements and rates of a mechanism's tree by joint.

    Attributes
    ----------
    free
        Whether coordinates and rates may be any: nothing is prescribed, no loop has to close, no gear ties them.
    gears
        What ties rates of joints to each other.
    """

    def __init__(self, equations: ReducedEquations) -> None:
        self.layout: Layout = equations.layout
        self.gears = tuple(map(str, equations.reduced.gears))
        self.free = self.layout.total == self.layout.n and not equations.driven.size and not self.gears
        t = equations.reduced.tables
        self._parts = {
            name: [(e.pair, slice(int(t.q_at[i]), int(t.q_at[i] + e.pair.size)), e.pair.dim) for i, e in parts]
            for name, parts in self.layout.edges.items()
        }
        self._flat = all(pair.code == VECTOR for parts in self._parts.values() for pair, _, _ in parts)
        self._order = np.empty(self.layout.n, dtype=np.int64)  # of elements, where they are coordinates
        for name, where in self.layout.freedoms.items() if self._flat and self.free else ():
            self._order[where] = self.layout.elements[name]

        self.outwards = [slice(int(t.r_at[i]), int(t.r_at[i] + t.dim[i])) for i in range(equations.reduced.links)]
        """Places in vectors (n,) of the tree's joints, from the ground outwards; a universal joint is two."""

    def state(self, first: State, coordinates: ByJoint | None, rates: ByJoint | None) -> State | None:
        """A state with some joints displaced; None where they are not free or the loops do not close."""
        if not self.free:
            return None
        q = self.elements(first.q, {} if coordinates is None else coordinates)
        r = self.rates(first.r, {} if rates is None else rates)
        if q is None or r is None:
            return None
        return State(np.concatenate([q, r, first.entropies]), self.layout, first.cut_rates)

    def moved(self, first: State, coordinates: Mapping[str, ArrayLike], rates: Mapping[str, ArrayLike]) -> State:
        """A state with some joints elsewhere, whose loops may be open.

        Raises
        ------
        OptionError
            What is given does not fit a joint.
        """
        q, r = self.elements(first.q, coordinates), self.rates(first.r, rates)
        if q is None or r is None:
            expected = ", ".join(f"{name} {where.size}" for name, where in self.layout.freedoms.items())
            raise OptionError(
                "state", {**coordinates, **rates}, f"finite numbers, one per degree of freedom: {expected}"
            )
        return State(np.concatenate([q, r, first.entropies]), self.layout, first.cut_rates)

    def elements(self, q: Array, given: ByJoint) -> Array | None:
        """Elements q with some joints at these coordinates; None where they do not fit."""
        if not isinstance(given, Mapping):
            values = np.asarray(given, dtype=float)
            if values.shape != (self.layout.n,) or not np.isfinite(values).all():
                return None
            if self._flat:
                out = q.copy()
                out[self._order] = values
                return out
            given = {name: values[where] for name, where in self.layout.freedoms.items()}
        out = q.copy()
        for name, value in given.items():
            values = np.asarray(value, dtype=float)
            where = self.layout.freedoms.get(name)
            if where is None or values.size != where.size or values.ndim > 1:
                return None
            if self._flat:
                out[self.layout.elements[name]] = values
                continue
            first, values = 0, np.atleast_1d(values)
            for pair, at, dim in self._parts[name]:
                out[at] = pair.element(values[first : first + dim])
                first += dim
        return out if np.isfinite(out).all() else None

    def places(self, given: Mapping[str, ArrayLike]) -> Index:
        """Freedoms of the tree that joints of these names have."""
        found = np.concatenate([np.zeros(0, dtype=np.int64), *(self.layout.freedoms[name] for name in given)])
        return found[found < self.layout.n]

    def rates(self, r: Array, given: ByJoint) -> Array | None:
        """Rates r with some joints at these; None where they do not fit."""
        if not isinstance(given, Mapping):
            values = np.array(given, dtype=float)
            return values if values.shape == r.shape and np.isfinite(values).all() else None
        out, freedoms = r.copy(), self.layout.freedoms
        for name, value in given.items():
            where = freedoms.get(name)
            values = np.asarray(value, dtype=float)
            if where is None or values.size != where.size or values.ndim > 1:
                return None
            out[where] = values
        return out if np.isfinite(out).all() else None

    def difference(self, q: Array, wanted: Array) -> Array:
        """(n,) increments that lead from elements of the tree to others, left-trivialised."""
        if self._flat and self.free:
            return (wanted - q)[self._order]
        out = np.empty(self.layout.total)
        for name, where in self.layout.freedoms.items():
            first = 0
            for pair, at, dim in self._parts[name]:
                out[where[first : first + dim]] = pair.manifold.increment(q[at], wanted[at])
                first += dim
        return out[: self.layout.n]
