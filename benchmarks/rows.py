"""What keeping every step costs, beside keeping the ends; and a call that takes no time of motion, again and again."""

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ephs
from benchmarks.report import Report, table_of
from benchmarks.touching import SCENES

HERE = Path(__file__).resolve().parents[1] / "scenes"
RUNS = {"slider-crank": 10.0, "four-bar": 10.0, "heavy-top": 10.0, "motor-four-bar": 4.0, "hot-brake": 4.0}
"""Scene -> end of the run in s."""
REPEATS = 5
MOMENT = 1e-6
"""Motion in s of a call that is all start."""
COLUMNS = {
    "scene": ("scene", 1.0),
    "instants": ("instants", 1.0),
    "all of them [ms]": ("all", 1e3),
    "the ends [ms]": ("ends", 1e3),
    "ratio": ("ratio", 1.0),
    "a call for 1e-6 s [ms]": ("start", 1e3),
}


def report() -> Report:
    """Time whole calls of `simulate` by ``auto`` at rtol 1e-8, audit included, in turn: the least of some."""
    rows: list[dict[str, Any]] = []
    for name, until in RUNS.items():
        scene = ephs.load(HERE / f"{name}.toml")
        rows.append({"scene": name, **_measured(scene, until)})
    with TemporaryDirectory() as folder:
        for made in SCENES:
            given, file = made(), Path(folder) / "scene.toml"
            file.write_text(given.scene, encoding="utf-8")
            rows.append({"scene": given.name, "start": _started(ephs.load(file))})
    return Report(table_of(rows, COLUMNS), rows)


def _measured(scene: Any, until: float) -> dict[str, Any]:
    whole, solution = _least(lambda: ephs.simulate(scene, until, rtol=1e-8))
    ends, _ = _least(lambda: ephs.simulate(scene, until, rtol=1e-8, save_at=[0.0, until]))
    return {"instants": len(solution), "all": whole, "ends": ends, "ratio": whole / ends, "start": _started(scene)}


def _started(scene: Any) -> float:
    return _least(lambda: ephs.simulate(scene, MOMENT, audit="off"))[0]


def _least(run: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time in s of the fastest of some runs after a first one, and the last result."""
    found, times = run(), list[float]()
    for _ in range(REPEATS):
        begin = time.process_time()
        found = run()
        times.append(time.process_time() - begin)
    return min(times), found
