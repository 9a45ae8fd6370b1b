"""One page about one run: the motion, plots, balances in words, figures, the pattern. It needs no network."""

import html
import re
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ephs.show.diagrams.kept import pattern_svg
from ephs.show.motions.player import player
from ephs.show.motions.sheets import sheets_of
from ephs.show.motions.stage import stage_of
from ephs.show.motions.still import still_svg
from ephs.show.notebook import first_pose
from ephs.show.plots.balances import balances, number
from ephs.show.plots.panels import constraint_panels, energy_panels, entropy_panels, exergy_panels, motion_panels
from ephs.show.plots.signals import PanelGroup, packed
from ephs.show.plots.touching import contact_panels, contact_table
from ephs.show.shared.page import asset, wide_table

ZERO = 1e-12
"""SI number below which a report writes 0."""
_ROWS = (
    ("method", "Method", ""),
    ("form", "Form of the equations", ""),
    ("t_end", "Simulated until", "s"),
    ("steps", "Steps accepted", ""),
    ("rejected", "Steps rejected", ""),
    ("setup_s", "Time to set up", "s"),
    ("integrate_s", "Time to integrate", "s"),
    ("mobility", "Mobility", ""),
    ("redundant_constraints", "Redundant constraints", ""),
    ("max_energy_error", "Largest energy defect, relative", ""),
    ("max_constraint_error", "Largest position residual", "m, rad"),
    ("max_velocity_error", "Largest velocity residual", "m/s, rad/s"),
    ("min_entropy_production", "Least entropy production of a step", "J/K"),
    ("heat", "Heat from friction and damping", "J"),
    ("work", "Work of drives and inputs", "J"),
)
_FINAL = (
    ("bodies", "position", "position [m]"),
    ("bodies", "velocity", "velocity [m/s]"),
    ("joints", "coordinate", "coordinate [rad, m]"),
    ("joints", "rate", "rate [rad/s, m/s]"),
    ("thermal", "temperature", "temperature [K]"),
)


def write_report(sol: Any, directory: str | FilePath) -> FilePath:
    """Write ``report.html`` about a solution into a folder, which is created if missing.

    The page holds everything in itself: for a scene the animation; plots that zoom, show values and follow the
    animation, of signals that are picked from a list; the balances in words; the summary with units; the pattern.

    Returns
    -------
    Path
        Of the page.
    """
    folder = FilePath(directory)
    folder.mkdir(parents=True, exist_ok=True)
    summary: dict[str, Any] = sol.summary()
    sections = [
        _audit(summary),
        _animation(sol),
        _plots(sol),
        balances(sol, summary),
        _summary(summary),
        contact_table(sol),
        _final(summary),
        _schematic(sol),
        _pattern(sol),
    ]
    name = html.escape(str(sol.name))
    page = "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            f'<head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{name}</title>',
            f'<link rel="icon" href="data:,"><style>{asset("report.css")}{asset("uplot.css")}</style></head>',
            f'<body><h1>{name}</h1><p class="lead">{_lead(sol, summary)}</p>',
            *[section for section in sections if section],
            "</body></html>",
            "",
        ]
    )
    target = folder / "report.html"
    target.write_text(page, encoding="utf-8")
    return target


def _lead(sol: Any, summary: dict[str, Any]) -> str:
    span = float(sol.t[-1]) - float(sol.t[0])
    method = html.escape(str(summary.get("method", "")))
    by = f" by the method {method}" if method else ""
    return f"{span:g} s of motion{by}, {len(sol.t)} instants kept."


def _number(value: Any) -> str:
    if value is None or isinstance(value, str):
        return html.escape(str(value if value is not None else "–"))
    if isinstance(value, list | tuple):
        return ", ".join(_number(each) for each in value)
    if isinstance(value, int):
        return str(value)
    return number(float(value))  # the whole numbers are in summary.json


def _settled(value: Any) -> Any:
    """Values in m, rad and their rates below rounding are shown as zero."""
    if isinstance(value, list | tuple):
        return [_settled(each) for each in value]
    return 0 if isinstance(value, float) and abs(value) < ZERO else value


def _summary(summary: dict[str, Any]) -> str:
    rows = [
        f"<tr><th>{words}</th><td>{_number(summary[key])}{f' {unit}' if unit else ''}</td></tr>"
        for key, words, unit in _ROWS
        if key in summary
    ]
    unknowns = summary.get("unknowns")
    if isinstance(unknowns, dict):
        shown = f"{_number(unknowns.get('paper'))} as flattened, {_number(unknowns.get('used'))} used"
        rows.append(f"<tr><th>Unknowns</th><td>{shown}</td></tr>")
    return f"<h2>Summary</h2><table><tbody>{''.join(rows)}</tbody></table>"


def _audit(summary: dict[str, Any]) -> str:
    findings: list[dict[str, Any]] = summary.get("audit", {}).get("findings", [])
    if not findings:
        return ""
    keys = ("law", "size", "allowed", "at", "path", "advice")
    rows = ([_number(found[key]) for key in keys] for found in findings)
    head = ("law", "found", "allowed", "at [s]", "where", "what to do")
    return f"<h2>The result does not pass its audit</h2>{wide_table(head, rows)}"


def _final(summary: dict[str, Any]) -> str:
    tables: list[str] = []
    for group in ("bodies", "joints", "thermal"):
        entries: dict[str, dict[str, Any]] = summary.get(group) or {}
        if not entries:
            continue
        fields = [(key, words) for kind, key, words in _FINAL if kind == group]
        rows = (
            (html.escape(name), *(_number(_settled(entry.get(key))) for key, _ in fields))
            for name, entry in entries.items()
        )
        tables.append(wide_table((group, *(words for _, words in fields)), rows))
    return f"<h2>At the end</h2>{'<p></p>'.join(tables)}" if tables else ""


def _schematic(sol: Any) -> str:
    if sol.outline is None or not len(sol.t):
        return ""
    poses = {name: first_pose(sol.body(name)) for name, _ in sol.outline.all_bodies()}
    return f"<h2>Schematic</h2><figure>{still_svg(sol.outline, poses)}</figure>" if poses else ""


def _pattern(sol: Any) -> str:
    if sol.system is None:
        return ""
    picture = _inline(pattern_svg(sol.system))
    return f"<h2>Interconnection pattern</h2><figure>{picture}</figure>"


def _animation(sol: Any) -> str:
    if sol.outline is None:
        return ""
    warm = any(True for _ in sol.outline.all_thermal())
    bent = any(True for _ in sol.outline.all_beams()) or bool(sheets_of(sol.outline))
    stage = stage_of(sol, colour="temperature" if warm else "energy" if bent else None, fps=30.0, duration=None)
    return f"<h2>Motion</h2>{player(stage, str(sol.name))}"


def _plots(sol: Any) -> str:
    groups = [
        PanelGroup("Motion" if sol.outline is not None else "States", motion_panels(sol), shown=True),
        PanelGroup("Energy", energy_panels(sol), shown=True),
        PanelGroup("Exergy", exergy_panels(sol), shown=False),
        PanelGroup("Entropy", entropy_panels(sol), shown=False),
        PanelGroup("Contacts", contact_panels(sol), shown=False),
        PanelGroup("Constraints", constraint_panels(sol), shown=False),
    ]
    data = packed(np.asarray(sol.t, dtype=float), groups)
    return (
        "<h2>Signals</h2><p>Drag across a plot to zoom into a span of time, double-click to see all of it.</p>"
        '<div id="signals-box"><nav id="picker"><input type="search" id="find" placeholder="find a signal"></nav>'
        '<div id="plots"></div></div>'
        f'<script type="application/json" id="signals">{data}</script>'
        f"<script>{asset('uplot.js')}</script><script>{asset('plots.js')}</script><script>{asset('report.js')}</script>"
    )


def _inline(picture: str) -> str:
    """An SVG file's text without prologue and metadata."""
    element = picture[picture.index("<svg") :]
    return re.sub(r"<metadata>.*?</metadata>", "", element, flags=re.DOTALL)
