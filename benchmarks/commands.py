"""Processor time of the commands of every day, each in a new process with kernels on disk."""

import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.process import with_bytecode
from benchmarks.report import Report, table_of

__all__ = ["report"]

SCENE = "scenes/slider-crank.toml"
TIMES = 2
"""Runs of each command, of which the quickest counts; one before fills the caches."""


def spent(words: Sequence[str]) -> float:
    """Processor time in s, of all threads, of ``python`` with these words."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL, env=with_bytecode())
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def report() -> Report:
    """One row a command; the ratio is to a process that imports NumPy and SciPy's linear algebra."""
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder:
        out = str(Path(folder, "out"))
        commands = {
            "run": ["run", SCENE, "--until", "5", "--replace", "-o", out],
            "run --no-report": ["run", SCENE, "--until", "5", "--no-report", "--replace", "-o", f"{folder}/bare"],
            "check": ["check", SCENE],
            "info": ["info", SCENE],
            "reduce": ["reduce", "scenes/four-bar.toml"],
            "draw": ["draw", SCENE, "-o", str(Path(folder, "a.svg"))],
            "draw --opened": ["draw", SCENE, "--opened", "-o", str(Path(folder, "b.svg"))],
            "animate": ["animate", out, "-o", str(Path(folder, "a.html"))],
            "plot": ["plot", out, "joints.bearing.rate"],
        }
        bare = ["-c", "import scipy.linalg"]
        calls = {name: ["-m", "ephs", *words] for name, words in commands.items()}
        times: dict[str, list[float]] = {name: [] for name in (*calls, "")}
        for turn in range(TIMES + 1):
            for name, words in (("", bare), *calls.items()):
                found = spent(words)
                if turn:
                    times[name].append(found)
        least = min(times.pop(""))
        rows = [{"command": f"ephs {name}", "s": min(each), "ratio": min(each) / least} for name, each in times.items()]
    columns = {"command": ("command", 1.0), "processor time, s": ("s", 1.0), "times an import of SciPy": ("ratio", 1.0)}
    return Report(table_of(rows, columns), rows)
