"""Edges whose frames are so near to each other that their components act.

Tests are of numbers that components do not see: whether a plane is between two shapes, up to a margin beyond rounding.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

from ephs.mechanics.road.cuts import Relative, place_of
from ephs.mechanics.road.needs import NO_INTEGERS
from ephs.mechanics.tree.sweeps.acting import ABOVE, ALONG, APART, BEYOND, Acting, Tables, Work
from ephs.mechanics.tree.sweeps.grouping import Group
from ephs.semantics.spaces.vectors import Rows, add, apply, apply_transposed, dot, product, sub, transposed
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Truth, Variable

PARALLEL: Final = 1e-12
"""Square of a sine that keeps the nearest points of parallel segments finite."""


@final
@dataclass(frozen=True, slots=True)
class Near:
    """Tests of one evaluation, which meets the edges of a group one after the other.

    Attributes
    ----------
    tables, places, located
        Of the mechanism; its links in the world, and memory for the points of groups there.
    first, second, pair
        Links of the last edge that was tested, and the second one in the first.
    """

    on: Evaluator
    tables: Tables
    places: Matrix
    located: Matrix
    first: Variable[Integer]
    second: Variable[Integer]
    pair: Relative

    @staticmethod
    def of(on: Evaluator, tables: Tables, work: Work) -> "Near":
        """Return tests that have met no edge."""
        pair = Relative(NO_INTEGERS, 0, on.scratch(Relative.real_width).cells, 0)
        return Near(on, tables, work.places(tables), work.located, on.counter(-2), on.counter(-2), pair)

    def each(self, body: Callable[[Acting, Integer], None]) -> None:
        """Call body(edge, number) of the edges, but those whose frames are so far apart that nothing acts."""
        on, tables = self.on, self.tables

        def each_group(g: Integer) -> None:
            group, near = tables.group[g], on.counter(1)

            def look() -> None:
                near.value = on.select(self._far(group), 0, 1)

            def edge(i: Integer) -> None:
                self._alone(tables.acting[i], lambda edge: body(edge, i))

            on.when(group.support > 0, look)
            on.when(on.same(near.value, 1), lambda: on.loop(group.end, edge, start=group.start))

        on.loop(tables.middle.size, self._place)
        on.loop(tables.group.size, each_group)

    def _place(self, k: Integer) -> None:
        middle = self.tables.middle[k]
        link = place_of(self.on, self.places, middle.link)
        for i, x in enumerate([*add(apply(link.turn, middle.at), link.at), *apply(link.turn, middle.axis)]):
            self.located[k, i] = x

    def _far(self, group: Group) -> Truth:
        """Whether the points of a group are so far from each other that none of its edges acts."""
        on, one, two = self.on, self.located.row(group.one), self.located.row(group.two)
        way = [two[k] - one[k] for k in range(3)]
        above = on.both(on.same(group.support, ABOVE), dot([one[3 + k] for k in range(3)], way) > group.spread)
        beyond = on.both(on.same(group.support, BEYOND), dot(way, way) > group.spread * group.spread)
        return on.either(above, beyond)

    def _alone(self, edge: Acting, body: Callable[[Acting], None]) -> None:
        on, near = self.on, self.on.counter(1)

        def near_edge() -> None:
            self._meet(edge)
            inner, pair = edge.inner_turn, self.pair
            way = sub(add(apply(pair.turn, edge.outer_at), pair.at), edge.inner_at)
            above = on.both(on.same(edge.support, ABOVE), dot(transposed(inner)[2], way) > edge.reach)
            beyond = on.both(edge.support >= BEYOND, dot(way, way) > edge.reach * edge.reach)
            near.value = on.select(on.either(above, beyond), 0, 1)

            def boxes() -> None:
                turn = product(transposed(inner), product(pair.turn, edge.outer_turn))
                near.value = on.select(self._apart(edge, turn, apply_transposed(inner, way)), 0, 1)

            def segments() -> None:
                axis = apply_transposed(inner, apply(pair.turn, transposed(edge.outer_turn)[2]))
                found = segments_apart(
                    on, axis, apply_transposed(inner, way), (edge.halves[2], edge.halves[5]), edge.margin, edge.parallel
                )
                near.value = on.select(found, 0, 1)

            for kind, test in ((APART, boxes), (ALONG, segments)):
                on.when(on.both(on.same(edge.support, kind), on.same(near.value, 1)), test)

        on.when(edge.support > 0, near_edge)
        on.when(on.same(near.value, 1), lambda: body(edge))

    def _meet(self, edge: Acting) -> None:
        """Evaluate the pose between the links of an edge, where those of the edge before are others."""
        on, pair = self.on, self.pair

        def meet() -> None:
            one, other = place_of(on, self.places, edge.first), place_of(on, self.places, edge.second)
            self.first.value, self.second.value = edge.first, edge.second
            pair.turn = product(transposed(one.turn), other.turn)
            pair.at = apply_transposed(one.turn, sub(other.at, one.at))

        known = on.both(on.same(self.first.value, edge.first), on.same(self.second.value, edge.second))
        on.when(on.negate(known), meet)

    def _apart(self, edge: Acting, turn: Rows, at: list[Real]) -> Truth:
        """Whether a plane along faces of either box about the frames of an edge is between them, at more than a margin.

        ``turn`` and ``at`` are the second frame in the first.
        """
        on = self.on
        found: Truth = False
        one, other = ([edge.halves[3 * k + i] for i in range(3)] for k in (0, 1))
        for rows, places, here, there in (
            (turn, at, one, other), (transposed(turn), apply_transposed(turn, at), other, one)
        ):  # fmt: skip
            for row, place, half in zip(rows, places, here, strict=True):
                spread = dot([on.absolute(x) for x in row], there)
                found = on.either(found, on.absolute(place) > half + spread + edge.margin)
        return found


def segments_apart(
    on: Evaluator, axis: list[Real], at: list[Real], halves: tuple[Real, Real], margin: Real, parallel: Real
) -> Truth:
    """Whether a plane is between two segments, at more than a margin, or they are parallel.

    The plane is across the line of their nearest points. These are approximate: whatever plane is between them will do.

    Parameters
    ----------
    axis, at
        Direction and middle of the second segment, in m; the first one is along z about the origin.
    halves
        Half lengths in m.
    parallel
        Square of the sine of the angle between them below which they count as parallel.
    """
    (x, y, z), (one, other) = axis, halves
    along, square = dot(at, axis), x * x + y * y
    near = _clamped(on, (at[2] - z * along) / (square + PARALLEL), one)
    far = _clamped(on, near * z - along, other)
    near = _clamped(on, at[2] + far * z, one)
    way = [at[0] + far * x, at[1] + far * y, at[2] + far * z - near]
    between = dot(way, at) - on.absolute(dot(way, axis)) * other - on.absolute(way[2]) * one
    clear = between * on.absolute(between) > margin * margin * dot(way, way)
    return on.either(clear, square < parallel)


def _clamped(on: Evaluator, x: Real, most: Real) -> Real:
    """x between −most and most."""
    return on.minimum(on.maximum(x, -most), most)
