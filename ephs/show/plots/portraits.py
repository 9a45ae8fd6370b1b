"""Phase portraits: each degree of freedom's rate over its coordinate, or one state over another."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.show.plots.curves import styled
from ephs.show.plots.series import Array, freedom_lines
from ephs.show.shared.errors import ShowError
from ephs.show.shared.figures import new_figure
from ephs.show.shared.palette import BLUE, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STILL = 1e-9
"""Least change of a drawn coordinate, in m or rad."""
MOST = 6
"""Largest number of portraits drawn by default."""


class _PhaseCurve(NamedTuple):
    across: str
    up: str
    x: Array
    y: Array


def plot_phase(sol: Any, *which: str | tuple[str, str]) -> "Figure":
    """Rates over coordinates of joints; for any other system, momenta over displacements.

    A ring marks the start, a disc the end, an arrow head the direction in time.

    Parameters
    ----------
    which : str or (str, str)
        Degrees of freedom of joints, as ``"pin"`` or ``"slider distance"``, or pairs of states of any system, as
        ``("osc.pe.q", "osc.ke.p")``: first what is drawn to the right. By default the first degrees of freedom that
        move, or one pair of states of either parity.

    Raises
    ------
    ShowError
        If there is no such degree of freedom or state, or nothing that could be drawn by default.
    """
    known = _freedoms(sol)
    curves = [_curve(sol, each, known) for each in which] or _default(sol, known)
    columns = 2 if len(curves) == 4 else min(3, len(curves))
    rows = -(-len(curves) // columns)
    with styled():
        figure = new_figure(3.4 if columns == 1 else 7.2, 0.5 + (2.7 if columns == 1 else 7.2 / columns * 0.85) * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, curve in zip(grid.flat, curves, strict=False):
            _draw(axes, curve)
        for axes in list(grid.flat)[len(curves) :]:
            axes.set_axis_off()
        figure.suptitle(f"{sol.name}: phase portrait", x=0.01, ha="left", fontsize=10.0)
    return figure


def _freedoms(sol: Any) -> dict[str, _PhaseCurve]:
    def place(name: str) -> Any:
        return sol.joint(name).coordinate

    places = freedom_lines(sol.freedoms, place, place)
    rates = freedom_lines(sol.freedoms, place, lambda name: sol.joint(name).rate)
    return {
        name: _PhaseCurve(f"{name} [{unit}]", f"rate [{unit}/s]", x, y)
        for (name, unit, x), (_, _, y) in zip(places, rates, strict=True)
    }


def _curve(sol: Any, which: str | tuple[str, str], known: dict[str, _PhaseCurve]) -> _PhaseCurve:
    if isinstance(which, str):
        if which not in known:
            hint = did_you_mean(which, known, f"there are {listing(known)}")
            found = f"degree of freedom {which!r}"
            raise ShowError("nothing", path=str(sol.name), found=found, expected=f"a name: {hint}")
        return known[which]
    across, up = which
    names = {str(path): path for path in sol.states}
    for name in which:
        if name not in names or np.asarray(sol.states[names[name]]).ndim != 1:
            hint = did_you_mean(name, names, f"there are {listing(names)}")
            raise ShowError("nothing", path=str(sol.name), found=f"scalar state {name!r}", expected=f"a path: {hint}")
    units = [sol.labels[names[name]].unit for name in which]
    x, y = (np.asarray(sol.states[names[name]], dtype=float) for name in which)
    return _PhaseCurve(f"{across} [{units[0]}]", f"{up} [{units[1]}]", x, y)


def _default(sol: Any, known: dict[str, _PhaseCurve]) -> list[_PhaseCurve]:
    if known:
        moving = [curve for curve in known.values() if float(np.nanmax(curve.x) - np.nanmin(curve.x)) > STILL]
        if moving:
            return moving[:MOST]
        raise ShowError("nothing", path=str(sol.name), found="degree of freedom that moves", expected="a joint's")
    pairs = {("m", "kg m/s"), ("rad", "kg m²/s"), ("C", "Wb"), ("m³", "kg m/s")}
    found = [
        (str(a), str(b)) for a in sol.states for b in sol.states if (sol.labels[a].unit, sol.labels[b].unit) in pairs
    ]
    if not found:
        expected = "a displacement and a momentum, or the like; name a pair of states"
        raise ShowError("nothing", path=str(sol.name), found="pair of states for a phase portrait", expected=expected)
    return [_curve(sol, found[0], {})]


def _draw(axes: "Axes", curve: _PhaseCurve) -> None:
    axes.plot(curve.x, curve.y, color=BLUE, linewidth=1.1)
    if len(curve.x) > 2:
        _direction(axes, curve)
        axes.plot(curve.x[:1], curve.y[:1], "o", color=INK, markerfacecolor="white", markersize=5, zorder=3)
        axes.plot(curve.x[-1:], curve.y[-1:], "o", color=INK, markersize=4, zorder=3)
    axes.set_xlabel(curve.across)
    axes.set_ylabel(curve.up)
    axes.margins(0.08)


def _direction(axes: "Axes", curve: _PhaseCurve) -> None:
    """An arrow head where the curve has run a fifth of its way over the picture."""
    wide, high = (float(np.nanmax(values) - np.nanmin(values)) or 1.0 for values in (curve.x, curve.y))
    way = np.cumsum(np.nan_to_num(np.hypot(np.diff(curve.x) / wide, np.diff(curve.y) / high)))
    if not way[-1] > 0.0:
        return
    k = int(np.searchsorted(way, min(0.6, 0.2 * way[-1])))
    start, end = (curve.x[k], curve.y[k]), (curve.x[k + 1], curve.y[k + 1])
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 0, "mutation_scale": 11})
