"""A slider-crank whose rod grows stiffer, beside the rigid mechanism: steps, time, error and balance of each method.

The crank turns at 50 rad/s for a quarter of a turn; the rod is a steel wire with Young's modulus E in place of its own,
in four elements of order 4. The rigid slider stands at r cos φ + √(l² − r² sin² φ); what an elastic rod leaves of that
falls with 1/E, so this part is common to all methods. All runs save the same instants. A method that takes longer
than `LIMIT` is not asked for stiffer rods.
"""

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import ephs
from benchmarks.report import Report, table_of

__all__ = ["METHODS", "STIFFNESS", "measure", "report"]

RADIUS, LENGTH, SPEED = 0.15, 0.3, 50.0
UNTIL = 0.5 * np.pi / SPEED
INSTANTS = np.linspace(0.0, UNTIL, 21)
STIFFNESS = (2e9, 2e10, 2e11, 2e12, 2e13, 2e14)
"""Young's moduli in Pa; that of steel is the third."""
METHODS: dict[str, dict[str, float]] = {
    "natural": {"step": UNTIL / 200.0},
    "natural4": {"step": UNTIL / 100.0},
    "radau, constant steps": {"step": UNTIL / 100.0},
    "radau": {"rtol": 1e-4},
    "rk87": {"rtol": 1e-4},
}
LIMIT = 10.0
"""Seconds of processor time."""
SCENE = """format = 1
name = "slider-crank with an elastic rod"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.crank]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, 0.0]
angular_velocity = [0.0, {speed!r}, 0.0]
[bodies.slider]
mass = 0.1
inertia = [1e-3, 1e-3, 1e-3]
position = [{reach!r}, 0.0, 0.0]
velocity = [{start!r}, 0.0, 0.0]
[beams.rod]
from = [0.0, 0.0, {radius!r}]
to = [{reach!r}, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
elements = 4
order = 4
section = {{ circle = 0.004, E = {young!r}, nu = 0.3, rho = 7850.0 }}
velocity = [{start!r}, 0.0, 0.0]
[joints.bearing]
type = "revolute"
bodies = ["ground", "crank"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
motion = {{ rate = {speed!r} }}
[joints.pin]
type = "revolute"
bodies = ["crank", "rod.0"]
at = [0.0, 0.0, {radius!r}]
axis = [0.0, 1.0, 0.0]
[joints.wrist]
type = "revolute"
bodies = ["rod.4", "slider"]
at = [{reach!r}, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.wall]
type = "prismatic"
bodies = ["ground", "slider"]
at = [{reach!r}, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
"""
COLUMNS = {
    "method": ("method", 1.0), "E [Pa]": ("young", 1.0), "steps": ("steps", 1.0), "time [s]": ("seconds", 1.0),
    "from the rigid slider [m]": ("error", 1.0), "defect of energy": ("defect", 1.0), "refused": ("failed", 1.0),
}  # fmt: skip


def measure(young: float, name: str) -> dict[str, Any]:
    """One run of a method on a rod of Young's modulus `young` in Pa, or what made it stop."""
    options: dict[str, Any] = {"method": name.partition(",")[0], "audit": "off", **METHODS[name]}
    row: dict[str, Any] = {"method": name, "young": young, "failed": ""}
    with TemporaryDirectory() as folder:
        file = Path(folder, "crank.toml")
        text = SCENE.format(
            reach=float(np.sqrt(LENGTH**2 - RADIUS**2)), radius=RADIUS, speed=SPEED, start=RADIUS * SPEED, young=young
        )
        file.write_text(text, encoding="utf-8")
        scene = ephs.load(file)
    try:
        ephs.simulate(scene, UNTIL / 100.0, **options)  # compiles
        start = time.process_time()
        sol = ephs.simulate(scene, UNTIL, save_at=INSTANTS, **options)
    except ephs.SimulationError as error:
        return row | {"failed": error.outcome.value}
    seconds = time.process_time() - start
    found = sol.body("slider").position[:, 0]
    return row | {
        "steps": int(sol.stats["steps"]), "seconds": seconds, "error": float(np.abs(found - rigid(sol.t)).max()),
        "defect": float(sol.energy_error.max()),
    }  # fmt: skip


def rigid(t: np.ndarray) -> np.ndarray:
    """Where the slider of the rigid mechanism stands at the times `t` in s, in m."""
    angle = 0.5 * np.pi - SPEED * t
    return RADIUS * np.cos(angle) + np.sqrt(LENGTH**2 - (RADIUS * np.sin(angle)) ** 2)


def report(out: Path | None = None, names: Iterable[str] = METHODS, moduli: Iterable[float] = STIFFNESS) -> Report:
    """A row for each method and modulus; a chart of steps, time and error goes into a folder."""
    rows: list[dict[str, Any]] = []
    moduli = tuple(moduli)
    for name in names:
        for young in moduli:
            rows.append(measure(young, name))
            print(rows[-1], file=sys.stderr, flush=True)
            if rows[-1].get("seconds", 0.0) > LIMIT:
                break
    if out is not None:
        _draw(rows, out)
    return Report(table_of(rows, COLUMNS), rows)


def _draw(rows: list[dict[str, Any]], out: Path) -> None:
    """Steps, time and distance from the rigid slider over Young's modulus, a line a method."""
    from matplotlib import rc_context

    from ephs.show.plots.curves import STYLE
    from ephs.show.shared.figures import new_figure

    out.mkdir(parents=True, exist_ok=True)
    shown = {"steps": "steps", "seconds": "time [s]", "error": "from the rigid slider [m]"}
    style: Any = STYLE
    with rc_context(style):
        figure = new_figure(10.5, 3.6)
        for place, (key, words) in enumerate(shown.items(), start=1):
            axes = figure.add_subplot(1, 3, place)
            for name in dict.fromkeys(row["method"] for row in rows):
                done = [row for row in rows if row["method"] == name and not row["failed"]]
                axes.loglog([row["young"] for row in done], [row[key] for row in done], marker="o", ms=3, label=name)
            axes.set_xlabel("Young's modulus [Pa]")
            axes.set_title(words)
            if place == 1:
                axes.legend(fontsize=7)
        figure.savefig(out / "rigid-limit.png", dpi=150)
