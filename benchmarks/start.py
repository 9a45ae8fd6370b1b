"""How long one waits for the first result: in a new process, of a large scene, and with nothing compiled yet."""

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ephs
from benchmarks import families
from benchmarks.process import run
from benchmarks.report import Report, table_of
from ephs.mechanics.scene.model import Scene

__all__ = ["measure", "report"]

LIMIT = 600.0
REPEATS = 5
CASES = (
    ("revolute-chain", 4),
    ("four-bar-windows", 1),
    ("revolute-chain", 200),
    ("revolute-chain", 1000),
    ("four-bar-windows", 320),
)


def measure(family: str, size: int) -> dict[str, float]:
    """Processor time in s of reading the scene, and of short simulations, which are all set-up: the system, its tables,
    the solution; the first, one of a scene that keeps nothing, the next.

    The latter two are the least of some, taken in turn, and their ratio is what keeping saves.
    """
    file = Path(families.write(family, size))
    written = time.process_time()
    scene = ephs.load(file)
    loaded = time.process_time()
    file.unlink()
    first = _simulated(scene)
    rows = [[_simulated(of) for of in (replace(scene), scene)] for _ in range(REPEATS)]
    sol = ephs.simulate(scene, 1e-3, method="rk87", rtol=1e-6, atol=1e-6)
    begin = time.process_time()
    sol.summary()
    summed = time.process_time() - begin
    fresh, again = map(min, zip(*rows, strict=True))
    return {
        "load": loaded - written, "first": first, "fresh": fresh, "next": again, "ratio": again / fresh,
        "summary": summed,
    }  # fmt: skip


def _simulated(scene: Scene) -> float:
    """Processor time in s of a short simulation."""
    start = time.process_time()
    ephs.simulate(scene, 1e-3, method="rk87", rtol=1e-6, atol=1e-6, save_at=[1e-3])
    return time.process_time() - start


def imported() -> float:
    """Seconds that ``import ephs`` adds to a new process."""
    times: list[float] = []
    for code in ("", "import ephs"):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - begin)
    return times[1] - times[0]


def report() -> Report:
    """One row a scene, with compiled functions on disk; then one with an empty cache."""
    rows: list[dict[str, Any]] = []
    for family, size in CASES:
        key = {"scene": f"{family}-{size}"}
        call = f"benchmarks.start:measure({family!r}, {size})"
        run(call, LIMIT, key)  # fills the cache
        begin = time.perf_counter()
        found = run(call, LIMIT, key)
        rows.append({**key, "cache": "filled", "process": time.perf_counter() - begin, "import": imported(), **found})
        print(rows[-1], file=sys.stderr, flush=True)
    with TemporaryDirectory() as folder:
        key = {"scene": f"{CASES[0][0]}-{CASES[0][1]}"}
        call = f"benchmarks.start:measure({CASES[0][0]!r}, {CASES[0][1]})"
        begin = time.perf_counter()
        found = run(call, LIMIT, key, {"XDG_CACHE_HOME": folder})
        rows.append({**key, "cache": "empty", "process": time.perf_counter() - begin, **found})
    columns = {"scene": ("scene", 1.0), "compiled functions": ("cache", 1.0), "whole process [s]": ("process", 1.0)}
    parts = ("import", "load", "first", "fresh", "next", "summary")
    columns |= {f"{part} [s]": (part, 1.0) for part in parts}
    columns |= {"next / fresh": ("ratio", 1.0), "": ("failure", 1.0)}
    return Report(table_of(rows, columns), rows)
