"""Plots of a solution, ready for print.

Every function returns a matplotlib ``Figure`` that is bound to no window, and takes solutions of scenes and of any
other system alike.
"""

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.show.plots.panels import (
    Curve,
    Panel,
    constraint_panels,
    energy_panels,
    entropy_panels,
    exergy_panels,
    motion_panels,
)
from ephs.show.plots.series import Array, thinned
from ephs.show.shared.figures import new_figure, plain
from ephs.show.shared.palette import GREY, RED, dashes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EMPTY = 1e-17, 1e-15
"""Range of an axis of errors that are all zero."""
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


def styled() -> AbstractContextManager[None]:
    """The style of all figures, in which they are drawn."""
    from matplotlib import rc_context

    style: Any = STYLE
    return rc_context(style)


def plot_motion(sol: Any) -> "Figure":
    """Joint coordinates, positions of the centres of mass and temperatures; of a system, its states, too."""
    return panel_figure(sol, "motion" if sol.outline is not None else "states", motion_panels(sol))


def panel_figure(sol: Any, what: str, panels: list[Panel]) -> "Figure":
    """Panels above each other over the same time, names of curves to their right."""
    figure, axes = _panels(sol, what, panels)
    for each, panel in zip(axes, panels, strict=True):
        _curves(each, sol, panel)
        if len(panel.curves) > _MOST_NAMES:
            each.plot([], [], alpha=0.0, label=f"and {len(panel.curves) - _MOST_NAMES} more")
        _legend(each)
    return figure


def plot_energy(sol: Any) -> "Figure":
    """The ledger of energy, and the defect of its balance relative to the energy turned over."""
    ledger, defect = panels = energy_panels(sol)
    figure, axes = _panels(sol, "energy", panels)
    _curves(axes[0], sol, ledger)
    _legend(axes[0])
    _residual(axes[1], sol, defect)
    return figure


def plot_exergy(sol: Any) -> "Figure":
    """Stored exergy, the work supplied, and destroyed exergy."""
    panels = exergy_panels(sol)
    figure, axes = _panels(sol, "exergy", panels)
    _curves(axes[0], sol, panels[0])
    _legend(axes[0])
    return figure


def plot_entropy(sol: Any) -> "Figure":
    """Entropy gained since the start, and the least production in each step; a negative production is marked."""
    gained, produced = panels = entropy_panels(sol)
    figure, axes = _panels(sol, "entropy", panels)
    _line(axes[0], sol, gained.curves[0], None)
    _line(axes[1], sol, produced.curves[0], None)
    axes[1].axhline(0.0, color=GREY, linewidth=0.7)
    production = produced.curves[0].values
    t, negative = _times(sol, production), production < 0
    if negative.any():
        axes[1].plot(t[negative], production[negative], "x", color=RED, markersize=4, label="negative")
        _legend(axes[1])
    return figure


def plot_constraints(sol: Any) -> "Figure":
    """Largest residual of the joints at each time, of positions and of velocities."""
    panels = constraint_panels(sol)
    figure, axes = _panels(sol, "constraints", panels)
    for each, panel in zip(axes, panels, strict=True):
        _residual(each, sol, panel)
    return figure


def _times(sol: Any, values: Array) -> Array:
    return np.asarray(sol.t, dtype=float)[len(sol.t) - len(values) :]


def _panels(sol: Any, what: str, panels: list[Panel]) -> "tuple[Figure, list[Axes]]":
    heights = [panel.height for panel in panels]
    with styled():
        figure = new_figure(_WIDTH, 0.7 + _ROW * sum(heights))
        grid = figure.subplots(len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
        axes: list[Axes] = list(grid[:, 0])
        axes[0].set_title(plain(f"{sol.name}: {what}"), loc="left")
        axes[-1].set_xlabel("time [s]")
        for each, panel in zip(axes, panels, strict=True):
            each.set_ylabel(plain(panel.title))
        t = np.asarray(sol.t, dtype=float)
        if len(t) > 1 and t[-1] > t[0]:
            axes[0].set_xlim(float(t[0]), float(t[-1]))
        figure.align_ylabels(axes)
    return figure, axes


def _curves(axes: "Axes", sol: Any, panel: Panel) -> None:
    for index, curve in enumerate(panel.curves):
        _line(axes, sol, curve, curve.name if index < _MOST_NAMES else None, dashes(index))


def _line(axes: "Axes", sol: Any, curve: Curve, label: str | None, style: Any = "-") -> None:
    t, values = thinned(_times(sol, curve.values), curve.values)
    axes.plot(t, values, color=curve.colour, linestyle=style, linewidth=1.4, label=label and plain(label))


def _residual(axes: "Axes", sol: Any, panel: Panel) -> None:
    """Sizes on a logarithmic axis; a residual of zero throughout is a note."""
    shown = False
    for curve in panel.curves:
        size = np.where(np.abs(curve.values) > 0, np.abs(curve.values), np.nan)
        if np.isfinite(size).any():
            shown = True
            marker = "." if np.isfinite(size).sum() < 60 else ""
            t, values = thinned(_times(sol, size), size)
            axes.plot(t, values, color=curve.colour, label=curve.name, linewidth=1.1, marker=marker)
    axes.set_yscale("log")
    if not shown:
        axes.set_ylim(*EMPTY)
        middle: Any = {"transform": axes.transAxes, "ha": "center", "va": "center", "color": GREY, "size": 9}
        axes.text(0.5, 0.5, "zero throughout", **middle)
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
