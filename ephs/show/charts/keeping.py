"""Cells of a chart on disk: an interrupted chart resumes from them."""

import json
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, final

import numpy as np

from ephs.show.charts.outcomes import ChartOutcome
from ephs.show.charts.runs import RunSetting
from ephs.show.charts.stability import Cell


@final
class KeptCells:
    """A file with one cell per line, written when measured.

    Parameters
    ----------
    file
        Where they are.
    resume
        Whether cells that are there already count; else the file begins anew.
    """

    def __init__(self, file: Path, *, resume: bool) -> None:
        self._file = file
        self._cells: dict[tuple[str, float, str, RunSetting], Cell] = {}
        if resume and file.is_file():
            for cell in _read(file):
                self._cells[_key(cell)] = cell
        else:
            file.write_text("", encoding="utf-8")

    def get(self, family: str, value: float, method: str, setting: RunSetting) -> Cell | None:
        """A measured cell."""
        return self._cells.get((family, value, method, setting))

    def add(self, cell: Cell) -> None:
        """Write a cell down."""
        self._cells[_key(cell)] = cell
        row = {field.name: getattr(cell, field.name) for field in fields(cell)}
        row |= {"setting": [cell.setting.kind, cell.setting.value]}
        with self._file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(row) + "\n")


def _key(cell: Cell) -> tuple[str, float, str, RunSetting]:
    return cell.family, cell.value, cell.method, cell.setting


def _read(file: Path) -> Iterator[Cell]:
    """The cells of a file, without an incomplete last line."""
    for line in file.read_text(encoding="utf-8").splitlines():
        try:
            row: dict[str, Any] = json.loads(line)
        except json.JSONDecodeError:
            continue
        row |= {"setting": RunSetting(*row["setting"]), "outcome": ChartOutcome(row["outcome"])}
        found: dict[str, Any] = {key: np.nan if value is None else value for key, value in row.items()}
        yield Cell(**found)
