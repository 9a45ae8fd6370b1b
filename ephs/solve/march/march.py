"""Explicit steps, many in one call: stages, closing of constraints, error, step control, records."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import final

from ephs.semantics.linear.dense import clear, copy
from ephs.semantics.stage import Evaluator, Integer, Real, Truth, Variable, Vector
from ephs.solve.march.account import WHOLE, WORTH, RunAccount, worth
from ephs.solve.march.control import PATIENCE, held_back, judge, length
from ephs.solve.march.evaluating import MarchStep, allow
from ephs.solve.march.lagged import Lagged, begin
from ephs.solve.march.memory import Memory, Totals
from ephs.solve.march.newton import filtered
from ephs.solve.march.records import Ending, MarchControl, Motion, Status, TableauRecord
from ephs.solve.march.steps import attempt, book, drift, error_of, first, stiffness_of
from ephs.solve.march.stiff import Stiff

GOING = -1
"""No ending yet."""
ROUNDING = 16.0 * 2.220446049250313e-16
"""Least step relative to the time."""


def march(
    on: Evaluator,
    motion: Motion,
    tableau: TableauRecord,
    memory: Memory,
    control: MarchControl,
    account: RunAccount,
    steps: Integer,
    stiff: Stiff | None = None,
    lagged: Lagged | None = None,
) -> Integer:
    """Take steps from the state in (memory.q, memory.y) until the end, or ``steps`` of them.

    With memory for that, steps are implicit, their stages by Newton's method, or semi-implicit.

    Instants in memory.times are kept where control.saved is not negative, else every step is.

    Returns
    -------
    Integer
        An `Ending`.
    """
    run = _TrialStep(
        on, motion, tableau, memory, control, account, stiff, lagged, *(on.counter(n) for n in (GOING, 0, 0, 0))
    )
    tries = on.counter(0)

    def once() -> Truth:
        run.step()
        tries.value = tries.value + 1
        return on.either(run.ended, tries.value >= steps)

    on.when(steps > 0, lambda: on.repeat(once))
    reached = on.select(control.time >= on.absolute(control.end), int(Ending.DONE), int(Ending.PAUSED))
    return on.select(run.ended, run.ending.value, reached)


@final
@dataclass(frozen=True, slots=True)
class _TrialStep:
    """A trial step and its outcome; `ending` is the march's status, `ahead` 1 where its end was evaluated last."""

    on: Evaluator
    motion: Motion
    tableau: TableauRecord
    memory: Memory
    control: MarchControl
    account: RunAccount
    stiff: Stiff | None
    lagged: Lagged | None
    ending: Variable[Integer]
    status: Variable[Integer]
    accepted: Variable[Integer]
    ahead: Variable[Integer]

    @property
    def ended(self) -> Truth:
        return self.ending.value >= 0

    @property
    def sound(self) -> Truth:
        return self.on.same(self.status.value, int(Status.SOUND))

    @property
    def sign(self) -> Real:
        return self.on.select(self.control.end >= 0.0, 1.0, -1.0)

    def end(self, ending: Integer) -> None:
        self.ending.value = ending

    def whole(self, h: Real) -> MarchStep:
        """Return a step of h seconds from the state."""
        m = self.memory
        return MarchStep(self.motion, self.tableau, self.control, m.q, m.y, h, m.k, m.y1, m.q1)

    def unless_ended(self, following: Callable[[], None]) -> None:
        """Go on where there is no ending yet."""
        self.on.when(self.on.negate(self.ended), following)

    def step(self) -> None:
        """Try one step."""
        on, c = self.on, self.control
        rest = on.absolute(c.end) - c.time

        def go_on() -> None:
            h = c.tried = length(on, c, rest)
            on.when(on.same(c.fresh, 0), lambda: self._begin(h))
            self.unless_ended(self._refresh)
            self.unless_ended(lambda: self._try(h, rest))

        def check_rest() -> None:
            on.when(c.rows >= self.memory.rows_t.rows, lambda: self.end(Ending.FULL), go_on)

        on.when(rest <= 0.0, lambda: self.end(Ending.DONE), check_rest)

    def _begin(self, h: Real) -> None:
        """Evaluate the rates at the state, the start of a step."""
        on, step = self.on, self.whole(h)
        self.status.value = first(on, step) if self.lagged is None else begin(on, step, self.lagged)

        def open_account() -> None:
            self.status.value = self.motion.open(on, self.account, self.memory.q, self.memory.y)
            self.account.begins = 0

        on.when(on.both(self.sound, on.same(self.account.begins, 1)), open_account)

        def known() -> None:
            self.control.fresh = 1

        def refused() -> None:
            dependent = on.same(self.status.value, int(Status.DEPENDENT))
            self.end(on.select(dependent, int(Ending.CAREFUL), int(Ending.REFUSED) + self.status.value))

        on.when(self.sound, known, refused)

    def _refresh(self) -> None:
        """Request a new matrix if the present one converged slowly."""
        if self.stiff is not None:
            known = self.stiff.newton[0]
            stale = self.on.both(self.on.same(known.stale, 1), self.on.negate(self.on.same(known.young, 1)))
            self.on.when(stale, lambda: self.end(Ending.STALE))

    def _try(self, h: Real, rest: Real) -> None:
        """Take a step of length h, measure its error, and accept it or not."""
        on, m, c, step = self.on, self.memory, self.control, self.whole(self.sign * h)
        self.accepted.value = 0
        self.status.value = attempt(on, step, m.errors, m.last, self.stiff, self.lagged)

        def estimate_error() -> None:
            allow(on, self.motion, m.errors, m.y, m.y1)
            if self.lagged is None:
                c.stiff = stiffness_of(on, step, m)

        on.when(self.sound, estimate_error)
        error = self._finish(step, m.carry1, part=False)

        def weigh() -> None:
            def always() -> None:
                self.accepted.value = 1

            def ask() -> None:
                self.accepted.value = judge(on, c, h, error)

            on.when(c.grid > 0.0, always, ask)

        def refused() -> None:
            def shorten() -> None:
                c.step = 0.25 * h

            def other() -> None:
                on.when(c.grid > 0.0, lambda: self.end(Ending.REFUSED + self.status.value), shorten)

            dependent = on.same(self.status.value, int(Status.DEPENDENT))
            on.when(dependent, lambda: self.end(Ending.CAREFUL), other)
            if self.stiff is not None:  # first by the matrix of the state
                known = self.stiff.newton[0]
                unsettled = on.same(self.status.value, int(Status.UNSETTLED))

                def renew() -> None:
                    known.stale, c.step = 1, h
                    self.end(Ending.STALE)

                on.when(on.both(unsettled, on.negate(on.same(known.young, 1))), renew)

        on.when(self.sound, weigh, refused)
        taken = on.same(self.accepted.value, 1)
        self.unless_ended(lambda: on.when(taken, lambda: self._take(h, rest), self._reject))

    def _finish(self, step: MarchStep, carry: Vector, *, part: bool) -> Real:
        """Project the end of a step, or of a part of one, to a state that obeys the laws; return its error."""
        on, motion, m, c, y, q = self.on, self.motion, self.memory, self.control, step.y, step.q
        totals = Totals(step.start, y, m.carry, carry, m.change, m.size, m.whole, m.low)
        n, nv, error = motion.freedoms, motion.increments, on.variable(0.0)
        damped = None if self.stiff is None and self.lagged is None else q

        def keep_books() -> None:
            self.status.value = book(
                on, motion, self.tableau, step.k, step.h, totals, self.account.anchor, part, damped
            )  # fmt: skip

        def settle_end() -> None:
            copy(on, y.part(nv, n), m.open)
            self.status.value = motion.settle(on, m.q, y, q)

        def measure() -> None:
            if self.stiff is None:
                error.value = error_of(on, step, m)
            else:
                error.value = filtered(on, step, m.errors, self.stiff)

            def reveal() -> None:
                error.value = on.maximum(error.value, drift(on, m.open, y.part(nv, n), m.allowed))

            if motion.closes:
                on.when(on.same(c.rough, 0), reveal)

        def correct() -> None:
            self.status.value = motion.correct(on, self.account, step.h, step.start, y, q, m.allowed)

            def weigh() -> None:
                share = WORTH if self.lagged is None else WHOLE
                error.value = on.maximum(error.value, worth(on, self.account, share))

            on.when(self.sound, weigh)

        def go_on(following: Callable[[], None]) -> None:
            """Go on with a step that is sound so far and will not be refused."""
            on.when(on.both(self.sound, on.either(c.grid > 0.0, error.value <= 1.0)), following)

        def look_ahead() -> None:
            """A surface that is met late in a step is met by no stage: what acts at its end counts, too."""
            corrected = error.value
            clear(on, y.part(0, nv))
            following = replace(step, base=q, start=y, q=m.q2)
            assert self.lagged is not None
            self.status.value = begin(on, following, self.lagged)
            copy(on, self.lagged.seen, step.k.row(self.tableau.a.columns))
            self.ahead.value = 1

            def again() -> None:
                measure()
                error.value = on.maximum(error.value, corrected)

            on.when(self.sound, again)

        on.when(self.sound, keep_books)
        if motion.closes:
            on.when(self.sound, settle_end)
        on.when(self.sound, measure)
        go_on(correct)
        if self.lagged is not None and not part:
            go_on(look_ahead)
        return error.value

    def _reject(self) -> None:
        """Count a step that is tried again; end where it gets too short or keeps failing."""
        on, c = self.on, self.control
        c.rejected = c.rejected + 1
        if self.lagged is not None:
            c.fresh = 0

        def count() -> None:
            c.refusals = c.refusals + 1
            on.when(c.refusals > PATIENCE, lambda: self.end(Ending.STIFF))

        on.when(on.both(on.negate(self.sound), c.limit > 0.0), count)
        latest = on.maximum(on.absolute(c.origin + self.sign * c.time), on.absolute(c.origin + c.end))
        tiny = c.step < on.maximum(c.least_step, ROUNDING * latest)
        short = on.select(self.sound, int(Ending.SHORT), int(Ending.REFUSED) + self.status.value)
        self.unless_ended(lambda: on.when(tiny, lambda: self.end(short)))

    def _take(self, h: Real, rest: Real) -> None:
        """Record an accepted step as asked, and advance to its end."""
        on, motion, m, c = self.on, self.motion, self.memory, self.control
        on_grid = on.select(c.grid > 0.0, c.grid * (on.real(c.steps) + 1.0), c.time + h)
        after = on.select(h >= rest, on.absolute(c.end), on_grid)
        least, a = motion.least(on, m.change), self.account
        put, rest = a.moved, a.rest
        on.when(
            c.saved < 0, lambda: self._keep(after, least, put, m.q1, m.y1), lambda: self._instants(after, least, put)
        )

        def account() -> None:
            a.put, a.total, a.left = a.put + put, a.total + on.absolute(put), rest

        self.unless_ended(account)
        self.unless_ended(lambda: self._go(h, after, least))

    def _keep(self, time: Real, least: Real, put: Real, q: Vector, y: Vector) -> None:
        """Record a state, with the energy added by its step, as the next row."""
        m, row, a = self.memory, self.control.rows, self.account
        for column, value in enumerate((time, least, a.put + put, a.total + self.on.absolute(put))):
            m.rows_t[row, column] = value
        copy(self.on, q, m.rows_q.row(row))
        nv = self.motion.increments
        copy(self.on, y.part(nv, y.size - nv), m.rows_y.row(row))
        self.control.rows = row + 1

    def _instants(self, after: Real, least: Real, put: Real) -> None:
        """Keep the instants within a step: each by a step of its own from the start of this one."""
        on, motion, m, c = self.on, self.motion, self.memory, self.control

        def inside(wanted: Real) -> None:
            copy(on, m.k.row(0), m.k2.row(0))
            part = replace(self.whole(self.sign * (wanted - c.time)), k=m.k2, y=m.y2, q=m.q2)
            if self.lagged is not None:
                self.status.value = begin(on, part, self.lagged)
                self.ahead.value = 0

            def take() -> None:
                self.status.value = attempt(on, part, m.errors, m.last, self.stiff, self.lagged)

            on.when(self.sound, take)

            # Near a change of rank a part may be wrong and the whole right: closing removes transverse components.
            on.when(self.sound, lambda: allow(on, motion, m.errors, m.y, m.y2))
            error = self._finish(part, m.carry2, part=True)
            right = on.either(c.grid > 0.0, on.negate(error > 1.0)) if motion.closes else True
            # Where it is not, the step is taken again carefully, and its part in shorter ones.
            kept = on.both(self.sound, right)
            moved = self.account.moved
            on.when(kept, lambda: self._keep(wanted, least, moved, m.q2, m.y2), lambda: self.end(Ending.CAREFUL))

        def once() -> Truth:
            wanted = m.times[c.saved]

            def keep() -> None:
                def whole() -> None:
                    self._keep(wanted, least, put, m.q1, m.y1)

                on.when(wanted >= after, whole, lambda: inside(wanted))

                def count() -> None:
                    c.saved = c.saved + 1

                self.unless_ended(count)

            due = wanted <= after
            on.when(due, keep)
            return on.either(on.either(on.negate(due), self.ended), c.saved >= m.times.size)

        on.when(c.saved < m.times.size, lambda: on.repeat(once))

    def _go(self, h: Real, after: Real, least: Real) -> None:
        """Make the step's end the state."""
        on, motion, m, c = self.on, self.motion, self.memory, self.control
        nv, size = motion.increments, m.y.size
        c.time, c.steps = after, c.steps + 1
        c.shortest, c.longest = on.minimum(c.shortest, h), on.maximum(c.longest, h)
        c.least = on.minimum(c.least, least)
        copy(on, m.q1, m.q)
        copy(on, m.carry1, m.carry)

        clear(on, m.y.part(0, nv))
        copy(on, m.y1.part(nv, size - nv), m.y.part(nv, size - nv))
        c.rough = 0
        c.fresh = self.ahead.value if self.lagged is not None else 0 if motion.closes else 1
        if not motion.closes:  # Nothing was projected: the last rates are the next first ones.
            copy(on, m.k.row(self.tableau.a.columns), m.k.row(0))
            copy(on, m.y.part(nv, nv), m.k.row(0).part(0, nv))
        c.refusals = 0
        if self.stiff is not None:
            self.stiff.newton[0].young = 0

        def watch() -> None:
            on.when(held_back(on, c), lambda: self.end(Ending.STIFF))

        on.when(c.limit > 0.0, watch)
