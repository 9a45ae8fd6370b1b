"""Explicit Runge-Kutta methods on the reduced form: adaptive, loops projected back after each step.

Coefficients are those of Dormand and Prince, of orders 5(4) and 8(5, 3), as SciPy ships them.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, final

import numpy as np

from ephs.mechanics.reduced.equations import Equations, ReducedState
from ephs.mechanics.reduced.method import ReducedMethod
from ephs.mechanics.solve.control import Control
from ephs.mechanics.solve.loop import Attempt
from ephs.semantics.bundle import Array

__all__ = ["Explicit", "Tableau", "tableau"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coefficients of an explicit method; ``error`` and, of order 8, ``coarse`` estimate its error."""

    name: str
    order: int
    a: Array
    b: Array
    c: Array
    error: Array
    coarse: Array | None

    def estimates(self, k: Array, h: float) -> list[Array]:
        """The vectors that estimate a step's error: one, or a fine and a rough one."""
        return [h * (weights @ k) for weights in (self.error, self.coarse) if weights is not None]

    @staticmethod
    def measure(estimates: list[Array]) -> float:
        """Their size, where each is relative to what is allowed: at most 1 where a step may be accepted."""
        size = max(estimates[0].size, 1)
        squares = [float(estimate @ estimate) for estimate in estimates]
        if len(squares) == 1 or squares[0] == 0.0:
            return float(np.sqrt(squares[0] / size))
        return squares[0] / np.sqrt((squares[0] + 0.01 * squares[1]) * size)

    @property
    def exponent(self) -> float:
        """The power of the step with which the estimate falls."""
        return 8.0 if self.coarse is not None else 5.0


@cache
def tableau(name: str) -> Tableau:
    """The method rk54 or rk87."""
    from scipy.integrate import DOP853, RK45

    method: Any = DOP853 if name == "rk87" else RK45
    n = method.n_stages
    a, b, c = np.array(method.A)[:n, :n], np.array(method.B), np.array(method.C)[:n]
    if name == "rk87":
        return Tableau(name, 8, a, b, c, np.array(DOP853.E5), np.array(DOP853.E3))
    return Tableau(name, 5, a, b, c, np.array(RK45.E), None)


@final
class Explicit(ReducedMethod):
    """The method of a tableau on one mechanism.

    Attributes
    ----------
    stiffness
        h·|λ| of the fastest mode, as the last step showed it.
    """

    def __init__(self, equations: Equations, control: Control, method: Tableau) -> None:
        super().__init__(equations, control)
        self.method, self.name, self.exponent = method, method.name, method.exponent
        self.share = 0.5
        self._known: tuple[Array, Array] | None = None
        self.stiffness = 0.0

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq, method = self.equations, self.method
        if self._known is None or self._known[0] is not state.q:
            self._known = state.q, eq.rates(state.t, state.q, eq.vector(state))
        end, k, y0, y1 = self._stages(state, h, self._known[1])
        allowed = self.atol + self.rtol * eq.sizes(y0, y1)
        closed = eq.closed(end)
        error = method.measure([eq.along(e[eq.counted]) / allowed for e in method.estimates(k, h)])
        self._look(k, y1, allowed, h)
        if closed is end and closed.q is not state.q:  # nothing was projected: the last rates are the next first ones
            first = k[-1].copy()
            first[: eq.nv] = closed.r
            self._known = closed.q, first
        return Attempt(state, closed, h, error, eq.least(state, closed))

    def _stages(self, state: ReducedState, h: float, first: Array) -> tuple[ReducedState, Array, Array, Array]:
        eq, method = self.equations, self.method
        y0 = eq.vector(state)
        k, y1 = np.zeros((method.b.size + 1, eq.size)), np.empty(eq.size)
        k[0] = first
        eq.stages(state, method.a, method.b, method.c, h, y0, k, y1)
        return eq.state(state, y1, state.t + h), k, y0, y1

    def _look(self, k: Array, y1: Array, allowed: Array, h: float) -> None:
        """h·|λ| of the mode that the last two stages differ in: what says that a problem is stiff.

        Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
        """
        eq, method = self.equations, self.method
        before = h * (method.a[-1] @ k[: method.a.shape[1]])
        after = h * (method.b @ k[: method.b.size])
        rise = np.linalg.norm(((k[-1] - k[-2])[eq.counted]) / allowed)
        run = np.linalg.norm(((after - before)[eq.counted]) / allowed)
        self.stiffness = float(abs(h) * rise / run) if run > 0.0 else 0.0
