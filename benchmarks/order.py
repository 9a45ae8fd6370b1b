"""Observed order of the natural method over three halvings of the step."""

from collections.abc import Iterator

import numpy as np

import ephs
from benchmarks.cases import CASES, Case

HALVINGS = 3


def observed(case: Case) -> Iterator[tuple[float, float, float]]:
    """(step, error, observed order against the step before; nan for the first)."""
    before = np.nan
    for k in range(HALVINGS + 1):
        h = case.step / 2**k
        error = case.error(ephs.simulate(case.scene(), case.time, step=h, save_at=[case.time]))
        yield h, error, float(np.log2(before / error))
        before = error


def table() -> str:
    """The measurement as a table."""
    lines = [
        "| scene | t [s] | h [s] | error at h, h/2, h/4, h/8 | order |",
        "| --- | --- | --- | --- | --- |",
    ]
    for case in CASES:
        rows = list(observed(case))
        errors = ", ".join(f"{error:.2e}" for _, error, _ in rows)
        orders = ", ".join(f"{order:.3f}" for _, _, order in rows[1:])
        lines.append(f"| {case.name} | {case.time:g} | {case.step:g} | {errors} | {orders} |")
    return "\n".join(lines)
