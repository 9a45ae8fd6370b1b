"""Storages of heat: entropies of energies, and the entropy that a step made."""

from ephs.mechanics.tree.sweeps.acting import Tables, Work
from ephs.semantics.descriptor.kernel_table import TEMPERATURE
from ephs.semantics.stage import Evaluator, Integer, Real, Vector
from ephs.solve.equations.heats import LITTLE, PLAIN

ROUNDING = 100.0 * 2.220446049250313e-16
"""Part of what a sum of flows adds up by which it may be off: 10 κ ε with a condition κ of 10."""


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


def count(on: Evaluator, tables: Tables, work: Work, before: Vector, change: Vector, size: Vector) -> None:
    """Put what components made in a step in place of what they passed on, in the changes of (heats, heat, work, flows).

    Mean temperatures of the step are ΔE/Δs: so entropies change by what is made. ``before``: (heats, …) at the start.
    ``size``: sums of the sizes of what the changes add up; those of flows become rounding of what was made.
    """
    cold, nodes = work.temperature, tables.node.size

    def node(k: Integer) -> None:
        row = tables.node[k]

        def outside() -> None:
            cold[k] = on.select(on.same(row.component, PLAIN), 1.0, 1.0 / tables.scal[1])

        def stored() -> None:
            held = row.c1 + before[k]
            cold[k] = _log_ratio(on, change[k] / held) * row.c2 / held

        on.when(row.component < 0, outside, stored)

    def passed(maker: Integer, factor: Real, most: Real) -> None:
        at = nodes + 2 + maker
        change[at], size[at] = change[at] * factor, ROUNDING * size[at] * most

    def friction(i: Integer) -> None:
        sink = tables.sink[i]

        def heated() -> None:
            passed(sink.maker, cold[sink.entropy], cold[sink.entropy])

        on.when(sink.entropy >= 0, heated, lambda: passed(sink.maker, 1.0, 1.0))

    def gather(i: Integer) -> None:
        """Add what a component makes at its further places to its first."""
        sink = tables.sink[i]
        at, first = nodes + 2 + sink.maker, nodes + 2 + sink.owner

        def move() -> None:
            change[first], size[first] = change[first] + change[at], size[first] + size[at]
            change[at], size[at] = 0.0, 0.0

        on.when(on.negate(on.same(at, first)), move)

    def conduction(i: Integer) -> None:
        row = tables.conduction[i]
        one, two = cold[row.one], cold[row.two]
        passed(tables.component[row.component].made, two - one, one + two)

    on.loop(nodes, node)
    on.loop(tables.sink.size, friction)
    on.loop(tables.sink.size, gather)
    on.loop(tables.conduction.size, conduction)


def lawless(on: Evaluator, tables: Tables, change: Vector, rounding: Vector, sign: Real) -> Integer:
    """Return 1 + the component that lost entropy in a step beyond rounding, 0: none; ``sign`` is that of time.

    Where none does, neither does the sum of all.
    """
    first, found = tables.node.size + 2, on.counter(0)

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

    See `ephs.solve.equations.heats.Heats.booked`.
    """
    nodes, whole = tables.node.size, on.variable(0.0)

    def weigh(i: Integer) -> None:
        sink = tables.sink[i]
        flow = on.select(sink.rubs > 0, change[nodes + 2 + sink.maker], 0.0)
        whole.value = whole.value + on.maximum(flow, 0.0)

    on.loop(tables.sink.size, weigh)
    short, made = lost - change[nodes], whole.value
    share = on.select(on.both(made > 0.0, short > -LITTLE * made), short / on.select(made > 0.0, made, 1.0), 0.0)

    def grow(i: Integer) -> None:
        sink = tables.sink[i]
        at = nodes + 2 + sink.maker

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


def hold(on: Evaluator, tables: Tables, change: Vector, low: Vector, high: Vector) -> None:
    """Put the flows of a part of a step between those of a shorter part and those of the whole, and heats with them.

    So heat does not fall from instant to instant within a step. All are changes of (heats, heat, work, flows).
    """
    nodes = tables.node.size

    def clamped(maker: Integer) -> Real:
        at = nodes + 2 + maker
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
