"""IDA of SUNDIALS on the reduced form: an independent integrator, beside which the others are measured.

Its unknowns are the increments from a base that is moved, with the loops closed, where they have grown or a loop has
opened by rounding; each move starts IDA anew, at order 1. What it hands over at each of its steps keeps the balance of
energy by a correction; it goes on from its own numbers. Needs the package scikit-sundae.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.registry import METHODS, MethodEntry, on_joints, register_method
from ephs.mechanics.methods.tableaux import MIDPOINT
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.running.control import Control
from ephs.solve.running.stepping import Attempt

LEAST_RTOL, LEAST_ATOL = 1e-14, 1e-15
"""Least tolerances for IDA, which fails with smaller ones because of rounding."""
LOG = "SUNLOGGER_ERROR_FILENAME"
"""Environment variable that names the file of SUNDIALS' errors, if not stderr; read when a solver is made."""
FAR = 1.5
"""Increments beyond this on a group ask for another base, in rad or m."""
OPEN = 10.0
"""Loops open by more than this, relative to the tolerance, ask for another base."""
PART = 1e-2
"""Tolerances for IDA relative to the run's: they apply to single steps, whose errors accumulate."""


@final
class Ida(ReducedMethod):
    """The integrator on one mechanism. It takes its own steps, at most as long as the loop proposes."""

    name = "ida"
    exponent = 5.0

    def __init__(self, equations: ReducedEquations, control: Control) -> None:
        try:
            from sksundae.ida import IDA as Solver
        except ImportError as error:
            raise OptionError("method", "ida", "another, or ephs[ida] installed, which brings scikit-sundae") from error
        super().__init__(equations, control)
        equations.accounts.followed = False
        self._make: Any = Solver
        self._failure: SolveError | None = None
        self._base: ReducedState | None = None
        self._last: Array | None = None
        self._y = np.zeros(equations.size)
        self._solver: Any = None
        self.counts = {"restarts": 0}

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One of IDA's steps, h seconds or less."""
        state = self.equations.accounts.opened(state)
        if self._last is not state.q or self._base is None:
            self._restart(state)
        base, self._failure = self._base, None
        assert base is not None
        self._base = None  # until this step is taken: the solver cannot reverse
        try:
            found = self._solver.step(state.t + h - base.t, method="onestep", tstop=state.t + h - base.t)
        except RuntimeError as error:
            raise self._failure or SolveError(Outcome.DIVERGED, "", f"IDA: {error}") from error
        if not found.success:
            if self._failure is not None:
                raise self._failure
            raise SolveError(Outcome.DIVERGED, "", f"IDA: {found.message}")
        t, y = float(np.ravel(found.t)[-1]) + base.t, np.array(found.y[-1] if found.y.ndim > 1 else found.y)
        if t == state.t:
            raise self._failure or SolveError(Outcome.TINY, "", "IDA's step")
        return self._attempt(state, base, y, t)

    def inside(self, attempt: Attempt[ReducedState], t: float) -> ReducedState:
        """The state at a time within a step, by a run of its own from the step's start."""
        own = Ida(self.equations, self.control)
        state = attempt.start
        while state.t != t:
            state = own.step(state, t - state.t).end
        return state

    def _attempt(self, state: ReducedState, base: ReducedState, y: Array, t: float) -> Attempt[ReducedState]:
        eq, plain = self.equations, self.equations.heats.plain
        first = eq.size - len(eq.reduced.made)
        # What IDA counts of friction's heat falls by its error where there is little: what was counted most stays.
        sink = eq.reduced.tables.sink
        counted, friction = y.copy(), first + sink[sink[:, 3] > 0, 0]
        counted[friction] = np.maximum(y[friction], self._y[friction])
        passed, self._y = counted - self._y, counted
        nv, n, ns = eq.nv, eq.n, eq.ns
        v, r, heats = np.split(y[: nv + n + ns], [nv, nv + n])
        heats = np.where(plain, heats, state.heats)
        free = eq.prescribed.followed(
            base, ReducedState(t, eq.advance(base.q, v), r, heats, state.totals, account=state.account)
        )
        closed = eq.closed(free)
        change, flows = np.concatenate([np.zeros(nv + n), passed[nv + n :]]), passed[first:]
        change[nv + n : nv + n + ns] = np.where(plain, heats - state.heats, eq.heats.taken(state.heats, flows)[0])
        closed = eq.accounts.summed(state, closed, MIDPOINT, change[None], 1.0)
        # It continues from its own state, so corrections are applied to each returned state.
        since = np.concatenate([base.account[: eq.accounts.own], state.account[eq.accounts.own :]])
        allowed = self.atol + self.rtol * eq.sizes(eq.vector(state), eq.vector(closed))
        closed, _ = eq.accounts.corrected(
            replace(state, account=since), closed, t - state.t, allowed, chosen=True, alone=True
        )
        moved = float(np.abs(eq.gaps(free.q, free.r)[0]).max(initial=0.0)) if closed is not free else 0.0
        self._last = closed.q
        if np.max(np.abs(y[eq.curved]), initial=0.0) <= FAR and moved <= OPEN * float(np.min(self.rtol)):
            self._base = base
        return Attempt(state, closed, t - state.t, 0.0, eq.least(state, closed))

    def _restart(self, state: ReducedState) -> None:
        eq = self.equations
        self._base = state = eq.accounts.opened(state)
        self.counts["restarts"] += 1
        y0 = self._y = eq.vector(state)
        rtol = PART * float(np.min(self.rtol, initial=1.0))
        atol = np.full(y0.size, PART * float(np.min(self.atol, initial=1.0)))
        atol[eq.nv + eq.n :] *= eq.model.reference.temperature  # J, of J/K
        atol[eq.nv + eq.n : eq.nv + eq.n + eq.ns][eq.heats.plain] = PART * float(np.min(self.atol, initial=1.0))
        self._failure = None

        def residual(t: float, y: Array, yp: Array, out: Array) -> None:
            try:
                out[:] = yp - eq.rates(state.t + t, state.q, np.asarray(y))
            except SolveError as error:
                self._failure = error
                out[:] = np.nan

        first = eq.rates(state.t, state.q, y0)
        with _unlogged():
            self._solver = self._make(
                residual, rtol=max(rtol, LEAST_RTOL), atol=np.maximum(atol, LEAST_ATOL), max_num_steps=100000
            )
            self._solver.init_step(0.0, y0, first)


@contextmanager
def _unlogged() -> Generator[None, None, None]:
    """Context in which SUNDIALS writes no errors to stderr; they are raised as exceptions."""
    if LOG in os.environ:
        yield
        return
    os.environ[LOG] = os.devnull
    try:
        yield
    finally:
        del os.environ[LOG]


IDA = MethodEntry("ida", 5, True, False, False, True, "IDA of SUNDIALS", on_joints(Ida))


def register() -> None:
    """Register it as the method ``ida`` of this process."""
    if IDA.name not in METHODS:
        register_method(IDA)
