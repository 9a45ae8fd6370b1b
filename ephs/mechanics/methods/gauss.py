"""Gauss methods of orders 4, 6 and 8 on the reduced form: symmetric, not damping, both laws kept by the correction.

Hairer, Lubich and Wanner, *Geometric Numerical Integration*, II.1 and VIII.6. Stages are iterated in machine code, many
steps a call, while that contracts; from where it does not, by Newton's method with exact derivatives.
"""

from functools import cache
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.explicit import Explicit, Tableau
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.stages import Stages
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.solve.control import Control
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.march import STEPS
from ephs.solve.methods.collocation import moments
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt, Leg, Span

__all__ = ["ORDERS", "Gauss", "gauss"]

ORDERS = {"gauss4": 4, "gauss6": 6, "gauss8": 8}
ROUNDING = 1e-14
"""Tolerances to which stages are solved at constant steps."""
SHARE = 0.1
"""Part of a divided difference of the rates that counts as a step's error; its weights' sizes sum up to one."""


@cache
def gauss(name: str) -> Tableau:
    """The method by its name, with the start of the step for a first stage of no weight.

    Its estimates are divided differences of the rates at the start, the stages and the end, and at the start and the
    stages. A first sweep guesses each stage by the polynomial through the rates at those before it.
    """
    stages = ORDERS[name] // 2
    nodes = _nodes(stages)
    every = np.concatenate([[0.0], nodes, [1.0]])
    a, guess = np.zeros((stages + 2, stages + 1)), np.zeros((stages + 1, stages + 1))
    for i in range(1, stages + 2):
        a[i, 1:] = moments(nodes, every[i])
    for i in range(1, stages + 1):
        guess[i, :i] = moments(every[:i], every[i])
    arrays: dict[str, Any] = {
        "a": a,
        "guess": guess,
        "error": SHARE * _difference(every),
        "coarse": SHARE * np.append(_difference(every[:-1]), 0.0),
        "eighth": np.ones(1, dtype=np.int64),
    }
    return Tableau(name, ORDERS[name], arrays, every[:-1], stages + 3.0)


def _nodes(stages: int) -> Any:
    return 0.5 + 0.5 * np.polynomial.legendre.leggauss(stages)[0]


def _difference(nodes: Any) -> Any:
    """Weights of the divided difference at nodes, with sizes that sum up to one."""
    weights = np.array([1.0 / np.prod(node - np.delete(nodes, i)) for i, node in enumerate(nodes)])
    return weights / np.abs(weights).sum()


@final
class Gauss(ReducedMethod):
    """The method of a name on one mechanism."""

    share = 0.5

    def __init__(self, equations: Equations, control: Control, name: str) -> None:
        super().__init__(equations, control)
        self.tableau = gauss(name)
        self.name, self.exponent = name, self.tableau.exponent
        self._sweeping = Explicit(equations, control, self.tableau)
        if control.step is not None:
            for method in (self, self._sweeping):
                method.rtol, method.atol = np.full_like(self.rtol, ROUNDING), np.full_like(self.atol, ROUNDING)
        # h·|λ| beyond which sweeps over the stages do not contract
        self._limit = 1.0 / float(np.abs(np.linalg.eigvals(self.tableau.arrays["a"][1:-1, 1:])).max())
        self._stages: Stages | None = None
        self.counts: dict[str, Any] = {"switches": []}

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        if self._stages is None:
            try:
                return self._sweeping.step(state, h)
            except SolveError as error:
                if error.outcome is not Outcome.DIVERGED:
                    raise
        return self._solved(state, h)

    def many(self, span: Span[ReducedState]) -> Leg[ReducedState] | None:
        """Steps by sweeps over the stages, many in one compiled call, until these do not contract."""
        return None if self._stages is not None else self._sweeping.many(span, self._limit, self._switch)

    def inside(self, attempt: Attempt[ReducedState], t: float) -> ReducedState:
        """The state at a time within a step, by a shorter one."""
        return super().inside(attempt, t) if self._stages is not None else self._sweeping.inside(attempt, t)

    def _switch(self, t: float, h: float, reason: str) -> None:
        self._newton()
        self.counts["switches"].append({"t": float(t), "to": "Newton's method", "step": float(h), "reason": reason})

    def _newton(self) -> Stages:
        if self._stages is None:
            a = self.tableau.arrays["a"]
            self._stages = Stages(self.equations, self.control, self.tableau.c[1:], a[1:-1, 1:], self.counts)
        return self._stages

    def _solved(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """A step by Newton's method."""
        eq, stages, arrays = self.equations, self._newton(), self.tableau.arrays
        y0, k = eq.vector(state), np.zeros((arrays["a"].shape[0], eq.size))
        k[0] = eq.rates(state.t, state.q, y0)
        found, passed, fast = stages.solve(state, y0, h)
        size = found.shape[1]
        k[1:-1, :size] = stages.inverse @ found / h
        k[1:-1, size:] = passed
        y1 = y0 + h * (arrays["a"][-1] @ k[:-1])
        k[-1] = eq.rates(state.t + h, state.q, y1)
        closed = eq.closed(eq.state(state, y1, state.t + h))
        estimates = [eq.along(h * (weights @ k)[eq.counted]) for weights in self.tableau.estimates]
        allowed = stages.allowed(y0, y1)
        error = float(STEPS.compiled()["measure"](*estimates, allowed, arrays["eighth"]))
        stages.keep(closed, fast=fast)
        return Attempt(state, closed, h, error, eq.least(state, closed))

    def taken(self, state: ReducedState) -> Snapshot:
        """Memory of how it solves its stages."""
        return {
            "sweeping": self._sweeping.taken(state),
            "stages": None if self._stages is None else self._stages.snapshot(state),
        }

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Take along what `taken` said."""
        self._sweeping.take(own["sweeping"], state)
        if own["stages"] is not None:
            self._newton().restore(own["stages"], state)
