"""Explicit Runge-Kutta methods on the reduced form: adaptive, loops projected back after each step.

Steps of a mechanism on which nothing but given constants acts are taken many in one compiled call.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, final

import numpy as np

from ephs.mechanics.methods import tableaux as t
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.tree.equations.accounts import OWN
from ephs.mechanics.tree.equations.equations import Equations, ReducedState
from ephs.mechanics.tree.finding.naming import within
from ephs.semantics.bundle import Array
from ephs.solve.control import Control, Proportional
from ephs.solve.errors import LARGEST, Outcome, SolveError
from ephs.solve.march import STEPS, Account, Ending, Status
from ephs.solve.march import Control as Steering
from ephs.solve.march.control import PATIENCE
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Attempt, Counts, Leg, Span

__all__ = ["Explicit", "Tableau", "tableau"]

Solve = Callable[..., Array]
"""What solves the stages of a step, with the arguments of `Equations.stages`."""
ROWS = 1024
"""Rows that are kept before they are handed over."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coefficients of a method, explicit or iterated.

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


@cache
def tableau(name: str) -> Tableau:
    """The method rk54 or rk87."""
    if name == "rk87":
        arrays = {"a": _steps(t.A8, t.B8), "error": np.array(t.E8_5), "coarse": np.array(t.E8_3)}
        return Tableau(name, 8, arrays | _explicit(t.B8, two=True), np.array(t.C8), 8.0)
    arrays = {"a": _steps(t.A5, t.B5), "error": np.array(t.E5), "coarse": np.zeros(len(t.B5) + 1)}
    return Tableau(name, 5, arrays | _explicit(t.B5, two=False), np.array(t.C5), 5.0)


def _explicit(b: tuple[float, ...], *, two: bool) -> dict[str, Any]:
    """Of stages that are not iterated, with one estimate or two that are combined."""
    return {"guess": np.zeros((0, len(b))), "eighth": np.array([int(two)], dtype=np.int64)}


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
    solve
        Solves the stages of a step as `Equations.stages` does, which is taken where there is none.

    Attributes
    ----------
    stiffness
        h·|λ| of the fastest mode, as the last step showed it.
    rough
        Elements of the last step's start and end, each where constraints nearly repeat each other: rates there carry
        rounding over the least singular value, so that drift says nothing.
    """

    def __init__(self, equations: Equations, control: Control, method: Tableau, solve: Solve | None = None) -> None:
        super().__init__(equations, control)
        self.solve: Solve = equations.stages if solve is None else solve
        self.method, self.name, self.exponent = method, method.name, method.exponent
        self.share = 0.5
        self._known: tuple[Array, Array] | None = None
        self.stiffness = 0.0
        self.rough: tuple[Array, ...] = ()
        self._low: tuple[ReducedState, float, Array] | None = None

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds."""
        return self._tried(state, h, part=False)

    def inside(self, attempt: Attempt[ReducedState], t: float) -> ReducedState:
        """A shorter step from the same start, in which heat is between none and that of the whole."""
        books, start = self.equations.engine.books, attempt.start
        after = self._low is not None and self._low[0] is start and abs(t - start.t) >= abs(self._low[1] - start.t)
        books["whole"][:], books["low"][:] = attempt.detail, self._low[2] if self._low and after else 0.0
        try:
            found = self._tried(start, t - start.t, part=True)
        except SolveError:
            found = None
        if found is None or (found.error > 1.0 and self.control.step is None):
            return super().inside(attempt, t)
        self._low = start, t, found.detail
        return found.end

    def _tried(self, state: ReducedState, h: float, *, part: bool) -> Attempt[ReducedState]:
        eq, scheme = self.equations, self.method.arrays
        state = eq.accounts.opened(state)
        if self._known is None or self._known[0] is not state.q:
            self._known = state.q, eq.rates(state.t, state.q, eq.vector(state))
        y0, y1 = eq.vector(state), np.empty(eq.size)
        k = np.zeros((scheme["a"].shape[0], eq.size))
        k[0] = self._known[1]
        tolerances, chosen = (self.atol, self.rtol), self.control.step is None
        before = self.solve(state, scheme, self.method.c, h, y0, k, y1, tolerances, chosen=chosen)
        allowed, steps = self.atol + self.rtol * eq.sizes(y0, y1), STEPS.compiled()
        y1, account = eq.accounts.booked(state, scheme, k, h, y1, part=part)
        sums = np.array(eq.engine.books["low" if part else "whole"])
        end = replace(eq.ended(state, y1, state.t + h), account=account)
        closed = eq.closed(end)
        estimates = [eq.along(h * (weights @ k)[eq.counted]) for weights in self.method.estimates]
        error = float(steps["measure"](estimates[0], np.array(estimates[-1]), allowed, scheme["eighth"]))
        rough = any(q is state.q for q in self.rough)
        if eq.engine.looped and not (rough or eq.careful):
            error = max(error, float(steps["drift"](end.r, closed.r, allowed)))
        if not error > 1.0 or self.control.step is not None:
            closed, missed = eq.accounts.corrected(state, closed, h, allowed, chosen=self.control.step is None)
            error = max(error, missed)
        self.rough = (*((state.q,) if rough else ()), *((closed.q,) if eq.careful else ()))
        rise, run = (k[-1] - k[-2])[eq.counted], (y1 - before)[eq.counted]
        self.stiffness = float(steps["stiffness"](rise, run, allowed, h))
        if not (eq.engine.looped or eq.careful):  # nothing was projected: the last rates are the next first ones
            first = k[-1].copy()
            first[: eq.nv] = closed.r
            self._known = closed.q, first
        return Attempt(state, closed, h, error, eq.least(state, closed), sums)

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
    """One run in compiled steps. Times in it are counted from the start and grow.

    Attributes
    ----------
    march
        The compiled function, bound to all that it reads and writes.
    memory, steering
        Its state and memory, and what chooses its steps.
    """

    def __init__(
        self,
        method: Explicit,
        span: Span[ReducedState],
        limit: float,
        left: Callable[[float, float, str], None] | None,
    ) -> None:
        eq, tableau, start = method.equations, method.method, method.equations.accounts.opened(span.state)
        self.own, eq.accounts.kept = eq.accounts.own, True
        summed = start.account.size - self.own
        self.method, self.span, self.left, self._leave = method, span, False, left
        self._handed = 0
        size, q, times = eq.size, span.state.q, span.save_at
        rows = ROWS if times is None else max(times.size, 1)
        self.times = np.zeros(0) if times is None else np.abs(times - span.t0)
        stages, counted = tableau.arrays["a"].shape[0], method.atol.size
        shapes: dict[str, tuple[int, ...]] = {
            "k": (stages, size), "q1": (q.size,), "y1": (size,), "q2": (q.size,), "y2": (size,), "k2": (stages, size),
            "last": (size,), "allowed": (counted,), "open": (eq.n,), "fine": (counted,), "coarse": (counted,),
            "rows_t": (rows, 4), "rows_q": (rows, q.size), "rows_y": (rows, size - eq.nv),
            **dict.fromkeys(("carry1", "carry2", "change", "size", "whole", "low"), (summed,)),
        }  # fmt: skip
        self.memory = {name: np.zeros(shape) for name, shape in shapes.items()} | {
            "q": np.array(q), "y": eq.vector(span.state), "atol": np.array(method.atol), "rtol": np.array(method.rtol),
            "times": self.times, "carry": start.account[self.own :].copy(),
        }  # fmt: skip
        self.steering, self.account = Steering.table(1), Account.table(1)
        a: Any = self.account[0]
        (a.anchor, a.left, a.put, a.total), self.momenta[:] = np.split(start.account[: self.own], [OWN])
        a.chosen, a.begins = int(span.policy is not None), int(not (np.isnan(a.anchor) or start.books.any()))
        self.march = eq.engine.bind("march", tableau.arrays, self.memory, self.steering, self.account, 0)
        c, policy, control = self.control, span.policy, span.control
        c.end, c.span, c.origin = span.until - span.t0, abs(span.until - span.t0), span.t0
        c.step, c.least_step, c.most_step = span.h, control.least, control.most
        c.before, c.shortest, c.least = 1e-4, np.inf, np.inf
        c.exponent, c.share, c.damping, c.strict = method.exponent, method.share, 0.4, Proportional.STRICT
        c.saved = -1 if times is None else span.saved
        c.limit, c.grid = limit, 0.0 if policy else float(control.step or 0.0)

    @property
    def momenta(self) -> Array:
        """The momenta that steps keep, where these read them."""
        return self.method.equations.engine.work["kept"][: self.own - OWN]

    @property
    def control(self) -> Any:
        """Where the march stands, a record of `Steering`; its numbers are known here."""
        return self.steering[0]

    def advance(self, steps: int) -> bool:
        """Up to so many steps; whether the end is reached.

        Raises
        ------
        SolveError
            The steps get too short, or a state cannot be evaluated.
        """
        eq, c = self.method.equations, self.control
        before, sound = c.evaluations, float(c.time)
        found = int(self.march(steps))
        eq.evaluations += c.evaluations - before
        self._hold(sound)
        self.method.stiffness = float(c.stiff)
        if found == Ending.CAREFUL:
            self._step()
        elif self._leave is not None and found in (Ending.STIFF, Ending.REFUSED + Status.UNSETTLED):
            failing = found != Ending.STIFF or c.refusals > PATIENCE
            reason = "its steps fail" if failing else f"h·|λ| = {c.stiff:.1f} holds its steps"
            self._leave(self.time, float(c.step), reason)
            self.left = True
        elif found == Ending.SHORT:
            raise SolveError(Outcome.TINY, "", f"{c.step:.3g} s")
        elif found >= Ending.REFUSED:
            self._refused(found - Ending.REFUSED)
        return found == Ending.DONE

    def _hold(self, sound: float) -> None:
        """Give up the rows that left the range of numbers; ``sound``: the time before.

        Raises
        ------
        SolveError
            It names the joint.
        """
        eq, c, q, y = self.method.equations, self.control, self.memory["q"], self.memory["y"]
        sizes = (np.abs(q), np.abs(y[eq.nv : eq.nv + eq.n + eq.ns]))
        if all(size.max(initial=0.0) < LARGEST for size in sizes) and np.isfinite(y[eq.nv :]).all():
            return
        beyond = self.state
        times, q, y = self.kept()
        good = np.isfinite(y).all(axis=1)
        good &= np.abs(np.hstack([q, y[:, : eq.n + eq.ns]])).max(axis=1, initial=0.0) < LARGEST
        rows = int(np.argmin(good)) if not good.all() else good.size
        c.rows, c.time = rows, times[rows - 1, 0] if rows else sound
        within(eq.reduced, beyond.q, beyond.r, beyond.heats)
        raise SolveError(Outcome.RANGE, "", "heat, work or entropy made")

    def _refused(self, status: int) -> None:
        eq = self.method.equations
        if status == Status.OPEN:
            residual = eq.dense.gaps(self.memory["q"], self.memory["y"][eq.nv : eq.nv + eq.n])[0]
            raise eq.dense.opened(residual, float(np.abs(residual).max(initial=0.0)))
        eq.refuse(status, eq.engine.failed)

    def _step(self) -> None:
        """One step with the careful elimination, where constraints nearly repeat each other."""
        c, s, h = self.control, self.memory, float(self.control.tried)
        state, eq, grid = self.state, self.method.equations, float(c.grid)
        sign, latest = self._sign, max(abs(state.t), abs(self.span.until))
        self.method.rough = (state.q,) if c.rough else ()
        try:
            attempt = self.method.step(state, sign * h)
        except SolveError as error:
            if grid:
                raise
            c.step, c.rejected = 0.25 * h, c.rejected + 1
            self.span.control.allowed(float(c.step), latest, error)
            return
        if not (grid or STEPS.compiled()["judge"](self.steering, h, attempt.error)):
            c.rejected += 1
            self.span.control.allowed(float(c.step), latest, None)
            return
        now, whole = float(c.time), float(abs(c.end))
        after = whole if h >= whole - now else now + h
        wanted = [(after, attempt.end)]
        if c.saved >= 0:
            last = int(np.searchsorted(self.times, after, side="right"))
            wanted = [
                (when, attempt.end if when == after else self.method.inside(attempt, state.t + sign * (when - now)))
                for when in self.times[c.saved : last].tolist()
            ]
            c.saved = last
        for when, found in wanted:
            s["rows_t"][c.rows] = when, attempt.least, *found.account[2:4]
            s["rows_q"][c.rows], s["rows_y"][c.rows] = found.q, eq.vector(found)[eq.nv :]
            c.rows += 1
        s["q"][:], s["y"][:] = attempt.end.q, eq.vector(attempt.end)
        a: Any = self.account[0]
        (a.anchor, a.left, a.put, a.total), _, s["carry"][:] = np.split(attempt.end.account, [OWN, self.own])
        c.time, c.steps, c.fresh, c.rough = after, c.steps + 1, 0, int(eq.careful)
        c.shortest, c.longest = min(c.shortest, h), max(c.longest, h)
        c.least = min(c.least, attempt.least)

    @property
    def _sign(self) -> float:
        return 1.0 if self.control.end >= 0.0 else -1.0

    @property
    def time(self) -> float:
        """The time reached."""
        done = self.control.time >= abs(self.control.end)
        return self.span.until if done else self.span.t0 + self._sign * float(self.control.time)

    @property
    def state(self) -> ReducedState:
        """The state reached."""
        a: Any = self.account[0]
        account = np.concatenate([[a.anchor, a.left, a.put, a.total], self.momenta, self.memory["carry"]])
        return self._state(self.time, self.memory["q"], self.memory["y"][self.method.equations.nv :], account)

    def _state(self, t: float, q: Array, rest: Array, account: Array) -> ReducedState:
        n, ns = self.method.equations.n, self.method.equations.ns
        heats, books = rest[n : n + ns].copy(), rest[n + ns :].copy()
        return ReducedState(t, q.copy(), rest[:n].copy(), heats, books, account=account)

    def rows(self) -> list[tuple[float, ReducedState, float]]:
        """Records since the last call: time, state, the step's least production."""
        end = abs(float(self.control.end))
        out: list[tuple[float, ReducedState, float]] = []
        for row, (times, q, y) in enumerate(zip(*self.kept(), strict=True)):
            passed, least, *put = times.tolist()
            t = self.span.until if passed == end else self.span.t0 + self._sign * passed
            if self.span.save_at is not None:
                t = float(self.span.save_at[self.span.saved + self._handed + row])
            account = np.concatenate([[self.account[0].anchor, 0.0, *put], self.momenta, 0.0 * self.memory["carry"]])
            out.append((t, self._state(t, q, y, account), least))
        self._handed += len(out)
        self.control.rows = 0
        return out

    def kept(self) -> tuple[Array, Array, Array]:
        """The rows that `rows` would hand over, views of the memory: (n, 4) time from the start, least production, what
        corrections put in and its sizes; (n, ·) elements; (n, ·) rates, heats and books."""
        count, memory = int(self.control.rows), self.memory
        return memory["rows_t"][:count], memory["rows_q"][:count], memory["rows_y"][:count]

    def snapshot(self) -> Snapshot:
        """Where it stands: the state, the rates there, and what chooses the steps."""
        return dict(self._taken())

    def _taken(self) -> list[tuple[str, Any]]:
        (counts, control), s = self.steering.arrays, self.memory
        parts = control, counts, s["q"], s["y"], s["k"][0], s["carry"], self.account.arrays[1], self.momenta
        names = "control", "counts", "q", "y", "rates", "carry", "account", "momenta"
        return list(zip(names, parts, strict=True))

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        for name, array in self._taken():
            array[:] = snapshot[name]

    @property
    def counts(self) -> Counts:
        """Statistics so far."""
        c = self.control
        return Counts(c.steps, c.rejected, float(c.shortest), float(c.longest), float(c.least), float(c.step))
