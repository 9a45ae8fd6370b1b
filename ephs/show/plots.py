"""Plots of a solution, fit to print as they are.

Every function returns a matplotlib ``Figure`` that is bound to no window, and takes solutions of scenes and of any
other system alike.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ephs.show.figures import new_figure, plain
from ephs.show.palette import BLACK, BLUE, CYCLE, GREEN, GREY, ORANGE, PURPLE, RED, SKY, dashes
from ephs.show.series import Array, scene_panels, state_panels, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _ROW = 7.2, 2.0
_MOST_NAMES = 14
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 10.0,
    "legend.fontsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#dfe3e8",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "xtick.direction": "out",
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 4),
}
_Line = tuple[str, NDArray[np.float64], str]


def plot_motion(sol: Any) -> "Figure":
    """Joint coordinates, positions of the centres of mass and temperatures; for any other system, its states."""
    panels = scene_panels(sol) if sol.scene is not None else state_panels(sol)
    panels = panels or {"state": []}
    figure, axes = _panels(sol, "motion" if sol.scene is not None else "states", [1.0] * len(panels))
    for each, (title, lines) in zip(axes, panels.items(), strict=True):
        for index, (name, values) in enumerate(lines):
            label = name if index < _MOST_NAMES else None
            _line(each, sol, values, CYCLE[index % len(CYCLE)], label, dashes(index))
        if len(lines) > _MOST_NAMES:
            each.plot([], [], alpha=0.0, label=f"and {len(lines) - _MOST_NAMES} more")
        each.set_ylabel(plain(title))
        _legend(each)
    return figure


def plot_energy(sol: Any) -> "Figure":
    """The ledger of energy, and the defect of its balance relative to what was turned over."""
    figure, axes = _panels(sol, "energy", [1.7, 1.0])
    heat, work = _array(sol.heat), _array(sol.work)
    if sol.kinetic is not None and sol.potential is not None:
        kinetic, potential = _array(sol.kinetic), _array(sol.potential)
        potential = potential - potential[0]
        lines: list[_Line] = [
            ("kinetic", kinetic, BLUE),
            ("potential (change)", potential, GREEN),
            ("heat", heat, RED),
            ("work supplied", work, ORANGE),
            ("sum less work", kinetic + potential + heat - work, BLACK),
        ]
    else:
        energy = _array(sol.energy)
        lines = [
            ("energy (change)", energy - energy[0], BLACK),
            ("heat", heat, RED),
            ("work supplied", work, ORANGE),
        ]
    _accounts(axes[0], sol, lines)
    axes[0].set_ylabel("energy [J]")
    _legend(axes[0])
    _residual(axes[1], sol, [("defect", _array(sol.energy_error), PURPLE)], "relative defect [1]")
    return figure


def plot_exergy(sol: Any) -> "Figure":
    """Exergy that there is, that was supplied as work, and that was destroyed."""
    figure, axes = _panels(sol, "exergy", [1.7])
    exergy, work = _array(sol.exergy), _array(sol.work)
    destroyed = exergy[0] + work - exergy
    lines: list[_Line] = [("exergy (change)", exergy - exergy[0], BLUE), ("work supplied", work, ORANGE)]
    _accounts(axes[0], sol, [*lines, ("destroyed", destroyed, RED)])
    axes[0].set_ylabel("exergy [J]")
    _legend(axes[0])
    return figure


def plot_entropy(sol: Any) -> "Figure":
    """Entropy gained since the start, and what each step produced; a negative production is marked."""
    figure, axes = _panels(sol, "entropy", [1.3, 1.0])
    entropy, production = _array(sol.entropy), _array(sol.entropy_production)
    _line(axes[0], sol, entropy - entropy[0], BLUE, None)
    axes[0].set_ylabel("entropy (change) [J/K]")
    # Where there is an entry for the start too, nothing was produced before it.
    production = production[1:] if len(production) == len(sol.t) else production
    t = _array(sol.t)[len(sol.t) - len(production) :]
    axes[1].plot(*thinned(t, production), color=GREEN)
    axes[1].axhline(0.0, color=GREY, linewidth=0.7)
    negative = production < 0
    if negative.any():
        axes[1].plot(t[negative], production[negative], "x", color=RED, markersize=4, label="negative")
        _legend(axes[1])
    axes[1].set_ylabel("least produced [J/K a step]")
    return figure


def plot_constraints(sol: Any) -> "Figure":
    """Largest residual of the joints at each time, of positions and of velocities."""
    figure, axes = _panels(sol, "constraints", [1.0, 1.0])
    _residual(axes[0], sol, [("position", _array(sol.constraint_error), BLUE)], "position [m, rad]")
    _residual(axes[1], sol, [("velocity", _array(sol.velocity_error), SKY)], "velocity [m/s, rad/s]")
    return figure


def _array(values: Any) -> Array:
    return np.asarray(values, dtype=float)


def _panels(sol: Any, what: str, heights: list[float]) -> "tuple[Figure, list[Axes]]":
    from matplotlib import rc_context

    style: Any = STYLE
    with rc_context(style):
        figure = new_figure(_WIDTH, 0.7 + _ROW * sum(heights))
        grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
        axes: list[Axes] = list(grid[:, 0])
        axes[0].set_title(plain(f"{sol.name}: {what}"), loc="left")
        axes[-1].set_xlabel("time [s]")
        t = _array(sol.t)
        if len(t) > 1 and t[-1] > t[0]:
            axes[0].set_xlim(float(t[0]), float(t[-1]))
        figure.align_ylabels(axes)
    return figure, axes


def _line(axes: "Axes", sol: Any, values: Array, colour: str, label: str | None, style: Any = "-") -> None:
    axes.plot(
        *thinned(_array(sol.t), values), color=colour, linestyle=style, linewidth=1.4, label=label and plain(label)
    )


def _accounts(axes: "Axes", sol: Any, lines: list[_Line]) -> None:
    """The entries of a ledger, without those that nothing was ever booked on (but never without the first)."""
    booked = [line for index, line in enumerate(lines) if index == 0 or np.any(line[1] != 0.0)]
    for index, (name, values, colour) in enumerate(booked):
        _line(axes, sol, values, colour, name, dashes(index))


def _residual(axes: "Axes", sol: Any, lines: list[_Line], title: str) -> None:
    """Sizes on a logarithmic axis; what is zero throughout is said in words."""
    t = _array(sol.t)
    shown = False
    for name, values, colour in lines:
        size = np.where(np.abs(values) > 0, np.abs(values), np.nan)
        if np.isfinite(size).any():
            shown = True
            marker = "." if np.isfinite(size).sum() < 60 else ""
            axes.plot(
                *thinned(t[len(t) - len(size) :], size),
                color=colour,
                label=name,
                linewidth=1.1,
                marker=marker,
            )
    axes.set_yscale("log")
    axes.set_ylabel(title)
    if not shown:
        axes.set_ylim(1e-17, 1e-15)
        axes.text(
            0.5,
            0.5,
            "zero throughout",
            transform=axes.transAxes,
            ha="center",
            va="center",
            color=GREY,
            size=9,
        )
        return
    low, high = axes.get_ylim()
    if high / low < 100.0:
        middle = float(np.sqrt(low * high))
        axes.set_ylim(middle / 10.0, middle * 10.0)


def _legend(axes: "Axes") -> None:
    """Names to the right of the panel, where no line can run under them."""
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02), frameon=False, borderaxespad=0.4, fontsize=8.0)
