"""Resistances of a tree's losses, and their linear system (M + w D) for the accelerations.

A loss pulls with −μ u on the relative twist u of two links, or on a joint's rates; so D = Σ Jᵀ μ J with the rows J of
u on the rates. All twists are about one point, the place of the first link, and along the ground's axes. The mass
matrix is that of composite bodies, see Featherstone, *Rigid Body Dynamics Algorithms*, 2008, 6.2.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.sweeps.acting import ON_TREE, Acting, Tables, Work
from ephs.mechanics.tree.sweeps.cuts import place_of
from ephs.mechanics.tree.sweeps.pack import Part
from ephs.mechanics.tree.sweeps.records import Link
from ephs.semantics.bundle import Array
from ephs.semantics.linear.dense import clear, copy
from ephs.semantics.linear.skyline import skyline_cholesky, skyline_solve, skyline_times
from ephs.semantics.spaces import se3, vectors
from ephs.semantics.spaces.vectors import add, apply, cross, plus, product, scale, sub, symmetric, transposed, upper
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Table,
    Truth,
    Vector,
    indices,
    matrix,
    staged,
    vector,
)
from ephs.semantics.stage.memory import ArrayIntegers
from ephs.solve.march.lagged import Lagged
from ephs.solve.march.records import Motion, Status

EDGES, PAIRS = 0, 1
"""Places of the numbers of losses and of pairs of links between which they act."""


@final
@dataclass(frozen=True, slots=True)
class Drags(Lagged):
    """Losses of one evaluation.

    Attributes
    ----------
    order, above, owner
        (n,): rates, those of parents first; the rate before each in its chain, −1: none; its link.
    tip
        (links,): the last rate that moves a link, −1: none.
    reach, first
        (n,): the least number in the chain of a rate; where its row of M and D begins.
    counts
        (2,): see `EDGES`.
    edge, pair, chain
        (losses,) edges of the losses; (losses, 2) links between which they act; (n,) rates that move one against the
        other.
    resistance, row
        (losses, 36): μ (d, d), and T (d, 6) with u = T (V₂ − V₁) for the links' twists V.
    joined
        (losses, 36): Σ Tᵀ μ T of a pair.
    column, moved
        (n, 6): twists by units of the rates; memory.
    body
        (links, 10): mass, moment and inertia of a link and what it carries.
    mass, drag
        (n, n): M, then the factor of M + w D; D: lower triangles, see `ephs.semantics.linear.skyline`.
    part, sign
        (n,): memory.
    """

    scheme: Matrix
    again: Integers
    seen: Vector
    reached: Vector
    order: Integers
    above: Integers
    owner: Integers
    tip: Integers
    reach: Integers
    first: Integers
    counts: Integers
    edge: Integers
    pair: Integers
    chain: Integers
    resistance: Matrix
    row: Matrix
    joined: Matrix
    column: Matrix
    moved: Matrix
    body: Matrix
    mass: Matrix
    drag: Matrix
    part: Vector
    sign: Vector

    # ---- what acts -------------------------------------------------------------------------------------------------

    def observe(
        self, on: Evaluator, motion: Motion, base: Vector, y: Vector, q: Vector
    ) -> tuple[Integer, Integer]:
        assert isinstance(motion, Mechanism)
        self.counts[EDGES], self.counts[PAIRS] = 0, 0
        status, component = motion.rates(on, base, y, q, self.seen, self)

        def place() -> None:
            on.reach(motion.tables.own[0].axes, *motion.swept, q, self.column)

        on.when(on.both(on.same(status, 0), self.counts[EDGES] > 0), place)
        return status, component

    def note(self, on: Evaluator, tables: Tables, work: Work, edge: Acting, number: Integer) -> None:
        """Keep the resistance of an edge, whose M/θ₀ is in the memory of components."""
        _note(on, self, tables, work, edge, number)

    # ---- the system ------------------------------------------------------------------------------------------------

    def resist(self, on: Evaluator, motion: Motion, y: Vector, weight: Real, fresh: Truth, out: Vector) -> Integer:
        assert isinstance(motion, Mechanism)
        return _resist(on, self, motion, y, weight, on.select(fresh, 1, 0), out)


@staged
def _note(on: Evaluator, drags: Drags, tables: Tables, work: Work, edge: Acting, number: Integer) -> None:
    c, d = drags.counts[EDGES], edge.dim
    drags.counts[EDGES] = c + 1
    drags.edge[c] = number
    share = tables.scal[1] / (work.temperature[edge.heat] + tables.scal[1])

    def resistance(i: Integer) -> None:
        def entry(j: Integer) -> None:
            drags.resistance[c, i * d + j] = work.jac[i * (d + 1) + j] * share

        on.loop(d, entry)

    on.loop(d, resistance)
    on.when(on.same(edge.kind, ON_TREE), lambda: None, lambda: _join(on, drags, work, edge, c))


def _join(on: Evaluator, drags: Drags, work: Work, edge: Acting, c: Integer) -> None:
    """Write the rows of a loss between links, and add Tᵀ μ T to that of the pair."""
    far, d = place_of(on, work.place, edge.second), edge.dim
    turn = product(far.turn, edge.outer_turn)
    at = sub(add(far.at, apply(far.turn, edge.outer_at)), place_of(on, work.place, 0).at)
    begun = drags.counts[PAIRS]
    last = on.select(begun > 0, begun - 1, 0)
    same = on.both(on.same(drags.pair[2 * last], edge.first), on.same(drags.pair[2 * last + 1], edge.second))

    def row(j: Integer) -> None:
        left = Vector(edge.reals, edge.real_start + Acting.left.offset + 6 * j, 6)
        for k, x in enumerate(se3.wrench_outward(turn, at, [left[k] for k in range(6)])):
            drags.row[c, 6 * j + k] = x

    def begin() -> None:
        drags.pair[2 * begun], drags.pair[2 * begun + 1] = edge.first, edge.second
        drags.counts[PAIRS] = begun + 1
        clear(on, drags.joined.row(begun))

    on.loop(d, row)
    on.when(on.both(begun > 0, same), lambda: None, begin)
    joined = drags.joined.row(drags.counts[PAIRS] - 1)

    def grow(i: Integer) -> None:
        pull = [on.variable(0.0) for _ in range(6)]

        def by(j: Integer) -> None:
            for k, total in enumerate(pull):
                total.value = total.value + drags.resistance[c, i * d + j] * drags.row[c, 6 * j + k]

        on.loop(d, by)
        for k in range(6):
            for m, total in enumerate(pull):
                joined[6 * k + m] = joined[6 * k + m] + drags.row[c, 6 * i + k] * total.value

    on.loop(d, grow)


@staged
def _resist(
    on: Evaluator, drags: Drags, motion: Mechanism, y: Vector, weight: Real, fresh: Integer, out: Vector
) -> Integer:
    n, status, z, part = motion.freedoms, on.counter(0), drags.reached, drags.part
    rate, losses = out.part(motion.increments, n), drags.counts[EDGES] > 0

    def reach(i: Integer) -> None:
        z[i] = z[i] + weight * rate[i]

    def solve() -> None:
        def assemble() -> None:
            _begin(on, drags)
            _masses(on, drags, motion)
            _losses(on, drags, motion)
            status.value = _factorise(on, drags, weight)

        on.when(on.same(fresh, 1), lambda: None, assemble)
        on.when(on.same(status.value, 0), change)

    def change() -> None:
        def move(i: Integer) -> None:
            rate[i], z[i] = rate[i] - part[i], z[i] - weight * part[i]

        skyline_times(on, drags.drag, drags.first, z, part)
        skyline_solve(on, drags.mass, drags.first, part)
        on.loop(n, move)
        _heat(on, drags, motion, out)

    on.loop(n, reach)
    on.when(losses, solve)
    on.when(on.same(status.value, 0), lambda: motion.flow(on, y, z, out))
    return status.value


def _walk(on: Evaluator, drags: Drags, link: Integer, body: Callable[[Integer], None]) -> None:
    """Call body(rate) for the rates that move a link, the last one first."""
    at = on.counter(on.select(link < 0, -1, drags.tip[on.select(link < 0, 0, link)]))

    def step() -> Truth:
        body(at.value)
        at.value = drags.above[at.value]
        return at.value < 0

    on.when(at.value >= 0, lambda: on.repeat(step))


def _begin(on: Evaluator, drags: Drags) -> None:
    """Find where rows begin, and clear them."""

    def lone(i: Integer) -> None:
        drags.first[i] = drags.reach[i]

    def join(p: Integer) -> None:
        low, links = on.counter(drags.order.size), (drags.pair[2 * p], drags.pair[2 * p + 1])

        def find(i: Integer) -> None:
            low.value = on.select(drags.first[i] < low.value, drags.first[i], low.value)

        def lower(i: Integer) -> None:
            drags.first[i] = on.select(low.value < drags.first[i], low.value, drags.first[i])

        for body in (find, lower):
            for link in links:
                _walk(on, drags, link, body)

    def empty(i: Integer) -> None:
        def entry(j: Integer) -> None:
            drags.mass[i, j], drags.drag[i, j] = 0.0, 0.0

        on.loop(i + 1, entry, start=drags.first[i])

    on.loop(drags.order.size, lone)
    on.loop(drags.counts[PAIRS], join)
    on.loop(drags.order.size, empty)


def _factorise(on: Evaluator, drags: Drags, weight: Real) -> Integer:
    """Factorise M + w D; return a status."""

    def row(i: Integer) -> None:
        def entry(j: Integer) -> None:
            drags.mass[i, j] = drags.mass[i, j] + weight * drags.drag[i, j]

        on.loop(i + 1, entry, start=drags.first[i])

    on.loop(drags.mass.rows, row)
    return on.select(skyline_cholesky(on, drags.mass, drags.first) > 0, int(Status.STILL), 0)


@staged
def _masses(on: Evaluator, drags: Drags, motion: Mechanism) -> None:
    """The lower triangle of the mass matrix; columns are moved to the first link's place."""
    tables, place, links = motion.tables, motion.work.place, motion.tables.links
    origin = place_of(on, place, 0).at

    def link_of(i: Integer) -> Link:
        return Link(tables.integers.cells, i * Link.integer_width, tables.reals.cells, i * Link.real_width)

    def one(i: Integer) -> None:
        link, here, body = link_of(i), place_of(on, place, i), drags.body.row(i)
        for k, x in enumerate(_inertia(link, here.turn, sub(here.at, origin))):
            body[k] = x

    def carry(i: Integer) -> None:
        parent = link_of(i).parent

        def grow() -> None:
            for k in range(10):
                drags.body[parent, k] = drags.body[parent, k] + drags.body[i, k]

        on.when(parent < links, grow)

    def column(j: Integer) -> None:
        here = drags.column.row(j)
        for k, x in enumerate(cross([here[0], here[1], here[2]], origin)):
            here[3 + k] = here[3 + k] + x

    def row(j: Integer) -> None:
        load = _momentum([drags.body[drags.owner[j], k] for k in range(10)], [drags.column[j, k] for k in range(6)])

        def entry(i: Integer) -> None:
            low, high = on.select(i < j, i, j), on.select(i < j, j, i)
            drags.mass[high, low] = vectors.dot([drags.column[i, k] for k in range(6)], load)

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

    n = drags.order.size
    on.loop(links, one)
    on.loop(links, carry, down=True)
    on.loop(n, column)
    on.loop(n, lambda k: row(drags.order[k]))
    on.loop(links, armature)


def _inertia(link: Link, turn: Any, at: Any) -> list[Real]:
    """Mass, moment and inertia (upper triangle) of a link about a point, from which its frame is at ``at``."""
    moment = apply(turn, link.moment)
    inertia = product(product(turn, symmetric(link.inertia)), transposed(turn))
    out = [[moment[i] * at[j] + at[i] * (moment[j] + link.mass * at[j]) for j in range(3)] for i in range(3)]
    trace = out[0][0] + out[1][1] + out[2][2]
    moved = [[(trace if i == j else 0.0) - out[i][j] for j in range(3)] for i in range(3)]
    return [link.mass, *add(moment, scale(link.mass, at)), *upper(plus(inertia, moved))]


def _momentum(body: list[Real], twist: list[Real]) -> list[Real]:
    """(l, p) of mass, moment and inertia about a point, for a twist about it."""
    mass, moment, inertia = body[0], body[1:4], symmetric(body[4:])
    turning, moving = twist[:3], twist[3:]
    return [
        *add(apply(inertia, turning), cross(moment, moving)), *add(scale(mass, moving), cross(turning, moment))
    ]  # fmt: skip


@staged
def _losses(on: Evaluator, drags: Drags, motion: Mechanism) -> None:
    """D of all losses."""
    tables = motion.tables

    def within(c: Integer) -> None:
        edge = tables.acting[drags.edge[c]]

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                a, b = edge.r_at + i, edge.r_at + j
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
            _walk(on, drags, links[0], one)
            _walk(on, drags, links[1], other)
        on.loop(size.value, row)

    on.loop(drags.counts[EDGES], within)
    on.loop(drags.counts[PAIRS], between)


@staged
def _heat(on: Evaluator, drags: Drags, motion: Mechanism, out: Vector) -> None:
    """Add what losses make at the rates that are reached: rates of entropies, entropies, the power of friction."""
    tables, w, at = motion.tables, motion.work, motion.summed
    ns, z = tables.node.size, drags.reached
    s_rate, made, power = out.part(at, ns), out.part(at + (ns + 2), out.size - (at + ns + 2)), on.variable(0.0)

    def move(j: Integer) -> None:
        above, rate = drags.above[j], z[j]
        before = on.select(above < 0, 0, above)
        for k in range(6):
            drags.moved[j, k] = on.select(above < 0, 0.0, drags.moved[before, k]) + drags.column[j, k] * rate

    def twist(link: Integer) -> list[Real]:
        tip = on.select(link < 0, -1, drags.tip[on.select(link < 0, 0, link)])
        return [on.select(tip < 0, 0.0, drags.moved[on.select(tip < 0, 0, tip), k]) for k in range(6)]

    def one(c: Integer) -> None:
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

    on.loop(drags.order.size, lambda k: move(drags.order[k]))
    on.loop(drags.counts[EDGES], one)
    out[at + ns] = out[at + ns] + power.value


def frictions(tables: Mapping[str, Any]) -> list[int]:
    """Numbers of the components of friction, edge by edge."""
    acting: Any = tables["acting"]
    numbers = [int(acting[i].friction) for i in range(int(acting.size))]
    return [number for number in numbers if number >= 0]


def resisting(tables: Mapping[str, Any], onsager: Mapping[int, int]) -> dict[str, Any]:
    """Tables with the addresses of the programs of M/θ₀ of the components of friction, by their numbers."""
    rows: Any = tables["component"]
    component: Any = Table(rows.record, ArrayIntegers(rows.arrays[0].copy()), rows.reals, rows.size)
    for number, address in onsager.items():
        component[number].onsager = address
    return {**tables, "component": component}


def memory_of(tables: Mapping[str, Any], parts: Sequence[Part], size: int) -> dict[str, Array]:
    """Memory of the losses of a tree whose links are given, but for a scheme; ``size``: of its y."""
    n = sum(part.joint.dim for part in parts)
    above, owner, reach = np.full((3, n), -1)
    tip, order = np.full(len(parts), -1), list[int]()
    for i, part in enumerate(parts):
        last = int(tip[part.parent]) if part.parent >= 0 else -1
        for j in range(part.r_at, part.r_at + part.joint.dim):
            above[j], owner[j], last = last, i, j
            reach[j] = j if above[j] < 0 else min(j, reach[above[j]])
            order.append(j)
        tip[i] = last
    losses = len(frictions(tables))
    whole = {"order": np.array(order), "above": above, "owner": owner, "tip": tip, "reach": reach, "first": reach}
    whole |= {"counts": np.zeros(2)}
    whole |= {"edge": np.zeros(losses), "pair": np.zeros(2 * losses), "chain": np.zeros(n)}
    shapes = {
        **dict.fromkeys(("resistance", "row", "joined"), (losses, 36)), **dict.fromkeys(("column", "moved"), (n, 6)),
        **dict.fromkeys(("mass", "drag"), (n, n)), **dict.fromkeys(("part", "sign", "reached"), (n,)),
        "body": (len(parts), 10), "seen": (size,),
    }  # fmt: skip
    return {name: array.astype(np.int64) for name, array in whole.items()} | {
        name: np.zeros(shape) for name, shape in shapes.items()
    }


DRAGS: Final[dict[str, Any]] = {
    "scheme": matrix(), "again": indices(), "seen": vector(), "reached": vector(), "order": indices(),
    "above": indices(), "owner": indices(), "tip": indices(), "reach": indices(), "first": indices(),
    "counts": indices(2), "edge": indices(), "pair": indices(), "chain": indices(), "resistance": matrix(36), "row": matrix(36), "joined": matrix(36),
    "column": matrix(6), "moved": matrix(6), "body": matrix(10), "mass": matrix(), "drag": matrix(),
    "part": vector(), "sign": vector(),
}  # fmt: skip
