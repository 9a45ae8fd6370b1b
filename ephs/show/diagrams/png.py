"""A placed picture drawn by matplotlib: a bitmap, or a part of a figure."""

from io import BytesIO
from typing import TYPE_CHECKING, Any

from ephs.show.diagrams.geometry import Placement
from ephs.show.diagrams.marks import DiagramMark, DiagramWord, parts_of
from ephs.show.shared.palette import INK, PAPER

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def to_png(placement: Placement, *, dpi: int = 192) -> bytes:
    """The picture as the bytes of a PNG file, at `dpi` pixels an inch (72 points)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = placement.size
    figure = Figure(figsize=(width / 72, height / 72), dpi=dpi, facecolor=PAPER)
    FigureCanvasAgg(figure)
    draw_placement(figure.add_axes((0.0, 0.0, 1.0, 1.0)), placement)
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=dpi, metadata={"Software": None})
    return stream.getvalue()


def draw_placement(axes: "Axes", placement: Placement, scale: float = 1.0) -> None:
    """Draw the picture over all of some axes, which show `scale` of a point for each of its points."""
    from matplotlib.patches import FancyBboxPatch

    (start, above), (width, height) = placement.origin, placement.size
    axes.set_xlim(start, start + width)
    axes.set_ylim(above + height, above)
    axes.axis("off")
    left, top, across, down = placement.rectangle
    style = f"round,pad=0,rounding_size={placement.corner}"
    outer = FancyBboxPatch((left, top), across, down, boxstyle=style, fc=PAPER, ec=INK, lw=1.4 * scale)
    axes.add_patch(outer)
    for level, part in enumerate(parts_of(placement), 2):
        for mark in part.marks:
            _draw(axes, mark, scale, level)
        for word in part.words:
            _write(axes, word, scale, level)


def _draw(axes: "Axes", mark: DiagramMark, scale: float, level: int) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle

    style: dict[str, Any] = {"lw": mark.width * scale, "zorder": level}
    if mark.radius:
        axes.add_patch(Circle(mark.points[0], mark.radius, fc=mark.fill, ec=mark.stroke or "none", **style))
        return
    dashes = (0, tuple(length / mark.width for length in mark.dashes)) if mark.dashes else "-"
    across, down = zip(*mark.points, strict=True)
    axes.add_line(Line2D(across, down, color=mark.stroke, ls=dashes, **style))


def _write(axes: "Axes", word: DiagramWord, scale: float, level: int) -> None:
    from matplotlib.patheffects import withStroke

    text, (x, y) = word.text, word.text.at
    plain = text.base.replace("$", r"\$")
    words = plain if not text.sub else rf"{plain}$_{{\mathregular{{{text.sub}}}}}$"
    style: dict[str, Any] = {"ha": "center", "va": "center_baseline", "zorder": level + 0.5}
    drawn = axes.text(x, y, words, fontsize=text.size * scale, color=word.colour, **style)
    if word.halo:
        drawn.set_path_effects([withStroke(linewidth=2.5 * scale, foreground=word.halo)])
