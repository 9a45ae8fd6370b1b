"""A mechanism's equations of motion: accelerations, rates of all that a step advances, loops closed after it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from ephs.mechanics.road.records import LinkConstants
from ephs.mechanics.road.rows import SIZE
from ephs.mechanics.tree.engine.balance import correct, measure, stored_energies
from ephs.mechanics.tree.engine.forces import act
from ephs.mechanics.tree.engine.heats import StageRates, absorb, count, entropies, heat_rates, hold, lawless, warm
from ephs.mechanics.tree.engine.shutting import close
from ephs.mechanics.tree.sweeps.acting import TOTALS, Tables, Work
from ephs.mechanics.tree.sweeps.expanding import About
from ephs.semantics.linear.dense import clear, subtract
from ephs.semantics.spaces.rank import GAP
from ephs.semantics.stage import Argument, Evaluator, Integer, Matrix, Real, Truth, Vector
from ephs.solve.march.account import BEYOND, RunAccount, rounding
from ephs.solve.march.memory import Totals
from ephs.solve.march.records import Motion, Status, TableauRecord
from ephs.solve.march.stiff import whole

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.drags import Drags


@final
@dataclass(frozen=True, slots=True)
class Mechanism(Motion):
    """A mechanism in joint coordinates: y = (v, r, heats, totals, flows), see `TOTALS`.

    Parameters
    ----------
    tables, work
        Its tables, and memory.
    looped
        Whether loops are closed, or joints have prescribed motions in them; known while staging.
    kept, read
        As in `act`: receives what acts; is read in its place.
    """

    tables: Tables
    work: Work
    looped: bool
    kept: About | None = None
    read: About | None = None

    @property
    def increments(self) -> Integer:
        return self.tables.drive.size

    @property
    def freedoms(self) -> Integer:
        return self.work.force.size

    @property
    def summed(self) -> Integer:
        return self.increments + self.freedoms

    @property
    def counted(self) -> Integer:
        return 2 * self.freedoms + self.tables.node.size

    @property
    def closes(self) -> bool:
        return self.looped

    # ---- sweeps ----------------------------------------------------------------------------------------------------

    @property
    def swept(self) -> tuple[Argument, ...]:
        """First arguments of all sweeps."""
        e = self.tables
        return e.own[0].links, e.integers, e.reals, self.work.work, e.gravity

    @property
    def _rows(self) -> tuple[Argument, ...]:
        e, w = self.tables, self.work
        return e.at, e.slot, e.row, e.flat, w.value, w.entry, w.covector, w.along

    @property
    def _cuts(self) -> tuple[Argument, ...]:
        return self.tables.cut, self.tables.cut_numbers, self.work.relative

    @property
    def _placed(self) -> tuple[Argument, ...]:
        return self.tables.cut, self.tables.cut_numbers, self.work.places(self.tables), self.work.relative

    def outward(self, on: Evaluator, q: Vector, r: Vector, lead: Vector) -> None:
        """The outward sweep: poses, twists, loads of all links, and the rows that close loops.

        ``lead`` are the accelerations of joints with prescribed motions.
        """
        e, w, own = self.tables, self.work, self.tables.own[0]
        on.reach(own.move, *self.swept, q, r, lead)
        clear(on, whole(w.pushed))
        if not self.looped:
            return
        clear(on, w.entry)
        clear(on, whole(w.covector))

        def forget(a: Integer) -> None:
            w.value[a, SIZE] = 0.0

        on.loop(w.value.rows, forget)
        on.reach(own.rows, *self._placed, e.end, w.value, w.covector)

    def fold(self, on: Evaluator, force: Vector, pushed: Matrix) -> Integer:
        """The inward sweep under forces on the rates and wrenches on links; return a status."""
        return self._still(on, on.reach(self.tables.own[0].fold, *self.swept, *self._rows, force, pushed))

    def unfold(self, on: Evaluator, rate: Vector) -> None:
        """The last outward sweep: write accelerations."""
        on.reach(self.tables.own[0].unfold, *self.swept, *self._rows, rate)

    def _still(self, on: Evaluator, still: Integer) -> Integer:
        """Status where a sweep says 1 + the link whose joint moves no mass, which loops may determine; else 0."""

        def blame() -> None:
            place = (still - 1) * LinkConstants.integer_width + LinkConstants.r_at.offset
            self.work.fault[0] = self.tables.integers[place]

        on.when(still > 0, blame)
        return on.select(still > 0, int(Status.DEPENDENT if self.looped else Status.STILL), 0)

    def _sound(self, on: Evaluator) -> Integer:
        """`Status.DEPENDENT` where a row, without those it is coupled to, is nearly nothing beside them; else 0."""
        found = on.counter(0)

        def reach_dependent() -> None:
            found.value = on.reach(self.tables.own[0].dependent, *self._rows, self.work.largest)

        on.when(self.work.value.rows > 0, reach_dependent)
        return on.select(found.value > 0, int(Status.DEPENDENT), 0)

    def _resolve(self, on: Evaluator) -> Vector:
        """The least change of rates, in the mass metric, that meets the targets, with the factors at hand."""
        on.reach(self.tables.own[0].resolve, *self.swept, *self._rows, self.work.alter)
        return self.work.alter

    def accelerate(
        self, on: Evaluator, q: Vector, r: Vector, rate: Vector, s_rate: Vector, made: Vector, totals: Vector,
        drags: "Drags | None" = None,
    ) -> Integer:  # fmt: skip
        """Write ṙ, ṡ, what each component makes, and the rates of the totals; return a status.

        With ``drags`` there is no friction: its resistances go there."""
        w, own, status = self.work, self.tables.own[0], on.counter(0)

        def fall() -> None:
            status.value = self._still(on, on.reach(own.accelerations, *self.swept, q, r, w.zero, rate))

        def general() -> None:
            self.outward(on, q, r, self.tables.lead)
            clear(on, w.force)

            def forced() -> None:
                status.value = act(on, self.tables, w, q, r, s_rate, made, totals, self.kept, self.read, drags)

            def inward() -> None:
                status.value = self.fold(on, w.force, w.pushed)

            def separate() -> None:
                status.value = self._sound(on)

            def outward() -> None:
                self.unfold(on, rate)
                on.when(own.driven > 0, drive)

            def drive() -> None:
                on.loop(rate.size, follow)
                on.reach(own.power, *self.swept, *self._rows, r, w.force, w.answer)
                totals[1] = totals[1] + w.answer[0]

            def follow(j: Integer) -> None:
                rate[j] = rate[j] + self.tables.lead[j]

            on.when(own.forced > 0, forced)
            on.when(on.same(status.value, 0), inward)
            if self.looped:
                on.when(on.same(status.value, 0), separate)
            on.when(on.same(status.value, 0), outward)

        if self.looped:
            general()
        else:
            on.when(own.falls > 0, fall, general)
        return status.value

    # ---- what a march asks for ---------------------------------------------------------------------------------------

    def rates(
        self, on: Evaluator, base: Vector, y: Vector, q: Vector, out: Vector, drags: "Drags | None" = None
    ) -> tuple[Integer, Integer]:
        e, w, nv, n, ns = self.tables, self.work, self.increments, self.freedoms, self.tables.node.size
        at, status = nv + n + ns, on.counter(0)
        clear(on, out.part(at, out.size - at))
        self.advance(on, base, y, q)
        r, made = y.part(nv, n), out.part(at + TOTALS, out.size - (at + TOTALS))
        s_rate = out.part(nv + n, ns)
        status.value = entropies(on, e, w, y.part(nv + n, ns))

        def accelerate() -> None:
            status.value = self.accelerate(on, q, r, out.part(nv, n), s_rate, made, out.part(at, TOTALS), drags)

        on.when(on.same(status.value, 0), accelerate)
        if drags is None:
            on.when(on.same(status.value, 0), lambda: self.flow(on, y, r, out))
        return status.value, w.fault[0]

    def flow(self, on: Evaluator, y: Vector, r: Vector, out: Vector) -> None:
        """Write v̇ of the rates r, and turn rates of entropies into those of energies, where y has been evaluated."""
        at, ns = self.summed, self.tables.node.size
        first = at + (ns + TOTALS)
        heat_rates(on, self.tables, self.work, out.part(at, ns), out.part(first, out.size - first))
        self.velocities(on, y, r, out)

    def advance(self, on: Evaluator, base: Vector, v: Vector, q: Vector) -> None:
        """Write base·exp(v), joint by joint, to q."""
        on.reach(self.tables.own[0].advance, self.tables.charts, base, v, q)

    def velocities(self, on: Evaluator, y: Vector, r: Vector, out: Vector) -> None:
        """Write v̇ = dexp⁻¹(v) r of all joints, that of cut ones from the outward sweep."""
        on.reach(self.tables.own[0].velocities, self.tables.charts, *self._cuts, y, r, out)

    def settle(self, on: Evaluator, base: Vector, y: Vector, q: Vector) -> Integer:
        self.advance(on, base, y, q)
        return self.shut(on, q, y.part(self.increments, self.freedoms)) if self.looped else 0

    def shut(self, on: Evaluator, q: Vector, r: Vector) -> Integer:
        """Close the loops; return a status."""
        return close(on, self, q, r)

    def rounding(self, on: Evaluator, anchor: Real, y: Vector) -> Real:
        at = self.summed + self.tables.node.size
        return rounding(on, anchor, y[at + 1], y[at])

    def book(self, on: Evaluator, tableau: TableauRecord, k: Matrix, h: Real, totals: Totals) -> Integer:
        before, stages = totals.start.part(self.summed, totals.change.size), StageRates(tableau, k, h, self.summed)
        status = count(on, self.tables, self.work, before, totals.change, totals.size, stages)
        lost = lawless(on, self.tables, totals.change, totals.size, on.select(h >= 0.0, 1.0, -1.0))
        lawful = on.either(status > 0, on.negate(lost > 0))
        self.work.fault[0] = on.select(lawful, self.work.fault[0], lost - 1)
        return on.select(lawful, status, int(Status.LAWLESS))

    def count(self, on: Evaluator, start: Vector, y: Vector, stages: StageRates | None = None) -> None:
        """Put what components made in a step in place of what they passed on, at its end y."""
        at, change = self.summed, self.work.idle

        def each_entry(j: Integer) -> None:
            change[j] = y[at + j] - start[at + j]

        def each_number(j: Integer) -> None:
            y[at + j] = start[at + j] + change[j]

        on.loop(change.size, each_entry)
        count(on, self.tables, self.work, start.part(at, change.size), change, None, stages)
        on.loop(change.size, each_number)

    def absorb(self, on: Evaluator, anchor: Real, y0: Vector, q: Vector, y1: Vector, change: Vector) -> None:
        nv, n, at, nodes = self.increments, self.freedoms, self.summed, self.tables.node.size
        energies, before = on.scratch(3), y0.part(at + nodes, TOTALS)

        def known() -> None:
            stored_energies(on, self, q, y1.part(nv, n), y1.part(at, nodes), energies)
            lost = anchor + (before[1] - before[0]) + change[nodes + 1] - (energies[0] + energies[1])
            absorb(on, self.tables, lost, change)

        on.when(on.both(self.tables.sink.size > 0, on.absolute(anchor) < BEYOND), known)

    def warm(self, on: Evaluator, y0: Vector, y: Vector) -> None:
        ns = self.tables.node.size
        warm(on, self.tables, y0.part(self.summed, ns), y.part(self.summed, ns))

    def hold(self, on: Evaluator, change: Vector, low: Vector, high: Vector, *, made: bool) -> None:
        hold(on, self.tables, change, low, high, made=made)

    def correct(
        self, on: Evaluator, account: RunAccount, h: Real, start: Vector, y: Vector, q: Vector, allowed: Vector,
        always: bool = False,
    ) -> Integer:  # fmt: skip
        nv, n, at = self.increments, self.freedoms, self.summed + self.tables.node.size
        stored, heats = (each.part(self.summed, self.tables.node.size) for each in (start, y))
        return correct(
            on, self, account, y[at + 1], y[at], h, start.part(nv, n), q, y.part(nv, n), stored, heats, allowed, always
        )

    def open(self, on: Evaluator, account: RunAccount, q: Vector, y: Vector) -> Integer:
        energies, at, ns = on.scratch(3), self.summed, self.tables.node.size
        status = stored_energies(on, self, q, y.part(self.increments, self.freedoms), y.part(at, ns), energies)
        account.anchor = energies[0] + energies[1] + (y[at + ns] - y[at + (ns + 1)])
        on.when(self.tables.own[0].islands > 0, lambda: measure(on, self, q, y.part(self.increments, self.freedoms)))
        return status

    def sizes(self, on: Evaluator, y0: Vector, y1: Vector, out: Vector) -> None:
        """1 rad or m of increments; of rates the largest in their joint; energies of heat."""
        n, nv, charts = self.freedoms, self.increments, self.tables.chart

        def larger(j: Integer) -> Real:
            return on.maximum(on.absolute(y0[j]), on.absolute(y1[j]))

        def unit(j: Integer) -> None:
            out[j] = 1.0

        def joint(i: Integer) -> None:
            chart, most = charts[i], on.variable(0.0)

            def widen(j: Integer) -> None:
                most.value = on.maximum(most.value, larger(nv + chart.r_at + j))

            def each_freedom(j: Integer) -> None:
                out[n + chart.r_at + j] = most.value

            def on_tree() -> None:
                on.loop(chart.dim, widen)
                on.loop(chart.dim, each_freedom)

            on.when(chart.cut < 0, on_tree)

        def energy(k: Integer) -> None:
            out[2 * n + k] = larger(nv + n + k)

        on.loop(n, unit)
        on.loop(charts.size, joint)
        on.loop(self.tables.node.size, energy)

    def stray(self, on: Evaluator, change: Vector) -> None:
        """Write targets that take a change of the rates back across the constraints."""
        own, w = self.tables.own[0], self.work
        on.reach(own.spread, *self.swept, change)
        on.reach(own.across, *self._placed, w.value)

    def project(self, on: Evaluator, q: Vector, change: Vector) -> None:
        self.stray(on, change)
        subtract(on, -1.0, self._resolve(on), change)

    def least(self, on: Evaluator, change: Vector) -> Real:
        first, least = self.tables.node.size + TOTALS, on.variable(0.0)

        def each_entry(j: Integer) -> None:
            least.value = on.select(on.same(j, first), change[j], on.minimum(change[j], least.value))

        on.loop(change.size, each_entry, start=first)
        return least.value

    def gaps(self, on: Evaluator, q: Vector) -> Real:
        """Write targets that close the cut joints in one step of Newton's method; how far they are open, in m, rad."""
        on.reach(self.tables.own[0].gaps, *self._cuts, q, self.work.value, self.work.answer)
        return self.work.answer[0]

    def newton(
        self, on: Evaluator, q: Vector, r: Vector, before: Real, *, always: bool = False
    ) -> tuple[Integer, Real, Truth]:
        """Fit the cut joints, factorise, and move the tree if that helps; a status, the gap, and whether it is done.

        With ``always`` it is moved in any case: the tangent of closing is that of a round that was taken."""
        own, w, status = self.tables.own[0], self.work, on.counter(0)
        self.outward(on, q, r, w.zero)
        on.reach(own.poses, *self._placed)
        on.reach(own.fit, *self._cuts, q)
        gap = self.gaps(on, q)
        status.value = self.fold(on, w.zero, w.pushed)

        def separate() -> None:
            status.value = self._sound(on)

        on.when(on.same(status.value, 0), separate)
        unsound = on.negate(on.same(status.value, 0))
        done = unsound if always else on.either(unsound, on.either(gap <= GAP, gap > 0.5 * before))

        def displace_once() -> None:
            self.gaps(on, q)
            self.displace(on, self._resolve(on), q)

        on.when(on.negate(done), displace_once)
        return status.value, gap, done

    def displace(self, on: Evaluator, alter: Vector, q: Vector) -> None:
        """Move the joints of the tree by a change of their increments, cut ones at rest."""
        e, moved = self.tables, self.work.moved

        def joint(i: Integer) -> None:
            chart = e.chart[i]

            def rest(j: Integer) -> None:
                moved[chart.v_at + j] = 0.0

            def on_tree(j: Integer) -> None:
                moved[chart.v_at + j] = alter[chart.r_at + j]

            on.loop(chart.dim, rest)
            on.when(chart.cut < 0, lambda: on.loop(chart.dim, on_tree))

        on.loop(e.chart.size, joint)
        on.reach(e.own[0].displace, e.charts, moved, q)

    def straighten(self, on: Evaluator, q: Vector, r: Vector) -> None:
        """Put the rates on the constraints, with the factors at hand."""
        on.reach(self.tables.own[0].relative_rates, *self._cuts, self.work.value)
        subtract(on, -1.0, self._resolve(on), r)
