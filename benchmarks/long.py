"""Structure over long times: energy, gaps and unit quaternions after very many steps of methods that promise them."""

import sys
import time
from pathlib import Path

import numpy as np

import ephs

__all__ = ["table"]

HERE = Path(__file__).parent
MANY, MILLION, FEWER = 10_000_000, 1_000_000, 100_000
RUNS = (
    ("heavy-top", 2e-4, {"natural": MANY, "natural4": MILLION, "rk87": MILLION, "variational": FEWER}),
    ("four-bar-windows-1", 2e-3, {"natural": MILLION, "natural4": FEWER, "rk87": MILLION, "variational": FEWER}),
    ("four-body-loop", 2e-3, {"natural": MILLION, "natural4": FEWER, "variational": FEWER}),
)
"""Scene, step in s, and how many steps of which method, by what a step costs."""
KEPT = 400


def measure(name: str, step: float, method: str, steps: int) -> tuple[float, float, float, float, float]:
    """(largest energy error in the first tenth, over all, largest gap, error of unit length, seconds)."""
    scene = ephs.load(HERE / "scenes" / f"{name}.toml")
    until = steps * step
    began = time.perf_counter()
    instants = np.linspace(0.0, until, KEPT + 1)
    # after so long a motion that is sensitive to its start, the place says nothing
    sol = ephs.simulate(scene, until, method=method, step=step, save_at=instants, audit="off")
    seconds = time.perf_counter() - began
    length = max(
        float(np.abs(np.linalg.norm(sol.body(body).quaternion, axis=1) - 1.0).max()) for body, _ in scene.all_bodies()
    )
    energy = sol.energy_error
    return float(energy[: KEPT // 10].max()), float(energy.max()), float(sol.constraint_error.max()), length, seconds


def table(_: Path | None = None) -> str:
    """Relative energy errors, joints' gaps and unit length of quaternions."""
    lines = [
        "| scene | method | steps | step [s] | energy, first tenth | all | gap [m, rad] | unit length | time [s] |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, step, runs in RUNS:
        for method, steps in runs.items():
            first, all_of_it, gap, length, seconds = measure(name, step, method, steps)
            lines.append(
                f"| {name} | {method} | {steps} | {step:g} | {first:.1e} | {all_of_it:.1e} | {gap:.0e} | {length:.0e} "
                f"| {seconds:.0f} |"
            )
            print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)
