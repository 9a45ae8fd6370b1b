"""Both laws by every method: the largest defect of the balance of energy, and the least entropy made in a step.

Steps are coarse, so that a law that a method does not keep is seen to be missed.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import ephs
from benchmarks.report import Report, table_of
from ephs import Pattern, System
from ephs import library as lib
from examples import physics

__all__ = ["CELLS", "METHODS", "Cell", "measure", "report"]

SCENES = Path(__file__).resolve().parents[1] / "scenes"
BOTH, KEPT = {"keep": "energy and momenta"}, {"keep": "energy"}


@final
@dataclass(frozen=True, slots=True)
class Cell:
    """A kind of system: in words, its scene, end of the run and constant steps in s, tolerance of chosen steps.

    In place of the name of a scene a function that makes a system, and the states that it starts from.
    """

    words: str
    of: str | Callable[[], System]
    until: float
    step: float
    tolerance: float = 1e-5
    start: Mapping[str, float] = field(default_factory=dict[str, float])


@final
@dataclass(frozen=True, slots=True)
class Asked:
    """A method as it is asked for."""

    method: str
    chosen: bool = False
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])


def _circuit() -> System:
    """A capacitor and a coil: nothing takes up what a step loses."""
    pattern = Pattern.from_text("q: charge; b: flux_linkage; cap(q); coil(b); emc(q, b)")
    return pattern(cap=lib.capacitor(c=0.5), coil=lib.inductor(l=2.0), emc=lib.emc())


def _lossy() -> System:
    """The same with a resistor in a room."""
    pattern = Pattern.from_text(
        "q: charge; b: flux_linkage; s: entropy; cap(q); coil(b); emc(q, b); res(b, s); room(s)"
    )
    return pattern(
        cap=lib.capacitor(c=0.5), coil=lib.inductor(l=2.0), emc=lib.emc(), res=lib.resistor(r=0.1),
        room=lib.environment(),
    )  # fmt: skip


def _tanks() -> System:
    """Two tanks, a pipe with inertance, and a loss that is no line."""
    pattern = Pattern.from_text(
        "a: liquid; b: liquid; g: pressure_impulse; s: entropy;"
        "tank1(v=a); tank2(v=b); pipe(g); join(v1=a, v2=b, g); loss(g, s); room(s)"
    )
    one, two = (lib.tank(area=area, density=1e3) for area in (2.0, 1.0))
    loss, pipe = lib.pipe_loss(r=2e3, k=5e3), lib.inertance(i=1e5)
    return pattern(tank1=one, tank2=two, pipe=pipe, join=lib.conduit(), loss=loss, room=lib.environment())


CELLS = (
    Cell("tree", "chain", 1.0, 0.01),
    Cell("loops", "bricard", 0.4, 0.01),
    Cell("drive", "slider-crank", 0.4, 0.01),
    Cell("heat", "hot-brake", 0.4, 0.01),
    Cell("motor", "motor-four-bar", 0.05, 5e-4),
    Cell("LC", _circuit, 5.0, 0.1, start={"cap.q": 1.0}),
    Cell("RLC", _lossy, 5.0, 0.1, start={"cap.q": 1.0}),
    Cell("fluid", _tanks, 20.0, 0.25, start={"tank1.v": 3.0, "tank2.v": 0.5}),
    Cell("gases", lambda: physics.cylinder, 0.5, 0.005, start=physics.CYLINDER_START),
)
METHODS = {
    "natural": Asked("natural"),
    "natural4": Asked("natural4"),
    **{name: Asked(name, chosen=True) for name in ("auto", "rk54", "rk87", "radau", "semi")},
    "variational": Asked("variational"),
    "variational, corrected": Asked("variational", options=BOTH),
}


def measure(cell: Cell, asked: Asked) -> dict[str, Any]:
    """Largest defect relative to the gross energies, least entropy made in J/K, and what made it fail."""
    model = ephs.load(SCENES / f"{cell.of}.toml") if isinstance(cell.of, str) else cell.of()
    start = cell.start or None
    tolerances = {"rtol": cell.tolerance, "atol": cell.tolerance}
    pace: dict[str, Any] = tolerances if asked.chosen else {"step": cell.step}
    row: dict[str, Any] = {"cell": cell.words, "defect": None, "least": None, "failed": ""}
    try:
        # what has no bodies has no momenta to be kept
        options = KEPT if asked.options and not isinstance(cell.of, str) else asked.options
        sol = ephs.simulate(model, cell.until, method=asked.method, options=options, initial=start, audit="off", **pace)
    except ephs.OptionError:  # the method needs bodies
        return row | {"failed": "–"}
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
