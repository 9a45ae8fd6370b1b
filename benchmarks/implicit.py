"""The natural methods at equal error beside SUNDIALS IDA, the nearest in kind that comes as a package.

IDA (package scikit-sundae, if it is installed) solves the same scenes in joint coordinates, by its own order and steps.
"""

from collections.abc import Iterable
from pathlib import Path

from benchmarks import ida
from benchmarks.report import Report, table_of
from benchmarks.work import cell, collect

__all__ = ["report"]

CELLS = ("spherical-chain-2", "heavy-top", "andrews-squeezer", "four-bar-windows-10")
OWN, OTHERS = ("natural4", "natural"), ("ida",)
TARGETS = (1e-3, 1e-5, 1e-7)


def report(out: Path | None = None, cells: Iterable[str] = CELLS) -> Report:
    """The least seconds of a natural method and of IDA by scene and target; a folder keeps what was measured."""
    ida.register()
    runs = collect(None if out is None else out / "implicit.jsonl", cells, (OWN, OTHERS), TARGETS)
    rows = [cell(name, target, runs, OTHERS) for name in cells for target in TARGETS]
    columns = {
        "scene": ("scene", 1.0), "error": ("target", 1.0), "natural [s]": ("own", 1.0), "by": ("own method", 1.0),
        "IDA [s]": ("peer", 1.0), "with": ("peer method", 1.0), "ratio": ("ratio", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
