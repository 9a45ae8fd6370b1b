"""Marks of a placed picture in drawing order: circles, lines and names, gathered by what they stand for."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from ephs.show.diagrams.geometry import Lettering, PlacedBox, Placement, Point
from ephs.show.diagrams.legend import title
from ephs.show.shared.palette import FILLS, GREY, HATCHED, INK, OPENED, PAPER, RIMS

DASHES: Final = {"link": (1.5, 3.0)}
"""Lengths of dashes and gaps in points by the role of lines without power; of other roles `DASHED`."""
DASHED: Final = (4.0, 3.0)


@final
@dataclass(frozen=True, slots=True)
class DiagramMark:
    """A circle about its only point where it has a radius, else a line.

    `stroke` and `fill` are colours, empty for none; `width` is that of the line.
    """

    points: tuple[Point, ...]
    stroke: str
    width: float
    radius: float = 0.0
    fill: str = ""
    dashes: tuple[float, ...] = ()


@final
@dataclass(frozen=True, slots=True)
class DiagramWord:
    """A name in a colour, with a halo of another where `halo` is not empty."""

    text: Lettering
    colour: str
    halo: str = PAPER


@final
@dataclass(frozen=True, slots=True)
class DiagramPart:
    """Marks and names of one box, junction or wire, with its title and its SVG classes."""

    title: str
    classes: str
    marks: tuple[DiagramMark, ...] = ()
    words: tuple[DiagramWord, ...] = ()


def parts_of(placement: Placement) -> Iterator[DiagramPart]:
    """The parts of a picture without its rectangle, those at the back first."""
    for region in placement.regions:
        circle = DiagramMark((region.at,), RIMS["composite"], 1.3, region.radius, OPENED)
        name = DiagramWord(region.label, RIMS["composite"], "")
        yield DiagramPart(f"{region.path} (composite)", "box composite opened", (circle,), (name,))
    for wire in placement.wires:
        dashes = () if wire.power else DASHES.get(wire.role, DASHED)
        line = DiagramMark(wire.points, INK, 1.2, dashes=dashes)
        yield DiagramPart(wire.title, f"wire {wire.role} {'power' if wire.power else 'state'}", (line,))
    for box in placement.boxes:
        yield _box(box, title(box.path, box.kind), f"box {box.kind}")
    for box, word in placement.legend:
        yield _box(box, "", f"legend {box.kind}", DiagramWord(word, GREY))
    for junction in placement.junctions:
        dot = DiagramMark((junction.at,), "", 0.0, junction.radius, INK)
        yield DiagramPart(junction.path, "junction", (dot,), (DiagramWord(junction.label, INK),))
    names = (wire.label for wire in placement.wires if wire.label is not None)
    yield DiagramPart("", "names", words=tuple(DiagramWord(name, GREY) for name in names))


def _box(box: PlacedBox, said: str, classes: str, *beside: DiagramWord) -> DiagramPart:
    fill = FILLS[box.kind]
    circle = DiagramMark((box.at,), RIMS[box.kind], 1.3, box.radius, fill)
    chords = (DiagramMark(chord, HATCHED, 0.6) for chord in box.hatching)
    words = (DiagramWord(line, INK, fill) for line in box.lines)
    return DiagramPart(said, classes, (circle, *chords), (*words, *beside))
