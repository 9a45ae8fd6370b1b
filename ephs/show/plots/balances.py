"""The balances of a run in sentences, and the exergy flow as bars."""

import html
from typing import Any

import numpy as np

from ephs.show.plots.flows import ExergyBand, exergy_bands
from ephs.show.plots.panels import entropy_panels

_VERBS = {("storage", True): "gives", ("storage", False): "takes", ("destroyed", False): "destroys"}


def balances(sol: Any, summary: dict[str, Any]) -> str:
    """HTML of the balances of energy, exergy and entropy, and of the constraints of a scene."""
    heat, work = float(sol.heat[-1] - sol.heat[0]), float(sol.work[-1] - sol.work[0])
    energy = np.asarray(sol.energy, dtype=float)
    stored = float(energy[-1] - energy[0])
    exergy = np.asarray(sol.exergy, dtype=float)
    entropy = np.asarray(sol.entropy, dtype=float)
    least = float(np.min(entropy_panels(sol)[1].curves[0].values, initial=np.inf))
    bands = exergy_bands(sol)
    destroyed = sum(band.amount for band in bands if band.kind == "destroyed" and not band.source)
    sentences = {
        "Energy": f"Drives and inputs did {number(work)} J of work; friction and damping made {number(heat)} "
        f"J of heat; the energy of the whole, heat included, changed by {number(stored)} J. The balance closes to "
        f"{number(float(np.abs(sol.energy_error).max()))} of the energy turned over.",
        "Exergy": f"The exergy of the whole changed by {number(float(exergy[-1] - exergy[0]))} J; "
        f"{number(destroyed)} J were destroyed.",
        "Entropy": f"The entropy grew by {number(float(entropy[-1] - entropy[0]))} J/K. No component produced less "
        f"than {number(least)} J/K in a step.",
    }
    if summary.get("max_constraint_error") is not None and sol.freedoms:
        residual = number(float(summary["max_constraint_error"]))
        sentences["Constraints"] = f"Joints hold to {residual} (m, rad) in position."
    words = "".join(f"<p><strong>{title}.</strong> {text}</p>" for title, text in sentences.items())
    return f"<h2>Balances</h2>{words}{_flow(bands)}"


def number(value: float) -> str:
    """Four figures for reading."""
    return f"{value:.4g}".replace("e-0", "e-").replace("-", "−")


def _flow(bands: list[ExergyBand]) -> str:
    total = sum(band.amount for band in bands if band.source)
    if not total > 0.0:
        return ""
    rows = [_bar(band, total) for band in sorted(bands, key=lambda band: not band.source)]
    return f'<p>Sources and sinks of exergy, {number(total)} J in all:</p><div class="flow">{"".join(rows)}</div>'


def _bar(band: ExergyBand, total: float) -> str:
    share = band.amount / total
    verb = _VERBS.get((band.kind, band.source), "")
    bar = f'<div><span style="display:block;width:{100.0 * share:.2f}%;background:{band.colour}"></span></div>'
    return f"<div>{html.escape(band.name)} {verb}</div>{bar}<div>{number(band.amount)} J ({100.0 * share:.1f} %)</div>"
