"""A pattern beside its mechanism, in one figure."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.show.diagrams.layout import place
from ephs.show.diagrams.png import draw_placement
from ephs.show.motions.motion import best_side, poses_at
from ephs.show.motions.still import draw_still
from ephs.show.plots.curves import styled
from ephs.show.shared.errors import ShowError
from ephs.show.shared.figures import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 7.2
GAP = 0.15


def plot_mechanism(sol: Any, at: float | None = None, *, opened: bool = False) -> "Figure":
    """The interconnection pattern of a scene's system, and next to it a still of the mechanism.

    Parameters
    ----------
    sol : Solution or Scene
        What to draw; a scene is drawn in its initial state.
    at : float, optional
        Time of the still in s; by default the start.
    opened : bool
        Whether the pattern's composites are opened by one level.

    Raises
    ------
    ShowError
        If there is no scene, or the time is outside of the solution.
    """
    scene = sol if callable(getattr(sol, "all_bodies", None)) else sol.outline
    if scene is None:
        raise ShowError("nothing", path=str(sol.name), found="mechanism", expected="a solution with bodies")
    if sol is scene:
        poses = {name: np.asarray(body.pose, dtype=float) for name, body in scene.all_bodies()}
        way, system = None, scene.system()
    else:
        poses, way = _poses(sol, at)
        system = sol.system
    placement = place(system, opened=opened)
    wide, high = (side / 72.0 for side in placement.size)
    scale = min(1.0, 0.52 * WIDTH / wide, 4.4 / high)
    with styled():
        height = max(2.4, scale * high)
        figure = new_figure(WIDTH, height)
        figure.set_layout_engine("none")
        share = scale * wide / WIDTH
        below = 0.5 * (1.0 - scale * high / height)
        draw_placement(figure.add_axes((0.0, below, share, scale * high / height)), placement, scale)
        left = share + GAP / WIDTH
        draw_still(figure.add_axes((left, 0.02, 0.99 - left, 0.96)), scene, poses, way)
    return figure


def _poses(sol: Any, at: float | None) -> tuple[dict[str, Any], Any]:
    """Poses at a time, and the side from which the whole motion is seen best."""
    t = np.asarray(sol.t, dtype=float)
    if not len(t):
        raise ShowError("nothing", path=str(sol.name), found="instants", expected="some to show")
    time = float(t[0]) if at is None else float(at)
    if not min(t[0], t[-1]) <= time <= max(t[0], t[-1]):
        span = f"one from {t[0]:g} to {t[-1]:g} s"
        raise ShowError("nothing", path=str(sol.name), found=f"time {time:g} s", expected=span)
    names = [name for name, _ in sol.outline.all_bodies()]
    places = [np.asarray(sol.body(name).position, dtype=float) for name in names]
    still = {name: rows[0] for name, rows in poses_at(sol, names, np.array([time])).items()}
    return still, best_side(np.concatenate(places)) if places else None
