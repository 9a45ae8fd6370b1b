"""Gauss methods of orders 4, 6 and 8 on the reduced form: symmetric, undamped, both laws kept by correction.

Hairer, Lubich and Wanner, *Geometric Numerical Integration*, II.1 and VIII.6. Stages are iterated in machine code, many
steps a call, while that contracts; from where it does not, constant steps are solved by Newton's method with exact
derivatives, and chosen ones are left to radau, since nothing here damps what is too fast.
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.explicit import Explicit, Tableau
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.stages import Stages
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.semantics.bundle import Array
from ephs.semantics.spaces.decompositions import eigenvalues
from ephs.solve.control import Control
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.collocation import moments
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt, Leg, Span

ORDERS = {"gauss4": 4, "gauss6": 6, "gauss8": 8}
ROUNDING = 1e-14
"""Tolerances to which stages are solved at constant steps."""
SHARES = {4: 6.0, 6: 0.5, 8: 0.2}
"""Part of a divided difference of the rates, whose weights' sizes sum up to one, that counts as a step's error.

Tried on chains and loops so that errors at the end are about what the tolerances say.
"""


@cache
def gauss(name: str) -> Tableau:
    """The method by its name, with the start of the step for a first stage of no weight.

    Its estimates are divided differences of the rates at the start and the stages, and at the stages. (With the end as
    well, rates of a linear equation are those of one polynomial, and say nothing.) A first sweep guesses each stage by
    the polynomial through the rates at those before it.
    """
    stages, share = ORDERS[name] // 2, SHARES[ORDERS[name]]
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
        "error": np.concatenate([share * _difference(every[:-1]), [0.0]]),
        "coarse": np.concatenate([[0.0], share * _difference(nodes), [0.0]]),
        "eighth": np.array([2], dtype=np.int64),
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
        self._steps = Explicit(equations, control, self.tableau, self._solve)
        if control.step is not None:
            for method in (self, self._steps):
                method.rtol, method.atol = np.full_like(self.rtol, ROUNDING), np.full_like(self.atol, ROUNDING)
        # h·|λ| beyond which sweeps over the stages do not contract
        self.limit = 1.0 / float(np.abs(eigenvalues(self.tableau.arrays["a"][1:-1, 1:])).max())
        self._stages: Stages | None = None
        self._sweeps = True
        self.counts: dict[str, Any] = {"switches": []}

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        return self._steps.step(state, h)

    @property
    def stiffness(self) -> float:
        """h·|λ| of the fastest mode, estimated in the last step."""
        return self._steps.stiffness

    def many(
        self, span: Span[ReducedState], limit: float = 0.0, left: Callable[[float, float, str], None] | None = None
    ) -> Leg[ReducedState] | None:
        """Steps by sweeps over the stages, many in one compiled call, until sweeps do not contract.

        From there they are ``left``, or solved by Newton's method.
        """
        return self._steps.many(span, limit or self.limit, left or self._switch) if self._sweeps else None

    def inside(self, attempt: Attempt[ReducedState], t: float) -> ReducedState:
        """The state at a time within a step, by a shorter one."""
        return self._steps.inside(attempt, t)

    def _switch(self, t: float, h: float, reason: str) -> None:
        self._sweeps = False
        self.counts["switches"].append({"t": float(t), "to": "Newton's method", "step": float(h), "reason": reason})

    def _newton(self) -> Stages:
        if self._stages is None:
            a = self.tableau.arrays["a"]
            self._stages = Stages(self.equations, self.control, self.tableau.c[1:], a[1:-1, 1:], self.counts)
        return self._stages

    def _solve(
        self, state: ReducedState, scheme: Mapping[str, Array], c: Array, h: float, y0: Array, k: Array, y1: Array,
        tolerances: tuple[Array, Array], *, chosen: bool,
    ) -> Array:  # fmt: skip
        """Stages by sweeps, by Newton's method from where these do not contract; see `Equations.stages`."""
        eq = self.equations
        if self._sweeps:
            try:
                return eq.stages(state, scheme, c, h, y0, k, y1, tolerances, chosen=chosen)
            except SolveError as error:
                if error.outcome is not Outcome.DIVERGED:
                    raise
        stages = self._newton()
        found, passed, fast = stages.solve(state, y0, h)
        size, last = found.shape[1], y0.copy()
        k[1:-1, :size], k[1:-1, size:] = stages.inverse @ found / h, passed
        last[:size] += found[-1]
        y1[:] = y0 + h * (scheme["a"][-1] @ k[:-1])
        k[-1] = eq.rates(state.t + h, state.q, y1)
        stages.keep(fast=fast)
        return last

    def taken(self, state: ReducedState) -> Snapshot:
        """Memory of its solver of the stages."""
        return {
            "steps": self._steps.taken(state),
            "stages": None if self._stages is None else self._stages.snapshot(state),
            "sweeps": self._sweeps,
        }

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        self._steps.take(own["steps"], state)
        self._sweeps = own["sweeps"]
        if own["stages"] is not None:
            self._newton().restore(own["stages"], state)
