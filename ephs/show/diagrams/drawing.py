"""`draw`: a pattern or system as a picture that shows itself and can be saved."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, final

from ephs.operad import Nesting, Pattern
from ephs.show.diagrams.geometry import Placement, faults
from ephs.show.diagrams.layout import place
from ephs.show.diagrams.png import to_png
from ephs.show.diagrams.svg import to_svg
from ephs.show.diagrams.tikz import to_tikz
from ephs.show.shared.errors import ShowError

if TYPE_CHECKING:
    from ephs.semantics import System


@final
@dataclass(frozen=True, slots=True)
class Drawing:
    """A picture of a pattern, displayed by notebooks."""

    placement: Placement

    @property
    def svg(self) -> str:
        """The picture as the text of an SVG file."""
        return to_svg(self.placement)

    @property
    def tikz(self) -> str:
        """The picture as a LaTeX document."""
        return to_tikz(self.placement)

    @property
    def png(self) -> bytes:
        """The picture as the bytes of a PNG file."""
        return to_png(self.placement)

    @property
    def faults(self) -> list[str]:
        """Faults of the picture, in words; empty for author-placed and for small patterns."""
        return faults(self.placement)

    def save(self, path: str | FilePath) -> FilePath:
        """Write the picture to a file: .svg, .tex or .png, by its name.

        Raises
        ------
        ShowError
            For any other name.
        """
        target = FilePath(path)
        match target.suffix.lower():
            case ".svg":
                target.write_text(self.svg, encoding="utf-8")
            case ".tex":
                target.write_text(self.tikz, encoding="utf-8")
            case ".png":
                target.write_bytes(self.png)
            case _:
                raise ShowError("suffix", found=target.name)
        return target

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        shape = self.placement
        return f"<Drawing of {len(shape.boxes)} boxes, {len(shape.junctions)} junctions, {len(shape.wires)} wires>"


def draw(
    source: "Pattern | Nesting | System",
    path: str | FilePath | None = None,
    *,
    kinds: Mapping[str, str] | None = None,
    positions: Mapping[str, tuple[float, float]] | None = None,
    opened: bool = False,
) -> Drawing:
    """Draw a pattern or a system as a syntactic picture.

    Round boxes coloured by kind (storage blue, environment blue and hatched, reversible green, irreversible red,
    composite yellow, unknown white), black dots for junctions, dashed lines for state ports, dotted lines between
    junctions that share their state, and a rounded rectangle for the outer box, to which the outer ports run. A port is
    named at its junction; where its name differs from the junction's, at its box too. Boxes of one kind have one size;
    a legend below names the kinds. In SVG the full path of each box, and what a name of the literature stands for, is
    shown on hover.

    Parameters
    ----------
    source : Pattern, Nesting or System
        What to draw, the outermost level of it; flatten it first to see all.
    path : str or Path, optional
        Where to save the picture: .svg, .tex or .png.
    kinds : mapping of str to str, optional
        Kind of each box, by path, where the system does not say it.
    positions : mapping of str to (float, float), optional
        Points for all boxes, and junctions if wanted, in steps of a grid, y upwards. By default they are found.
    opened : bool
        Whether composites are opened by one level.

    Raises
    ------
    ShowError
        For an unknown kind, positions that do not fit the pattern, or a file name that does not say its format.
    """
    drawing = Drawing(place(source, kinds=kinds, positions=positions, opened=opened))
    if path is not None:
        drawing.save(path)
    return drawing
