"""Texts of a pattern's picture: the legend of kinds, and explanations of names of the literature."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from ephs.show.diagrams.geometry import Lettering, PlacedBox, Point, hatching
from ephs.show.diagrams.graph import width_of

WORDS: Mapping[str, str] = MappingProxyType(
    {
        "storage": "storage",
        "environment": "environment",
        "reversible": "reversible",
        "irreversible": "irreversible",
        "composite": "subsystem",
    }
)
"""Kinds in the legend, in its order."""

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "pe": "potential energy",
        "ke": "kinetic energy",
        "pkc": "coupling of potential and kinetic energy",
        "lp": "Lie–Poisson structure, the gyroscopic terms",
        "hc": "holonomic constraint",
        "o": "offset from the centre of mass to the joint",
        "mf": "mechanical friction",
        "st": "stretch, the lengthening that a rate makes",
        "tc": "thermal capacity",
        "ht": "heat transfer",
        "env": "environment",
        "osc": "oscillator",
    }
)
"""Names of boxes in the literature, without subscripts."""

TYPE, RADIUS, PITCH, GAP = 7.5, 4.5, 14.0, 10.0
"""Size of the type, radius of a disc, distance of rows and of entries, in points."""


def legend(kinds: Iterable[str], start: Point, width: float) -> tuple[tuple[PlacedBox, Lettering], ...]:
    """Discs and words of the occurring kinds, in rows from `start` downwards, at most `width` wide where words fit."""
    found, entries = frozenset(kinds), []
    x, y = start[0], start[1] + PITCH / 2
    for kind, word in WORDS.items():
        if kind not in found:
            continue
        wide = width_of(word, "", TYPE)
        if x > start[0] and x + 2 * RADIUS + 3.0 + wide > start[0] + width:
            x, y = start[0], y + PITCH
        centre = (x + RADIUS, y)
        marks = hatching(centre, RADIUS, 2.5) if kind == "environment" else ()
        middle = x + 2 * RADIUS + 3.0 + wide / 2
        entries.append((PlacedBox("", kind, centre, RADIUS, (), marks), Lettering(word, "", (middle, y), TYPE, wide)))
        x += 2 * RADIUS + 3.0 + wide + GAP
    return tuple(entries)


def title(path: str, kind: str) -> str:
    """Full path of a box, its kind, and the meaning of its name in the literature."""
    symbol = path.rpartition(".")[2].partition("_")[0]
    said = f"{path} ({kind})" if kind != "unknown" else path
    return f"{said}: {SYMBOLS[symbol]}" if symbol in SYMBOLS else said
