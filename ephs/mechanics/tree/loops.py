"""The program of cut joints and charts, specialised by the groups that a mechanism has."""

from collections.abc import Iterable
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.tree import cuts
from ephs.mechanics.tree.cuts import Chart, Cut, Kind
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integers,
    Matrix,
    Program,
    Table,
    Vector,
    indices,
    matrix,
    vector,
)
from ephs.semantics.stage.memory import ArrayReals

__all__ = [
    "ACROSS",
    "ADVANCE",
    "CHART",
    "ENTRIES",
    "FIT",
    "GAPS",
    "MOVE",
    "POSES",
    "RELATIVE_RATES",
    "ROWS",
    "VELOCITIES",
    "kinds_of",
    "loop_addresses",
    "loop_program",
]

ENTRIES: Final = ("rows", "poses", "fit", "gaps", "relative_rates", "across", "advance", "move", "velocities")
"""Entry functions, in the order of `loop_addresses`."""
ROWS, POSES, FIT, GAPS, RELATIVE_RATES, ACROSS, ADVANCE, MOVE, VELOCITIES = range(len(ENTRIES))
"""Their places."""
CHART: Final = 7
"""Integers of a joint's chart, written out since kernels take it."""


def kinds_of(joints: Iterable[tuple[int, int, int]]) -> tuple[Kind, ...]:
    """The kinds among joints (code, size, dim), in order."""
    return tuple(sorted({Kind(int(code), int(size), int(dim)) for code, size, dim in joints}))


NO_REALS: Final = ArrayReals(np.zeros(0))


@cache
def loop_program(kinds: tuple[Kind, ...]) -> Program:
    """Return the program for joints of these kinds."""

    def joints(cut: Integers, numbers: Vector) -> Table[Cut]:
        return Table(Cut, cut.cells, numbers.cells, cut.size // Cut.integer_width)

    def charted(chart: Integers) -> Table[Chart]:
        return Table(Chart, chart.cells, NO_REALS, chart.size // Chart.integer_width)

    def rows(
        on: Evaluator, cut: Integers, numbers: Vector, places: Matrix, motions: Matrix, end: Integers, value: Matrix,
        covector: Matrix,
    ) -> None:  # fmt: skip
        cuts.rows(on, joints(cut, numbers), places, motions, end, value, covector)

    def poses(on: Evaluator, cut: Integers, numbers: Vector, motions: Matrix) -> None:
        cuts.poses(on, joints(cut, numbers), motions)

    def fit(on: Evaluator, cut: Integers, numbers: Vector, motions: Matrix, q: Vector) -> None:
        cuts.fit(on, kinds, joints(cut, numbers), motions, q)

    def gaps(
        on: Evaluator, cut: Integers, numbers: Vector, motions: Matrix, q: Vector, value: Matrix, worst: Vector
    ) -> None:
        worst[0] = cuts.gaps(on, kinds, joints(cut, numbers), motions, q, value)

    def relative_rates(on: Evaluator, cut: Integers, numbers: Vector, motions: Matrix, value: Matrix) -> None:
        cuts.relative_rates(on, joints(cut, numbers), motions, value)

    def across(on: Evaluator, cut: Integers, numbers: Vector, motions: Matrix, change: Matrix, value: Matrix) -> None:
        cuts.across(on, joints(cut, numbers), motions, change, value)

    def advance(on: Evaluator, chart: Integers, base: Vector, v: Vector, q: Vector) -> None:
        cuts.advance(on, kinds, charted(chart), base, v, q)

    def move(on: Evaluator, chart: Integers, v: Vector, q: Vector) -> None:
        cuts.advance(on, kinds, charted(chart), q, v, q)

    def velocities(
        on: Evaluator, chart: Integers, cut: Integers, numbers: Vector, motions: Matrix, v: Vector, r: Vector,
        out: Vector,
    ) -> None:  # fmt: skip
        cuts.velocities(on, kinds, charted(chart), joints(cut, numbers), motions, v, r, out)

    joint = {"cut": indices(), "numbers": vector(), "motions": matrix(cuts.Relative.real_width)}
    value = matrix(4)
    return Program(
        "loops",
        rows=Entry(
            rows, cut=indices(), numbers=vector(), places=matrix(cuts.Place.real_width), motions=joint["motions"],
            end=indices(), value=value, covector=matrix(6),
        ),
        poses=Entry(poses, **joint),
        fit=Entry(fit, **joint, q=vector()),
        gaps=Entry(gaps, **joint, q=vector(), value=value, worst=vector(1)),
        relative_rates=Entry(relative_rates, **joint, value=value),
        across=Entry(across, **joint, change=matrix(6), value=value),
        advance=Entry(advance, chart=indices(), base=vector(), v=vector(), q=vector()),
        move=Entry(move, chart=indices(), v=vector(), q=vector()),
        velocities=Entry(velocities, chart=indices(), **joint, v=vector(), r=vector(), out=vector()),
    )  # fmt: skip


@cache
def loop_addresses(kinds: tuple[Kind, ...]) -> NDArray[np.int64]:
    """Return the addresses of the entry functions in machine code."""
    calls = loop_program(kinds).compiled()
    return np.array([calls[name].address for name in ENTRIES], dtype=np.int64)
