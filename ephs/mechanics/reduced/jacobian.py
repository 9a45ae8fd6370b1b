"""The Jacobian of the reduced form, and one that is kept while it serves."""

from typing import final

import numpy as np

from ephs.mechanics.reduced.equations import Equations, ReducedState
from ephs.semantics.bundle import Array

__all__ = ["Jacobian"]

RELATIVE = 2e-8
"""Of the differences: about the root of the rounding unit."""


@final
class Jacobian:
    """∂ẏ/∂y of y = (v, r, s) at v = 0, by differences: it steers Newton's method, not what that converges to."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self.size = equations.nv + equations.n + equations.ns
        self.count = 0
        self._at: Array | None = None
        self._value = np.zeros((self.size, self.size))

    def fresh(self, state: ReducedState) -> bool:
        """Whether the matrix was made at this state."""
        return self._at is state.q

    def at(self, state: ReducedState, *, renew: bool = False) -> Array:
        """The matrix (size, size), made anew where asked for or where there is none."""
        if self._at is not None and not renew:
            return self._value
        eq = self.equations
        y = eq.vector(state)
        middle = eq.rates(state.t, state.q, y)[: self.size]
        value = np.empty((self.size, self.size))
        for j in range(self.size):
            moved = y.copy()
            moved[j] += RELATIVE * max(1.0, abs(y[j]))
            value[:, j] = (eq.rates(state.t, state.q, moved)[: self.size] - middle) / (moved[j] - y[j])
        self._value, self._at = value, state.q
        self.count += 1
        return value
