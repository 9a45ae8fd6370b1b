"""Signals of a solution as data of a page: panels by group, thinned and packed."""

import base64
import json
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.show.plots.panels import ROUNDING, Panel
from ephs.show.plots.series import Array

MOST = 2000
"""Instants of a panel without thinning."""
FEW = 6
"""Largest number of initially shown curves of a panel."""


@final
@dataclass(frozen=True, slots=True)
class PanelGroup:
    """Panels under one heading of the list of signals; ``shown``: drawn at first."""

    name: str
    panels: list[Panel]
    shown: bool


def packed(t: Array, groups: list[PanelGroup]) -> str:
    """JSON of the groups, times as 64-bit and values as 32-bit floats in base64.

    Parameters
    ----------
    t : (n,) array
        Instants in s.
    groups : list of Group
        Their curves have values at the last instants of `t`.

    Returns
    -------
    str
        Without ``<``, so that no name ends or changes the script element that holds it.
    """
    out: list[dict[str, Any]] = []
    for group in groups:
        panels = [_panel(t, panel, shown=group.shown) for panel in group.panels if _drawn(panel)]
        if panels:
            out.append({"name": group.name, "open": group.shown, "panels": panels})
    return json.dumps(out, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def _drawn(panel: Panel) -> bool:
    """Residuals of rounding are stated in numbers, not drawn."""
    sizes = [float(np.nanmax(np.abs(curve.values), initial=0.0)) for curve in panel.curves]
    return bool(sizes) and not (panel.residual and max(sizes) < ROUNDING)


def _panel(t: Array, panel: Panel, *, shown: bool) -> dict[str, Any]:
    length = min(len(curve.values) for curve in panel.curves)
    columns = [curve.values[len(curve.values) - length :] for curve in panel.curves]
    kept = _kept(columns, length)
    return {
        "title": panel.title,
        "residual": panel.residual,
        "noise": panel.noise,
        "times": _text(t[len(t) - length :][kept].astype("<f8")),
        "curves": [
            {
                "name": curve.name,
                "colour": curve.colour,
                "shown": shown and k < FEW,
                "values": _text(values[kept].astype("<f4")),
            }
            for k, (curve, values) in enumerate(zip(panel.curves, columns, strict=True))
        ],
    }


def _kept(columns: list[Array], length: int) -> Any:
    """Instants of a panel: evenly spaced ones, extremes of each curve between them, and gaps of lines."""
    if length <= MOST:
        return slice(None)
    edges = np.linspace(0, length, MOST // 2 + 1).astype(int)[:-1]
    found = [edges, np.array([length - 1])]
    stretches = np.linspace(0, length, max(2, MOST // (2 * len(columns)))).astype(int)[:-1]
    for values in columns:
        found.append(np.flatnonzero(np.isnan(values)))
        safe = np.nan_to_num(values)
        found += [np.array(_places(safe, stretches, reduce)) for reduce in (np.argmin, np.argmax)]
    return np.unique(np.concatenate(found))


def _places(values: Array, starts: Array, reduce: Any) -> list[int]:
    ends = [*starts[1:], len(values)]
    return [int(first + reduce(values[first:last])) for first, last in zip(starts, ends, strict=True)]


def _text(values: Array) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
