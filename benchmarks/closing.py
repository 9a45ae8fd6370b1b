"""What independent coordinates would cost: closing the loops, which each evaluation would then begin with.

Runs keep all joint coordinates of the tree, and close loops once a step.
"""

import time
from collections.abc import Callable
from typing import Any

from benchmarks import families
from benchmarks.report import Report, table_of
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations

SIZES = (1, 4, 16)
CALLS, ROUNDS = 2000, 7
COLUMNS = {
    "four-bar windows": ("windows", 1.0),
    "joint coordinates": ("coordinates", 1.0),
    "independent": ("independent", 1.0),
    "evaluation [µs]": ("evaluation", 1e6),
    "closing [µs]": ("closing", 1e6),
    "evaluation with closing / evaluation": ("ratio", 1.0),
}


def report() -> Report:
    """Evaluations and closings of rows of four-bars, at a closed position: one pass of Newton's method each."""
    rows: list[dict[str, Any]] = []
    for count in SIZES:
        equations = ReducedEquations(problem_of_scene(families.scene("four-bar-windows", count)), 0.0)
        state = equations.start(0.0)
        y = equations.vector(state)

        def evaluate(equations: ReducedEquations = equations, state: Any = state, y: Any = y) -> None:
            equations.engine.rates(state.q, y)

        def close(equations: ReducedEquations = equations, state: Any = state) -> None:
            equations.engine.close(state.q, state.r)

        evaluation, closing = _least(evaluate), _least(close)
        sizes = {"windows": count, "coordinates": equations.n, "independent": 1}
        rows.append({**sizes, "evaluation": evaluation, "closing": closing, "ratio": 1.0 + closing / evaluation})
    return Report(table_of(rows, COLUMNS), rows)


def _least(call: Callable[[], None]) -> float:
    """The least time of a call in s."""
    found: list[float] = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        for _ in range(CALLS):
            call()
        found.append((time.perf_counter() - begin) / CALLS)
    return min(found)
