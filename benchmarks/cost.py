"""Time of the natural methods by that of the explicit ones at the same error, in the same run of this program."""

from typing import Any

import ephs
from benchmarks.cases import CASES, Case
from benchmarks.report import Report, table_of

TARGETS = (1e-4, 1e-6)
"""Errors of positions and rotations at which methods are compared."""
EXPLICIT = tuple(10.0 ** (-k / 2.0) for k in range(4, 26))
"""Tolerances of the explicit methods; the largest that meets the error counts."""
STEPS = 1000
"""Steps of a natural method; its time at another error follows by its order."""
ROUNDS = 2
COLUMNS = {
    "scene": ("scene", 1.0),
    "error": ("error", 1.0),
    "explicit [ms]": ("explicit", 1e3),
    "by": ("by", 1.0),
    "natural [s]": ("natural", 1.0),
    "times": ("natural_times", 1.0),
    "natural4 [s]": ("natural4", 1.0),
    "times ": ("natural4_times", 1.0),
}


def report() -> Report:
    """Every case by the faster of rk54 and rk87, and by both natural methods."""
    rows: list[dict[str, Any]] = []
    for error in TARGETS:
        for case in CASES:
            found = {name: _explicit(case, name, error) for name in ("rk54", "rk87")}
            fastest = min(found, key=lambda name: found[name])
            row: dict[str, Any] = {"scene": case.name, "error": error, "explicit": found[fastest], "by": fastest}
            for name, order in (("natural", 2), ("natural4", 4)):
                row[name] = _natural(case, name, order, error)
                row[f"{name}_times"] = row[name] / found[fastest]
            rows.append(row)
    return Report(table_of(rows, COLUMNS), rows)


def _explicit(case: Case, method: str, error: float) -> float:
    """Seconds of the first run with an error that is small enough."""
    scene = case.scene()
    for rtol in EXPLICIT:
        options: dict[str, Any] = {"method": method, "rtol": rtol, "atol": rtol, "save_at": [case.time], "audit": "off"}
        sols = [ephs.simulate(scene, case.time, **options) for _ in range(ROUNDS)]
        if case.error(sols[0]) <= error:
            return min(float(sol.stats["integrate_s"]) for sol in sols)
    return float("inf")


def _natural(case: Case, method: str, order: int, error: float) -> float:
    """Seconds at an error: those of a run, by the root of the ratio of the errors."""
    sol = ephs.simulate(
        case.scene(), case.time, method=method, step=case.time / STEPS, save_at=[case.time], audit="off"
    )
    return float(sol.stats["integrate_s"]) * (case.error(sol) / error) ** (1.0 / order)
