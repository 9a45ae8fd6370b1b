"""Loops closed on the way inwards: constraint rows eliminated in the order of `ephs.mechanics.road.elimination`.

A row K of a constraint is a covector on a link's acceleration, so that K μ is the wrench with which the multiplier μ
pushes the link. Passing a joint takes the row's part along the joint out of it, which leaves Sᵀ K, couples it to the
other rows that are open, and moves its target.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.mechanics.road.needs import FieldLayout, LaidOut
from ephs.mechanics.road.records import JointKind, LinkConstants, LinkState, Tree
from ephs.mechanics.road.tree import freedoms_of, shift_back
from ephs.semantics.spaces.vectors import add, apply, combine, dot, scale, sub, symmetric
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth, Vector

TARGET, MULTIPLIER, SIZE, PIVOT = range(4)
"""Columns of a row's numbers."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class LoopRows:
    """The rows of all loops, the program of their elimination, and its memory.

    Attributes
    ----------
    at, slot, row, flat
        As in `ephs.mechanics.road.elimination.ClosingProgram`, row by row.
    value
        (rows, 4): target, multiplier, size before elimination, pivot.
    entry
        What couples rows.
    covector
        (slots, 6): a row on a link, of which some entries may be known to be zero.
    along
        (slots, 12): SᵀK, then D⁻¹SᵀK.
    zeros
        Entries of covectors that are known to be zero.
    """

    at: Integers
    slot: Integers
    row: Integers
    flat: Integers
    value: Matrix
    entry: Vector
    covector: Vector
    along: Matrix
    zeros: tuple[int, ...]

    def first(self, i: Integer) -> Integer:
        """First slot of link i."""
        return self.at[4 * i]

    def ended(self, i: Integer) -> Integer:
        """Slot after those that are eliminated at link i."""
        return self.at[4 * i] + self.at[4 * i + 2]

    def last(self, i: Integer) -> Integer:
        """Slot after those of link i."""
        return self.at[4 * i] + self.at[4 * i + 1]

    def _cells(self, s: Integer) -> Vector:
        layout = FieldLayout(dict.fromkeys(self.zeros, 0.0), {k: k for k in range(6) if k not in self.zeros})
        return Vector(LaidOut(layout, self.covector.cells, self.covector.start + 6 * s), 0, 6)

    def at_slot(self, s: Integer) -> list[Real]:
        """The covector of a slot."""
        cells = self._cells(s)
        return [cells[k] for k in range(6)]

    def grow(self, s: Integer, by: list[Real]) -> None:
        """Add to the covector of a slot."""
        cells = self._cells(s)
        for k in range(6):
            cells[k] = cells[k] + by[k]

    def later(self, on: Evaluator, a: Integer, body: Callable[[Integer, Integer, Integer], None]) -> None:
        """Call body(row, slot, entry) of the rows that row a is coupled to and that come after it."""
        head = self.row[4 * a]
        on.loop(
            self.row[4 * a + 1],
            lambda x: body(self.flat[head + 3 * x], self.flat[head + (3 * x + 1)], self.flat[head + (3 * x + 2)]),
        )


def _clear_entry(vector: Vector, k: Integer) -> None:
    vector[k] = 0.0


def eliminate(on: Evaluator, rows: LoopRows, i: Integer, state: LinkState | None) -> None:
    """Eliminate the rows that end at link i, into its inertia (None: the ground's) and what couples the others."""

    def each_row(s: Integer) -> None:
        a = rows.slot[2 * s]
        pivot = rows.entry[a]
        rows.value[a, PIVOT] = pivot
        inverse, k = 1.0 / pivot, rows.at_slot(s)
        if state is not None:
            _stiffen(state, k, inverse)
        head, count, pair = rows.row[4 * a], rows.row[4 * a + 1], on.counter(rows.row[4 * a + 2])

        def couple(x: Integer) -> None:
            factor = rows.entry[rows.flat[head + (3 * x + 2)]] * inverse
            rows.grow(rows.flat[head + (3 * x + 1)], scale(-factor, k))

            def among(y: Integer) -> None:
                place = rows.flat[pair.value]
                rows.entry[place] = rows.entry[place] - factor * rows.entry[rows.flat[head + (3 * y + 2)]]
                pair.value = pair.value + 1

            on.loop(count, among, start=x)

        on.loop(count, couple)

    on.loop(rows.ended(i), each_row, start=rows.first(i))


def _stiffen(state: LinkState, k: list[Real], inverse: Real) -> None:
    """Add K Kᵀ/pivot to a link's inertia."""
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    state.angular = [x + k[i] * k[j] * inverse for x, (i, j) in zip(state.angular, pairs, strict=True)]
    state.linear = [x + k[3 + i] * k[3 + j] * inverse for x, (i, j) in zip(state.linear, pairs, strict=True)]
    state.mixed = [[x + k[i] * k[3 + j] * inverse for j, x in enumerate(row)] for i, row in enumerate(state.mixed)]


def eliminate_load(on: Evaluator, rows: LoopRows, i: Integer, state: LinkState | None) -> None:
    """The same for the targets and the load of link i."""

    def each_row(s: Integer) -> None:
        a = rows.slot[2 * s]
        pushed = rows.value[a, TARGET] / rows.value[a, PIVOT]
        if state is not None:
            state.load = sub(state.load, scale(pushed, rows.at_slot(s)))

        def lower(other: Integer, slot: Integer, entry: Integer) -> None:
            rows.value[other, TARGET] = rows.value[other, TARGET] - rows.entry[entry] * pushed

        rows.later(on, a, lower)

    on.loop(rows.ended(i), each_row, start=rows.first(i))


def _through(joint: JointKind, rows: LoopRows, s: Integer, at: int) -> list[Real]:
    return [rows.along[s, at + j] for j in range(joint.dim)]


def carry(on: Evaluator, tree: Tree, rows: LoopRows, i: Integer) -> None:
    """Take the open rows of link i through its joint, to its parent; ``along`` keeps SᵀK and D⁻¹SᵀK."""

    def through(joint: JointKind, link: LinkConstants) -> None:
        state = tree.states[i]
        pair = on.counter(rows.at[4 * i + 3])
        first, last = rows.ended(i), rows.last(i)
        free = joint.dim and not joint.driven
        axes = freedoms_of(joint, link, state) if free else []

        def each_row(s: Integer) -> None:
            a, k = rows.slot[2 * s], rows.at_slot(s)
            if free:
                part = [dot(axis, k) for axis in axes]
                inverse = symmetric(state.inverse[: joint.dim * (joint.dim + 1) // 2])
                for j, (x, y) in enumerate(zip(part, apply(inverse, part), strict=True)):
                    rows.along[s, j], rows.along[s, 6 + j] = x, y
                rows.value[a, SIZE] = rows.value[a, SIZE] + dot(part, _through(joint, rows, s, 6))

                def couple(y: Integer) -> None:
                    place = rows.flat[pair.value]
                    rows.entry[place] = rows.entry[place] + dot(part, _through(joint, rows, y, 6))
                    pair.value = pair.value + 1

                on.loop(s + 1, couple, start=first)
                units = tree.units(joint)
                rest = sub(k, combine(state.gain[: joint.dim], part))
                k = [0.0 if x in units else value for x, value in enumerate(rest)]
            rows.grow(rows.slot[2 * s + 1], shift_back(k, state.down))

        on.loop(last, each_row, start=first)

    tree.visit(on, i, through)


def carry_load(on: Evaluator, tree: Tree, rows: LoopRows, i: Integer) -> None:
    """Change of the targets of the open rows by the joint of link i."""

    def through(joint: JointKind, link: LinkConstants) -> None:
        if not joint.dim or joint.driven:
            return

        def each_row(s: Integer) -> None:
            a, pushed = rows.slot[2 * s], tree.states[i].push[: joint.dim]
            rows.value[a, TARGET] = rows.value[a, TARGET] - dot(_through(joint, rows, s, 0), pushed)

        on.loop(rows.last(i), each_row, start=rows.ended(i))

    tree.visit(on, i, through)


def push(on: Evaluator, tree: Tree, rows: LoopRows, i: Integer) -> None:
    """Add what the multipliers do to link i's joint."""

    def through(joint: JointKind, link: LinkConstants) -> None:
        if not joint.dim or joint.driven:
            return

        def each_row(s: Integer) -> None:
            state = tree.states[i]
            pushed = scale(rows.value[rows.slot[2 * s], MULTIPLIER], _through(joint, rows, s, 6))
            state.push = [*add(state.push[: joint.dim], pushed), *state.push[joint.dim :]]

        on.loop(rows.last(i), each_row, start=rows.ended(i))

    tree.visit(on, i, through)


def multipliers(on: Evaluator, rows: LoopRows, i: Integer, state: LinkState | None) -> None:
    """Multipliers of the rows that were eliminated at link i, whose acceleration is known; None: of the ground."""

    def each_row(s: Integer) -> None:
        a = rows.slot[2 * s]
        value = on.variable(rows.value[a, TARGET])
        if state is not None:
            value.value = value.value - dot(rows.at_slot(s), state.change)

        def lower(other: Integer, slot: Integer, entry: Integer) -> None:
            value.value = value.value - rows.entry[entry] * rows.value[other, MULTIPLIER]

        rows.later(on, a, lower)
        rows.value[a, MULTIPLIER] = value.value / rows.value[a, PIVOT]

    on.loop(rows.ended(i), each_row, start=rows.first(i), down=True)


def dependent(on: Evaluator, rows: LoopRows, largest: Vector, limit: Real) -> Truth:
    """Whether a row, once the others are out of it, is less than ``limit`` of the largest one that it is coupled to.

    ``largest`` is memory for a number of each group of rows that are coupled.
    """
    on.loop(largest.size, lambda k: _clear_entry(largest, k))

    def measure(a: Integer) -> None:
        block = rows.row[4 * a + 3]
        largest[block] = on.maximum(largest[block], rows.value[a, SIZE])

    on.loop(rows.value.rows, measure)
    found = on.counter(0)

    def compare(a: Integer) -> None:
        sound = rows.value[a, PIVOT] > limit * largest[rows.row[4 * a + 3]]
        found.value = on.select(sound, found.value, 1)

    on.loop(rows.value.rows, compare)
    return found.value > 0
