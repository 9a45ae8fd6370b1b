"""Cut joints beside dense equations: rows on links, wrenches of multipliers, rates and accelerations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.mechanics.road import cuts
from ephs.mechanics.road.cuts import Cut, Relative
from ephs.mechanics.road.records import Tree
from ephs.semantics.spaces.vectors import add, dot, scale
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Table, Vector


@final
@dataclass(frozen=True, slots=True, eq=False)
class Closures:
    """Cut joints, and what is found of them.

    Attributes
    ----------
    places
        (links + 1, …): rows of links and the ground that begin with `Place`.
    motions
        (cuts, 31): see `cuts.Relative`.
    end
        0, 1, 2, …: where the covectors of a row on its first and its second link are.
    value
        (rows, 4): minus the rows' accelerations, in the first column.
    covector
        (ends, 6).
    """

    cuts: Table[Cut]
    places: Matrix
    motions: Matrix
    end: Integers
    value: Matrix
    covector: Matrix

    def place(self, on: Evaluator) -> None:
        """Write the motions and rows of cut joints at the links' accelerations."""

        def clear(e: Integer) -> None:
            for k in range(6):
                self.covector[e, k] = 0.0

        on.loop(self.covector.rows, clear)
        cuts.rows(on, self.cuts, self.places, self.motions, self.end, self.value, self.covector)
        cuts.poses(on, self.cuts, self.places, self.motions)

    def each_row(self, on: Evaluator, body: Callable[[Cut, Integer, Integer], None]) -> None:
        """Call body(joint, row, place of its first end) for all rows."""

        def each_cut(i: Integer) -> None:
            cut = self.cuts[i]
            on.loop(cut.rows, lambda j: body(cut, cut.row + j, cut.end + 2 * j))

        on.loop(self.cuts.size, each_cut)

    def at_end(self, e: Integer) -> list[Real]:
        """The covector of a row on one of its links."""
        return [self.covector[e, k] for k in range(6)]

    def push(self, on: Evaluator, tree: Tree, multiplier: Vector) -> None:
        """Take the wrenches of multipliers off the links' loads."""

        def each_row(cut: Cut, row: Integer, end: Integer) -> None:
            for link, e in ((cut.first, end), (cut.second, end + 1)):
                on.when(link >= 0, lambda link=link, e=e: _load(tree, link, scale(-multiplier[row], self.at_end(e))))

        self.each_row(on, each_row)

    def along(self, on: Evaluator, rates: Vector, changes: Vector, first: Integer) -> None:
        """The cut joints' rates and accelerations along their degrees of freedom; ``first`` is the place of the first
        in v.
        """

        def each_cut(i: Integer) -> None:
            cut, start = self.cuts[i], i * self.motions.columns
            motion = Relative(self.cuts.integers, 0, self.motions.cells, self.motions.start + start)
            twist, change = motion.twist, motion.change

            def freedom(j: Integer) -> None:
                left = Vector(cut.reals, cut.real_start + Cut.left.offset + 6 * j, 6)
                row = [left[k] for k in range(6)]
                rates[cut.v_at - first + j], changes[cut.v_at - first + j] = dot(row, twist), dot(row, change)

            on.loop(cut.dim, freedom)

        on.loop(self.cuts.size, each_cut)


def _load(tree: Tree, link: Integer, by: list[Real]) -> None:
    state = tree.states[link]
    state.load = add(state.load, by)
