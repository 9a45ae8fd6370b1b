"""Processor time of a step by the natural methods, beside that of the linear equations which one iteration solves."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.cases import CASES, Case
from benchmarks.report import Report, table_of
from ephs.mechanics.rewrite.folded import folded_problem
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.linear.sparse import sparse_lu
from ephs.solve.equations.model import Evaluation, compile_model
from ephs.solve.methods.natural import Natural

__all__ = ["report"]

STEP, STEPS, ROUNDS = 1e-3, 50, 5
COLUMNS = {
    "scene": ("scene", 1.0),
    "unknowns": ("unknowns", 1.0),
    "natural [µs]": ("natural", 1e6),
    "natural4 [µs]": ("natural4", 1e6),
    "one elimination [µs]": ("elimination", 1e6),
    "natural in eliminations": ("ratio", 1.0),
    "natural4 in eliminations": ("ratio4", 1.0),
}


def report() -> Report:
    """Every case, in its folded form."""
    rows = [_row(case) for case in CASES]
    return Report(table_of(rows, COLUMNS), rows)


def _row(case: Case) -> dict[str, Any]:
    problem = folded_problem(problem_of_scene(case.scene()))
    model = compile_model(problem.descriptor, problem.reference, problem.inputs(0.0, problem.initial))
    x, row = problem.descriptor.pack(problem.initial), dict[str, Any](scene=case.name, unknowns=model.unknowns)
    for method in (Natural(model), Natural(model, 3)):
        state, _ = method.advance(method.init(x), STEP, STEPS)  # past changes of the order of elimination
        row[method.name] = _least(lambda method=method, state=state: method.advance(state, STEP, STEPS)) / STEPS
    row["elimination"] = _least(_elimination(model, x)) / STEPS
    row["ratio"], row["ratio4"] = row["natural"] / row["elimination"], row["natural4"] / row["elimination"]
    return row


def _elimination(model: Any, x: Any) -> Callable[[], object]:
    """Factors of the natural method's matrix and one solution with them, as often as there are steps."""
    method = Natural(model)
    state, _ = method.advance(method.init(x), STEP, 1)
    method.prepare(state, STEP)
    o = method.elimination
    assert o is not None
    evaluation = Evaluation(model)
    evaluation.at(state.x, state.z[0], STEP)
    memory, factors = evaluation.memory, np.zeros(o.entry.size)
    memory.data[-model.unknowns :] = o.dropped
    pattern = (o.start, o.entry, o.diagonal)
    calls = sparse_lu().compiled()
    factorise = calls["factorise"].bind(
        o.place, *pattern, memory.data, factors, memory.dense, 0.0 * o.floor, memory.pivot
    )
    solve = calls["solve"].bind(o.rows, o.columns, *pattern, factors, memory.residual, memory.step, memory.dense)

    def run() -> None:
        for _ in range(STEPS):
            factorise()
            solve()

    return run


def _least(call: Callable[[], object]) -> float:
    best = float("inf")
    for _ in range(ROUNDS):
        begun = time.process_time()
        call()
        best = min(best, time.process_time() - begun)
    return best
