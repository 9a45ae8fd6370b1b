"""A placed picture as SVG."""

from typing import TYPE_CHECKING, Any

from ephs.show.diagrams.geometry import Placement
from ephs.show.diagrams.marks import DiagramMark, DiagramWord, parts_of
from ephs.show.shared.palette import INK, PAPER

if TYPE_CHECKING:
    import drawsvg

_FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"


def to_svg(placement: Placement) -> str:
    """The picture as the text of an SVG file; the same picture gives the same text.

    Boxes, junctions and wires carry their full paths as titles, and a class with their kind, for restyling.
    """
    import drawsvg as svg

    origin, (width, height) = ([round(x, 2) for x in pair] for pair in (placement.origin, placement.size))
    drawing = svg.Drawing(width, height, origin=origin, font_family=_FONT)
    frame = [round(value, 2) for value in placement.rectangle]
    style = {"fill": PAPER, "stroke": INK, "stroke_width": 1.4}
    drawing.append(svg.Rectangle(*frame, rx=placement.corner, class_="outer", **style))
    for part in parts_of(placement):
        group = svg.Group(class_=part.classes)
        if part.title:
            group.append_title(part.title)
        for drawn in (*map(_mark, part.marks), *map(_word, part.words)):
            group.append(drawn)
        drawing.append(group)
    return drawing.as_svg() or ""  # it returns text unless it is given a file to write to


def _mark(mark: DiagramMark) -> "drawsvg.DrawingBasicElement":
    import drawsvg as svg

    style: dict[str, Any] = {"stroke": mark.stroke, "stroke_width": mark.width} if mark.stroke else {}
    if mark.radius:
        x, y = mark.points[0]
        return svg.Circle(round(x, 2), round(y, 2), round(mark.radius, 2), fill=mark.fill, **style)
    if mark.dashes:
        style["stroke_dasharray"] = " ".join(f"{length:g}" for length in mark.dashes)
    path = "M" + " L".join(f"{x:.2f},{y:.2f}" for x, y in mark.points)
    return svg.Path(d=path, fill="none", stroke_linejoin="round", **style)


def _word(word: DiagramWord) -> "drawsvg.DrawingBasicElement":
    import drawsvg as svg

    text, (x, y), size = word.text, word.text.at, word.text.size
    style: dict[str, Any] = {"text_anchor": "middle", "fill": word.colour}
    if word.halo:
        style |= {"stroke": word.halo, "stroke_width": 2.5, "stroke_linejoin": "round", "paint_order": "stroke"}
    # A shift by a third of the type size replaces a central baseline, which some programs lack.
    drawn = svg.Text("" if text.sub else text.base, round(size, 2), round(x, 2), round(y + 0.35 * size, 2), **style)
    if text.sub:
        drawn.append(svg.TSpan(text.base))
        drawn.append(svg.TSpan(text.sub, font_size=round(0.72 * size, 2), dy=round(0.22 * size, 2)))
    return drawn
