"""The program of cut joints and charts, specialised by the groups that a mechanism has."""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Final

import numpy as np

from ephs.mechanics.road import charts, cuts
from ephs.mechanics.road.charts import Chart, GroupKind
from ephs.mechanics.road.cuts import Cut
from ephs.semantics.spaces import codes
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


def kinds_of(joints: Iterable[tuple[int, int, int]]) -> tuple[GroupKind, ...]:
    """The kinds among joints (code, size, dim), in order."""
    return tuple(sorted({GroupKind(int(code), int(size), int(dim)) for code, size, dim in joints}))


NO_REALS: Final = ArrayReals(np.zeros(0))
JOINT: Final[dict[str, Any]] = {"cut": indices(), "numbers": vector(), "motions": matrix(cuts.Relative.real_width)}
PLACED: Final[dict[str, Any]] = {
    "cut": indices(), "numbers": vector(), "places": matrix(), "motions": JOINT["motions"],
}  # fmt: skip
VALUE: Final = matrix(4)
ARGUMENTS: Final[dict[str, dict[str, Any]]] = {
    "rows": {
        **PLACED, "end": indices(), "value": VALUE, "covector": matrix(6),
    },
    "poses": PLACED,
    "fit": {**JOINT, "q": vector()},
    "gaps": {**JOINT, "q": vector(), "value": VALUE, "worst": vector(1)},
    "relative_rates": {**JOINT, "value": VALUE},
    "across": {**PLACED, "value": VALUE},
    "advance": {"chart": indices(), "base": vector(), "v": vector(), "q": vector()},
    "move": {"chart": indices(), "v": vector(), "q": vector()},
    "velocities": {"chart": indices(), **JOINT, "v": vector(), "r": vector(), "out": vector()},
}  # fmt: skip
"""Arguments of the entry functions; none returns anything."""


@cache
def loop_program(kinds: tuple[GroupKind, ...]) -> Program:
    """Return the program for joints of these kinds."""

    def joints(cut: Integers, numbers: Vector) -> Table[Cut]:
        return Table(Cut, cut.cells, numbers.cells, cut.size // Cut.integer_width)

    def charted(chart: Integers) -> Table[Chart]:
        return Table(Chart, chart.cells, NO_REALS, chart.size // Chart.integer_width)

    def fit(on: Evaluator, cut: Table[Cut], motions: Matrix, q: Vector) -> None:
        cuts.fit(on, kinds, cut, motions, q)

    def gaps(on: Evaluator, cut: Table[Cut], motions: Matrix, q: Vector, value: Matrix, worst: Vector) -> None:
        worst[0] = cuts.gaps(on, kinds, cut, motions, q, value)

    def advance(on: Evaluator, chart: Table[Chart], base: Vector, v: Vector, q: Vector) -> None:
        charts.advance(on, kinds, chart, base, v, q)

    def move(on: Evaluator, chart: Table[Chart], v: Vector, q: Vector) -> None:
        charts.advance(on, kinds, chart, q, v, q)

    def velocities(
        on: Evaluator, chart: Table[Chart], cut: Table[Cut], motions: Matrix, v: Vector, r: Vector, out: Vector
    ) -> None:
        cuts.velocities(on, kinds, chart, cut, motions, v, r, out)

    made = ((("chart",), charted), (("cut", "numbers"), joints))

    def entry(function: Callable[..., Any], arguments: dict[str, Any]) -> Entry:
        return Entry.bundled(function, arguments, *(one for one in made if arguments.keys() >= set(one[0])))

    functions: dict[str, Callable[..., Any]] = {
        "rows": cuts.rows, "poses": cuts.poses, "fit": fit, "gaps": gaps, "relative_rates": cuts.relative_rates,
        "across": cuts.across, "advance": advance, "move": move, "velocities": velocities,
    }  # fmt: skip
    name = "_".join(["loops", *(f"{kind.code}_{kind.dim}" for kind in kinds)])
    return Program(name, **{name: entry(function, ARGUMENTS[name]) for name, function in functions.items()})


def common_loops() -> Program:
    """Return the program of the most common loops: of joints that turn about an axis or slide along one."""
    return loop_program(kinds_of([(codes.VECTOR, 1, 1)]))
