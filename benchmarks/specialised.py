"""One evaluation of a tree's accelerations by the looped program of its class, and by that program unrolled for it.

Both are timed in turn within one process, at states that change, and the median counts. Compile times are those of the
processor from the staged functions to machine code, nothing taken from a cache; the looped program serves all trees of
its class.
"""

import sys
import time
from statistics import median
from typing import Any

import numpy as np

from benchmarks import families
from benchmarks.report import Report, table_of
from ephs.mechanics.road.programs import sweeps
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.engine.links import links_of
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.stage import Program
from ephs.semantics.stage.llvm import compile_text

__all__ = ["measure", "report"]

SIZES = {"planar-chain": (4, 8, 16), "revolute-chain": (4, 8, 16), "spherical-chain": (4, 8)}
STATES, REPEATS, BLOCK = 16, 15, 4000
"""States in turn; blocks of each program; links that a block evaluates, in states times links."""


def _compiling(program: Program) -> float:
    """Seconds of the processor to make a program's object code."""
    begin = time.process_time()
    compile_text(program.text())
    return time.process_time() - begin


def measure(family: str, size: int) -> dict[str, Any]:
    """Seconds of an evaluation, and to compile, of both programs."""
    scene = families.scene(family, size)
    equations = ReducedEquations(problem_of_scene(scene), 0.0)
    found = links_of(equations.reduced).packed(equations.reduced.gravity)
    looped = sweeps(found.kind)
    state, rng = equations.start(0.0), np.random.default_rng(0)
    q = np.array([state.q] * STATES)
    r = np.array([state.r + 0.1 * rng.standard_normal(equations.n) for _ in range(STATES)])
    rounds, memory = max(1, BLOCK // (STATES * size)), np.zeros((size + 1) * looped.width)
    tables = {
        "size": found.size, "integers": found.integers, "reals": found.reals, "memory": memory,
        "gravity": found.gravity,
    }  # fmt: skip
    written = Program("unrolled", evaluations=looped.program.entries["evaluations"].given(**tables))
    calls = {
        "looped": looped.program.compiled()["evaluations"].bind(*tables.values(), q, r, np.zeros_like(r), rounds),
        "unrolled": written.compiled()["evaluations"].bind(q, r, np.zeros_like(r), rounds),
    }
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(REPEATS):
        for name, call in calls.items():
            begin = time.perf_counter()
            call()
            times[name].append((time.perf_counter() - begin) / (rounds * STATES))
    seconds = {name: median(values) for name, values in times.items()}
    compiling = {"looped_compile": _compiling(looped.program), "unrolled_compile": _compiling(written)}
    ratio = seconds["unrolled"] / seconds["looped"]
    return {"scene": f"{family}-{size}", **seconds, "ratio": ratio, **compiling}


def report() -> Report:
    """Microseconds of an evaluation, and seconds to compile, by family and size."""
    rows: list[dict[str, Any]] = []
    for family, sizes in SIZES.items():
        for size in sizes:
            rows.append(measure(family, size))
            print(rows[-1], file=sys.stderr, flush=True)
    columns = {
        "scene": ("scene", 1.0), "looped [µs]": ("looped", 1e6), "unrolled [µs]": ("unrolled", 1e6),
        "ratio": ("ratio", 1.0), "compile looped [s]": ("looped_compile", 1.0),
        "compile unrolled [s]": ("unrolled_compile", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
