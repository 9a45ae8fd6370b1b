"""`radau` on mechanisms with three, five and seven stages: steps, errors, and times relative to three stages."""

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

import ephs
from benchmarks.report import Report, table_of
from benchmarks.touching import bouncing
from ephs.mechanics.methods import radau as implicit
from ephs.solve.methods.collocation import radau

__all__ = ["RUNS", "measure", "report"]

HERE = Path(__file__).resolve().parents[1] / "scenes"
RUNS = {
    "chain": 5.0, "heavy-top": 1.0, "hot-brake": 2.0, "biped": 1.0, "slider-crank": 1.0, "four balls, touching": 0.3,
}  # fmt: skip
"""Scene -> end of the run in s."""
BALLS = 4
TOLERANCES, FINE = (1e-4, 1e-6, 1e-8), 1e-11
STAGES = (3, 5, 7)
REPEATS = 3
COLUMNS = {
    "scene": ("scene", 1.0), "rtol": ("rtol", 1.0),
    **{f"{count} stages: steps": (f"steps {count}", 1.0) for count in STAGES},
    **{f"{count}: error": (f"error {count}", 1.0) for count in STAGES},
    **{f"{count}: time": (f"ratio {count}", 1.0) for count in STAGES[1:]},
}  # fmt: skip


def measure(scene: Any, until: float, rtol: float, stages: int) -> tuple[Any, float]:
    """A run with a number of stages, and the least processor time in s of some."""
    best, found = float("inf"), None
    options: dict[str, Any] = {"method": "radau", "rtol": rtol, "atol": 1e-2 * rtol, "audit": "off"}
    with patch.object(implicit, "scheme_of", lambda *_: radau(stages)):
        for _ in range(REPEATS):
            begun = time.process_time()
            found = ephs.simulate(scene, until, save_at=[0.0, until], **options)
            best = min(best, time.process_time() - begun)
    return found, best


def report(names: Iterable[str] = RUNS) -> Report:
    """All scenes at some tolerances; errors are the largest of bodies' positions and velocities at the end."""
    rows: list[dict[str, Any]] = []
    for name in names:
        scene, until = _scene(name), RUNS[name]
        exact = _end(scene, measure(scene, until, FINE, 7)[0])
        for rtol in TOLERANCES:
            row: dict[str, Any] = {"scene": name, "rtol": rtol}
            seconds = {}
            for count in STAGES:
                solution, seconds[count] = measure(scene, until, rtol, count)
                row[f"steps {count}"] = f"{solution.stats['steps']}+{solution.stats['rejected']}"
                row[f"error {count}"] = float(np.abs(_end(scene, solution) - exact).max())
            rows.append(row | {f"ratio {count}": taken / seconds[3] for count, taken in seconds.items()})
            sys.stderr.write(f"{rows[-1]}\n")
    return Report(table_of(rows, COLUMNS), rows)


def _scene(name: str) -> Any:
    if name in RUNS and (HERE / f"{name}.toml").exists():
        return ephs.load(HERE / f"{name}.toml")
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(bouncing(BALLS).scene, encoding="utf-8")
        return ephs.load(file)


def _end(scene: Any, solution: Any) -> Any:
    """(bodies, 9) at the end."""
    bodies = [solution.body(name) for name, _ in scene.all_bodies()]
    return np.array([np.hstack([b.position[-1], b.velocity[-1], b.angular_velocity[-1]]) for b in bodies])
