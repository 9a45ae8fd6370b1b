"""Work and precision of every method and of other programs on eight scenes, with the balance of energy that each keeps.

Charts and their data go into a folder; the table has the least time to an error of 1e-6, and the defect of that run.
MuJoCo and Pinocchio are measured where they are installed.
"""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

import ephs
from benchmarks.peers.measure import work_precision
from benchmarks.report import Report, table_of
from ephs.show.charts import draw_work_precision, tight_reference
from ephs.show.charts.measure import Point
from ephs.show.charts.reference import shipped_reference
from ephs.show.charts.runs import RunEnding

__all__ = ["SCENES", "report"]

HERE = Path(__file__).parent
SCENES = {
    "heavy-top": 0.5,
    "tumbling-body": 5.0,
    "revolute-chain-4": 1.0,
    "spherical-chain-2": 2.0,
    "four-bar-windows-1": 5.0,
    "andrews-squeezer": 0.01,
    "slider-crank": 1.0,
    "hot-brake": 1.0,
}
"""Scene -> end in s. The last two have friction that warms, the slider-crank a driven crank."""
TARGET = 1e-6
LIMIT = 4.0
"""Seconds of processor time of a method: one run takes at most a quarter."""


def measured(name: str, out: Path) -> list[Point]:
    """The runs on a scene; their chart goes into a folder."""
    file, until = HERE / "scenes" / f"{name}.toml", SCENES[name]
    known = HERE / "reference" / f"{name}.json"
    scene = ephs.load(file if file.is_file() else HERE.parent / "scenes" / f"{name}.toml")
    truth = shipped_reference(known, scene, until)[0] if known.is_file() else tight_reference(scene, until)
    points = work_precision(scene, until, reference=truth, repeats=3, limit=LIMIT)
    title = f"{name}, t = {until:g} s; reference to {truth.cross_check:.0e}"
    draw_work_precision(points, title, out, f"work-precision-{name}")
    return points


def rows_of(name: str, points: Sequence[Point]) -> list[dict[str, Any]]:
    """A row a method: the quickest run to the target all finer ones of which meet it too, its time and its defect."""
    rows: list[dict[str, Any]] = []
    for method in dict.fromkeys(point.method for point in points):
        own = [point for point in points if point.method == method and point.outcome is RunEnding.DONE]
        good = [
            point
            for point in own
            if all(p.error <= TARGET for p in own if p.setting.kind == point.setting.kind and _fine(p) <= _fine(point))
        ]
        best = min(good, key=lambda point: point.seconds, default=None)
        time, defect = (None, None) if best is None else (best.seconds, best.defect)
        rows.append({"scene": name, "method": method, "time": time, "defect": defect})
    return rows


def _fine(point: Point) -> float:
    return point.setting.value


def report(out: Path | None = None, names: Iterable[str] = tuple(SCENES)) -> Report:
    """A row a method: by scene its least time to the target in ms and the defect of energy there."""
    folder = Path(mkdtemp()) if out is None else out
    rows: list[dict[str, Any]] = []
    for name in names:
        rows += rows_of(name, measured(name, folder))
        print(f"{name}: {folder / f'work-precision-{name}.png'}", file=sys.stderr, flush=True)
    table: dict[str, dict[str, Any]] = {}
    for row in rows:
        time, defect = row["time"], row["defect"]
        words = "–" if time is None else f"{1e3 * time:.3g}, {'?' if np.isnan(defect) else f'{defect:.0e}'}"
        table.setdefault(row["method"], {"method": row["method"]})[row["scene"]] = words
    columns = {"method": ("method", 1.0), **{name: (name, 1.0) for name in names}}
    return Report(table_of(list(table.values()), columns), rows)
