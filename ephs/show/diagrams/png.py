"""A placed picture drawn by matplotlib from the same geometry as the other two: a bitmap, or a part of a figure."""

from io import BytesIO
from typing import TYPE_CHECKING

from ephs.show.diagrams.geometry import Lettering, Placement, all_boxes, notes_of
from ephs.show.shared.palette import FILLS, GREY, INK, PAPER, RIMS

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
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, FancyBboxPatch

    width, height = placement.size
    axes.set_xlim(0.0, width)
    axes.set_ylim(height, 0.0)
    axes.axis("off")
    left, top, across, down = placement.rectangle
    style = f"round,pad=0,rounding_size={placement.corner}"
    outer = FancyBboxPatch((left, top), across, down, boxstyle=style, fc=PAPER, ec=INK, lw=1.4 * scale)
    axes.add_patch(outer)
    for region in placement.regions:
        rim = RIMS["composite"]
        axes.add_patch(Circle(region.at, region.radius, fc=FILLS["composite"] + "59", ec=rim, lw=1.3 * scale, zorder=1))
        _write(axes, region.label, rim, scale, halo=PAPER)
    for wire in placement.wires:
        across_points, down_points = zip(*wire.points, strict=True)
        dashes = "-" if wire.power else (0, (1.2, 2.2)) if wire.role == "link" else (0, (3.3, 2.5))
        axes.add_line(Line2D(across_points, down_points, color=INK, lw=1.2 * scale, ls=dashes, zorder=2))
    for box in all_boxes(placement):
        rim = RIMS[box.kind]
        axes.add_patch(Circle(box.at, box.radius, fc=FILLS[box.kind], ec=rim, lw=1.3 * scale, zorder=3))
        for (x1, y1), (x2, y2) in box.hatching:
            axes.add_line(Line2D((x1, x2), (y1, y2), color=rim, lw=0.6 * scale, alpha=0.55, zorder=4))
        for text in box.lines:
            _write(axes, text, INK, scale, halo=FILLS[box.kind])
    for junction in placement.junctions:
        axes.add_patch(Circle(junction.at, junction.radius, fc=INK, ec=INK, lw=0, zorder=5))
        _write(axes, junction.label, INK, scale, halo=PAPER)
    for text in notes_of(placement):
        _write(axes, text, GREY, scale, halo=PAPER)


def _write(axes: "Axes", text: Lettering, colour: str, scale: float, *, halo: str) -> None:
    from matplotlib.patheffects import withStroke

    plain = text.base.replace("$", r"\$")
    words = plain if not text.sub else rf"{plain}$_{{\mathregular{{{text.sub}}}}}$"
    x, y = text.at
    drawn = axes.text(
        x, y, words, fontsize=text.size * scale, color=colour, ha="center", va="center_baseline", zorder=6
    )
    drawn.set_path_effects([withStroke(linewidth=2.5 * scale, foreground=halo)])
