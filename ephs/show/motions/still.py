"""Schematics of mechanisms drawn by matplotlib, and as SVG for pages."""

import html
from collections.abc import Callable
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.show.motions.motion import Array
from ephs.show.motions.overlays import Shades, Tones, tint
from ephs.show.motions.sketch import Sketch, SketchLabel, sketch
from ephs.show.shared.palette import PAPER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HIGHEST = 640.0, 420.0
"""Size of an SVG in pixels: its width, and its largest height."""
POINT = 4.0 / 3.0
"""Pixels of a point."""
THIN = 1e-12
"""Least ratio of a drawing's height and width: collinear marks have no extent across their line."""
BAR = 0.6
"""Width of all bars of colours, relative to the axes."""
MARGIN = 24.0
"""Pixels about the marks of an SVG, for names."""


def draw_still(
    axes: "Axes",
    scene: Any,
    poses: dict[str, Array],
    way: Array | None = None,
    extent: float | None = None,
    tones: Tones | None = None,
) -> None:
    """Draw a mechanism into some axes; parameters as of `sketch`."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patheffects import withStroke

    made = sketch(scene, poses, way, extent, tones)
    for level, (filled, group) in enumerate(groupby(made.marks, key=lambda mark: mark.fill is not None)):
        marks = list(group)
        strokes: dict[str, Any] = {
            "edgecolors": [mark.stroke for mark in marks],
            "linewidths": [mark.width for mark in marks],
            "zorder": 1.0 + 0.01 * level,
        }
        if filled:
            axes.add_collection(
                PolyCollection([m.points for m in marks], facecolors=[m.fill for m in marks], **strokes)
            )
        else:
            strokes["colors"] = strokes.pop("edgecolors")
            styles: Any = [(0, mark.dashes) if mark.dashes else "solid" for mark in marks]
            axes.add_collection(LineCollection([mark.points for mark in marks], linestyles=styles, **strokes))
    low, high = made.bounds()
    room = 0.04 * float(np.linalg.norm(high - low))
    axes.update_datalim([low - room, high + room])
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    axes.apply_aspect()
    figure = axes.get_figure(root=True)
    dots = 72.0 / (figure.dpi if figure is not None else 72.0)
    page = np.asarray(axes.bbox.extents, dtype=float) * dots
    halo: list[Any] = [withStroke(linewidth=2.2, foreground=PAPER)]
    for words, shift in _settled(made, lambda at: np.asarray(axes.transData.transform(at), dtype=float) * dots, page):
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": words.letter, "color": words.colour}
        at = (float(words.at[0]), float(words.at[1]))
        axes.annotate(words.text, at, shift, textcoords="offset points", zorder=9, **style).set_path_effects(halo)


def draw_bars(axes: "Axes", shades: tuple[Shades, ...]) -> None:
    """Draw a bar of colours with its range below some axes for each kind of values, in these axes."""
    from matplotlib.colors import ListedColormap

    colours = ListedColormap([[part / 255.0 for part in tint(k / 255)] for k in range(256)])
    wide = BAR / max(1, len(shades))
    for k, shade in enumerate(shades):
        bar = axes.inset_axes((0.5 + (k - 0.5 * len(shades) + 0.15) * wide, 0.06, 0.7 * wide, 0.02))
        bar.imshow(np.linspace(0.0, 1.0, 256)[None], aspect="auto", cmap=colours, extent=(0.0, 1.0, 0.0, 1.0))
        bar.set(yticks=(), xticks=(0.0, 1.0), xticklabels=shade.ends)
        bar.tick_params(length=0.0, labelsize=7.5)
        bar.set_title(shade.said, fontsize=7.5, pad=3.0)


def still_svg(scene: Any, poses: dict[str, Array]) -> str:
    """The same as an SVG element; parameters as of `sketch`."""
    made = sketch(scene, poses)
    low, high = made.bounds()
    span = np.maximum(high - low, THIN * float(np.max(high - low)))
    scale = float(min((WIDTH - 2.0 * MARGIN) / span[0], (HIGHEST - 2.0 * MARGIN) / span[1]))
    height = float(scale * span[1]) + 2.0 * MARGIN
    across = 0.5 * (WIDTH - scale * float(span[0]))

    def pixels(points: Array) -> Array:
        return np.column_stack(
            [across + scale * (points[:, 0] - low[0]), height - MARGIN - scale * (points[:, 1] - low[1])]
        )

    parts: list[str] = []
    for mark in made.marks:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels(mark.points))
        width = POINT * mark.width
        dashes = " ".join(f"{dash * width:.1f}" for dash in mark.dashes)
        style = f'stroke="{_colour(mark.stroke)}" stroke-width="{width:.2f}"'
        style += f' stroke-dasharray="{dashes}"' if dashes else ""
        shape = "polyline" if mark.fill is None else "polygon"
        parts.append(f'<{shape} points="{points}" fill="{_colour(mark.fill)}" {style}/>')

    def upward(at: Array) -> Array:
        x, y = pixels(at[None])[0]
        return np.array([x, height - y]) / POINT

    page = np.array([0.0, 0.0, WIDTH, height]) / POINT
    for words, (aside, over) in _settled(made, upward, page):
        x, y = pixels(words.at[None])[0] + POINT * np.array([aside, -over])
        parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{POINT * words.letter:.1f}" fill="{words.colour}">'
            f"{html.escape(words.text)}</text>"
        )
    common = (
        'font-family="system-ui,sans-serif" text-anchor="middle" dominant-baseline="central" paint-order="stroke" '
        'stroke-linejoin="round" stroke-linecap="butt"'
    )
    texts = "<style>.still text{stroke:#fff;stroke-width:3px}</style>"
    size = f'viewBox="0 0 {WIDTH:.0f} {height:.0f}" width="{WIDTH:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" class="still" {size} {common}>{texts}{"".join(parts)}</svg>'


def _colour(value: Any) -> str:
    """A colour of a mark in the words of SVG."""
    if value is None or isinstance(value, str):
        return value or "none"
    red, green, blue = (round(255.0 * float(part)) for part in value)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _settled(
    made: Sketch, points: Callable[[Array], Array], page: Array
) -> list[tuple[SketchLabel, tuple[float, float]]]:
    """Each name with its shift in points: beside its object where there is room.

    ``points`` gives a place (2,) in m in points of the page, y upwards; ``page`` is (4,), its corners.
    """
    out: list[tuple[SketchLabel, tuple[float, float]]] = []
    taken = [_room(points(at), 0.0, 0.0, 11.0, 11.0) for at in made.taken]
    for words in made.words:
        wide, high = 0.58 * words.letter * len(words.text), 1.15 * words.letter
        shifts = [(0.0, 0.0)] if words.fixed else _shifts(wide, high)
        rooms = [_room(points(words.at), *shift, wide, high) for shift in shifts]
        clashes = [sum(_overlap(room, other) for other in taken) + _beyond(room, page) for room in rooms]
        best = int(np.argmin(clashes))
        taken.append(rooms[best])
        out.append((words, shifts[best]))
    return out


def _shifts(wide: float, high: float) -> list[tuple[float, float]]:
    """Candidate offsets of a name's centre from its object, in points, best first."""
    aside, over = 0.5 * wide + 8.0, 0.5 * high + 8.0
    near = [(0.0, over), (aside, 0.0), (aside, over), (-aside, over), (-aside, 0.0), (0.0, -over), (aside, -over)]
    return [(0.0, 0.0), *near, (-aside, -over), (0.0, 2.2 * over), (0.0, -2.2 * over)]


def _room(at: Array, x: float, y: float, wide: float, high: float) -> tuple[float, float, float, float]:
    middle = at + np.array([x, y])
    return (middle[0] - wide / 2, middle[1] - high / 2, middle[0] + wide / 2, middle[1] + high / 2)


def _beyond(room: tuple[float, float, float, float], page: Array) -> float:
    """The area outside the picture."""
    whole = (room[2] - room[0]) * (room[3] - room[1])
    return whole - _overlap(room, (page[0], page[1], page[2], page[3]))


def _overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> float:
    """Common area."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, wide) * max(0.0, high)
