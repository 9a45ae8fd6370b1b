"""Explicit Runge-Kutta methods on the reduced form: adaptive, loops projected back after each step.

Steps of a mechanism on which nothing but given constants acts are taken many in one compiled call.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.methods import tableaux as t
from ephs.mechanics.methods.contest import Contest
from ephs.mechanics.methods.marching import March
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage.calling import Bound
from ephs.solve.march.account import WHOLE, WORTH
from ephs.solve.march.steps import STEPS
from ephs.solve.methods.own import Method, coefficients_of
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Leg, Span

if TYPE_CHECKING:
    from ephs.mechanics.methods.semi import Semi


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coefficients of an explicit method.

    Attributes
    ----------
    arrays
        By the names of `ephs.solve.march.Tableau`.
    c
        Its nodes.
    exponent
        The power of the step with which its estimate falls.
    """

    name: str
    order: int
    arrays: Mapping[str, Any]
    c: Array
    exponent: float

    @property
    def estimates(self) -> tuple[Array, ...]:
        """(stages + 1,) weights of the estimates: one, or two that are combined."""
        return tuple(self.arrays[name] for name in ("error", "coarse")[: 1 + min(1, int(self.arrays["eighth"][0]))])


def tableau(method: str | Method, *, chosen: bool = True) -> Tableau:
    """The method rk54 or rk87, or one of a user's own; ``chosen``: its steps are, by an estimate of their error."""
    if isinstance(method, str):
        return _named(method)
    of = coefficients_of(method, chosen=chosen)
    return Tableau(method.name, of.order, t.arrays(of.extended[:, :-1], of.error), of.a.sum(axis=1), float(of.power))


@cache
def _named(name: str) -> Tableau:
    if name == "rk87":
        arrays = t.arrays(_steps(t.A8, t.B8), np.array(t.E8_5), np.array(t.E8_3))
        return Tableau(name, 8, arrays, np.array(t.C8), 8.0)
    return Tableau(name, 5, t.arrays(_steps(t.A5, t.B5), np.array(t.E5)), np.array(t.C5), 5.0)


def _steps(rows: tuple[tuple[float, ...], ...], last: tuple[float, ...]) -> Array:
    out = np.zeros((len(rows) + 2, len(rows) + 1))
    for i, row in enumerate((*rows, last), 1):
        out[i, : len(row)] = row
    return out


@final
class Explicit(ReducedMethod):
    """The method of a tableau on one mechanism.

    Parameters
    ----------
    lagged
        Memory of semi-implicit steps, which need no rates at the start and turn energy that they lose into heat.
    """

    def __init__(
        self, equations: ReducedEquations, control: Control, method: Tableau, lagged: "Semi | None" = None
    ) -> None:
        super().__init__(equations, control)
        self.solve = equations.stages if lagged is None else lagged.stages
        self.lagged = lagged
        self._march: March | None = None
        self.method, self.name, self.exponent = method, method.name, method.exponent
        self.share, self._worth = (0.5, WORTH) if lagged is None else (0.0, WHOLE)
        self._fine, self._coarse, self._allowed = np.zeros((3, self.atol.size))
        self._open, self._shut = np.zeros((2, equations.n))

    @cached_property
    def _weighing(self) -> tuple[Bound, Bound, Bound]:
        """The measure of an error, that of what is projected, and stiffness, of steps that are taken one by one."""
        compiled, ends = STEPS.compiled(), (self._fine, self._coarse, self._allowed)
        drift = compiled["drift"].bind(self._open, self._shut, self._allowed)
        return (
            compiled["measure"].bind(*ends, self.method.arrays["eighth"]),
            drift,
            compiled["stiffness"].bind(*ends, 0.0),
        )

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        return self.tried(state, h, part=False)

    def tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        """One step, or a part of one."""
        eq, scheme, (measure, drift, stiffness) = self.equations, self.method.arrays, self._weighing
        state = eq.accounts.opened(state)
        y0, y1 = eq.vector(state), np.empty(eq.size)
        k = np.zeros((scheme["a"].shape[0], eq.size))
        if self.lagged is None:
            k[0] = self.first(state, y0)
        before = self.solve(state, scheme, self.method.c, h, y0, k, y1)
        allowed = self._allowed[:] = self.atol + self.rtol * eq.sizes(y0, y1)
        damped = None if self.lagged is None else eq.advance(state.q, y1[: eq.nv])
        y1, account = eq.accounts.booked(state, scheme, k, h, y1, part=part, damped=damped)
        sums = np.array(eq.engine.totals["low" if part else "whole"])
        end = replace(eq.ended(state, y1, state.t + h), account=account)
        closed = eq.closed(end)

        def estimated() -> float:
            estimates = [eq.along(h * (weights @ k)[eq.counted]) for weights in self.method.estimates]
            self._fine[:], self._coarse[:] = estimates[0], estimates[-1]
            return float(measure())

        error, rough = estimated(), any(q is state.q for q in self.rough)
        if eq.engine.looped and not (rough or eq.careful):
            self._open[:], self._shut[:] = end.r, closed.r
            error = max(error, float(drift()))
        if not error > 1.0 or self.control.step is not None:
            closed, missed = eq.accounts.corrected(
                state, closed, h, allowed, chosen=self.control.step is None, share=self._worth
            )
            error = max(error, missed)
            found = (
                None
                if self.lagged is None or part or error > 1.0
                else self.lagged.ahead(closed, state.t if eq.held else closed.t)
            )
            if found is not None:
                k[-1] = found
                error = max(error, estimated())
        self.rough = (*((state.q,) if rough else ()), *((closed.q,) if eq.careful else ()))
        if self.lagged is None:
            self._fine[:], self._coarse[:] = (k[-1] - k[-2])[eq.counted], (y1 - before)[eq.counted]
            self.stiffness = float(stiffness(h))
            if not (eq.engine.looped or eq.careful):  # nothing was projected: the last rates are the next first ones
                first = k[-1].copy()
                first[: eq.nv] = closed.r
                self._known = closed.q, first
        return Attempt(state, closed, h, error, eq.least(state, closed), sums)

    def taken(self, state: ReducedState) -> Snapshot:
        """The rates at the state, if known, and the stiffness of the last step."""
        known = self._known[1] if self._known is not None and self._known[0] is state.q else None
        return {"known": known, "stiffness": self.stiffness, "rough": any(q is state.q for q in self.rough)}

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a value of `taken`."""
        self._known = None if own["known"] is None else (state.q, own["known"])
        self.stiffness = own["stiffness"]
        self.rough = (state.q,) if own["rough"] else ()

    def many(
        self,
        span: Span[ReducedState],
        limit: float = 0.0,
        left: Callable[[float, float, str], None] | None = None,
        contest: Contest | None = None,
    ) -> Leg[ReducedState] | None:
        """Many steps in one compiled call, if no step needs Python.

        The leg ends when stability limits the steps, h·|λ| is ``limit`` then, and calls left(t, h, reason); in a
        contest it ends where that has another method go on.
        """
        if not self.equations.constant:
            return None
        if self._march is None or not self._march.serves(span):
            self._march = March(self, self.method.arrays, span, lagged=self.lagged)
        return self._march.leg(span, limit, left, contest)
