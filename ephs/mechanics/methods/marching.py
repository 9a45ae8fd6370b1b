"""Many steps of a mechanism in one compiled call, if no step needs Python."""

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.methods.contest import Contest
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.rounding import LOOKED, held_by_rounding
from ephs.mechanics.methods.stages import KeptJacobian
from ephs.mechanics.tree.equations.accounts import OWN
from ephs.mechanics.tree.equations.equations import ReducedState
from ephs.mechanics.tree.finding.naming import within
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.findings import CostWarning
from ephs.solve.march.account import RunAccount
from ephs.solve.march.control import DAMPING, PATIENCE, STRICT
from ephs.solve.march.records import Ending, MarchControl, Status
from ephs.solve.march.steps import STEPS
from ephs.solve.posing.errors import LARGEST, Outcome, SolveError
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Counts, Span, Taken

if TYPE_CHECKING:
    from ephs.mechanics.methods.semi import Semi

ROWS = 1024
"""Capacity of the buffers of rows."""
BUFFERS = ("rows_t", "rows_q", "rows_y")
"""These: only rows that were written are read, and no others come into memory."""
LAGGED = 4
"""Evaluations that cost as much as the factors of the masses in a semi-implicit step."""
FAILING = "its steps fail"
"""The reason to leave explicit steps that have no solution."""
CHEAPEST = "its steps cost least per second of motion"
"""The reason to take a method that won a contest."""
Leave = Callable[[float, float, str], None]
"""Callback with the time, the next step in s, and the reason for its limit."""


@final
class March:
    """One run in compiled steps, or the legs of it that `leg` begins. Times in it are counted from the start and grow.

    Parameters
    ----------
    arrays
        Coefficients, by the names of `ephs.solve.march.Tableau`.
    span
        The run, or its first leg.
    kept
        The matrix of implicit steps, and memory for these; None: steps are explicit or iterated.
    lagged
        Memory of semi-implicit steps.

    Attributes
    ----------
    march
        The compiled function, bound to all that it reads and writes.
    memory, steering, control
        Its state and memory, and what chooses its steps: a table of one record of `MarchControl`, and this record.
    """

    def __init__(
        self,
        method: ReducedMethod,
        arrays: Mapping[str, Any],
        span: Span[ReducedState],
        kept: KeptJacobian | None = None,
        lagged: "Semi | None" = None,
    ) -> None:
        eq, start = method.equations, method.equations.accounts.opened(span.state)
        self.own, self.method, self.span = eq.accounts.own, method, span
        summed = start.account.size - self.own
        self._kept, self._lagged = kept, lagged is not None
        size, q, times = eq.size, span.state.q, span.save_at
        rows = ROWS if times is None else max(times.size, 1)
        self.times = np.zeros(0) if times is None else np.abs(times - span.t0)
        stages, counted = arrays["a"].shape[0], method.atol.size
        shapes: dict[str, tuple[int, ...]] = {
            "k": (stages, size), "q1": (q.size,), "y1": (size,), "q2": (q.size,), "y2": (size,), "k2": (stages, size),
            "last": (size,), "allowed": (counted,), "open": (eq.n,), "fine": (counted,), "coarse": (counted,),
            "rows_t": (rows, 4), "rows_q": (rows, q.size), "rows_y": (rows, size - eq.nv),
            "q": (q.size,), "y": (size,), **dict.fromkeys(("carry", "carry1", "carry2", "change", "size"), (summed,)),
            **dict.fromkeys(("whole", "low"), (2 * summed,)),
        }  # fmt: skip
        made = {name: (np.empty if name in BUFFERS else np.zeros)(shape) for name, shape in shapes.items()}
        self.memory = made | {
            "atol": np.array(method.atol), "rtol": np.array(method.rtol), "times": self.times,
        }  # fmt: skip
        self.steering, self.account = MarchControl.table(1), RunAccount.table(1)
        self.control: Any = self.steering[0]
        given = arrays, self.memory, self.steering, self.account
        if lagged is not None:
            self.march = eq.engine.lagged("march", lagged.onsager, *given, lagged.memory, 0)
        elif kept is not None:
            self.march = eq.engine.implicit(*given, kept.memory, 0)
        else:
            self.march = eq.engine.bind("march", *given, 0)

    def serves(self, span: Span[ReducedState]) -> bool:
        """Whether it has a leg for a span: with the same instants to keep."""
        return span.save_at is self.span.save_at and span.t0 == self.span.t0

    def leg(
        self,
        span: Span[ReducedState],
        limit: float = 0.0,
        left: Leave | None = None,
        contest: Contest | None = None,
    ) -> "March":
        """The same at the start of a span, as the leg of it.

        Parameters
        ----------
        limit, left
            Limit of h·|λ|, beyond which the leg ends; 0: none. Callback at that end, and where another method wins
            the contest.
        contest
            It weighs the steps, window by window, and tells where another method takes those that follow.
        """
        eq, start, method = self.method.equations, self.method.equations.accounts.opened(span.state), self.method
        eq.accounts.kept = True
        self.span, self.left, self._leave, self._contest = span, False, left, contest
        self._handed, self._look = 0, float(LOOKED)
        self._weighed = np.zeros(3)  # where the window began: tries, cost in evaluations, time
        for array in (*self.steering.arrays, *self.account.arrays):
            array[:] = 0
        if self._kept is not None:
            self._kept.begin()
        s, times = self.memory, span.save_at
        s["q"][:], s["y"][:], s["carry"][:] = span.state.q, eq.vector(span.state), start.account[self.own :]
        a: Any = self.account[0]
        (a.anchor, a.left, a.put, a.total), self.momenta[:] = np.split(start.account[: self.own], [OWN])
        a.chosen, a.begins = int(span.policy is not None), int(not (np.isnan(a.anchor) or start.totals.any()))
        # constant implicit steps may not resolve fast modes
        a.alone = int(self._kept is not None and span.policy is None)
        c, policy, control = self.control, span.policy, span.control
        c.end, c.span, c.origin = span.until - span.t0, abs(span.until - span.t0), span.t0
        c.step, c.least_step, c.most_step = span.h, control.least, control.most
        c.time, c.before, known = abs(span.state.t - span.t0), 1e-4, span.counts
        c.steps, c.rejected = known.steps, known.rejected
        c.shortest, c.longest, c.least = known.shortest, known.longest, known.least
        c.exponent, c.share, c.damping, c.strict = method.exponent, method.share, DAMPING, STRICT
        c.saved = -1 if times is None else span.saved
        c.limit, c.grid = limit, 0.0 if policy else float(control.step or 0.0)
        self._weighed[:] = self._tries, self._cost, c.time
        return self

    @property
    def explicit(self) -> bool:
        """Whether no step needs a matrix, which Python makes."""
        return self._kept is None

    @property
    def momenta(self) -> Array:
        """The momenta that steps keep, where these read them."""
        return self.method.equations.engine.work["kept"][: self.own - OWN]

    def advance(self, steps: int) -> bool:
        """Take up to ``steps`` steps; whether the end is reached.

        Raises
        ------
        SolveError
            The steps get too short, or a state cannot be evaluated.
        """
        eq, c = self.method.equations, self.control
        before, sound = c.evaluations, float(c.time)
        if self._lagged and c.fresh:  # others may have used the memory of the last evaluation, which is made again
            c.fresh, c.evaluations = 0, c.evaluations - 1
        found = self._marched(steps)
        eq.evaluations += c.evaluations - before
        if self._kept is not None:
            self._kept.count()
        self._hold(sound)
        if self.explicit and c.steps >= self._look and not c.grid:
            self._look *= 2
            many = c.steps * c.span / c.time
            if told := held_by_rounding(self.method, self.state, float(c.step), float(c.span), many):
                self._look = LARGEST
                self._leave_rounding(told)
        self.method.stiffness = float(c.stiff)
        if found == Ending.CAREFUL or (self._kept is not None and found >= Ending.REFUSED):
            self._step()
        elif found in (Ending.STIFF, Ending.REFUSED + Status.UNSETTLED) and c.limit > 0.0:
            self._yield(failing=found != Ending.STIFF or c.refusals > PATIENCE)
        elif found == Ending.SHORT:
            raise SolveError(Outcome.TINY, "", f"{c.step:.3g} s")
        elif found >= Ending.REFUSED:
            self._refused(found - Ending.REFUSED)
        return found == Ending.DONE

    def _leave_rounding(self, told: str) -> None:
        """Leave explicit steps that rounding holds short to others, or tell a user.

        Warns
        -----
        CostWarning
            There are no others.
        """
        if self.control.limit > 0.0 and self._contest is None and self._leave is not None:
            self._leave(self.time, float(self.control.step), told)
            self.left = True
        else:
            warnings.warn(f"{told}; loosen atol and rtol", CostWarning, stacklevel=2)

    def _hold(self, sound: float) -> None:
        """Discard rows with overflow; ``sound``: the time before.

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

    @property
    def _tries(self) -> int:
        """Steps tried so far."""
        return int(self.control.steps + self.control.rejected)

    @property
    def _cost(self) -> int:
        """Cost of the steps tried so far, in evaluations."""
        kept = 0 if self._kept is None else self._kept.cost
        return int(self.control.evaluations) + kept + LAGGED * self._tries * self._lagged

    def _marched(self, steps: int) -> int:
        """Try up to ``steps`` steps, with new matrices where these are old, while no other method wins; the ending."""
        contest, most = self._contest, self._tries + steps
        while True:
            tries = self._tries
            weighed = most if contest is None else int(self._weighed[0]) + contest.length
            found = int(self.march(max(0, min(most, weighed) - tries)))
            if found == Ending.STALE and self._kept is not None:
                self._kept.renew(self.state)
                continue
            tries = self._tries
            if found != Ending.PAUSED or contest is None or tries < weighed:
                return found
            home, cost, (_, known, since) = contest.home, self._cost, self._weighed
            self._weighed[:] = tries, cost, self.control.time
            self.left = contest.weigh(float(cost - known), float(self.control.time - since))
            self._tell(home)
            if self.left or tries >= most:
                return found

    def _yield(self, *, failing: bool) -> None:
        """Leave explicit steps that have no solution, or that stability holds back, to others."""
        reason = FAILING if failing else f"h·|λ| = {self.control.stiff:.1f} holds its steps"
        if self._contest is None:
            if self._leave is not None:
                self._leave(self.time, float(self.control.step), reason)
                self.left = True
            return
        home = self._contest.home
        if failing:
            self._contest.fail()
            self.left = True
        else:
            self.control.held, self.left = 0, self._contest.stiff()
        self._tell(home, reason)

    def _tell(self, home: int, reason: str = CHEAPEST) -> None:
        """Say that the method of the run is another one."""
        if self._contest is not None and self._leave is not None and self._contest.home != home:
            self._leave(self.time, float(self.control.step), reason)

    def _refused(self, status: int) -> None:
        eq = self.method.equations
        if status == Status.OPEN:
            raise eq.opened(self.memory["q"], self.memory["y"][eq.nv : eq.nv + eq.n])
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
        heats, totals = rest[n : n + ns].copy(), rest[n + ns :].copy()
        return ReducedState(t, q.copy(), rest[:n].copy(), heats, totals, account=account)

    def rows(self) -> Taken[ReducedState]:
        """Instants since the last call."""
        times, q, y = (each.copy() for each in self.kept())
        passed, least, put = times[:, 0], times[:, 1], times[:, 2:]
        if self.span.save_at is None:
            t = np.where(passed == abs(self.control.end), self.span.until, self.span.t0 + self._sign * passed)
        else:
            first = self.span.saved + self._handed
            t = np.array(self.span.save_at[first : first + len(q)])
        anchor, momenta, carry = self.account[0].anchor, self.momenta.copy(), 0.0 * self.memory["carry"]

        def state(k: int) -> ReducedState:
            account = np.concatenate([[anchor, 0.0, *put[k]], momenta, carry])
            return self._state(float(t[k]), q[k], y[k], account)

        self._handed += len(q)
        self.control.rows = 0
        return Taken(t, least, (q, y, put), state)

    def kept(self) -> tuple[Array, Array, Array]:
        """The rows that `rows` would hand over, views of the memory: (n, 4) time from the start, least production, what
        corrections put in and its sizes; (n, ·) elements; (n, ·) rates, heats and totals."""
        count, memory = int(self.control.rows), self.memory
        return memory["rows_t"][:count], memory["rows_q"][:count], memory["rows_y"][:count]

    def snapshot(self) -> Snapshot:
        """Present state, the rates there, and the choice of steps."""
        return dict(self._taken())

    def _taken(self) -> list[tuple[str, Any]]:
        (counts, control), s = self.steering.arrays, self.memory
        parts = control, counts, s["q"], s["y"], s["k"][0], s["carry"], self.account.arrays[1], self.momenta
        names = "control", "counts", "q", "y", "rates", "carry", "account", "momenta"
        own = [("weighed", self._weighed), *([] if self._kept is None else self._kept.parts())]
        return [*zip(names, parts, strict=True), *own]

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        for name, array in self._taken():
            array[:] = snapshot[name]
        self.account[0].begins = 0  # books were opened where the run began

    @property
    def counts(self) -> Counts:
        """Statistics so far."""
        c = self.control
        return Counts(c.steps, c.rejected, float(c.shortest), float(c.longest), float(c.least), float(c.step))
