"""Colours, one meaning each, distinguishable by colour-blind readers (Okabe and Ito)."""

from typing import Any

INK = "#1a1a1a"
GREY = "#6b7280"
PAPER = "#ffffff"

FILLS = {
    "storage": "#a9cff0",
    "environment": "#a9cff0",
    "reversible": "#b5e0b0",
    "irreversible": "#f4a9a0",
    "composite": "#fbe79a",
    "unknown": "#ffffff",
}
RIMS = {
    "storage": "#1f5f99",
    "environment": "#1f5f99",
    "reversible": "#2f7d32",
    "irreversible": "#b3261e",
    "composite": "#a07700",
    "unknown": "#444444",
}
OPENED, HATCHED = "#fef7dc", "#5d91c0"
"""Ground of opened composites, and chords across environments."""

BLUE, ORANGE, GREEN, RED = "#0072b2", "#e69f00", "#009e73", "#d55e00"
PURPLE, SKY, BLACK = "#cc79a7", "#56b4e9", "#000000"
CYCLE = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)

_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.2, 1.2, 1.2)), (0, (9, 2)))


def dashes(index: int) -> Any:
    """The dashing of a line: with the colours of `CYCLE`, no two of the first 35 lines are drawn alike, nor in grey."""
    return _DASHES[index % len(_DASHES)]
