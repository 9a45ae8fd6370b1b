"""Observed order of every method that takes constant steps, fitted where its error can be told."""

from collections.abc import Iterator

import numpy as np

import ephs
from benchmarks.cases import CASES, Case
from ephs.mechanics.methods.registry import METHODS

__all__ = ["fitted", "table"]

COARSE, FINE = 1e-4, 100.0
"""Errors count between the first and so many times what the reference is known to."""
MOST = 20_000
"""Steps of the longest run."""
START = {2: 1.0, 3: 2.0, 4: 8.0, 5: 8.0, 8: 16.0}
"""Order -> the first step, in steps of the case."""


def measured(case: Case, method: str) -> Iterator[tuple[float, float]]:
    """(step, error), halving the step as long as errors are above what can be told."""
    h = START[METHODS[method].order] * case.step
    floor = FINE * max(case.cross_check(), 1e-15)
    while case.time / h <= MOST:
        try:
            error = case.error(ephs.simulate(case.scene(), case.time, method=method, step=h, save_at=[case.time]))
        except ephs.SimulationError:  # steps that are too long for the method
            error = np.inf
        if error < floor:
            return
        if error < COARSE:
            yield h, error
        h *= 0.5


def fitted(points: list[tuple[float, float]]) -> float:
    """The slope of log error over log step; nan from fewer than two points."""
    if len(points) < 2:
        return float("nan")
    h, error = np.log(np.array(points)).T
    return float(np.polyfit(h, error, 1)[0])


def table() -> str:
    """The measurement as a table."""
    lines = [
        "| scene | method | nominal | observed | points | steps [s] | errors |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for case in CASES:
        for method in (m for m in METHODS.values() if m.fixed and m.scenes):
            points = list(measured(case, method.name))
            span = (
                f"{points[0][0]:.1e} … {points[-1][0]:.1e} | {points[0][1]:.0e} … {points[-1][1]:.0e}"
                if points
                else "|"
            )
            lines.append(
                f"| {case.name} | {method.name} | {method.order} | {fitted(points):.2f} | {len(points)} | {span} |"
            )
            print(lines[-1], flush=True)
    return "\n".join(lines)
