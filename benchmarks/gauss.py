"""Gauss methods beside rk87 at equal error, on trees and on loops, in one run.

The ratio is that of seconds of integration until the end states are good to a target. Asked is no more than 10 on trees
and no more than 20 on loops.
"""

from collections.abc import Iterable
from pathlib import Path

from benchmarks.report import Report, table_of
from benchmarks.work import cell, collect

__all__ = ["report"]

TREES = ("revolute-chain-2", "revolute-chain-16", "spherical-chain-8", "heavy-top")
LOOPS = ("andrews-squeezer", "four-bar-windows-10")
OWN, OTHERS = ("gauss8", "gauss6", "gauss4"), ("rk87",)
TARGETS = (1e-5, 1e-7, 1e-9)


def report(out: Path | None = None, cells: Iterable[str] = (*TREES, *LOOPS)) -> Report:
    """The least seconds of a Gauss method and of rk87 by scene and target; a folder keeps what was measured."""
    runs = collect(None if out is None else out / "gauss.jsonl", cells, (OWN, OTHERS), TARGETS)
    rows = [cell(name, target, runs, OTHERS) for name in cells for target in TARGETS]
    columns = {
        "scene": ("scene", 1.0), "error": ("target", 1.0), "Gauss [ms]": ("own", 1e3), "by": ("own method", 1.0),
        "rk87 [ms]": ("peer", 1e3), "ratio": ("ratio", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
