"""What a benchmark gives back: a table for readers and its numbers for programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

__all__ = ["Report", "exponent", "table_of"]


@final
@dataclass(frozen=True, slots=True)
class Report:
    """A Markdown table, and one mapping for each of its rows."""

    text: str
    rows: Sequence[Mapping[str, Any]]


def table_of(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, tuple[str, float]]) -> str:
    """Rows as Markdown.

    Parameters
    ----------
    columns
        Title -> (key of a row, factor by which its number is multiplied).
    """
    lines = ["| " + " | ".join(columns) + " |", "| --- " * len(columns) + "|"]
    lines += ["| " + " | ".join(_shown(row.get(key), scale) for key, scale in columns.values()) + " |" for row in rows]
    return "\n".join(lines)


def _shown(value: Any, scale: float) -> str:
    if value is None:
        return "–"
    return f"{scale * value:.3g}" if isinstance(value, float) or scale != 1.0 else str(value)


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Slope of log(value) over log(size), by least squares; nan from fewer than two points."""
    if len(sizes) < 2:
        return float("nan")
    return float(np.polyfit(np.log(np.asarray(sizes, dtype=float)), np.log(np.asarray(values, dtype=float)), 1)[0])
