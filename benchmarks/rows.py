"""What keeping every step costs, beside keeping the ends; and a call that takes no time of motion, again and again.

From one state, and from states in which the scene has not been before.
"""

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ephs
from benchmarks.contact import robots
from benchmarks.report import Report, table_of
from benchmarks.touching import SCENES

HERE = Path(__file__).resolve().parents[1] / "scenes"
RUNS = {"slider-crank": 10.0, "four-bar": 10.0, "heavy-top": 10.0, "motor-four-bar": 4.0, "hot-brake": 4.0}
"""Scene -> end of the run in s."""
REPEATS = 5
MOMENT, LATER = 1e-6, 1e-3
"""Motion in s of a call that is all start, and between its starts."""
COLUMNS = {
    "scene": ("scene", 1.0),
    "instants": ("instants", 1.0),
    "all of them [ms]": ("all", 1e3),
    "the ends [ms]": ("ends", 1e3),
    "ratio": ("ratio", 1.0),
    "a call for 1e-6 s [ms]": ("start", 1e3),
    "from another state [ms]": ("restart", 1e3),
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
            rows.append({"scene": given.name, **_started(ephs.load(file))})
    for file, scene in robots(("half_cheetah", "humanoid")):
        rows.append({"scene": file.stem, **_started(scene)})
    return Report(table_of(rows, COLUMNS), rows)


def _measured(scene: Any, until: float) -> dict[str, Any]:
    whole, solution = _least(lambda: ephs.simulate(scene, until, rtol=1e-8))
    ends, _ = _least(lambda: ephs.simulate(scene, until, rtol=1e-8, save_at=[0.0, until]))
    return {"instants": len(solution), "all": whole, "ends": ends, "ratio": whole / ends, **_started(scene)}


def _started(scene: Any) -> dict[str, float]:
    """Calls from the start, and from later states that are made beforehand, each once."""
    start, _ = _least(lambda: ephs.simulate(scene, MOMENT, audit="off"))
    times = [LATER * (k + 1) for k in range(REPEATS + 1)]
    run = ephs.simulate(scene, times[-1], save_at=times, audit="off")
    others = iter([scene.at(run, time) for time in times])
    return {"start": start, "restart": _least(lambda: ephs.simulate(next(others), MOMENT, audit="off"))[0]}


def _least(run: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time in s of the fastest of some runs after a first one, and the last result."""
    found, times = run(), list[float]()
    for _ in range(REPEATS):
        begin = time.process_time()
        found = run()
        times.append(time.process_time() - begin)
    return min(times), found
