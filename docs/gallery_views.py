"""How the systems of the gallery are looked at: the moving picture of each, and all that the page shows of it."""

import html
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from gallery_pictures import View, bending, moving_scene, sliding
from live_pages import file_of

from ephs.mechanics.elements.shell import statics
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.section import ShellSection
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.motion.inside import Inside
from examples.gallery import UNTIL, entries

ENTRIES = entries()
SHORT, FEW = 8, 3
"""Equations that are set in formulas, more are folded away as text; boxes that are drawn opened."""

FRONT = View(-90.0, 8.0)  # along y: for what moves in the plane x, z
VIEWS = {
    "heavy top": View(-50.0, 18.0),
    "four-bar": View(-75.0, 62.0),
    "N-four-bar": FRONT,
    "biped": View(-68.0, 10.0),
    "slider-crank": View(-80.0, 15.0),
    "screw press": View(-60.0, 14.0),
    "hot brake": View(-50.0, 20.0),
}


def picture(name: str, sol: Any) -> str:
    """The moving picture of an entry, as SVG."""
    if sol.scene is not None:
        return moving_scene(sol, VIEWS.get(name))
    return SYSTEMS[name](sol)


def _oscillator(sol: Any) -> str:
    return sliding(sol["osc.pe.q"], (0.5, 0.5, 0.5), seconds=float(sol.t[-1]), walls=(-2.2,), springs=True)


def _cylinder(sol: Any) -> str:
    return sliding(2.0 * sol["gas1.v"], (0.06, 0.6, 0.6), seconds=float(sol.t[-1]), walls=(0.0, 2.0), springs=False)


def _engine(module: str, sol: Any) -> str:
    engine = Inside(sol, "engine", import_module(f"examples.{module}").scene)
    return moving_scene(engine, VIEWS["slider-crank"])


SYSTEMS: dict[str, Callable[[Any], str]] = {
    "oscillator": _oscillator,
    "damped oscillator": _oscillator,
    "two gases": _cylinder,
    "motor and crank": partial(_engine, "motor_crank"),
    "gas engine": partial(_engine, "gas_engine"),
}


def snapping() -> str:
    """A flat roof, hinged along two sides, that a force in its middle presses through, as SVG; symmetry is used."""
    radius, half, x, y, z = 2540.0, 254.0, 3, 4, 5  # mm, N, MPa

    def roof(u: Any, v: Any) -> Any:
        return radius * np.sin(0.1 * u), half * v, radius * np.cos(0.1 * u)

    points, where, cells = grid(roof, (4, 4))
    section = ShellSection.isotropic(thickness=12.7, E=3102.75, nu=0.3)
    shell = Shell.of(points, cells, section, normals=points * [1.0, 0.0, 1.0])
    free, load = np.ones((len(points), 6), dtype=bool), np.zeros((len(points), 6))
    for side, held in (
        (where[:, 0] == 1.0, [0, 2, x, y, z]),
        (where[:, 0] == 0.0, [1, 2, x]),
        (where[:, 1] == 0.0, [0, 2, y]),
    ):
        free[np.ix_(side, held)] = False
    load[0, z] = -250.0
    low = radius - 30.0
    path = statics.follow(shell, load, free, until=10.0, step=0.1, stop=lambda share, poses: poses[0, 6] < low)
    there = np.linspace(0.0, len(path.poses) - 1.0, 20).astype(int)
    poses = path.poses[[*there, *there[::-1]]]
    signs = [np.array([one, other, 1.0]) for one in (1.0, -1.0) for other in (1.0, -1.0)]
    whole = np.concatenate([poses[..., 4:] * sign for sign in signs], axis=1)
    faces = np.concatenate([cells + k * len(points) for k in range(4)])
    stored = np.array([shell.energy(at) / shell.areas for at in poses])  # N/mm is kJ/m²
    middle = whole - [0.0, 0.0, radius]
    return bending(
        middle, faces, np.tile(1e3 * stored, 4), "strain energy", "J/m²", view=View(-60.0, 24.0), seconds=6.0
    )


def shown(name: str) -> None:
    """Show a system on the page: what it is, its pattern, its equations, its motion, its balances."""
    from IPython.display import HTML, SVG, Markdown, display

    from ephs import System
    from ephs.show import draw

    entry = ENTRIES[name]
    model = entry.model()
    system = model if isinstance(model, System) else model.system()
    sol = entry.run(UNTIL)
    display(SVG(picture(name, sol)))
    page = file_of(name)
    if page is not None:
        display(HTML(f'<p><a href="live/{page}">Simulate it in the browser</a>, with sliders for its numbers.</p>'))
    display(SVG(draw(system, opened=len(system.fillings) <= FEW).svg))
    equations = system.equations()
    if len(equations) <= SHORT:
        display(equations)
    else:
        head = f"<summary>{len(equations)} equations, interface variables eliminated</summary>"
        display(HTML(f"<details>{head}<pre>{html.escape(str(equations))}</pre></details>"))
    made, gap = float(sol.entropy[-1] - sol.entropy[0]), float(sol.constraint_error.max())
    display(
        Markdown(
            f"Energy balanced to {sol.energy_error.max():.1e}"
            + (f", joints closed to {gap:.1e}" if gap else "")
            + f"; heat {sol.heat[-1]:.4g} J, work {sol.work[-1]:.4g} J, entropy made {made:.3g} J/K."
        )
    )
    display(sol.ledger())
