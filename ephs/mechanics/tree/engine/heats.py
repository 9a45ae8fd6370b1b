"""Storages of heat: entropies of energies, and the entropy that a step made."""

from ephs.mechanics.tree.sweeps.acting import Tables, Work
from ephs.semantics.kernel_table import TEMPERATURE
from ephs.semantics.stage import Evaluator, Integer, Real, Vector
from ephs.solve.heats import PLAIN

__all__ = ["count", "entropies", "heat_rates"]


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

    def one(k: Integer) -> None:
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

    on.loop(tables.node.size, one)
    return status.value


def heat_rates(on: Evaluator, tables: Tables, work: Work, rates: Vector, made: Vector) -> None:
    """Turn rates of entropies into those of energies, and entropies made a second into flows.

    Flows are what friction makes, and what conduction carries from its first to its second end.
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
        maker, one, two = tables.component[row.component].made, theta(row.one), theta(row.two)
        drop = work.temperature[row.one] - work.temperature[row.two]
        level = on.absolute(drop) <= 0.0
        made[maker] = on.select(level, 0.0, made[maker] * one * two / on.select(level, 1.0, drop))

    on.loop(tables.node.size, node)
    on.loop(tables.sink.size, friction)
    on.loop(tables.conduction.size, conduction)


def count(on: Evaluator, tables: Tables, work: Work, before: Vector, after: Vector) -> None:
    """Put what components made in a step in place of what they passed on, in ``after`` (heats, heat, work, flows).

    Mean temperatures of the step are ΔE/Δs: so entropies change by what is made. ``before``: (heats, heat, work, made).
    """
    cold, nodes = work.temperature, tables.node.size

    def node(k: Integer) -> None:
        row = tables.node[k]

        def outside() -> None:
            cold[k] = on.select(on.same(row.component, PLAIN), 1.0, 1.0 / tables.scal[1])

        def stored() -> None:
            held = row.c1 + before[k]
            share = (after[k] - before[k]) / held
            cold[k] = _log_ratio(on, share) * row.c2 / held

        on.when(row.component < 0, outside, stored)

    def passed(maker: Integer, factor: Real) -> None:
        at = nodes + 2 + maker
        after[at] = before[at] + (after[at] - before[at]) * factor

    def friction(i: Integer) -> None:
        sink = tables.sink[i]
        on.when(sink.entropy >= 0, lambda: passed(sink.maker, cold[sink.entropy]))

    def gather(i: Integer) -> None:
        """Add what a component makes at its further places to its first."""
        sink = tables.sink[i]
        at, first = nodes + 2 + sink.maker, nodes + 2 + sink.owner

        def move() -> None:
            after[first] = after[first] + (after[at] - before[at])
            after[at] = before[at]

        on.when(on.negate(on.same(at, first)), move)

    def conduction(i: Integer) -> None:
        row = tables.conduction[i]
        passed(tables.component[row.component].made, cold[row.two] - cold[row.one])

    on.loop(nodes, node)
    on.loop(tables.sink.size, friction)
    on.loop(tables.sink.size, gather)
    on.loop(tables.conduction.size, conduction)
