"""What it costs explicit steps to keep the balance of energy, and how well it is kept over very many of them.

The same compiled steps are taken with corrections and without, in turn, from the same state; medians of ratios count.
"""

import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import ephs
from benchmarks import families
from ephs.mechanics.methods.explicit import Explicit, tableau
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.solve.running.control import Control, Tolerance
from ephs.solve.running.stepping import Span

__all__ = ["table"]

HERE = Path(__file__).parent
SIZES = (("revolute-chain", 4), ("revolute-chain", 64), ("spherical-chain", 16), ("four-bar-windows", 10))
STEPS, REPEATS = 200, 11
MILLION = 1_000_000


def _leg(family: str, count: int, method: str) -> Any:
    """Constant steps of a millisecond, of which none are kept."""
    equations = ReducedEquations(problem_of_scene(families.scene(family, count)), 0.0)
    control = Control(Tolerance(1e-9, {}), Tolerance(1e-9, {}), 1e-3, 0.0, np.inf, None)
    span = Span(equations.start(0.0), 0.0, 10.0, 1e-3, control, None, np.zeros(0), 0)
    return Explicit(equations, control, tableau(method)).many(span)


def ratio(family: str, count: int, method: str) -> tuple[float, float]:
    """(µs a corrected step, its time relative to a plain one)."""
    leg, found, spent = _leg(family, count, method), list[float](), list[float]()
    leg.advance(1)
    begun, anchor = leg.snapshot(), leg.account[0].anchor
    begun = {name: np.array(part) for name, part in begun.items()}
    for _ in range(REPEATS):
        took: list[float] = []
        for kept in (anchor, np.nan):
            leg.restore(begun)
            leg.account[0].anchor = kept
            began = time.perf_counter()
            leg.advance(STEPS)
            took.append(time.perf_counter() - began)
        found.append(took[0] / took[1])
        spent.append(took[0] / STEPS * 1e6)
    return median(spent), median(found)


def drift(name: str, step: float, method: str) -> tuple[float, float]:
    """Errors of the balance, and what they would be without corrections, of a million steps."""
    until = MILLION * step
    kept = np.linspace(0.0, until, 401)
    scene = ephs.load(HERE / "scenes" / f"{name}.toml")
    sol = ephs.simulate(scene, until, method=method, step=step, save_at=kept, audit="off")
    plain = sol.stats["plain_defect"]["largest"] / sol.ledgers.scale
    return float(np.abs(sol.energy_error).max()), plain


def table() -> str:
    """Cost of corrections a step, then balances after a million steps."""
    lines = ["| mechanism | method | µs a step | corrected / plain |", "|---|---|---|---|"]
    for family, count in SIZES:
        for method in ("rk54", "rk87"):
            spent, found = ratio(family, count, method)
            lines.append(f"| {family} {count} | {method} | {spent:.2f} | {found:.3f} |")
    lines += ["", "| scene | method | step | balance after 10⁶ steps | without corrections |", "|---|---|---|---|---|"]
    for name, step, method in (("heavy-top", 2e-4, "rk54"), ("revolute-chain-4", 5e-3, "rk87")):
        error, plain = drift(name, step, method)
        lines.append(f"| {name} | {method} | {step:g} s | {error:.0e} | {plain:.0e} |")
    return "\n".join(lines)
