"""A placed picture as SVG."""

from ephs.show.diagrams.geometry import Lettering, Placement, Point, all_boxes
from ephs.show.diagrams.legend import title
from ephs.show.shared.palette import FILLS, GREY, INK, PAPER, RIMS

_FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"


def to_svg(placement: Placement) -> str:
    """The picture as the text of an SVG file; the same picture gives the same text.

    Boxes, junctions and wires carry their full paths as titles, and a class with their kind, for restyling.
    """
    import drawsvg as svg

    width, height = (round(side, 2) for side in placement.size)
    drawing = svg.Drawing(width, height, font_family=_FONT)
    left, top, across, down = (round(value, 2) for value in placement.rectangle)
    drawing.append(
        svg.Rectangle(
            left,
            top,
            across,
            down,
            rx=placement.corner,
            fill=PAPER,
            stroke=INK,
            stroke_width=1.4,
            class_="outer",
        )
    )
    for region in placement.regions:
        group = svg.Group(class_="box composite opened")
        group.append_title(f"{region.path} (composite)")
        fill, rim = FILLS["composite"], RIMS["composite"]
        style = {"fill": fill, "fill_opacity": 0.35, "stroke": rim, "stroke_width": 1.3}
        group.append(svg.Circle(*_rounded(region.at), round(region.radius, 2), **style))
        group.append(_text(region.label, rim))
        drawing.append(group)
    for wire in placement.wires:
        line = svg.Path(
            d=_path(wire.points),
            fill="none",
            stroke=INK,
            stroke_width=1.2,
            stroke_linejoin="round",
            class_=f"wire {wire.role} {'power' if wire.power else 'state'}",
        )
        if not wire.power:
            line.args["stroke-dasharray"] = "1.5 3" if wire.role == "link" else "4 3"
        line.append_title(wire.title)
        drawing.append(line)
    for box in all_boxes(placement):
        group = svg.Group(class_=f"box {box.kind}" if box.path else f"legend {box.kind}")
        if box.path:
            group.append_title(title(box.path, box.kind))
        x, y = _rounded(box.at)
        rim = RIMS[box.kind]
        group.append(svg.Circle(x, y, round(box.radius, 2), fill=FILLS[box.kind], stroke=rim, stroke_width=1.3))
        for start, end in box.hatching:
            group.append(svg.Line(*_rounded(start), *_rounded(end), stroke=rim, stroke_width=0.6, opacity=0.55))
        for text in box.lines:
            group.append(_text(text, INK, halo=FILLS[box.kind] if box.hatching else ""))
        drawing.append(group)
    for junction in placement.junctions:
        group = svg.Group(class_="junction")
        group.append_title(junction.path)
        group.append(svg.Circle(*_rounded(junction.at), junction.radius, fill=INK))
        group.append(_text(junction.label, INK, halo=PAPER))
        drawing.append(group)
    for wire in placement.wires:
        if wire.label is not None:
            drawing.append(_text(wire.label, GREY, halo=PAPER))
    for _, word in placement.legend:
        drawing.append(_text(word, GREY))
    text = drawing.as_svg()
    if text is None:  # as_svg() returns text unless it is given a file to write to
        return ""
    return text


def _rounded(point: Point) -> Point:
    return (round(point[0], 2), round(point[1], 2))


def _path(points: tuple[Point, ...]) -> str:
    return "M" + " L".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _text(text: Lettering, colour: str, *, halo: str = ""):  # type: ignore[no-untyped-def]
    import drawsvg as svg

    x, y = text.at
    style = {"stroke": halo, "stroke_width": 2.5, "stroke_linejoin": "round", "paint_order": "stroke"} if halo else {}
    # A shift by a third of the type size replaces a central baseline, which some programs lack.
    drawn = svg.Text(
        text.base if not text.sub else "",
        round(text.size, 2),
        round(x, 2),
        round(y + 0.35 * text.size, 2),
        text_anchor="middle",
        fill=colour,
        **style,
    )
    if text.sub:
        drawn.append(svg.TSpan(text.base))
        drawn.append(svg.TSpan(text.sub, font_size=round(0.72 * text.size, 2), dy=round(0.22 * text.size, 2)))
    return drawn
