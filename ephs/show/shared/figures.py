"""Figures without a window, displayed by notebooks."""

import io
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure of this size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = _kind()(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain(words: str, most: int = 36) -> str:
    """A model's text for a figure: dollar signs are escaped, long names abbreviated."""
    short = words if len(words) <= most else f"{words[: most - 15]}…{words[-14:]}"
    return short.replace("$", r"\$")


@cache
def _kind() -> Any:
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure that notebooks show as a picture also where no drawing backend was chosen."""

        def _repr_png_(self) -> bytes:  # pyright: ignore[reportUnusedFunction] - notebooks call it
            stream = io.BytesIO()
            self.savefig(stream, format="png", dpi=110)
            return stream.getvalue()

    return Shown
