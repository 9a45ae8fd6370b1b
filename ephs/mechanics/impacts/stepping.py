"""Steps with hard contact: flights and persistent contact by any method in joint coordinates, impacts between them.

A step is divided where a gap closes, which is located, and where a slip comes to rest. At a closed gap an impact takes
place at once, by its island (`ephs.mechanics.impacts.islands`). Contacts that stay closed act by forces Jᵀ P/h over a
part h of a step, with impulses P in the friction cones, complementary to the velocities at its end; those that slip
before are held against the mean of their slips, v̄. So their heat −P_tᵀ v̄ is never negative, and every joule of it has
a place; the energy of the end is moved to what is left, as that of all corrected steps is.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.impacts.cone import impulses
from ephs.mechanics.impacts.holding import Holding
from ephs.mechanics.impacts.islands import Unlawful, islands_of, shared, struck
from ephs.mechanics.impacts.mobility import answer
from ephs.mechanics.impacts.parting import closing_part, stopping_parts
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.tableaux import MIDPOINT
from ephs.mechanics.tree.equations.equations import ReducedState
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Leg, Span

CLOSED = 1e-9
"""Gap, in the mechanism's length, below which a contact is closed."""
LOCATED = 1e-3
"""Tolerance of locating closures, as a fraction of it."""
DRIFTED = 1e-5
"""Largest change of persistent contacts' gaps in a part of a step, as a fraction of it."""
PARTING = 1e-9
"""Speed, in the mechanism's own, above which closed contacts part."""
QUIET = 1e-6
"""Speed, likewise, below which contacts do not bounce: the error of a ball's bouncing time; squared, of its energy."""
PARTS = 1000
"""Largest number of parts of a step."""
BRIEF = 1e-6
"""Fraction of a step too short to decide between sticking and slipping: what friction stops within it sticks."""
SLIVER = 1e-12
"""Fraction of a step that counts as zero."""
NONE: Final[Index] = np.zeros(0, dtype=np.int64)
DIVISIONS = 60
ROUNDS = 20
PRESSING = 1e-6
"""Least impulse of an active contact, relative to the largest."""
SETTLED = 1e-7
"""Relative change of impulses at which iterations end; velocities are then corrected."""
ROUNDED = 1e-13
"""Rounding of velocities, relative to them and to the mechanism's speed."""
APART, STICKING, SLIPPING = range(3)
SAID = ("opens", "sticks", "slips")
"""Modes of a contact in a part of a step, and the words of events where they change."""
TOO_LONG = 8.0
"""Error of a part of a step whose halves have contacts that the whole misses."""


@final
class Impacts(ReducedMethod):
    """A method on a mechanism with hard contacts.

    Parameters
    ----------
    inner
        Takes the steps between impacts.
    """

    def __init__(self, inner: ReducedMethod) -> None:
        self._inner, self.equations, self.control = inner, inner.equations, inner.control
        self.rtol, self.atol = inner.rtol, inner.atol
        self.name, self.exponent, self.share = inner.name, inner.exponent, inner.share
        self._touching = Touching(self.equations)
        self._names = _named(self._touching.paths)
        eq = self.equations
        self._inputs = eq.constant, eq.held, eq.steady
        self._alone = eq.problem.constant and not (eq.drive.any() or eq.wrench.any() or eq.given.supply.any())
        self._alone = self._alone and not eq.driven.size
        self._closed = CLOSED * eq.problem.length
        self._speed = self._whole = 0.0
        self.counts: dict[str, Any] = inner.counts
        self.counts |= {"parts": 0}
        self._modes = np.zeros(len(self._touching))
        self._left = np.full(len(self._touching), -np.inf)
        self._happened: list[tuple[float, str, ReducedState]] = []

    def start(self, t: float, h: float) -> ReducedState:
        """The initial state; speeds count by the mechanism's own, a fall's or that of the start."""
        state = self.equations.accounts.opened(self._inner.start(t, h))
        self._speed = self._touching.speed(state.q, state.r, self.equations.accelerations(state))
        gaps = self._touching.gaps(state.q, state.r)
        deep = int(np.argmin(gaps))
        if gaps[deep] < -self._closed:
            path = str(self._touching.paths[deep])
            raise SolveError(Outcome.INCONSISTENT, path, f"hard surfaces overlap by {-gaps[deep]:.3g} m")
        return state

    def many(self, span: Span[ReducedState]) -> Leg[ReducedState] | None:
        """None: impacts are looked for at each step."""
        return None

    def step(self, state: ReducedState, h: float) -> Attempt[ReducedState]:
        """One step of h seconds, in as many parts as needed."""
        here, left, error = self.equations.accounts.opened(state), h, 0.0
        self._whole = abs(h)
        self._left[:] = -np.inf
        self._happened, modes = [], state.memory[0] if state.memory else None
        self.name, self.exponent, self.share = self._inner.name, self._inner.exponent, self._inner.share
        for _ in range(PARTS):
            here = self._struck(here)
            end, share, worst = self._taken(here, left)
            if not worst <= 1.0 and self.control.step is None:
                return Attempt(state, end, end.t - state.t, self._rejecting(h - left, share * left, h, worst), 0.0)
            if abs(share * left) > BRIEF * abs(h):
                modes = self._changed(here, modes)
            here, error = end, max(error, worst)
            left *= 1.0 - share
            self.counts["parts"] += 1
            if abs(left) <= SLIVER * abs(h):
                end = replace(self._struck(replace(here, t=state.t + h)), memory=() if modes is None else (modes,))
                least = self.equations.least(state, end)
                return Attempt(state, end, h, error, least, happened=tuple(self._happened))
        path = self._touching.paths[int(np.argmin(self._touching.gaps(here.q, here.r)))]
        raise SolveError(Outcome.TINY, str(path), f"a step of more than {PARTS} impacts")

    def _rejecting(self, done: float, part: float, h: float, error: float) -> float:
        """Error of a step of h s whose part of ``part`` s after ``done`` has an error above 1: what shortens it so far
        that the part would have 1.
        """
        if not np.isfinite(error):
            return error
        power = self.exponent - self.share
        return float(max(h / (done + part * error ** (-1.0 / power)), 1.0 + BRIEF) ** power)

    # ---- impacts -----------------------------------------------------------------------------------------------

    def _struck(self, state: ReducedState) -> ReducedState:
        """The state after the impact of its closed gaps, if these close.

        Contacts whose flight since the last impact of this step was lower than what can be located do not bounce.
        """
        gaps, rates = self._touching.motion(state.q, state.r)
        closed = np.flatnonzero(gaps <= self._closed)
        if not closed.size or not np.any(rates[closed] < -PARTING * self._speed):
            return state
        eq = self.equations
        rows, _ = self._touching.rows(state.q, state.r, closed)
        by = answer(eq, state, rows)
        before = rows @ state.r
        laws = [self._touching.laws[i] for i in closed]
        low = 0.25 * (state.t - self._left[closed]) * np.abs(before[::3]) <= LOCATED * self._closed
        quiet = np.where(low, np.inf, QUIET * self._speed)
        try:
            blow = struck(rows @ by, before, laws, PARTING * self._speed, quiet)
        except Unlawful as failed:
            path = str(self._touching.paths[closed[failed.contact]])
            raise SolveError(Outcome.LAWLESS, path, failed.reason) from None
        change = by @ blow.impulse
        mass = eq.mass(state.q, state.r)
        gained = float(change @ (mass @ (state.r + 0.5 * change)))
        self._left[closed] = state.t
        end = replace(state, q=state.q.copy(), r=state.r + change, memory=())
        work = gained + float(blow.heat.sum()) if eq.driven.size else 0.0
        end = self._booked(state, end, closed, blow.heat, work)
        self._happened += [(end.t, f"{self._names[i]} strikes", end) for i in closed[blow.impulse[::3] > 0.0]]
        return end

    def _changed(self, start: ReducedState, before: Array | None) -> Array:
        """Record modes of contacts in an accepted part of a step; changes since the previous part are events."""
        now = self._modes.copy()
        if before is not None:
            said = [(i, SAID[int(now[i])]) for i in np.flatnonzero(now != before)]
            self._happened += [(start.t, f"{self._names[i]} {what}", start) for i, what in said]
        return now

    def _booked(self, start: ReducedState, end: ReducedState, which: Index, heat: Array, work: float) -> ReducedState:
        """End of the step with heat of contacts and work in its accumulators."""
        eq = self.equations
        flows = np.zeros(len(eq.reduced.made))
        np.add.at(flows, self._touching.makers[which], heat)
        warmed, still = eq.heats.taken(start.heats, flows)[0], np.zeros(eq.nv + eq.n)
        rates = np.concatenate([still, warmed, [heat.sum(), work, 0.0], flows])
        return eq.accounts.summed(start, end, MIDPOINT, rates[None], 1.0)

    # ---- between impacts ---------------------------------------------------------------------------------------

    def _taken(self, state: ReducedState, h: float) -> tuple[ReducedState, float, float]:
        """The longest part of h seconds without an impact: its end, its fraction of h, and its error."""
        gaps, rates = self._touching.motion(state.q, state.r)
        held = np.flatnonzero((gaps <= self._closed) & (rates <= PARTING * self._speed))
        share = 1.0
        for _ in range(DIVISIONS):
            end, error, divided = self._smooth(state, share * h, held, gaps)
            if not error <= 1.0 and self.control.step is None:  # it says nothing about gaps or forces
                return end, share, error
            if divided == 1.0:
                divided = self._closing(gaps, rates, end, share * h, held)
            if divided == 1.0:
                if held.size and self.control.step is None:
                    end, error = self._halved(state, share * h, held, gaps, end, error)
                return end, share, error
            share *= divided
            if share <= SLIVER and not held.size:  # a gap that jumps
                break
        path = self._touching.paths[int(held[0]) if held.size else int(np.argmin(gaps))]
        raise SolveError(Outcome.DIVERGED, str(path), "an impact, or forces of closed contacts")

    def _halved(
        self, state: ReducedState, h: float, held: Index, gaps: Array, whole: ReducedState, error: float
    ) -> tuple[ReducedState, float]:
        """The end by two halves, and its error by their difference to the whole, which is of order 2."""
        middle, missed, divided = self._smooth(state, 0.5 * h, held, gaps)
        if divided < 1.0 or not missed <= 1.0:
            return whole, TOO_LONG
        end, missed, divided = self._smooth(middle, 0.5 * h, held, gaps)
        if divided < 1.0 or not missed <= 1.0:
            return whole, TOO_LONG
        self.exponent = 3.0
        eq = self.equations
        y0, y1 = eq.vector(state), eq.vector(end)
        allowed = self.atol + self.rtol * eq.sizes(y0, y1)
        far = max(float(np.abs(end.q - whole.q).max()) / float(allowed[: eq.n].min()), 0.0)
        rates = np.abs(end.r - whole.r) / allowed[eq.n : 2 * eq.n]
        inside = float(self._touching.gaps(end.q, end.r).min()) < -self._closed  # where the whole ends at an impact
        return whole if inside else end, max(error, far / 3.0, float(rates.max()) / 3.0)

    def _closing(self, gaps: Array, rates: Array, end: ReducedState, h: float, held: Index) -> float:
        """Part of a flight of h s at whose end a gap closes first, by cubics; 1 where none closes before its end."""
        after, speed = self._touching.motion(end.q, end.r)
        near = np.minimum(after, gaps) <= abs(h) * np.maximum(np.abs(rates), np.abs(speed))
        near[held] = False
        near[(np.abs(after) <= LOCATED * self._closed) & (speed <= 0.0)] = False  # closes at the end
        first = 1.0
        for i in np.flatnonzero(near):
            first = min(first, closing_part(gaps[i], h * rates[i], after[i], h * speed[i], LOCATED * self._closed))
        return first

    def _smooth(
        self, state: ReducedState, h: float, held: Index, gaps: Array, stopped: Index = NONE
    ) -> tuple[ReducedState, float, float]:
        """The end of h seconds with some contacts closed, its error, and the part of it after which to divide it;
        ``stopped``: places among the closed ones of those that stick, whatever slip is left.
        """
        eq, touching = self.equations, self._touching
        self._modes[:] = APART
        if not held.size:
            self._flying()
            flight = self._inner.step(self._inner.anew(state), h)
            return replace(flight.end, memory=()), flight.error, 1.0
        rows0, axes = touching.rows(state.q, state.r, held)
        start = rows0 @ state.r
        moving = np.hypot(start[1::3], start[2::3]) > PARTING * self._speed
        moving[stopped] = False
        slipping = np.repeat(moving, 3)
        slipping[::3] = False
        before = np.where(slipping, start, 0.0)
        settled = self._settled(state, h, held, axes, rows0, before)
        if isinstance(settled, float | int):  # errors above 1 are for the control, else the part is too long
            return (state, 0.0, 0.5) if settled <= 1.0 else (state, settled, 1.0)
        end, error, solved, pushed, rest, change = settled
        pressed = solved[::3] > PRESSING * solved[::3].max()
        moved = self._put(end, held[pressed], gaps[held[pressed]], change[:, ::3][:, pressed])
        rows1, _ = touching.rows(moved.q, moved.r, held, axes)
        moved = replace(moved, r=moved.r + change @ rest)
        stop = rows1 @ moved.r
        loose = held[~pressed]
        if loose.size and touching.gaps(moved.q, moved.r)[loose].min() < -self._closed:  # it opens and closes again
            return end, 0.0, 0.5
        laws = [touching.laws[i].friction for i in held]
        shares = stopping_parts(before, stop, solved, laws, PARTING * self._speed)
        if (brief := np.flatnonzero((shares < 1.0) & (shares * abs(h) <= BRIEF * self._whole))).size:
            return self._smooth(state, h, held, gaps, np.append(stopped, brief))
        if (divided := float(shares.min())) < 1.0:
            return end, 0.0, divided
        taken = -0.5 * (solved * (start + stop)).reshape(-1, 3)[:, 1:].sum(axis=1)
        heat = np.zeros(held.size)
        for island in islands_of(rows1 @ change):
            heat[island] = shared(taken[island])
        put = float(end.totals[1] - state.totals[1])
        if not self._alone:
            put = 0.5 * float((rows0.T @ pushed) @ state.r + (rows1.T @ pushed) @ end.r)
        booked = self._booked(end, moved, held, heat, -put)
        booked, _ = eq.accounts.corrected(state, booked, h, np.full(self.atol.size, np.inf), chosen=False, alone=True)
        slips = np.hypot(stop[1::3], stop[2::3]) > PARTING * self._speed
        self._modes[held] = np.where(pressed, np.where(slips, SLIPPING, STICKING), APART)
        return replace(booked, memory=()), error, 1.0

    def _settled(
        self, state: ReducedState, h: float, held: Index, axes: Index, rows0: Array, before: Array
    ) -> tuple[ReducedState, float, Array, Array, Array, Array] | float:
        """The end of h s, its error, the impulses (3k,) of closed contacts, those that pushed it there besides what
        holds, the rest that has to, and the answers (n, 3k) to them; else the error without these.

        Stops are held at every instant, points of contact where their impulses do not settle.
        """
        stops, found = np.array([self._touching.pulling(i) is not None for i in held]), 0.0
        for may in (stops,) if stops.all() else (stops, np.ones_like(stops)):
            holding = Holding(self.equations, self._touching, state, h, held, axes, before, may)
            if may is not stops and not holding:
                break
            found = self._iterated(state, h, held, axes, rows0, before, holding)
            if not isinstance(found, float | int):
                break
        return found

    def _iterated(
        self, state: ReducedState, h: float, held: Index, axes: Index, rows0: Array, before: Array, holding: Holding
    ) -> tuple[ReducedState, float, Array, Array, Array, Array] | float:
        """The same with what holds at every instant."""
        eq, touching, chosen = self.equations, self._touching, self.control.step is None
        laws = [touching.laws[i].friction for i in held]
        rows1, impulse, change = rows0, np.zeros(3 * held.size), np.zeros((0, 0))
        for count in range(ROUNDS):
            self._push(state.t, h, rows0.T @ impulse / h, rows1.T @ impulse / h)
            with holding.acting():
                attempt = self._inner.step(self._inner.anew(state), h)
            kept, end = holding.impulse(), attempt.end
            if chosen and not attempt.error <= 1.0:
                return float(attempt.error)
            rows1, _ = touching.rows(end.q, end.r, held, axes)
            if not count:
                change = answer(eq, end, rows1)
            mobility = rows1 @ change
            free = rows1 @ end.r - mobility @ (kept + impulse)
            solved = impulses(mobility, free + before, laws, kept + impulse)
            if solved is None:
                return 0.0
            rest = solved - kept - impulse
            most, fast = float(np.abs(mobility @ solved).max()), float((np.abs(rows1) @ np.abs(end.r)).max())
            if float(np.abs(mobility @ rest).max()) <= SETTLED * most + ROUNDED * (fast + self._speed):
                return end, attempt.error, solved, impulse, rest, change
            impulse = solved - kept
        return 0.0

    def _push(self, t: float, h: float, first: Array, last: Array) -> None:
        """Let closed contacts act on the tree's rates from t on, by forces (n,) that go from ``first`` to ``last``."""
        eq, forces = self.equations, np.zeros((2, self.equations.nv))
        forces[:, : eq.n] = first, last - first
        eq.given.push(lambda now: forces[0] + (now - t) / h * forces[1])
        eq.constant = eq.held = eq.steady = False

    def _flying(self) -> None:
        """Remove contact forces; inputs remain."""
        eq = self.equations
        eq.given.push(None)
        eq.constant, eq.held, eq.steady = self._inputs

    def _put(self, state: ReducedState, pressed: Index, before: Array, answer: Array) -> ReducedState:
        """The state moved to where pressed contacts have the gaps before, by changes (n, k) of unit impulses."""
        eq, q = self.equations, state.q
        for _ in range(ROUNDS if pressed.size else 0):
            gaps = self._touching.gaps(q, state.r)[pressed] - before
            if float(np.abs(gaps).max()) <= DRIFTED * self._closed:
                break
            rows, _ = self._touching.rows(q, state.r, pressed)
            q = eq.moved(q, answer @ least_squares(rows[::3] @ answer, -gaps, part=CONSTRAINT))
        return state if q is state.q else eq.closed(replace(state, q=q))

    def taken(self, state: ReducedState) -> Snapshot | None:
        """Memory of the method between impacts."""
        return self._inner.taken(state)

    def take(self, own: Snapshot, state: ReducedState) -> None:
        """Restore from a snapshot."""
        self._inner.take(own, state)


def _named(paths: Sequence[Path]) -> list[str]:
    """Names of contacts and joints by the paths of their processes; contacts of several points with the point."""
    owners = [tuple(path)[:-1] for path in paths]
    several = {owner[:-1] for owner in owners if owner[-1] == "point1"}
    single = {owner for owner in owners if owner[-1] == "point0" and owner[:-1] not in several}
    return [".".join(owner[:-1] if owner in single else owner) for owner in owners]
