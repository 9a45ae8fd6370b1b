"""Balls on a floor that take steps of their own, beside the same balls in steps of the whole."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ephs
from benchmarks.report import Report, table_of
from benchmarks.touching import bouncing
from ephs.mechanics.runs.running import Course

COUNTS = (2, 10, 50)
TOLERANCES = (3e-4, 1e-4, 1e-5, 1e-6, 1e-8)
REPEATS = 3
COLUMNS = {
    "balls": ("balls", 1.0),
    "rtol": ("rtol", 1.0),
    "parts [ms]": ("parts", 1e3),
    "steps of all": ("steps", 1.0),
    "whole [ms]": ("whole", 1e3),
    "its steps": ("its", 1.0),
    "ratio": ("ratio", 1.0),
}


def report() -> Report:
    """Time whole calls that keep their ends, with audit: set-up, steps and record; the least of some."""
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder:
        for count in COUNTS:
            given, file = bouncing(count), Path(folder) / "scene.toml"
            file.write_text(given.scene, encoding="utf-8")
            scene = ephs.load(file)
            for rtol in TOLERANCES:
                options = {"save_at": [given.until], "rtol": rtol, "atol": 1e-2 * rtol}
                parts, steps = _least(scene, given.until, options)
                with _as_one():
                    whole, its = _least(scene, given.until, options)
                rows.append({
                    "balls": count, "rtol": rtol, "parts": parts, "steps": steps, "whole": whole, "its": its,
                    "ratio": parts / whole,
                })  # fmt: skip
    return Report(table_of(rows, COLUMNS), rows)


@contextmanager
def _as_one() -> Iterator[None]:
    """Runs of the whole, whatever is independent in it."""
    parts = Course._parts
    Course._parts = lambda *_: []
    try:
        yield
    finally:
        Course._parts = parts


def _least(scene: Any, until: float, options: dict[str, Any]) -> tuple[float, int]:
    """Processor time in s of the fastest of some runs after a first one, and their steps."""
    times, steps = list[float](), 0
    for _ in range(1 + REPEATS):
        begin = time.process_time()
        steps = int(ephs.simulate(scene, until, **options).stats["steps"])
        times.append(time.process_time() - begin)
    return min(times[1:]), steps
