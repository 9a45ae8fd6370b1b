"""The figures of measurements, and their data as CSV and JSON beside them."""

import csv
import json
import math
import textwrap
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.methods.registry import METHODS
from ephs.show.charts.families import Family
from ephs.show.charts.measure import Point
from ephs.show.charts.outcomes import SILENT, ChartOutcome
from ephs.show.charts.reasons import Key, Reason, letter_of, reasons, reasons_table
from ephs.show.charts.runs import RunEnding, RunSetting
from ephs.show.charts.stability import Cell
from ephs.show.plots.curves import styled
from ephs.show.shared.figures import new_figure, plain
from ephs.show.shared.palette import BLACK, BLUE, GREEN, GREY, INK, ORANGE, PURPLE, RED, SKY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = (BLUE, SKY, GREEN, ORANGE, RED, PURPLE, BLACK, "#8c6d1f")
_PEER_COLOURS = ("#6b7280", "#9aa3af", "#4b5563", "#b8bec7")
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "h")
_PEER_MARKERS = ("<", ">", "p", "d")
_FILLS = {
    ChartOutcome.RIGHT: GREEN,
    ChartOutcome.WRONG_BUT_BOUNDED: "#f0e442",
    ChartOutcome.ENERGY_DRIFT: PURPLE,
    ChartOutcome.DAMPED: SKY,
    ChartOutcome.REFUSED: "#d1d5db",
    ChartOutcome.SLOW: "#f3f4f6",
    ChartOutcome.DIVERGED: RED,
    ChartOutcome.FLAGGED: ORANGE,
    ChartOutcome.UNKNOWN: "#ffffff",
}
_SIGNS = {
    ChartOutcome.WRONG_BUT_BOUNDED: "wrong",
    ChartOutcome.ENERGY_DRIFT: "drift",
    ChartOutcome.DAMPED: "damped",
    ChartOutcome.REFUSED: "–",
    ChartOutcome.SLOW: "slow",
    ChartOutcome.DIVERGED: "diverged",
    ChartOutcome.FLAGGED: "flagged",
    ChartOutcome.UNKNOWN: "?",
}
_DPI = 150
_DEFECTS = (1e-16, 1e-2)
"""Defects of energy from the lightest colour to the darkest."""
_UNKNOWN = "#d1d5db"
_MARKED: dict[str, dict[str, Any]] = {
    "floor": {"color": INK, "marker": "x", "markersize": 4.0},
    "flagged": {"color": RED, "marker": "o", "markersize": 9.0, "markerfacecolor": "none"},
}
"""Looks of marks on points, by the field of `Point` that they show."""
_MEANINGS = {"floor": "near the reference's own error", "flagged": "refused by the audit"}
_EMPTY = (1e-6, 1.0)
"""Limits of logarithmic axes without curves."""
_LINE = 0.13
"""Height of a line of the reasons, in inches."""
_Reasons = Mapping[Key, Reason]


def draw_work_precision(points: Sequence[Point], title: str, folder: Path, name: str) -> list[Path]:
    """Error against time, evaluations, and the tolerance asked for; and against time, coloured by the defect of energy.

    Written as PNG, SVG, CSV and JSON of this name. Methods over tolerances have filled marks and full lines, over steps
    hollow marks and dashed lines; runs that their audit refuses are ringed. Failed runs
    are counted at the right edge, their reasons are listed below.
    """
    series: dict[tuple[str, str], list[Point]] = {}
    for point in points:
        series.setdefault((point.method, point.setting.kind), []).append(point)
    with styled():
        figure = new_figure(12.0, 9.6)
        (left, middle), (right, lawful) = figure.subplots(2, 2, sharey=True)
        panels = (
            (left, "seconds", "time [s]"),
            (middle, "evaluations", "evaluations, iterations"),
            (right, "tolerance", "tolerance asked for"),
        )
        for axes, key, label in panels:
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlabel(label)
            for (method, kind), found in series.items():
                _curve(axes, method, kind, found, key)
        asked = [point.tolerance for point in points if point.tolerance > 0.0]
        if asked:
            right.plot([min(asked), max(asked)], [min(asked), max(asked)], color=GREY, linewidth=0.8, zorder=0.5)
            right.invert_xaxis()
        _defects(lawful, series)
        if not left.has_data():  # all runs failed: logarithmic axes need limits
            for axes in (left, middle, right, lawful):
                axes.set(xlim=_EMPTY, ylim=_EMPTY)
        left.set_ylabel("error at the end [m, 1]")
        right.set_ylabel("error at the end [m, 1]")
        left.set_title(plain(title, 90), loc="left")
        found = reasons(points)
        _failures(right, series, found)
        handles, labels = left.get_legend_handles_labels()
        extra, said = middle.get_legend_handles_labels()
        more = [(h, text) for h, text in zip(extra, said, strict=True) if text not in labels]
        handles, labels = [*handles, *(h for h, _ in more)], [*labels, *(text for _, text in more)]
        for field, look in _MARKED.items():
            if any(getattr(point, field) for point in points):
                from matplotlib.lines import Line2D

                handles.append(Line2D([], [], linestyle="none", **look))
                labels.append(_MEANINGS[field])
        for handle, label in zip(handles, labels, strict=True):
            handle.set_label(label)
        _legend(figure, handles, 6, found, 150)
    return [*_save(figure, folder, name), *_write_data([_flat(point) for point in points], folder, name)]


def draw_stability(cells: Sequence[Cell], family: Family, folder: Path, name: str) -> list[Path]:
    """A matrix of outcomes: rows are methods with their settings, columns the family's values.

    A cell has the error of an accurate run, or another outcome, with the letter of its reason, which is listed below
    the matrix; whole messages are in the data.
    """
    from matplotlib.patches import Patch, Rectangle

    values = list(dict.fromkeys(cell.value for cell in cells))
    rows = list(dict.fromkeys(_row(cell, family) for cell in cells))
    found = reasons(cells)
    with styled():
        width = 2.6 + 1.15 * max(len(values), 4)
        figure = new_figure(width, 1.7 + 0.23 * len(rows) + _LINE * len(_lines(found, int(15 * width))))
        axes = figure.subplots()
        for cell in cells:
            x, y = values.index(cell.value), rows.index(_row(cell, family))
            axes.add_patch(Rectangle((x, y), 1, 1, facecolor=_FILLS[cell.outcome], edgecolor="white", linewidth=1.2))
            dark = cell.outcome in (ChartOutcome.RIGHT, ChartOutcome.DIVERGED)
            axes.text(
                x + 0.5,
                y + 0.5,
                _cell_text(cell, family, found),
                ha="center",
                va="center",
                color="white" if dark else INK,
                size=7.5,
            )
        axes.set_xlim(0, len(values))
        axes.set_ylim(len(rows), 0)
        axes.set_xticks([i + 0.5 for i in range(len(values))], [family.label(value) for value in values])
        axes.set_yticks(
            [i + 0.5 for i in range(len(rows))], [" ".join(filter(None, row)) for row in rows], fontsize=8.0
        )
        for text, (method, _) in zip(axes.get_yticklabels(), rows, strict=True):
            text.set_fontweight("bold" if method in family.recommended else "normal")
        for before, row, after in zip(range(len(rows)), rows, rows[1:], strict=False):
            if row[0] != after[0]:
                axes.axhline(before + 1, color=GREY, linewidth=0.8)
        axes.grid(visible=False)
        axes.tick_params(length=0)
        for side in axes.spines.values():
            side.set_visible(False)
        unit = "" if family.unit == "1" else f" [{family.unit}]"
        axes.set_xlabel(f"{family.parameter}{unit}")
        axes.set_title(f"{family.name}: {family.summary}", loc="left", fontsize=9.0, wrap=True)
        seen = {cell.outcome for cell in cells}
        patches = [
            Patch(facecolor=fill, edgecolor=GREY, linewidth=0.5, label=outcome.value)
            for outcome, fill in _FILLS.items()
            if outcome in seen
        ]
        patches.append(Patch(alpha=0.0, label="bold: recommended here"))
        _legend(figure, patches, 4, found, int(15 * width))
    return _save(figure, folder, name)


def _write_data(rows: Sequence[Mapping[str, Any]], folder: Path, name: str) -> list[Path]:
    """The same rows as CSV and as JSON, NaN as null."""
    table, data = folder / f"{name}.csv", folder / f"{name}.json"
    with table.open("w", encoding="utf-8", newline="") as stream:
        if rows:
            writer = csv.DictWriter(stream, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    clean = [{key: _number(value) for key, value in row.items()} for row in rows]
    data.write_text(json.dumps(clean, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return [table, data]


def write_cells(cells: Sequence[Cell], folder: Path, name: str) -> list[Path]:
    """The data of matrices, and as Markdown tables the cells of each method by outcome, and the reasons."""
    table = folder / f"{name}.md"
    tables = filter(None, [counts_table(cells), reasons_table([*reasons(cells).values()])])
    table.write_text("\n".join(tables), encoding="utf-8")
    return [*_write_data([_flat(cell) for cell in cells], folder, name), table]


def counts_table(cells: Sequence[Cell]) -> str:
    """Cells of each method by outcome, in Markdown; silently wrong ones in one column."""
    columns = {
        "right": {ChartOutcome.RIGHT},
        "refused or failed, with a message": {ChartOutcome.REFUSED},
        "flagged by the audit": {ChartOutcome.FLAGGED},
        "silently wrong": SILENT,
        "took too long": {ChartOutcome.SLOW},
        "no reference": {ChartOutcome.UNKNOWN},
    }
    methods = list(dict.fromkeys(cell.method for cell in cells))
    rows = [["method", *columns], ["---"] * (1 + len(columns))]
    for method in [*methods, None]:
        own = [cell.outcome for cell in cells if method in (None, cell.method) and (method or cell.method in METHODS)]
        rows.append([method or "all methods", *(str(sum(o in kinds for o in own)) for kinds in columns.values())])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n"


def _number(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _flat(record: Point | Cell) -> dict[str, Any]:
    """A record as one row, its setting as two entries."""
    row: dict[str, Any] = {}
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, RunSetting):
            row |= {"control": value.kind, "setting": value.value}
        else:
            row[field.name] = str(value) if isinstance(value, ChartOutcome | RunEnding) else value
    return row


def _line_style(method: str) -> tuple[str, str]:
    """One colour and one marker a method, the same in every figure."""
    if method in METHODS:
        at = list(METHODS).index(method)
        return _COLOURS[at % len(_COLOURS)], _MARKERS[(at + at // len(_COLOURS)) % len(_MARKERS)]
    at = zlib.crc32(method.encode())  # another program's, whose names this room does not know
    return _PEER_COLOURS[at % len(_PEER_COLOURS)], _PEER_MARKERS[at // len(_PEER_COLOURS) % len(_PEER_MARKERS)]


def _look(method: str, kind: str) -> dict[str, Any]:
    """The look of a method's marks; those of constant steps are hollow."""
    colour, marker = _line_style(method)
    face = "white" if kind == "step" else colour
    return {"color": colour, "marker": marker, "markersize": 5.0, "markerfacecolor": face}


def _curve(axes: "Axes", method: str, kind: str, points: Sequence[Point], key: str) -> None:
    done = [p for p in points if p.outcome is RunEnding.DONE and getattr(p, key) > 0 and p.error > 0.0]
    if not done:
        return
    x, y = [getattr(p, key) for p in done], [p.error for p in done]
    hollow = kind == "step"
    axes.plot(
        x,
        y,
        **_look(method, kind),
        linestyle="--" if hollow else "-",
        linewidth=1.1,
        label=f"{method}{', steps' if hollow and _both(method) else ''}",
    )
    for field, look in _MARKED.items():
        those = [p for p in done if getattr(p, field)]
        axes.plot([getattr(p, key) for p in those], [p.error for p in those], linestyle="none", **look)


def _defects(axes: "Axes", series: Mapping[tuple[str, str], Sequence[Point]]) -> None:
    """Error against time, marks filled by the defect of the balance of energy, grey where unknown."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    shade: Any = ScalarMappable(LogNorm(*_DEFECTS, clip=True), "viridis_r")
    for (method, _), found in series.items():
        done = [p for p in found if p.outcome is RunEnding.DONE and p.error > 0.0]
        fills = [shade.to_rgba(max(p.defect, _DEFECTS[0])) if math.isfinite(p.defect) else _UNKNOWN for p in done]
        x, y = [p.seconds for p in done], [p.error for p in done]
        axes.plot(x, y, color=GREY, linewidth=0.5, zorder=1.0)
        axes.scatter(x, y, c=fills, marker=_line_style(method)[1], s=26.0, edgecolors=INK, linewidths=0.3, zorder=2.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time [s]")
    bar = axes.figure.colorbar(shade, ax=axes, pad=0.02)
    bar.set_label("defect of energy, relative to what is turned over")


def _both(method: str) -> bool:
    found = METHODS.get(method)
    return found is not None and found.adaptive and found.fixed


def _failures(axes: "Axes", series: Mapping[tuple[str, str], Sequence[Point]], found: _Reasons) -> None:
    """At the right edge, one row a series: the number of its failed runs, with the letters of the reasons."""
    failed = {key: [p for p in points if p.outcome is not RunEnding.DONE] for key, points in series.items()}
    failed = {key: points for key, points in failed.items() if points}
    if not failed:
        return
    axes.text(1.06, 1.0, "failed", transform=axes.transAxes, fontsize=8.0, color=GREY, va="bottom")
    for row, ((method, kind), points) in enumerate(failed.items()):
        y = 0.96 - 0.045 * row
        axes.plot(
            [1.05],
            [y],
            transform=axes.transAxes,
            clip_on=False,
            linestyle="none",
            **_look(method, kind),
        )
        ways = {p.outcome for p in points}
        how = next(iter(ways)).value if len(ways) == 1 else "failed"
        letters = ", ".join(filter(None, dict.fromkeys(letter_of(p, found) for p in points)))
        text = f"{method}, {'steps' if kind == 'step' else 'tol'}: {len(points)} {how}{letters and f' ({letters})'}"
        axes.text(1.08, y, text, transform=axes.transAxes, fontsize=7.0, va="center", color=INK)


def _row(cell: Cell, family: Family) -> tuple[str, str]:
    """Method and setting; where the step is the column, it is not in the row."""
    by_step = family.role == "step" and cell.setting.kind == "step"
    return cell.method, "" if by_step else str(cell.setting)


def _cell_text(cell: Cell, family: Family, found: _Reasons) -> str:
    if family.name == "chaos" and np.isfinite(cell.horizon):
        return f"{cell.horizon:.3g} s"
    if cell.outcome is ChartOutcome.RIGHT:
        return "0" if cell.error == 0.0 else f"{cell.error:.0e}".replace("e-0", "e-")
    return f"{_SIGNS[cell.outcome]} {letter_of(cell, found)}".rstrip()


def _lines(found: _Reasons, width: int) -> list[str]:
    """Reasons as lines of at most ``width`` characters."""
    texts = (str(each) for each in found.values())
    return [line for text in texts for line in textwrap.wrap(text, width, subsequent_indent="     ")]


def _legend(figure: "Figure", handles: Sequence[Any], columns: int, found: _Reasons, width: int) -> None:
    """The figure's legend below its panels, headed by the reasons."""
    text = "\n".join(plain(line, width + 10) for line in _lines(found, width))
    heading: Any = {"title": f"{text}\n", "title_fontproperties": {"size": 7.0}, "alignment": "left"} if text else {}
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=8.0, **heading)


def _save(figure: "Figure", folder: Path, name: str) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}.png", folder / f"{name}.svg"]
    for file in files:
        figure.savefig(file, dpi=_DPI)
    return files
