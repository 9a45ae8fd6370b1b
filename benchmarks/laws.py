"""Both laws by every method: the largest defect of the balance of energy, and the least entropy made in a step.

Steps are coarse, so that a law that a method does not keep is seen to be missed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import ephs
from benchmarks.report import Report, table_of

__all__ = ["CELLS", "METHODS", "Cell", "measure", "report"]

SCENES = Path(__file__).resolve().parents[1] / "scenes"
BOTH = {"keep": "energy and momenta"}


@final
@dataclass(frozen=True, slots=True)
class Cell:
    """A kind of system: in words, its scene, end of the run and constant steps in s, tolerance of chosen steps."""

    words: str
    scene: str
    until: float
    step: float
    tolerance: float = 1e-5


@final
@dataclass(frozen=True, slots=True)
class Asked:
    """A method as it is asked for."""

    method: str
    chosen: bool = False
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])


CELLS = (
    Cell("tree", "chain", 1.0, 0.01),
    Cell("loops", "bricard", 0.4, 0.01),
    Cell("drive", "slider-crank", 0.4, 0.01),
    Cell("heat", "hot-brake", 0.4, 0.01),
    Cell("circuit", "motor-four-bar", 0.05, 5e-4),
)
METHODS = {
    "natural": Asked("natural"),
    "natural4": Asked("natural4"),
    **{name: Asked(name, chosen=True) for name in ("auto", "rk54", "rk87", "radau", "ida")},
    **{name: Asked(name) for name in ("gauss4", "gauss6", "gauss8")},
    "alpha": Asked("alpha"),
    "alpha, corrected": Asked("alpha", options=BOTH),
    "variational": Asked("variational"),
    "variational, corrected": Asked("variational", options=BOTH),
}


def measure(cell: Cell, asked: Asked) -> dict[str, Any]:
    """Largest defect relative to the gross energies, least entropy made in J/K, and what made it fail."""
    scene = ephs.load(SCENES / f"{cell.scene}.toml")
    pace = {"rtol": cell.tolerance, "atol": cell.tolerance} if asked.chosen else {"step": cell.step}
    row: dict[str, Any] = {"cell": cell.words, "defect": None, "least": None, "failed": ""}
    try:
        sol = ephs.simulate(scene, cell.until, method=asked.method, options=asked.options, audit="off", **pace)
    except ephs.SimulationError as error:
        return row | {"failed": error.outcome.value}
    plain = sol.stats.get("plain_defect", {}).get("largest")
    return row | {
        "defect": float(sol.energy_error.max()), "least": float(sol.stats["least_production"]),
        "plain": None if plain is None else plain / sol.ledgers.scale,
    }  # fmt: skip


def report(cells: Iterable[Cell] = CELLS, names: Iterable[str] = METHODS) -> Report:
    """A row a method: defects by kind of system, the largest without corrections, the least entropy."""
    rows: list[dict[str, Any]] = []
    cells = tuple(cells)
    for name in names:
        found = [measure(cell, METHODS[name]) for cell in cells]
        row: dict[str, Any] = {one["cell"]: one["failed"] or f"{one['defect']:.0e}" for one in found}
        plain = [one["plain"] for one in found if one.get("plain") is not None]
        least = [one["least"] for one in found if one["least"] is not None]
        row |= {"method": name, "plain": f"{max(plain):.0e}" if plain else "", "least": f"{min(least):.0e}"}
        rows.append(row)
    columns = {"method": ("method", 1.0), **{cell.words: (cell.words, 1.0) for cell in cells}}
    columns |= {"largest without corrections": ("plain", 1.0), "least entropy [J/K]": ("least", 1.0)}
    return Report(table_of(rows, columns), rows)
