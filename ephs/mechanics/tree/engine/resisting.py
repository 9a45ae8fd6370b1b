"""The linear system (M + w D) of losses for the accelerations, where these obey constraints J, and the heat made.

The mass matrix is that of composite bodies, see Featherstone, *Rigid Body Dynamics Algorithms*, 2008, 6.2.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ephs.mechanics.road.cuts import place_of
from ephs.mechanics.road.records import LinkConstants
from ephs.mechanics.road.tree import Inertia, shift
from ephs.mechanics.tree.engine.held import among, pull
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.sweeps.acting import ON_TREE, TOTALS
from ephs.semantics.linear.dense import cholesky, copy
from ephs.semantics.linear.skyline import skyline_solve, skyline_times
from ephs.semantics.spaces import vectors
from ephs.semantics.spaces.vectors import sub
from ephs.semantics.stage import Evaluator, Integer, Real, Truth, Vector, staged
from ephs.solve.march.records import Status

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.drags import Drags

EDGES, PAIRS = 0, 1
"""Places of the numbers of losses and of pairs of links between which they act."""


@staged
def resist(
    on: Evaluator, drags: "Drags", motion: Mechanism, y: Vector, weight: Real, fresh: Integer, out: Vector
) -> Integer:
    """Complete ẏ, where losses act on rates z that are reached; return a status.

    M ṙ = forces − D z + Jᵀ λ with z = known + w ṙ, where ṙ without losses is known and obeys J.

    ``fresh``: 1 where M + w D is factorised.
    """
    n, status, z, part = motion.freedoms, on.counter(0), drags.reached, drags.part
    rate, losses, held = out.part(motion.increments, n), drags.counts[EDGES] > 0, drags.held.rows > 0
    power = motion.summed + (motion.tables.node.size + 1)

    def reach(i: Integer) -> None:
        z[i] = z[i] + weight * rate[i]

    def solve() -> None:
        def assemble() -> None:
            _begin(on, drags)
            _masses(on, drags, motion)
            _losses(on, drags, motion)
            status.value = _factorise(on, drags, weight)
            on.when(on.both(held, on.same(status.value, 0)), factorise)

        on.when(on.same(fresh, 1), lambda: None, assemble)
        on.when(on.same(status.value, 0), change)

    def factorise() -> None:
        status.value = among(on, drags)

    def change() -> None:
        def move(p: Integer) -> None:
            i, change = drags.rate[p], part[p]
            rate[i], z[i] = rate[i] - change, z[i] - weight * change
            drags.speed[p] = z[i]

        _drag(on, drags, z)
        on.when(held, lambda: pull(on, drags, motion, out))
        on.loop(n, move)
        _heat(on, drags, motion, out)

    def work(i: Integer) -> None:
        # At the rates of Y it would miss the energies of what z moves.
        out[power] = out[power] + drags.given[i] * (z[i] - y[motion.increments + i])

    on.loop(n, reach)
    on.when(losses, solve)
    on.loop(drags.given.size, work)
    on.when(on.same(status.value, 0), lambda: motion.flow(on, y, z, out))
    return status.value


def _drag(on: Evaluator, drags: "Drags", z: Vector) -> None:
    """Write (M + w D)⁻¹ D z, by rows, to the memory, and z by rows."""

    def gather(p: Integer) -> None:
        drags.speed[p] = z[drags.rate[p]]

    on.loop(z.size, gather)
    skyline_times(on, drags.drag, drags.first, drags.speed, drags.part)
    skyline_solve(on, drags.mass, drags.first, drags.part)


def walk(on: Evaluator, drags: "Drags", link: Integer, body: Callable[[Integer], None]) -> None:
    """Call body(row) for the rates that move a link, the last one first."""
    at = on.counter(on.select(link < 0, -1, drags.tip[on.select(link < 0, 0, link)]))

    def step() -> Truth:
        body(at.value)
        at.value = drags.above[at.value]
        return at.value < 0

    on.when(at.value >= 0, lambda: on.repeat(step))


def _begin(on: Evaluator, drags: "Drags") -> None:
    """Find where rows begin, and clear them."""

    def lone(i: Integer) -> None:
        drags.first[i] = drags.reach[i]

    def join(p: Integer) -> None:
        low, links = on.counter(drags.rate.size), (drags.pair[2 * p], drags.pair[2 * p + 1])

        def find(i: Integer) -> None:
            low.value = on.select(drags.first[i] < low.value, drags.first[i], low.value)

        def lower(i: Integer) -> None:
            drags.first[i] = on.select(low.value < drags.first[i], low.value, drags.first[i])

        for body in (find, lower):
            for link in links:
                walk(on, drags, link, body)

    def empty(i: Integer) -> None:
        def entry(j: Integer) -> None:
            drags.mass[i, j], drags.drag[i, j] = 0.0, 0.0

        on.loop(i + 1, entry, start=drags.first[i])

    on.loop(drags.rate.size, lone)
    on.loop(drags.counts[PAIRS], join)
    on.loop(drags.rate.size, empty)


def _factorise(on: Evaluator, drags: "Drags", weight: Real) -> Integer:
    """Factorise M + w D; return a status."""

    def row(i: Integer) -> None:
        def entry(j: Integer) -> None:
            drags.mass[i, j] = drags.mass[i, j] + weight * drags.drag[i, j]

        on.loop(i + 1, entry, start=drags.first[i])

    on.loop(drags.mass.rows, row)
    # Masses alone are definite, as the sweeps have found: what fails are numbers out of range.
    found = cholesky(on, drags.mass, drags.mass, drags.first)
    return on.select(found > 0, int(Status.UNSETTLED), 0)


@staged
def _masses(on: Evaluator, drags: "Drags", motion: Mechanism) -> None:
    """The lower triangle of the mass matrix; columns are moved to the first link's place."""
    tables, place, links = motion.tables, motion.work.places(motion.tables), motion.tables.links
    origin = place_of(on, place, 0).at

    def link_of(i: Integer) -> LinkConstants:
        return LinkConstants(
            tables.integers.cells, i * LinkConstants.integer_width, tables.reals.cells, i * LinkConstants.real_width
        )

    def each_link(i: Integer) -> None:
        link, here, body = link_of(i), place_of(on, place, i), drags.body.row(i)
        for k, x in enumerate(Inertia.of(link, here.turn).about(sub(here.at, origin)).numbers):
            body[k] = x

    def carry(i: Integer) -> None:
        parent = link_of(i).parent

        def grow() -> None:
            for k in range(10):
                drags.body[parent, k] = drags.body[parent, k] + drags.body[i, k]

        on.when(parent < links, grow)

    def column(p: Integer) -> None:
        here, axis = drags.column.row(p), drags.axes.row(drags.rate[p])
        for k, x in enumerate(shift([axis[m] for m in range(6)], origin)):
            here[k] = x

    def row(j: Integer) -> None:
        body = [drags.body[drags.owner[j], k] for k in range(10)]
        load = Inertia(body[0], body[1:4], body[4:]).momentum([drags.column[j, k] for k in range(6)])

        def entry(i: Integer) -> None:
            drags.mass[i, j] = vectors.dot([drags.column[i, k] for k in range(6)], load)

        at = on.counter(j)

        def step() -> Truth:
            entry(at.value)
            at.value = drags.above[at.value]
            return at.value < 0

        on.repeat(step)

    def armature(i: Integer) -> None:
        def grow() -> None:
            j = drags.tip[i]
            drags.mass[j, j] = drags.mass[j, j] + link_of(i).armature

        on.when(link_of(i).armature > 0.0, grow)

    n = drags.rate.size
    on.loop(links, each_link)
    on.loop(links, carry, down=True)
    on.loop(n, column)
    on.loop(n, row)
    on.loop(links, armature)


@staged
def _losses(on: Evaluator, drags: "Drags", motion: Mechanism) -> None:
    """D of all losses."""
    tables = motion.tables

    def within(c: Integer) -> None:
        edge = tables.acting[drags.edge[c]]

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                a, b = drags.row_of[edge.r_at + j], drags.row_of[edge.r_at + i]
                drags.drag[a, b] = drags.drag[a, b] + drags.resistance[c, edge.dim * i + j]

            on.loop(i + 1, entry)

        on.when(on.same(edge.kind, ON_TREE), lambda: on.loop(edge.dim, row))

    def between(p: Integer) -> None:
        size, sums, links = on.counter(0), drags.joined.row(p), (drags.pair[2 * p], drags.pair[2 * p + 1])

        def clear_sign(j: Integer) -> None:
            drags.sign[j] = 0.0

        def leave(j: Integer) -> None:
            drags.sign[j] = drags.sign[j] - 1.0

        def join(j: Integer) -> None:
            drags.sign[j] = drags.sign[j] + 1.0

        def gather(j: Integer) -> None:
            def take() -> None:
                drags.chain[size.value] = j
                size.value = size.value + 1
                for k in range(6):
                    drags.moved[j, k] = drags.sign[j] * vectors.dot(
                        [sums[6 * k + m] for m in range(6)], [drags.column[j, m] for m in range(6)]
                    )

            on.when(on.absolute(drags.sign[j]) > 0.5, take)

        def row(a: Integer) -> None:
            i = drags.chain[a]

            def entry(b: Integer) -> None:
                j = drags.chain[b]

                def grow() -> None:
                    value = vectors.dot([drags.column[i, k] for k in range(6)], [drags.moved[j, k] for k in range(6)])
                    drags.drag[i, j] = drags.drag[i, j] + drags.sign[i] * value

                on.when(j <= i, grow)

            on.loop(size.value, entry)

        for one, other in ((clear_sign, clear_sign), (leave, join), (gather, gather)):
            walk(on, drags, links[0], one)
            walk(on, drags, links[1], other)
        on.loop(size.value, row)

    on.loop(drags.counts[EDGES], within)
    on.loop(drags.counts[PAIRS], between)


@staged
def _heat(on: Evaluator, drags: "Drags", motion: Mechanism, out: Vector) -> None:
    """Add what losses make at the rates that are reached: rates of entropies, entropies, the power of friction."""
    tables, w, at = motion.tables, motion.work, motion.summed
    ns, z = tables.node.size, drags.reached
    first, power = at + (ns + TOTALS), on.variable(0.0)
    s_rate, made = out.part(at, ns), out.part(first, out.size - first)

    def move(j: Integer) -> None:
        above, rate = drags.above[j], drags.speed[j]
        before = on.select(above < 0, 0, above)
        for k in range(6):
            drags.moved[j, k] = on.select(above < 0, 0.0, drags.moved[before, k]) + drags.column[j, k] * rate

    def twist(link: Integer) -> list[Real]:
        tip = on.select(link < 0, -1, drags.tip[on.select(link < 0, 0, link)])
        return [on.select(tip < 0, 0.0, drags.moved[on.select(tip < 0, 0, tip), k]) for k in range(6)]

    def each_edge(c: Integer) -> None:
        edge, u, total = tables.acting[drags.edge[c]], on.scratch(6), on.variable(0.0)
        d = edge.dim

        def between() -> None:
            change = sub(twist(edge.second), twist(edge.first))

            def along(i: Integer) -> None:
                u[i] = vectors.dot([drags.row[c, 6 * i + k] for k in range(6)], change)

            on.loop(d, along)

        def pull(i: Integer) -> None:
            def by(j: Integer) -> None:
                total.value = total.value + u[i] * drags.resistance[c, d * i + j] * u[j]

            on.loop(d, by)

        on.when(on.same(edge.kind, ON_TREE), lambda: copy(on, z.part(edge.r_at, d), u.part(0, d)), between)
        on.loop(d, pull)
        entropy = total.value / (w.temperature[edge.heat] + tables.scal[1])
        power.value = power.value + total.value
        s_rate[edge.heat] = s_rate[edge.heat] + entropy
        made[tables.component[edge.friction].made] = entropy

    on.loop(drags.rate.size, move, down=True)
    on.loop(drags.counts[EDGES], each_edge)
    out[at + ns] = out[at + ns] + power.value
