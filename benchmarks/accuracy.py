"""Explicit methods on the reduced form against reference states by others: error, steps, time, by tolerance."""

import numpy as np

import ephs
from benchmarks.cases import CASES, Case

__all__ = ["table"]

TOLERANCES = (1e-6, 1e-9, 1e-12)


def measure(case: Case, method: str, tolerance: float) -> tuple[float, int, float, float]:
    """(error, steps, seconds of the time loop, largest gap of a joint), the time the median of three runs."""
    runs = [
        ephs.simulate(case.scene(), case.time, method=method, rtol=tolerance, atol=tolerance, save_at=[case.time])
        for _ in range(3)
    ]
    seconds = float(np.median([run.stats["integrate_s"] for run in runs]))
    return case.error(runs[-1]), runs[-1].stats["steps"], seconds, float(runs[-1].constraint_error.max())


def table() -> str:
    """Error at the reference's time, by rk87 and rk54."""
    lines = [
        "| scene | method | tolerance | error | steps | time [s] | largest gap |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for case in CASES:
        for method in ("rk54", "rk87"):
            for tolerance in TOLERANCES if method == "rk87" else TOLERANCES[:2]:
                error, steps, seconds, gap = measure(case, method, tolerance)
                lines.append(
                    f"| {case.name} | {method} | {tolerance:.0e} | {error:.1e} | {steps} | {seconds:.3f} | {gap:.0e} |"
                )
    return "\n".join(lines)
