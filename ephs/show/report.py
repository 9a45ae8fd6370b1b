"""One page about one run: figures in words, the pattern, the plots, the motion. It needs no network."""

import html
import io
import re
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from ephs.show.animation import animate
from ephs.show.drawing import draw
from ephs.show.flows import plot_exergy_flow
from ephs.show.plots import plot_constraints, plot_energy, plot_entropy, plot_exergy, plot_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
_PLOTS = (
    ("Motion", plot_motion),
    ("Energy", plot_energy),
    ("Exergy", plot_exergy),
    ("Where exergy went", plot_exergy_flow),
    ("Entropy", plot_entropy),
    ("Constraints", plot_constraints),
)
_STYLE = """
:root{color-scheme:light}
body{margin:0 auto;max-width:60rem;padding:2.5rem 1.5rem 4rem;background:#fff;color:#1a1a1a;
 font:16px/1.55 Charter,'Bitstream Charter','Source Serif 4',Georgia,serif}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 .3rem}
h2{font-size:1.2rem;margin:2.6rem 0 .8rem;padding-top:.7rem;border-top:1px solid #dfe3e8}
p.lead{color:#6b7280;margin:0 0 1.6rem}
table{border-collapse:collapse;font-size:.94rem;font-variant-numeric:tabular-nums}
th,td{padding:.22rem 1.4rem .22rem 0;text-align:left;vertical-align:baseline;border-bottom:1px solid #eef0f3}
th{font-weight:normal;color:#4b5563}
thead th{font-weight:600;color:#1a1a1a}
.wide{overflow-x:auto}
figure{margin:0 0 1.6rem}
svg{max-width:100%;height:auto}
@media print{iframe{display:none}}
"""


def write_report(sol: Any, directory: str | FilePath) -> FilePath:
    """Write ``report.html`` about a solution into a folder, which is made if need be.

    The page holds everything in itself: the summary with units, the pattern's picture, plots of motion, energy, exergy,
    entropy and constraint residuals and, for a scene, the animation.

    Returns
    -------
    Path
        Of the page.
    """
    folder = FilePath(directory)
    folder.mkdir(parents=True, exist_ok=True)
    summary: dict[str, Any] = sol.summary()
    sections = [_summary(summary), _final(summary), _pattern(sol), _animation(sol), *_plots(sol)]
    name = html.escape(str(sol.name))
    page = "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            f'<head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{name}</title>',
            f'<link rel="icon" href="data:,"><style>{_STYLE}</style></head>',
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
    # Four figures are for reading; the whole numbers are in summary.json.
    return f"{float(value):.4g}".replace("e-0", "e-").replace("-", "−")


def _settled(value: Any) -> Any:
    """Rounding that stands where nothing moves, in m, rad and their rates, is shown as what it is."""
    if isinstance(value, list | tuple):
        return [_settled(each) for each in value]
    return 0 if isinstance(value, float) and abs(value) < 1e-12 else value


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
    return f"<h2>Summary</h2><table><tbody>{''.join(rows)}</tbody></table>{_audit(summary)}"


def _audit(summary: dict[str, Any]) -> str:
    findings: list[dict[str, Any]] = summary.get("audit", {}).get("findings", [])
    if not findings:
        return ""
    rows = "".join(
        f"<tr><th>{html.escape(found['law'])}</th><td>{_number(found['size'])}</td><td>{_number(found['allowed'])}</td>"
        f"<td>{_number(found['at'])}</td><td>{html.escape(found['path'])}</td><td>{html.escape(found['advice'])}</td></tr>"
        for found in findings
    )
    head = "".join(f"<th>{words}</th>" for words in ("law", "found", "allowed", "at [s]", "where", "what to do"))
    return (
        "<h2>The result does not pass its audit</h2>"
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _final(summary: dict[str, Any]) -> str:
    tables: list[str] = []
    for group in ("bodies", "joints", "thermal"):
        entries: dict[str, dict[str, Any]] = summary.get(group) or {}
        if not entries:
            continue
        fields = [(key, words) for kind, key, words in _FINAL if kind == group]
        head = "".join(f"<th>{words}</th>" for _, words in fields)
        rows = "".join(
            "<tr><th>"
            + html.escape(name)
            + "</th>"
            + "".join(f"<td>{_number(_settled(entry.get(key)))}</td>" for key, _ in fields)
            + "</tr>"
            for name, entry in entries.items()
        )
        tables.append(
            f'<div class="wide"><table><thead><tr><th>{group}</th>{head}</tr></thead>'
            f"<tbody>{rows}</tbody></table></div>"
        )
    return f"<h2>At the end</h2>{'<p></p>'.join(tables)}" if tables else ""


def _pattern(sol: Any) -> str:
    if sol.system is None:
        return ""
    picture = _inline(draw(sol.system).svg)
    return f"<h2>Interconnection pattern</h2><figure>{picture}</figure>"


def _animation(sol: Any) -> str:
    if sol.scene is None:
        return ""
    if find_spec("viser") is None:
        return (
            "<h2>Animation</h2><p>There is no animation here, because the package viser is not installed; "
            "install it with <code>pip install 'ephs[viz]'</code> and write the report again.</p>"
        )
    return f"<h2>Animation</h2>{animate(sol, heat=any(True for _ in sol.scene.all_thermal())).frame()}"


def _plots(sol: Any) -> list[str]:
    return [f"<h2>{title}</h2><figure>{_svg(plot(sol), title)}</figure>" for title, plot in _PLOTS]


def _svg(figure: "Figure", salt: str) -> str:
    from matplotlib import rc_context

    stream = io.StringIO()
    # The salt makes the ids of each plot its own, and the same at every writing.
    with rc_context({"svg.hashsalt": f"ephs {salt}", "svg.fonttype": "path"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return _inline(stream.getvalue())


def _inline(picture: str) -> str:
    """An SVG file's text without its prologue and metadata, which a page has no use for."""
    element = picture[picture.index("<svg") :]
    return re.sub(r"<metadata>.*?</metadata>", "", element, flags=re.DOTALL)
