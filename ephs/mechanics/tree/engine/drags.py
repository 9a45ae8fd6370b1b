"""Resistances of a mechanism's losses.

A loss pulls with −μ u on the relative twist u of two links, or on a joint's rates; so D = Σ Jᵀ μ J with the rows J of
u on the rates. All twists are about one point, the place of the first link, and along the ground's axes. Rows of M and
D are rates in an order with children first, each subtree in one piece: factors have no entries but those of M and D.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np

from ephs.mechanics.road.cuts import frame_on, place_of
from ephs.mechanics.road.pack import PackedLink
from ephs.mechanics.road.tree import shift_back, turned
from ephs.mechanics.tree.engine.held import constrain
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.resisting import EDGES, PAIRS, resist, walk
from ephs.mechanics.tree.engine.tables import copied
from ephs.mechanics.tree.sweeps.acting import ON_TREE, Acting, CompiledComponent, Tables, Work
from ephs.semantics.linear.dense import clear, copy
from ephs.semantics.spaces.vectors import dot, sub
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Truth,
    Vector,
    staged,
)
from ephs.solve.equations.sparse import Index
from ephs.solve.march.lagged import Lagged
from ephs.solve.march.records import Motion


@final
@dataclass(frozen=True, slots=True)
class Drags(Lagged):
    """Losses of one evaluation.

    Attributes
    ----------
    rate, row_of
        (n,): the rate of a row; the row of a rate.
    above, owner
        (n,): the row of the rate before that of a row in its chain, −1: none; its link.
    tip
        (links,): the row of the last rate that moves a link, −1: none.
    reach, first
        (n,): the first row of what a row's rate moves; where the row begins in M and D.
    counts
        (2,): see `EDGES`.
    edge, pair, chain
        (losses,) edges of the losses; (losses, 2) links between which they act; (n,) rows of rates that move one
        against the other.
    resistance, row
        (losses, 36): μ (d, d), and T (d, 6) with u = T (V₂ − V₁) for the links' twists V.
    joined
        (losses, 36): Σ Tᵀ μ T of a pair.
    axes, column, moved
        (n, 6): twists by units of the rates about the ground's origin; those of rows; memory.
    body
        (links, 10): mass, moment and inertia of a link and what it carries.
    mass, drag
        (n, n): M, then the factor of M + w D; D: lower triangles, see `ephs.semantics.linear.skyline`.
    speed, part, sign
        (n,): rates that are reached, by rows; memory.
    given
        (n,): given forces and wrenches as forces on the rates; (0,) where there are none.
    led
        Rates of joints with prescribed motions.
    held, bent, among, pulled
        (constraints, n), (constraints, n), (constraints, constraints), (constraints,): rows J that rates obey, along
        the order of M, the prescribed ones first; J (M + w D)⁻¹; the factor of J (M + w D)⁻¹ Jᵀ; multipliers.
    """

    scheme: Matrix
    again: Integers
    seen: Vector
    reached: Vector
    rate: Integers
    row_of: Integers
    above: Integers
    owner: Integers
    tip: Integers
    reach: Integers
    first: Integers
    counts: Annotated[Integers, 2]
    edge: Integers
    pair: Integers
    chain: Integers
    resistance: Annotated[Matrix, 36]
    row: Annotated[Matrix, 36]
    joined: Annotated[Matrix, 36]
    axes: Annotated[Matrix, 6]
    column: Annotated[Matrix, 6]
    moved: Annotated[Matrix, 6]
    body: Annotated[Matrix, 10]
    mass: Matrix
    drag: Matrix
    speed: Vector
    part: Vector
    sign: Vector
    given: Vector
    led: Integers
    held: Matrix
    bent: Matrix
    among: Matrix
    pulled: Vector

    # ---- what acts -------------------------------------------------------------------------------------------------

    def observe(self, on: Evaluator, motion: Motion, base: Vector, y: Vector, q: Vector) -> tuple[Integer, Integer]:
        assert isinstance(motion, Mechanism)
        self.counts[EDGES], self.counts[PAIRS] = 0, 0
        status, component = motion.rates(on, base, y, q, self.seen, self)

        def place() -> None:
            on.reach(motion.tables.own[0].axes, *motion.swept, self.axes)
            on.when(self.given.size > 0, lambda: _push(on, self, motion))
            on.when(on.both(lossy, self.held.rows > 0), lambda: constrain(on, self, motion, q))

        lossy = self.counts[EDGES] > 0
        on.when(on.both(on.same(status, 0), on.either(lossy, self.given.size > 0)), place)
        return status, component

    def note(self, on: Evaluator, tables: Tables, work: Work, edge: Acting, number: Integer) -> None:
        """Keep the resistance of an edge, whose M/θ₀ is in the memory of components."""
        _note(on, self, tables, work, edge, number)

    # ---- the system ------------------------------------------------------------------------------------------------

    def resist(self, on: Evaluator, motion: Motion, y: Vector, weight: Real, fresh: Truth, out: Vector) -> Integer:
        assert isinstance(motion, Mechanism)
        return resist(on, self, motion, y, weight, on.select(fresh, 1, 0), out)

    def advance(self, on: Evaluator, motion: Motion, base: Vector, y: Vector, q: Vector) -> None:
        assert isinstance(motion, Mechanism)
        motion.advance(on, base, y, q)


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
    on.when(on.same(edge.kind, ON_TREE), lambda: None, lambda: _join(on, drags, tables, work, edge, c))


def _join(on: Evaluator, drags: Drags, tables: Tables, work: Work, edge: Acting, c: Integer) -> None:
    """Write the rows of a loss between links, and add Tᵀ μ T to that of the pair."""
    places, d = work.places(tables), edge.dim
    far = place_of(on, places, edge.second)
    turn, place = frame_on(far, edge.outer_turn, edge.outer_at)
    at = sub(place, place_of(on, places, 0).at)
    begun = drags.counts[PAIRS]
    last = on.select(begun > 0, begun - 1, 0)
    same = on.both(on.same(drags.pair[2 * last], edge.first), on.same(drags.pair[2 * last + 1], edge.second))

    def row(j: Integer) -> None:
        left = Vector(edge.reals, edge.real_start + Acting.left.offset + 6 * j, 6)
        for k, x in enumerate(shift_back(turned(turn, [left[k] for k in range(6)]), at)):
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
def _push(on: Evaluator, drags: Drags, motion: Mechanism) -> None:
    """Write the given forces on the tree's joints and wrenches on bodies as forces on the rates."""
    tables = motion.tables

    def body(b: Integer) -> None:
        one = tables.body[b]

        def pushed() -> None:
            place = place_of(on, motion.work.places(tables), one.link)
            turn, at = frame_on(place, one.turn, one.at)
            there = shift_back(turned(turn, [tables.wrench[b, k] for k in range(6)]), at)

            def grow(p: Integer) -> None:
                j = drags.rate[p]
                drags.given[j] = drags.given[j] + dot([drags.axes[j, k] for k in range(6)], there)

            walk(on, drags, one.link, grow)

        on.when(one.link >= 0, pushed)

    copy(on, tables.drive.part(0, drags.given.size), drags.given)
    on.loop(tables.body.size, body)


def frictions(tables: Mapping[str, Any]) -> Index:
    """Numbers of the components of friction between two links or in a joint, edge by edge."""
    friction, resisted = (tables["acting"].column(field) for field in (Acting.friction, Acting.resisted))
    return friction[(friction >= 0) & (resisted == 0)]


def resisting(tables: Mapping[str, Any], onsager: Mapping[int, int]) -> dict[str, Any]:
    """Tables with the addresses of the programs of M/θ₀ of the components of friction, by their numbers."""
    component = copied(tables["component"])
    component.column(CompiledComponent.onsager)[list(onsager)] = list(onsager.values())
    return {**tables, "component": component}


def chains(parts: Sequence[PackedLink]) -> dict[str, Any]:
    """``rate``, ``row_of``, ``above``, ``owner``, ``tip`` and ``reach`` of a tree's links."""
    size = [part.joint.dim for part in parts]  # rates of a link and of what it carries
    for i, part in reversed(list(enumerate(parts))):
        if part.parent >= 0:
            size[part.parent] += size[i]
    n = sum(part.joint.dim for part in parts)
    rate, above, owner, reach = np.full((4, n), -1)
    tip, end = {-1: -1}, {-1: n}  # of the ground too; where rows end that are still free below a link
    for i, part in enumerate(parts):
        top, tip[i] = end[part.parent], tip[part.parent]
        end[part.parent], end[i] = top - size[i], top - part.joint.dim
        for row, j in zip(range(top - 1, end[i] - 1, -1), range(part.r_at, n), strict=False):
            rate[row], above[row], owner[row], reach[row] = j, tip[i], i, top - size[i]
            tip[i] = row
    tips = np.array([tip[i] for i in range(len(parts))])
    return {"rate": rate, "row_of": np.argsort(rate), "above": above, "owner": owner, "tip": tips, "reach": reach}


def memory_of(
    tables: Mapping[str, Any], parts: Sequence[PackedLink], size: int, rows: int, led: Sequence[int], *, pushed: bool
) -> dict[str, Any]:
    """Memory of the losses of a mechanism whose links are given, but for a scheme.

    ``size``: of its y; ``rows``: how many close loops; ``led``: rates with prescribed motions; ``pushed``: whether
    forces on joints or wrenches on bodies may be given.
    """
    whole, losses = chains(parts), len(frictions(tables))
    n, held = whole["reach"].size, len(led) + rows
    whole["led"] = np.array(led)
    whole |= {"first": whole["reach"], "counts": np.zeros(2), "chain": np.zeros(n)}
    whole |= {"edge": np.zeros(losses), "pair": np.zeros(2 * losses)}
    shapes = {
        **dict.fromkeys(("resistance", "row", "joined"), (losses, 36)),
        **dict.fromkeys(("axes", "column", "moved"), (n, 6)), **dict.fromkeys(("mass", "drag"), (n, n)),
        **dict.fromkeys(("speed", "part", "sign", "reached"), (n,)),
        "body": (len(parts), 10), "seen": (size,), "held": (held, n), "bent": (held, n), "among": (held, held),
        "pulled": (held,), "given": (n * pushed,),
    }  # fmt: skip
    return {name: array.astype(np.int64) for name, array in whole.items()} | {
        name: np.zeros(shape) for name, shape in shapes.items()
    }
