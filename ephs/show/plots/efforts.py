"""Joint forces and moments over time."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.show.plots.curves import styled
from ephs.show.plots.series import thinned
from ephs.show.shared.errors import ShowError
from ephs.show.shared.figures import new_figure, plain
from ephs.show.shared.palette import BLUE, GREEN, GREY, RED, dashes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLANK = 1e-9
"""N or N m below which a panel shows a line at zero."""
MOST = 6
"""Largest number of joints drawn by default."""


def plot_wrenches(sol: Any, *joints: str) -> "Figure":
    """Force and moment of joints on their body 2, in the axes of the joint frame C2.

    Components that are statically indeterminate are named, and not drawn.

    Parameters
    ----------
    joints : str
        Which; by default the first six.

    Raises
    ------
    ShowError
        If the solution has no joints, or none of such a name.
    """
    known = list(sol.freedoms)
    if not known:
        raise ShowError("nothing", path=str(sol.name), found="joints", expected="a mechanism with joints")
    for name in joints:
        if name not in known:
            hint = did_you_mean(name, known, f"there are {listing(known)}")
            raise ShowError(
                "nothing", path=str(sol.name), found=f"joint {name!r}", expected=f"one of its joints: {hint}"
            )
    chosen = list(joints) or known[:MOST]
    t = np.asarray(sol.t, dtype=float)
    with styled():
        figure = new_figure(7.2, 0.8 + 1.5 * len(chosen))
        grid = figure.subplots(len(chosen), 2, sharex=True, squeeze=False)
        for (left, right), name in zip(grid, chosen, strict=True):
            wrench = np.asarray(sol.joint(name).wrench, dtype=float)
            _draw(left, t, wrench[:, 3:], f"{plain(name)}\nforce [N]")
            _draw(right, t, wrench[:, :3], "moment [N m]")
        for axes in grid[-1]:
            axes.set_xlabel("time [s]")
            if len(t) > 1:
                axes.set_xlim(float(min(t[0], t[-1])), float(max(t[0], t[-1])))
        figure.align_ylabels(list(grid[:, 0]))
        figure.align_ylabels(list(grid[:, 1]))
        handles = grid[0, 0].get_lines()[:3]
        legend = {"loc": "outside upper right", "ncols": 3, "frameon": False, "fontsize": 8.0}
        figure.legend(handles, ["x", "y", "z, axes of C2"], **legend)
        rest = f" ({len(chosen)} of {len(known)} joints)" if len(chosen) < len(known) else ""
        figure.suptitle(plain(f"{sol.name}: joint wrenches{rest}"), x=0.01, ha="left", fontsize=10.0)
    return figure


def _draw(axes: "Axes", t: Any, values: Any, title: str) -> None:
    loose = [axis for axis, column in zip("xyz", values.T, strict=True) if np.isnan(column).any()]
    for k, (column, colour) in enumerate(zip(values.T, (BLUE, RED, GREEN), strict=True)):
        axes.plot(*thinned(t, column), color=colour, linestyle=dashes(k), linewidth=1.2)
    largest = float(np.nanmax(np.abs(values), initial=0.0)) if np.isfinite(values).any() else 0.0
    if largest < BLANK:  # rounding would fill the panel
        axes.set_ylim(-1.0, 1.0)
    if loose:
        axes.set_title(f"{', '.join(loose)} indeterminate", loc="right", color=GREY, fontsize=7.5, pad=2.0)
    axes.set_ylabel(title)
