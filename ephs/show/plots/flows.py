"""Flow diagram of exergy between two instants."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ephs.show.plots.curves import styled
from ephs.show.shared.figures import new_figure, plain
from ephs.show.shared.palette import BLUE, GREEN, GREY, ORANGE, RED, SKY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST = 5e-3
"""Bands below this fraction of the turnover are drawn as one."""
GAP, SLOT = 0.02, 0.05
"""Between bands at the edge, and the least room that a band and its name get there, of the height of all."""


_COLOURS = {"storage": (BLUE, SKY), "destroyed": (RED, RED), "boundary": (ORANGE, GREEN)}
"""Colours of sources and of sinks."""


class ExergyBand(NamedTuple):
    """A source (from the left) or a sink (to the right) of exergy, in J."""

    name: str
    amount: float
    source: bool
    kind: str

    @property
    def colour(self) -> str:
        """By what it is of, and its side."""
        return _COLOURS.get(self.kind, (GREY, GREY))[0 if self.source else 1]


def exergy_bands(sol: Any, path: Any = ".") -> list[ExergyBand]:
    """The sources and sinks of a system or subsystem over the run; both sides add up to the same.

    Sources are storages that gave exergy, and supply; sinks are storages that took it, delivery, and destruction. What
    steps made or lost of the whole is the defect, on the side where it counts.
    """
    entry = sol.ledger(path)
    bands: list[ExergyBand] = []

    def change(values: Any) -> float:
        return float(values[-1] - values[0])

    for leaf in _leaves(entry):
        name = str(leaf.path.relative_to(entry.path)) if leaf.path != entry.path else str(leaf.path)
        stored, destroyed = change(leaf.exergy), change(leaf.destroyed)
        if stored:
            bands.append(ExergyBand(name, abs(stored), stored < 0.0, "storage"))
        if destroyed:
            bands.append(ExergyBand(name, abs(destroyed), destroyed < 0.0, "destroyed"))
    supplied = change(entry.exergy_supplied)
    if supplied:
        bands.append(
            ExergyBand("supplied" if supplied > 0.0 else "delivered", abs(supplied), supplied > 0.0, "boundary")
        )
    defect = change(entry.exergy_defect)
    if defect:
        bands.append(ExergyBand("defect of the steps", abs(defect), defect > 0.0, "defect"))
    return _merged(bands)


def plot_exergy_flow(sol: Any, path: Any = ".") -> "Figure":
    """A Sankey diagram: sources of exergy on the left, sinks and destruction on the right, widths in J."""
    bands = exergy_bands(sol, path)
    total = sum(band.amount for band in bands if band.source)
    with styled():
        most = max(sum(band.source for band in bands), sum(not band.source for band in bands), 1)
        figure = new_figure(7.2, 1.6 + 0.26 * most)
        axes = figure.subplots()
        axes.set_axis_off()
        axes.set_xlim(-1.05, 2.05)
        if total > 0.0:
            for source in (True, False):
                _side(axes, [band for band in bands if band.source == source], total, left=source)
            axes.fill_between([0.42, 0.58], 0.0, 1.0, color=GREY, alpha=0.9, linewidth=0.0)
            axes.text(0.5, 0.5, f"{total:.4g} J", rotation=90, ha="center", va="center", color="white")
        else:
            axes.text(0.5, 0.5, "no exergy was turned over", ha="center", va="center")
        where = "" if str(path) == "." else plain(f" in {path}")
        axes.set_title(f"exergy{where}, {sol.t[0]:g} … {sol.t[-1]:g} s", loc="left")
    return figure


def _leaves(entry: Any) -> list[Any]:
    return [leaf for part in entry.parts.values() for leaf in _leaves(part)] if entry.parts else [entry]


def _merged(bands: list[ExergyBand]) -> list[ExergyBand]:
    """Largest first, and the smallest ones together."""
    out: list[ExergyBand] = []
    total = max((sum(b.amount for b in bands if b.source == side) for side in (True, False)), default=0.0)
    for side in (True, False):
        mine = sorted((b for b in bands if b.source == side), key=lambda band: -band.amount)
        small = [b for b in mine if b.amount < SMALLEST * total]
        out += [b for b in mine if b.amount >= SMALLEST * total]
        if len(small) == 1:
            out += small
        elif small:
            out.append(ExergyBand(f"{len(small)} others", sum(b.amount for b in small), side, "others"))
    return out


def _side(axes: "Axes", bands: list[ExergyBand], total: float, *, left: bool) -> None:
    """Bands from the edge to the middle; at the edge they stand apart."""
    slots = [max(band.amount / total, SLOT) for band in bands]
    edge, inner = 0.5 + 0.5 * (sum(slots) + GAP * (len(bands) - 1)), 1.0
    s = np.linspace(0.0, 1.0, 60)
    bend = s * s * (3.0 - 2.0 * s)
    x = (0.42 * s) if left else (1.0 - 0.42 * s)
    for band, slot in zip(bands, slots, strict=True):
        width = band.amount / total
        start = edge - 0.5 * (slot - width)
        top = start + (inner - start) * bend
        axes.fill_between(x, top - width, top, color=band.colour, alpha=0.8, linewidth=0.0)
        verb = {"destroyed": " destroys", "storage": " gives" if left else " takes"}.get(band.kind, "")
        where = (-0.02, "right") if left else (1.02, "left")
        label = f"{plain(band.name, 30)}{verb}  {band.amount:.3g} J ({100.0 * width:.1f} %)"
        axes.text(where[0], edge - 0.5 * slot, label, ha=where[1], va="center")
        edge, inner = edge - slot - GAP, inner - width
