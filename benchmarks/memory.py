"""Memory of very long runs: the largest resident size of a process that takes so many steps and keeps 400 instants."""

import resource
import sys
from pathlib import Path

import numpy as np

import ephs
from benchmarks.process import run

__all__ = ["table"]

HERE = Path(__file__).parent
RUNS = {"rk54": (1e-6, (10**5, 10**6, 10**7)), "natural": (1e-3, (10**4, 10**5, 10**6))}
"""Method -> step in s, numbers of steps."""
KEPT = 400
LIMIT = 3600.0


def measure(method: str, step: float, steps: int) -> dict[str, float]:
    """Largest resident memory in MB, of it what was there before the run, and seconds."""
    scene = ephs.load(HERE / "scenes/four-bar-windows-1.toml")
    ephs.simulate(scene, 2.0 * step, method=method, step=step)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    until = steps * step
    sol = ephs.simulate(scene, until, method=method, step=step, save_at=np.linspace(0.0, until, KEPT + 1))
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"most": most, "before": before, "seconds": sol.stats["integrate_s"], "steps": sol.stats["steps"]}


def table(_: Path | None = None) -> str:
    """A line for each method and number of steps."""
    lines = [
        "| method | steps | largest memory [MB] | of it before the run [MB] | time [s] |",
        "| --- | --- | --- | --- | --- |",
    ]
    failed = dict.fromkeys(("most", "before", "seconds", "steps"), float("nan"))
    for method, (step, counts) in RUNS.items():
        for steps in counts:
            found = run(f"benchmarks.memory:measure({method!r}, {step!r}, {steps})", LIMIT, failed)
            line = f"| {method} | {steps} | {found['most']:.0f} | {found['before']:.0f} | {found['seconds']:.0f} |"
            lines.append(line + (f" {found['failure']}" if "failure" in found else ""))
            print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)
