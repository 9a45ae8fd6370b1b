"""Hard cases by every method: a run is right, refused with a message, or found wrong by its audit; none is silent."""

import json
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import final

import numpy as np

import ephs
from benchmarks.hard import CASES, Case
from benchmarks.report import Report
from ephs.mechanics.methods.registry import AUTO, METHODS, MethodEntry
from ephs.mechanics.scene.errors import SceneWarning
from ephs.show.charts.outcomes import right
from ephs.show.charts.runs import ChartRun, RunEnding, RunSetting, attempt

__all__ = ["FILE", "Cell", "Kind", "cells", "judged", "known", "methods", "report", "settings", "table"]

FILE = Path(__file__).parents[1] / "docs" / "_static" / "benchmarks" / "honesty.json"
LIMIT = 4.0
"""Processor time in s of a run."""


class Kind(StrEnum):
    """Kind of a result.

    ``RIGHT``: the error is at most what `ephs.show.charts.outcomes.right` says of the setting.
    ``REFUSED``: there is none, and a message says why.
    ``FLAGGED``: it is wrong, and the audit has a finding.
    ``SLOW``: it was stopped by the benchmark.
    ``SILENT``: it is wrong and nothing says so, or an exception came out that speaks to no user.
    """

    RIGHT = "right"
    REFUSED = "refused"
    FLAGGED = "flagged"
    SLOW = "slow"
    SILENT = "SILENT"


@final
@dataclass(frozen=True, slots=True)
class Cell:
    """One case by one method at one setting.

    Parameters
    ----------
    error
        Relative to what moves; None where there is no result.
    said
        The message, or the findings.
    """

    case: str
    method: str
    setting: str
    kind: str
    error: float | None
    said: str


def methods() -> dict[str, MethodEntry]:
    """Methods by name, ``auto`` first."""
    return {AUTO.name: AUTO, **METHODS}


def settings(case: Case, method: MethodEntry) -> Iterator[RunSetting]:
    """The settings of a case that a method takes."""
    for kind, values, takes in (("step", case.steps, method.fixed), ("tolerance", case.tolerances, method.adaptive)):
        yield from (RunSetting(kind, value) for value in values if takes)


def judged(case: Case, setting: RunSetting, run: ChartRun) -> tuple[Kind, float | None, str]:
    """Kind, error and message of a run."""
    sol = run.solution
    if sol is None:
        silent = run.ending is RunEnding.LEAKED or not run.message
        return (
            (Kind.SLOW if run.ending is RunEnding.SLOW else Kind.SILENT if silent else Kind.REFUSED),
            None,
            run.message,
        )
    with np.errstate(all="ignore"):
        error = float(np.nan_to_num(case.error(sol), nan=np.inf))
    allowed = right(setting, 1.0, int(sol.stats["steps"])) if case.exact is None else case.exact
    found = "" if sol.audit.passed else str(sol.audit)
    kind = Kind.FLAGGED if found else Kind.RIGHT if error <= allowed else Kind.SILENT
    return kind, min(error, float(np.finfo(float).max)), found


def cells(case: Case, names: Mapping[str, MethodEntry] | None = None, limit: float = LIMIT) -> list[Cell]:
    """All results of a case."""
    found: list[Cell] = []
    times = np.linspace(0.0, case.until, case.instants + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        try:
            model, refusal = case.make(), ""
        except ephs.SceneError as error:
            model, refusal = None, str(error).partition("\n")[2].strip()
    for name, method in (names or methods()).items():
        for setting in settings(case, method):
            if model is None:
                found.append(Cell(case.name, name, str(setting), Kind.REFUSED, None, refusal))
                continue
            run = attempt(
                model, case.until, name, setting, limit=limit, save_at=times, options=case.options
            )  # fmt: skip
            found.append(Cell(case.name, name, str(setting), *judged(case, setting, run)))
    return found


def report(out: Path | None = None) -> Report:
    """Run all cases by all methods; the cells are written into a folder where one is given."""
    found = [cell for case in CASES.values() for cell in cells(case)]
    rows = [asdict(cell) for cell in found]
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / FILE.name).write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    wrong = [cell for cell in found if cell.kind == Kind.SILENT]
    said = "\n".join(f"- {cell.case}, {cell.method}, {cell.setting}: {cell.error or cell.said}" for cell in wrong)
    return Report(f"{table(found)}\n\n{counts(found)}\n\nsilent: {len(wrong)}\n{said}", rows)


def known(file: Path = FILE) -> list[Cell]:
    """Cells of a file that `report` wrote."""
    return [Cell(**row) for row in json.loads(file.read_text(encoding="utf-8"))]


def table(found: list[Cell]) -> str:
    """Cells as Markdown: cases and settings by methods."""
    names, grid = list(methods()), dict[tuple[str, str], dict[str, Cell]]()
    for cell in found:
        grid.setdefault((cell.case, cell.setting), {})[cell.method] = cell
    lines = ["| case | setting | " + " | ".join(names) + " |", "| --- " * (len(names) + 2) + "|"]
    for (case, setting), row in grid.items():
        shown = [_shown(row[name]) if name in row else "–" for name in names]
        lines.append(f"| {case} | {setting} | " + " | ".join(shown) + " |")
    return "\n".join(lines)


def counts(found: list[Cell]) -> str:
    """How many results of each kind every method has, as Markdown."""
    lines = ["| method | " + " | ".join(Kind) + " |", "| --- " * (len(Kind) + 1) + "|"]
    for name in methods():
        of = [cell.kind for cell in found if cell.method == name]
        lines.append(f"| {name} | " + " | ".join(str(of.count(kind)) for kind in Kind) + " |")
    return "\n".join(lines)


def _shown(cell: Cell) -> str:
    if cell.error is None:
        return str(cell.kind)
    return f"{cell.error:.0e}" if cell.kind == Kind.RIGHT else f"{cell.kind} ({cell.error:.0e})"
