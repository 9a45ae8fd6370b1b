"""Radau IIA of order 5, 9 or 13 on the reduced form: stiff, adaptive, loops closed after each step.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8. The stages live in the increments of one step,
y = (v, r, heats), so that the same collocation serves joints on every group; work is its quadrature,
heats follow that and the energies, see `Heats`.
"""

from collections.abc import Mapping
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.contest import Contest
from ephs.mechanics.methods.marching import Leave, March
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.stages import KeptJacobian, Stages, scheme_of
from ephs.mechanics.methods.tableaux import arrays
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.solve.methods.collocation import Collocation, radau
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Leg, Span

FEWEST = 3
"""Stages of order 5."""
HELD = 1.2
"""`ReducedMethod.hold` where matrices are sparse: their factors take longer than stages."""


def tableau(scheme: Collocation) -> Mapping[str, Any]:
    """A method as `ephs.solve.march.Tableau`: after the start, the stages; the last leads to the end."""
    stages = np.vstack([np.zeros(scheme.nodes.size), scheme.coefficients, scheme.coefficients[-1]])
    return arrays(np.pad(stages, ((0, 0), (1, 0))), np.array([1.0, *(scheme.defect / scheme.gamma), 0.0]))


@final
class Implicit(ReducedMethod):
    """The method on one mechanism; with ``counts`` its own are counted there."""

    name = "radau"

    def __init__(
        self,
        equations: ReducedEquations,
        control: Control,
        counts: dict[str, Any] | None = None,
        scheme: Collocation | None = None,
    ) -> None:
        super().__init__(equations, control)
        self.counts = self.counts if counts is None else counts
        self.scheme = scheme or scheme_of(equations, control)
        self._fewer: Implicit | None = None
        self._march: March | None = None
        self.exponent = self.scheme.nodes.size + 1.0
        self._embedded = self.scheme.defect @ np.linalg.inv(self.scheme.coefficients) / self.scheme.gamma
        self._stages, self._tableau = Stages(equations, control, self.scheme, self.counts), tableau(self.scheme)
        self.rtol, self.atol = self._stages.rtol, self._stages.atol
        self.hold = HELD if self._stages.jacobian.sparse else 1.0

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        return self.tried(state, h, part=False)

    def tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        """One step, or a part of one: of three stages, where constraints lose rank and more have no solution.

        There, rounding is more than what stages of a higher order may be off by.
        """
        try:
            return self._step(state, h, part=part)
        except SolveError as error:
            few = self.scheme.nodes.size <= FEWEST or not self.equations.engine.looped
            if few or error.outcome is not Outcome.DIVERGED:
                raise
        return self._with_fewer().tried(state, h, part=part)

    def _with_fewer(self) -> "Implicit":
        """The method of three stages."""
        self._fewer = self._fewer or Implicit(self.equations, self.control, self.counts, radau(FEWEST))
        return self._fewer

    def _step(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        eq, state = self.equations, self.equations.accounts.opened(state)
        y0 = eq.vector(state)
        first = self.first(state, y0)
        stages, rates = self._stages.solve(state, y0, h)
        y1 = y0.copy()
        y1[: stages.shape[1]] += stages[-1]
        end = eq.ended(state, y1, state.t + h)
        closed, error = self._closed(state, end, y0, y1, first, stages, h)
        allowed = self._stages.allowed(y0, y1)
        closed = eq.accounts.summed(state, closed, self._tableau, np.vstack([first, rates]), h, part=part, damped=True)
        sums = np.array(eq.engine.totals["low" if part else "whole"])
        closed, missed = eq.accounts.corrected(state, closed, h, allowed, chosen=self.control.step is None, alone=True)
        self._stages.keep()
        return Attempt(state, closed, h, max(error, missed), eq.least(state, closed), sums)

    def many(
        self, span: Span[ReducedState], contest: Contest | None = None, left: Leave | None = None
    ) -> Leg[ReducedState] | None:
        """Steps of trees, many in one compiled call, if no step needs Python, until another method wins a contest."""
        eq = self.equations
        looped, attached = eq.engine.looped or eq.driven.size > 0, bool(eq.reduced.attaching.network.attached)
        if looped or attached or not eq.constant or self._stages.jacobian.sparse:
            return None
        if self._march is None or not self._march.serves(span):
            self._march = March(self, self._tableau, span, kept=KeptJacobian(self._stages))
        return self._march.leg(span, left=left, contest=contest)

    def taken(self, state: ReducedState) -> Snapshot:
        """State at which the matrix was made, and the step for which it was factorised, of fewer stages, too."""
        fewer = None if self._fewer is None else self._fewer.taken(state)
        return {"kept": self._stages.kept.snapshot(state), "fewer": fewer}

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        self._stages.kept.restore(own["kept"], state)
        if own["fewer"] is not None:
            self._with_fewer().take(own["fewer"], state)

    def _closed(
        self, state: ReducedState, end: ReducedState, y0: Array, y1: Array, first: Array, stages: Array, h: float
    ) -> tuple[ReducedState, float]:
        """The end with its loops closed, and the difference to the embedded method, filtered by the equations as its
        stiff part must be, relative to what is allowed."""
        eq, size, heat = self.equations, stages.shape[1], self._stages.heat
        real, rough = self._stages.kept.solvers(h)[0], self._embedded @ stages / h
        allowed = self._stages.allowed(y0, y1)

        def estimated(rates: Array) -> tuple[Array, ReducedState, float]:
            found, closed = real(rates[:size] + rough), eq.closed(end)
            return found, closed, float(np.max(np.abs(eq.along(found[eq.counted])) / allowed, initial=0.0))

        found, closed, error = estimated(first)
        if error > 1.0:  # again from the corrected state: the first estimate is far too large for stiff parts
            moved = y0.copy()
            moved[:size] += found
            moved[heat] = np.maximum(moved[heat], eq.heats.coldest(y0[heat]))
            _, closed, error = estimated(eq.rates(state.t, state.q, moved))
        return closed, error
