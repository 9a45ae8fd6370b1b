"""What choosing a method costs: runs by ``auto`` beside the fastest of the methods that it chooses from."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ephs
from benchmarks.contact import MODELS, UNTIL, robots
from benchmarks.report import Report, table_of
from benchmarks.rows import HERE, RUNS
from benchmarks.touching import SCENES

METHODS = ("rk87", "rk54", "semi", "radau")
TOLERANCES = (None, 1e-4, 1e-6)
"""Values of rtol and atol; none: those that a run has unless it is given others."""
REPEATS, LONGEST = 3, 20.0
"""Timings of a run, and processor time in s of a first one from which on it is timed once."""
COLUMNS = {
    "scene": ("scene", 1.0),
    "rtol": ("rtol", 1.0),
    "auto [ms]": ("auto", 1e3),
    "by": ("by", 1.0),
    "best [ms]": ("best", 1e3),
    "best method": ("method", 1.0),
    "ratio": ("ratio", 1.0),
}


def report() -> Report:
    """Time runs that keep their ends, without audit: set-up, steps and record; the least of some."""
    rows: list[dict[str, Any]] = []
    for file, scene in robots(MODELS):
        rows += _chosen(file.stem, scene, UNTIL)
    with TemporaryDirectory() as folder:
        for made in SCENES:
            given, file = made(), Path(folder) / "scene.toml"
            file.write_text(given.scene, encoding="utf-8")
            rows += _chosen(given.name, ephs.load(file), given.until)
    for name, until in RUNS.items():
        rows += _chosen(name, ephs.load(HERE / f"{name}.toml"), until)
    return Report(table_of(rows, COLUMNS), rows)


def _chosen(name: str, scene: Any, until: float) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for rtol in TOLERANCES:
        options = {"audit": "off", "save_at": [until], **({} if rtol is None else {"rtol": rtol, "atol": rtol})}
        found = {method: _least(scene, until, {"method": method, **options}) for method in ("auto", *METHODS)}
        chosen, *alone = [(*each, method) for method, each in found.items() if each is not None]
        best = min(alone)
        rows.append({
            "scene": name, "rtol": rtol or "default", "auto": chosen[0], "by": chosen[1],
            "best": best[0], "method": best[2], "ratio": chosen[0] / best[0],
        })  # fmt: skip
    return rows


def _least(scene: Any, until: float, options: dict[str, Any]) -> tuple[float, str] | None:
    """Processor time in s of the fastest of some runs after a first one, and its methods; None of a failed run."""
    times, method = list[float](), ""
    for _ in range(1 + REPEATS):
        begin = time.process_time()
        try:
            method = str(ephs.simulate(scene, until, **options).stats["method"])
        except ephs.SimulationError:
            return None
        times.append(time.process_time() - begin)
        if times[0] > LONGEST:
            return times[0], method
    return min(times[1:]), method
