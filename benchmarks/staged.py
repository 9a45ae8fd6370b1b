"""A staged function beside LAPACK: time to compile, time to solve linear equations."""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from ephs.semantics.linear.dense import lu, lu_solve
from ephs.semantics.stage import Entry, Evaluator, Integers, Matrix, Program, Truth, Vector, indices, matrix, vector
from ephs.semantics.stage.llvm import compile_text

__all__ = ["table"]

SIZES = (6, 20, 60)
RUNS, REPEATS = 7, 200


def _solved(on: Evaluator, a: Matrix, pivots: Integers, x: Vector) -> Truth:
    good = lu(on, a, pivots)
    lu_solve(on, a, pivots, x)
    return good


def _lapack(a: Any, pivots: Any, x: Any) -> None:
    lapack: Any = import_module("scipy.linalg.lapack")
    lapack.dgesv(a, x)


def _best(call: Callable[[], object], reset: Callable[[], None]) -> float:
    best = np.inf
    for _ in range(RUNS):
        spent = 0.0
        for _ in range(REPEATS):
            reset()
            begun = time.perf_counter()
            call()
            spent += time.perf_counter() - begun
        best = min(best, spent / REPEATS)
    return best


def _compiled() -> tuple[dict[str, Any], dict[str, float]]:
    """The two ways to solve, and the processor time to compile each."""
    Program("warm", call=Entry(lambda on, x: on.sqrt(x[0]), x=vector())).compiled()  # what LLVM does once in a process
    program = Program("solved", call=Entry(_solved, a=matrix(), pivots=indices(), x=vector()))
    staged = program.compiled()["call"]  # may come from disk, so that it is compiled once more
    begun = time.process_time()
    compile_text(Program("solved", call=program.entries["call"]).text())
    spent = {"staged": time.process_time() - begun, "LAPACK": 0.0}
    return {"staged": staged, "LAPACK": _lapack}, spent


def table() -> str:
    """Dense linear equations factorised and solved: microseconds, calls from Python included."""
    ways, spent = _compiled()
    rng = np.random.default_rng(1)
    lines = [
        f"| way | compiled in [s] | {' | '.join(f'{n} unknowns [µs]' for n in SIZES)} |",
        f"| --- | --- |{' --- |' * len(SIZES)}",
    ]
    costs: dict[str, list[float]] = {name: [] for name in ways}
    for n in SIZES:
        original, right = rng.standard_normal((n, n)), rng.standard_normal(n)
        a, x, pivots = original.copy(), right.copy(), np.zeros(n, dtype=np.int64)

        def reset(a: Any = a, x: Any = x, original: Any = original, right: Any = right) -> None:
            a[:], x[:] = original, right

        for name, way in ways.items():
            call = way.bind(a, pivots, x) if name == "staged" else lambda way=way, a=a, p=pivots, x=x: way(a, p, x)
            costs[name].append(1e6 * _best(call, reset))
    for name, found in costs.items():
        lines.append(f"| {name} | {spent[name]:.2f} | {' | '.join(f'{cost:.2f}' for cost in found)} |")
    return "\n".join(lines)
