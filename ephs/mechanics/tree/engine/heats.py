"""Storages of heat: entropies of energies, and the entropy that a step made."""

from dataclasses import dataclass
from typing import final

from ephs.mechanics.tree.sweeps.acting import TOTALS, Tables, Work
from ephs.semantics.descriptor.kernel_table import TEMPERATURE
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Truth, Vector
from ephs.solve.equations.heats import PLAIN
from ephs.solve.march.records import TableauRecord

ROUNDING = 100.0 * 2.220446049250313e-16
"""Part of what a sum of flows adds up by which it may be off: 10 κ ε with a condition κ of 10."""
LITTLE = 0.1
"""Part of a step's heat by which it may be less than a quadrature finds, where the motion gained that energy: moving
rates instead would leave the slow motion of what friction holds."""
TRUSTED = 0.5
"""Part of what stages say that components made by which it may differ from the entropy of the stores: a step beyond
that has other errors."""


def _log_ratio(on: Evaluator, x: Real) -> Real:
    """log(1 + x)/x for x > −1, exact to rounding.

    Goldberg, *What Every Computer Scientist Should Know About Floating-Point Arithmetic*, 1991, theorem 4.
    """
    whole = 1.0 + x
    moved = whole - 1.0
    still = on.absolute(moved) <= 0.0
    return on.select(still, 1.0, on.log(on.select(still, 2.0, whole)) / on.select(still, 1.0, moved))


def entropies(on: Evaluator, tables: Tables, work: Work, heats: Vector) -> Integer:
    """Write entropies of energies in J to the memory; return a status."""
    status = on.counter(0)

    def each_node(k: Integer) -> None:
        node, energy = tables.node[k], heats[k]

        def stored() -> None:
            share = energy / node.c1
            cold = on.negate(share > -1.0)

            def refuse() -> None:
                status.value = TEMPERATURE
                work.fault[0] = node.component

            on.when(on.both(cold, on.same(status.value, 0)), refuse)
            safe = on.select(cold, 0.0, share)
            work.entropy[k] = node.c2 * (safe * _log_ratio(on, safe))

        def outside() -> None:
            work.entropy[k] = on.select(on.same(node.component, PLAIN), energy, energy / tables.scal[1])

        on.when(node.component < 0, outside, stored)

    on.loop(tables.node.size, each_node)
    return status.value


def heat_rates(on: Evaluator, tables: Tables, work: Work, rates: Vector, made: Vector) -> None:
    """Turn rates of entropies into those of energies, and entropies a second into flows.

    Flows are what friction makes, and what conduction carries from its first to its second end: by the entropy that
    leaves the first, since what it makes is a small difference where temperatures are nearly equal.
    """
    around = tables.scal[1]

    def theta(k: Integer) -> Real:
        plain = on.same(tables.node[k].component, PLAIN)
        return on.select(plain, 1.0, work.temperature[k] + around)

    def node(k: Integer) -> None:
        rates[k] = rates[k] * theta(k)

    def friction(i: Integer) -> None:
        sink = tables.sink[i]

        def stored() -> None:
            made[sink.maker] = made[sink.maker] * theta(sink.entropy)

        on.when(sink.entropy >= 0, stored)

    def conduction(i: Integer) -> None:
        row = tables.conduction[i]
        maker = tables.component[row.component].made
        made[maker] = made[maker] * theta(row.one)

    on.loop(tables.node.size, node)
    on.loop(tables.sink.size, friction)
    on.loop(tables.conduction.size, conduction)


@final
@dataclass(frozen=True, slots=True)
class StageRates:
    """Rates of (heats, totals, flows) at the stages of a step of h seconds: the columns of k from ``at`` on."""

    tableau: TableauRecord
    k: Matrix
    h: Real
    at: Integer

    def cold(self, on: Evaluator, tables: Tables, before: Vector, s: Integer, node: Integer) -> Real:
        """1/θ of an entropy at a stage; 0 where there is none."""
        cold, a = on.variable(0.0), self.tableau.a

        def stored() -> None:
            row, energy = tables.node[node], on.variable(before[node])

            def add(j: Integer) -> None:
                energy.value = energy.value + self.h * a[s, j] * self.k[j, self.at + node]

            on.loop(a.columns, add)
            cold.value = row.c2 / (row.c1 + energy.value)

        def outside() -> None:
            cold.value = _cold_outside(on, tables, node)

        on.when(node >= 0, lambda: on.when(_stores(on, tables, node), stored, outside))
        return cold.value

    def made(
        self, on: Evaluator, tables: Tables, before: Vector, maker: Integer, ends: tuple[Integer, Integer]
    ) -> tuple[Real, Real]:
        """Heat in J that a component transferred and entropy in J/K that it produced, by the method's quadrature."""
        passed, made, a = on.variable(0.0), on.variable(0.0), self.tableau.a

        def stage(s: Integer) -> None:
            weight = self.h * a[a.columns, s]

            def add() -> None:
                flow = weight * self.k[s, self.at + (tables.node.size + TOTALS + maker)]
                source, sink = (self.cold(on, tables, before, s, end) for end in ends)
                passed.value, made.value = passed.value + flow, made.value + flow * (sink - source)

            on.when(on.negate(on.absolute(weight) <= 0.0), add)

        on.loop(a.columns, stage)
        return passed.value, made.value


def _stores(on: Evaluator, tables: Tables, node: Integer) -> Truth:
    """Whether an entropy is that of a store, whose temperature changes; −1: of nothing."""
    return on.both(node >= 0, tables.node[on.select(node < 0, 0, node)].component >= 0)


def _warms(on: Evaluator, tables: Tables, ends: tuple[Integer, Integer]) -> Truth:
    """Whether one of two entropies is that of a store."""
    return on.either(_stores(on, tables, ends[0]), _stores(on, tables, ends[1]))


def _cold_outside(on: Evaluator, tables: Tables, node: Integer) -> Real:
    """1/θ of an entropy that is not that of a store."""
    return on.select(on.same(tables.node[node].component, PLAIN), 1.0, 1.0 / tables.scal[1])


def count(
    on: Evaluator, tables: Tables, work: Work, before: Vector, change: Vector, size: Vector | None,
    stages: StageRates | None = None,
) -> Integer:  # fmt: skip
    """Put what components made in a step in place of what they passed on, in the changes of (heats, totals, flows).

    Mean temperatures of the step are ΔE/Δs: so entropies change by what is made, to rounding. By them each component's
    part is of order two in the step. Stages say each to the order of the method; what that misses in the sum is shared
    in proportion. The status returned is that of a store from which more heat was carried away than there is.

    Parameters
    ----------
    before
        (heats, …) at the start.
    size
        Sums of the sizes of what the changes add up; those of flows become rounding of what was made.
    """
    cold, nodes, parts = work.temperature, tables.node.size, work.spare
    rest, whole, status = on.variable(0.0), on.variable(0.0), on.counter(0)

    def node(k: Integer) -> None:
        row = tables.node[k]

        def outside() -> None:
            cold[k] = _cold_outside(on, tables, k)

        def inside() -> None:
            held = row.c1 + before[k]
            share = change[k] / held

            def refuse() -> None:
                status.value, work.fault[0] = TEMPERATURE, row.component

            cold[k] = _log_ratio(on, share) * row.c2 / held
            on.when(on.negate(share > -1.0), refuse)

        on.when(row.component < 0, outside, inside)

    def produced(maker: Integer, ends: tuple[Integer, Integer], rubs: Truth, factor: Real, most: Real) -> None:
        at = nodes + TOTALS + maker
        flow = change[at]
        change[at] = flow * factor
        if size is not None:
            size[at] = ROUNDING * size[at] * most

        def by_stages() -> None:
            if stages is None:
                return
            passed, made = stages.made(on, tables, before, maker, ends)
            same = passed * flow > 0.0
            scaled = on.select(same, made * (flow / on.select(same, passed, 1.0)), change[at])
            made = on.select(rubs, scaled, made)
            lawful = on.either(made * stages.h >= 0.0, on.negate(on.either(rubs, ends[0] >= 0)))
            made = parts[at] = on.select(lawful, made, change[at])
            rest.value, whole.value = rest.value + (change[at] - made), whole.value + on.absolute(made)

        on.when(_warms(on, tables, ends), by_stages)

    def friction(i: Integer) -> None:
        sink = tables.sink[i]
        factor = on.variable(1.0)

        def heated() -> None:
            factor.value = cold[sink.entropy]

        on.when(sink.entropy >= 0, heated)
        produced(sink.maker, (-1, sink.entropy), sink.rubs > 0, factor.value, factor.value)

    def gather(i: Integer) -> None:
        """Add what a component makes at its further places to its first."""
        sink = tables.sink[i]
        at, first = nodes + TOTALS + sink.maker, nodes + TOTALS + sink.owner

        def move() -> None:
            change[first], change[at] = change[first] + change[at], 0.0
            if size is not None:
                size[first], size[at] = size[first] + size[at], 0.0

        on.when(on.negate(on.same(at, first)), move)

    def conduction(i: Integer) -> None:
        row = tables.conduction[i]
        one, two = cold[row.one], cold[row.two]
        produced(tables.component[row.component].made, (row.one, row.two), False, two - one, one + two)

    def share(maker: Integer, ends: tuple[Integer, Integer]) -> None:
        at = nodes + TOTALS + maker

        def spread() -> None:
            change[at] = parts[at] + on.absolute(parts[at]) * (rest.value / whole.value)

        on.when(_warms(on, tables, ends), spread)

    def share_conducted(i: Integer) -> None:
        row = tables.conduction[i]
        share(tables.component[row.component].made, (row.one, row.two))

    def share_all() -> None:
        on.loop(tables.sink.size, lambda i: share(tables.sink[i].maker, (-1, tables.sink[i].entropy)))
        on.loop(tables.conduction.size, share_conducted)

    on.loop(nodes, node)
    on.loop(tables.sink.size, friction)
    on.loop(tables.conduction.size, conduction)
    if stages is not None:
        on.when(on.absolute(rest.value) < TRUSTED * whole.value, share_all)
    on.loop(tables.sink.size, gather)
    return status.value


def lawless(on: Evaluator, tables: Tables, change: Vector, rounding: Vector, sign: Real) -> Integer:
    """Return 1 + the component that lost entropy in a step beyond rounding, 0: none; ``sign`` is that of time.

    Where none does, neither does the sum of all.
    """
    first, found = tables.node.size + TOTALS, on.counter(0)

    def each_entry(place: Integer) -> None:
        def name(number: Integer) -> None:
            here = on.same(tables.component[number].made, place - first)
            found.value = on.select(here, number + 1, found.value)

        sound = sign * change[place] >= -rounding[place]
        on.when(sound, lambda: None, lambda: on.loop(tables.component.size, name))

    on.loop(change.size, each_entry, start=first)
    return found.value


def absorb(on: Evaluator, tables: Tables, lost: Real, change: Vector) -> None:
    """Make the heat of friction in a step's changes what the motion lost in J.

    It is shared by what each component made: see `ephs.solve.equations.heats`.
    """
    nodes, whole = tables.node.size, on.variable(0.0)

    def weigh(i: Integer) -> None:
        sink = tables.sink[i]
        flow = on.select(sink.rubs > 0, change[nodes + TOTALS + sink.maker], 0.0)
        whole.value = whole.value + on.maximum(flow, 0.0)

    on.loop(tables.sink.size, weigh)
    short, made = lost - change[nodes], whole.value
    share = on.select(on.both(made > 0.0, short > -LITTLE * made), short / on.select(made > 0.0, made, 1.0), 0.0)

    def grow(i: Integer) -> None:
        sink = tables.sink[i]
        at = nodes + TOTALS + sink.maker

        def more() -> None:
            heat = share * on.maximum(change[at], 0.0)
            for place in (at, sink.entropy, nodes):
                change[place] = change[place] + heat

        on.when(sink.rubs > 0, more)

    on.loop(tables.sink.size, grow)


def warm(on: Evaluator, tables: Tables, before: Vector, heats: Vector) -> None:
    """Lift energies in J to what they are at a hundredth of the temperatures before."""

    def each_node(k: Integer) -> None:
        c1 = tables.node[k].c1

        def lift() -> None:
            heats[k] = on.maximum(heats[k], 0.01 * (c1 + before[k]) - c1)

        on.when(tables.node[k].component >= 0, lift)

    on.loop(tables.node.size, each_node)


def hold(
    on: Evaluator, tables: Tables, change: Vector, low: Vector, high: Vector, *, made: bool
) -> None:  # fmt: skip
    """Put the flows of a part of a step between those of a shorter part and those of the whole, and heats with them.

    So heat does not fall from instant to instant within a step. All are changes of (heats, totals, flows); with
    ``made`` what components made is in place of flows, and nothing else moves.
    """
    nodes = tables.node.size
    if made:
        first = nodes + TOTALS
        held_between(on, *(each.part(first, each.size - first) for each in (change, low, high)))
        return

    def clamped(maker: Integer) -> Real:
        at = nodes + TOTALS + maker
        least, most = on.minimum(low[at], high[at]), on.maximum(low[at], high[at])
        kept = on.minimum(on.maximum(change[at], least), most)
        moved = kept - change[at]
        change[at] = kept
        return moved

    def friction(i: Integer) -> None:
        sink = tables.sink[i]

        def rubbed() -> None:
            moved = clamped(sink.maker)
            change[sink.entropy], change[nodes] = change[sink.entropy] + moved, change[nodes] + moved

        on.when(sink.rubs > 0, rubbed)

    def conduction(i: Integer) -> None:
        row = tables.conduction[i]
        moved = clamped(tables.component[row.component].made)
        change[row.one], change[row.two] = change[row.one] - moved, change[row.two] + moved

    on.loop(tables.sink.size, friction)
    on.loop(tables.conduction.size, conduction)


def held_between(on: Evaluator, made: Vector, low: Vector, high: Vector) -> None:
    """Put entropies made in a part of a step, with their sum, each between those of a shorter part and of the whole.

    They stay where their sums do not allow that.
    """
    rest, grown, above, below = (on.variable(0.0) for _ in range(4))

    def kept(j: Integer) -> Real:
        return on.minimum(on.maximum(made[j], on.minimum(low[j], high[j])), on.maximum(low[j], high[j]))

    def weigh(j: Integer) -> None:
        held = kept(j)
        rest.value, grown.value = rest.value + (made[j] - held), grown.value + (high[j] - low[j])
        above.value, below.value = above.value + (high[j] - held), below.value + (low[j] - held)

    on.loop(made.size, weigh)
    up = rest.value * grown.value > 0.0
    room = on.select(up, above.value, below.value)
    still = on.negate(on.absolute(rest.value) > 0.0)
    share = on.select(still, 0.0, rest.value / on.select(on.absolute(room) > 0.0, room, 1.0))
    allowed = on.either(still, on.both(on.absolute(room) > 0.0, on.both(share > 0.0, share <= 1.0)))

    def place(j: Integer) -> None:
        held = kept(j)
        made[j] = held + share * (on.select(up, high[j], low[j]) - held)

    on.when(allowed, lambda: on.loop(made.size, place))
