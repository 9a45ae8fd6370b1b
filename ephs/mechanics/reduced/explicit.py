"""Explicit Runge-Kutta methods on the reduced form: adaptive, loops projected back after each step.

Steps of a mechanism on which nothing but given constants acts are taken many in one compiled call.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import final

import numpy as np

from ephs.mechanics.engine.march_kernels import (
    C_BEFORE,
    C_COLUMNS,
    C_COMPONENT,
    C_DAMPING,
    C_END,
    C_EVALUATIONS,
    C_EXPONENT,
    C_FRESH,
    C_GRID,
    C_H,
    C_LEAST,
    C_LEAST_STEP,
    C_LIMIT,
    C_LONGEST,
    C_MOST,
    C_ORIGIN,
    C_REFUSALS,
    C_REJECTED,
    C_ROUGH,
    C_ROWS,
    C_SAVED,
    C_SHARE,
    C_SHORTEST,
    C_SPAN,
    C_STEPS,
    C_STIFF,
    C_STRICT,
    C_T,
    C_TRIED,
    CAREFUL,
    DONE,
    PATIENCE,
    REFUSED,
    SHORT,
    STIFF,
    drift,
    judge,
    march,
    measure,
    stiffness,
)
from ephs.mechanics.engine.rate_kernels import OPEN
from ephs.mechanics.engine.tables import Scheme, State
from ephs.mechanics.reduced import tableaux as t
from ephs.mechanics.reduced.equations import Equations, ReducedState
from ephs.mechanics.reduced.method import ReducedMethod
from ephs.mechanics.reduced.naming import within
from ephs.mechanics.solve.control import Control, Proportional
from ephs.mechanics.solve.errors import LARGEST, Outcome, SolveError
from ephs.mechanics.solve.snapshot import Snapshot
from ephs.mechanics.solve.stepping import Attempt, Counts, Leg, Span
from ephs.semantics.bundle import Array

__all__ = ["Explicit", "Tableau", "tableau"]

ROWS = 1024
"""Rows that are kept before they are handed over."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coefficients of an explicit method; ``exponent``: the power of the step with which its estimate falls."""

    name: str
    order: int
    scheme: Scheme
    c: Array
    exponent: float


@cache
def tableau(name: str) -> Tableau:
    """The method rk54 or rk87."""
    if name == "rk87":
        scheme = Scheme(_square(t.A8), np.array(t.B8), np.array(t.E8_5), np.array(t.E8_3), 1)
        return Tableau(name, 8, scheme, np.array(t.C8), 8.0)
    scheme = Scheme(_square(t.A5), np.array(t.B5), np.array(t.E5), np.zeros(len(t.B5) + 1), 0)
    return Tableau(name, 5, scheme, np.array(t.C5), 5.0)


def _square(rows: tuple[tuple[float, ...], ...]) -> Array:
    out = np.zeros((len(rows) + 1, len(rows) + 1))
    for i, row in enumerate(rows, 1):
        out[i, : len(row)] = row
    return out


@final
class Explicit(ReducedMethod):
    """The method of a tableau on one mechanism.

    Attributes
    ----------
    stiffness
        h·|λ| of the fastest mode, as the last step showed it.
    rough
        Elements of the last step's start and end, each where constraints nearly repeat each other: rates there carry
        rounding over the least singular value, so that drift says nothing.
    """

    def __init__(self, equations: Equations, control: Control, method: Tableau) -> None:
        super().__init__(equations, control)
        self.method, self.name, self.exponent = method, method.name, method.exponent
        self.share = 0.5
        self._known: tuple[Array, Array] | None = None
        self.stiffness = 0.0
        self.rough: tuple[Array, ...] = ()

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        eq, scheme = self.equations, self.method.scheme
        if self._known is None or self._known[0] is not state.q:
            self._known = state.q, eq.rates(state.t, state.q, eq.vector(state))
        y0, y1 = eq.vector(state), np.empty(eq.size)
        k = np.zeros((scheme.b.size + 1, eq.size))
        k[0] = self._known[1]
        before = eq.stages(state, scheme, self.method.c, h, y0, k, y1)
        end = eq.state(state, y1, state.t + h)
        allowed = self.atol + self.rtol * eq.sizes(y0, y1)
        closed = eq.closed(end)
        estimates = [
            eq.along(h * (weights @ k)[eq.counted])
            for weights in ((scheme.error, scheme.coarse) if scheme.order8 else (scheme.error,))
        ]
        error = float(measure(estimates[0], estimates[-1], allowed, scheme.order8 == 1))
        rough = any(q is state.q for q in self.rough)
        if not (rough or eq.careful):
            error = max(error, float(drift(end.r, closed.r, allowed)))
        self.rough = (*((state.q,) if rough else ()), *((closed.q,) if eq.careful else ()))
        self.stiffness = float(stiffness(scheme, before, k, y1, h, eq.n, eq.nv, allowed))
        if closed is end and closed.q is not state.q:  # nothing was projected: the last rates are the next first ones
            first = k[-1].copy()
            first[: eq.nv] = closed.r
            self._known = closed.q, first
        return Attempt(state, closed, h, error, eq.least(state, closed))

    def taken(self, state: ReducedState) -> Snapshot:
        """The rates at the state, where they are known, and how stiff the last step was."""
        known = self._known[1] if self._known is not None and self._known[0] is state.q else None
        return {"known": known, "stiffness": self.stiffness, "rough": any(q is state.q for q in self.rough)}

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Take along what `taken` said."""
        self._known = None if own["known"] is None else (state.q, own["known"])
        self.stiffness = own["stiffness"]
        self.rough = (state.q,) if own["rough"] else ()

    def many(
        self, span: Span[ReducedState], limit: float = 0.0, left: Callable[[float, float, str], None] | None = None
    ) -> Leg[ReducedState] | None:
        """Takes many steps in one compiled call, where nothing has to be asked of Python at each.

        Where stability, whose limit is h·|λ| = ``limit``, holds its steps back, it calls left(t, h, reason) and ends.
        """
        return _March(self, span, limit, left) if self.equations.constant else None


@final
class _March:
    """One run in compiled steps. Times in it are counted from the start and grow."""

    def __init__(
        self,
        method: Explicit,
        span: Span[ReducedState],
        limit: float,
        left: Callable[[float, float, str], None] | None,
    ) -> None:
        eq, scheme = method.equations, method.method.scheme
        self.method, self.span, self.left, self._leave = method, span, False, left
        self._handed = 0
        size, q = eq.size, span.state.q
        rows = ROWS if span.save_at is None else max(span.save_at.size, 1)
        self.times = np.zeros(0) if span.save_at is None else np.abs(span.save_at - span.t0)
        stages, counted = (scheme.b.size + 1, size), method.atol.size
        self.memory = State(
            q=np.array(q), y=eq.vector(span.state), k=np.zeros(stages), y1=np.zeros(size), q1=np.zeros(q.size),
            k2=np.zeros(stages), y2=np.zeros(size), q2=np.zeros(q.size), b=np.zeros(size),
            atol=np.array(method.atol), rtol=np.array(method.rtol), allowed=np.zeros(counted),
            fine=np.zeros(counted), coarse=np.zeros(counted), change=np.zeros(eq.n),
            moved=np.zeros(eq.nv), rows_t=np.zeros((rows, 2)), rows_q=np.zeros((rows, q.size)),
            rows_y=np.zeros((rows, size - eq.nv)),
        )  # fmt: skip
        c = self.control = np.zeros(C_COLUMNS)
        policy = span.policy
        c[C_END], c[C_SPAN], c[C_ORIGIN], c[C_H] = span.until - span.t0, abs(span.until - span.t0), span.t0, span.h
        c[C_LEAST_STEP], c[C_MOST] = span.control.least, span.control.most
        c[C_BEFORE], c[C_SHORTEST], c[C_LEAST] = 1e-4, np.inf, np.inf
        c[C_EXPONENT], c[C_SHARE], c[C_DAMPING] = method.exponent, method.share, 0.4
        c[C_STRICT] = Proportional.STRICT
        c[C_SAVED] = -1.0 if span.save_at is None else float(span.saved)
        c[C_LIMIT] = limit
        c[C_GRID] = 0.0 if policy else float(span.control.step or 0.0)

    def advance(self, steps: int) -> bool:
        """Up to so many steps; whether the end is reached.

        Raises
        ------
        SolveError
            The steps get too short, or a state cannot be evaluated.
        """
        eq, c = self.method.equations, self.control
        before = c[C_EVALUATIONS]
        sound = float(c[C_T])
        scheme = self.method.method.scheme
        found = march(eq.engine, eq.memory, scheme, self.memory, c, self.times, eq.drive, eq.wrench, eq.scal, steps)
        eq.evaluations += int(c[C_EVALUATIONS] - before)
        self._hold(sound)
        self.method.stiffness = float(c[C_STIFF])
        if found == CAREFUL:
            self._step()
        elif found == STIFF and self._leave is not None:
            failing = c[C_REFUSALS] > PATIENCE
            reason = "its steps fail" if failing else f"h·|λ| = {c[C_STIFF]:.1f} holds its steps"
            self._leave(self.time, float(c[C_H]), reason)
            self.left = True
        elif found == SHORT:
            raise SolveError(Outcome.TINY, "", f"{c[C_H]:.3g} s")
        elif found >= REFUSED:
            self._refused(int(found) - REFUSED)
        return found == DONE

    def _hold(self, sound: float) -> None:
        """Give up the rows that left the range of numbers; ``sound``: the time before.

        Raises
        ------
        SolveError
            It names the joint.
        """
        eq, s, c = self.method.equations, self.memory, self.control
        sizes = (np.abs(s.q), np.abs(s.y[eq.nv : eq.nv + eq.n + eq.ns]))
        if all(size.max(initial=0.0) < LARGEST for size in sizes) and np.isfinite(s.y[eq.nv :]).all():
            return
        beyond = self._state(0.0, s.q, s.y[eq.nv :])
        times, q, y = self.kept()
        good = np.isfinite(y).all(axis=1)
        good &= np.abs(np.hstack([q, y[:, : eq.n + eq.ns]])).max(axis=1, initial=0.0) < LARGEST
        rows = int(np.argmin(good)) if not good.all() else good.size
        c[C_ROWS] = rows
        c[C_T] = times[rows - 1, 0] if rows else sound
        within(eq.reduced, beyond.q, beyond.r, beyond.heats)
        raise SolveError(Outcome.RANGE, "", "heat, work or entropy made")

    def _refused(self, status: int) -> None:
        if status == OPEN:
            eq, (q, rest) = self.method.equations, (self.memory.q, self.memory.y[self.method.equations.nv :])
            residual = eq.dense.gaps(q, rest[: eq.n])[0]
            raise eq.dense.opened(residual, float(np.abs(residual).max(initial=0.0)))
        self.method.equations.refuse(status, int(self.control[C_COMPONENT]))

    def _step(self) -> None:
        """One step with the careful elimination, where constraints nearly repeat each other."""
        c, s, h = self.control, self.memory, float(self.control[C_TRIED])
        sign = 1.0 if c[C_END] >= 0.0 else -1.0
        state = self.state
        self.method.rough = (state.q,) if c[C_ROUGH] else ()
        try:
            attempt = self.method.step(state, sign * h)
        except SolveError as error:
            if c[C_GRID]:
                raise
            c[C_H], c[C_REJECTED] = 0.25 * h, c[C_REJECTED] + 1.0
            self.span.control.allowed(float(c[C_H]), max(abs(state.t), abs(self.span.until)), error)
            return
        if not (c[C_GRID] or judge(c, h, attempt.error)):
            c[C_REJECTED] += 1.0
            self.span.control.allowed(float(c[C_H]), max(abs(state.t), abs(self.span.until)), None)
            return
        now = float(c[C_T])
        after = float(abs(c[C_END])) if h >= abs(c[C_END]) - now else now + h
        wanted = [(after, attempt.end)]
        if c[C_SAVED] >= 0.0:
            last = int(np.searchsorted(self.times, after, side="right"))
            wanted = [
                (when, attempt.end if when == after else self.method.inside(attempt, state.t + sign * (when - now)))
                for when in self.times[int(c[C_SAVED]) : last].tolist()
            ]
            c[C_SAVED] = last
        for when, found in wanted:
            row = int(c[C_ROWS])
            s.rows_t[row] = when, attempt.least
            s.rows_q[row], s.rows_y[row] = found.q, self.method.equations.vector(found)[self.method.equations.nv :]
            c[C_ROWS] += 1.0
        s.q[:], s.y[:] = attempt.end.q, self.method.equations.vector(attempt.end)
        c[C_T], c[C_STEPS], c[C_FRESH] = after, c[C_STEPS] + 1.0, 0.0
        c[C_ROUGH] = float(self.method.equations.careful)
        c[C_SHORTEST], c[C_LONGEST] = min(c[C_SHORTEST], h), max(c[C_LONGEST], h)
        c[C_LEAST] = min(c[C_LEAST], attempt.least)

    @property
    def time(self) -> float:
        """The time reached."""
        sign = 1.0 if self.control[C_END] >= 0.0 else -1.0
        done = self.control[C_T] >= abs(self.control[C_END])
        return self.span.until if done else self.span.t0 + sign * float(self.control[C_T])

    @property
    def state(self) -> ReducedState:
        """The state reached."""
        return self._state(self.time, self.memory.q, self.memory.y[self.method.equations.nv :])

    def _state(self, t: float, q: Array, rest: Array) -> ReducedState:
        n, ns = self.method.equations.n, self.method.equations.ns
        return ReducedState(t, q.copy(), rest[:n].copy(), rest[n : n + ns].copy(), rest[n + ns :].copy())

    def rows(self) -> list[tuple[float, ReducedState, float]]:
        """Records since the last call: time, state, the step's least production."""
        sign = 1.0 if self.control[C_END] >= 0.0 else -1.0
        out: list[tuple[float, ReducedState, float]] = []
        for row, (times, q, y) in enumerate(zip(*self.kept(), strict=True)):
            passed, least = times.tolist()
            t = self.span.until if passed == abs(self.control[C_END]) else self.span.t0 + sign * passed
            if self.span.save_at is not None:
                t = float(self.span.save_at[self.span.saved + self._handed + row])
            out.append((t, self._state(t, q, y), least))
        self._handed += len(out)
        self.control[C_ROWS] = 0.0
        return out

    def kept(self) -> tuple[Array, Array, Array]:
        """The rows that `rows` would hand over: (n, 2) time from the start and least production, (n, ·) elements, and
        (n, ·) rates, entropies and books; views of the memory."""
        count = int(self.control[C_ROWS])
        return self.memory.rows_t[:count], self.memory.rows_q[:count], self.memory.rows_y[:count]

    def snapshot(self) -> Snapshot:
        """Where it stands: the state, the rates there, and what chooses the steps."""
        s = self.memory
        return {"control": self.control, "q": s.q, "y": s.y, "rates": s.k[0]}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        s = self.memory
        self.control[:], s.q[:], s.y[:], s.k[0] = (snapshot[key] for key in ("control", "q", "y", "rates"))

    @property
    def counts(self) -> Counts:
        """Statistics so far."""
        c = self.control
        return Counts(
            int(c[C_STEPS]), int(c[C_REJECTED]), float(c[C_SHORTEST]), float(c[C_LONGEST]), float(c[C_LEAST]),
            float(c[C_H]),
        )  # fmt: skip
