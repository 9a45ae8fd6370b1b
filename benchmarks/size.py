"""How the cost of syntax grows: chains and trees of 10² to 10⁵ boxes, nested in various depths, flattened.

Each row is measured in a process of its own, so that its peak memory is its own.
"""

import math
import resource
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.process import run
from benchmarks.report import exponent
from ephs.operad import Nesting, Pattern, junction, quantity

SIZES = (100, 1_000, 10_000, 100_000)
DEPTHS = {"2": 2, "5": 5, "log₂ n": 0}
SHAPES = ("chain", "tree")
LIMIT = 600.0
"""Seconds for a row."""
STEPS = ("nest", "flatten", "normal form", "equality")


def chain(count: int) -> Pattern:
    """So many boxes in a row, with an outer port at either end."""
    names = ["l", *(f"p{k}" for k in range(1, count)), "r"]
    junctions = {name: junction(quantity.momentum, exposed=name in "lr") for name in names}
    return Pattern(junctions, {f"b{k}": {"l": names[k], "r": names[k + 1]} for k in range(count)})


def tree(count: int) -> Pattern:
    """A trunk that bears so many boxes, with an outer port at its root."""
    junctions = {"p": junction(quantity.momentum, exposed=True), "q": junction(quantity.momentum)}
    return Pattern(junctions, {"trunk": {"p": "p", "q": "q"}} | {f"b{k}": {"p": "q"} for k in range(count)})


def nested(shape: str, boxes: int, depth: int) -> Nesting:
    """A nesting of so many levels with about so many boxes when flattened; each level is one shared value."""
    depth = depth or round(math.log2(boxes))
    branch = max(2, round(boxes ** (1 / depth)))
    level = {"chain": chain, "tree": tree}[shape](branch)
    whole = Nesting(level)
    for _ in range(depth - 1):
        whole = Nesting(level, {box: whole for box in level.boxes if str(box) != "trunk"})
    return whole


def _timed(task: Callable[[], object]) -> tuple[float, object]:
    start = time.perf_counter()
    result = task()
    return time.perf_counter() - start, result


def measure(shape: str, boxes: int, depth: int) -> dict[str, float]:
    """Seconds for each step, the least of some repeats, and the peak memory of this process in MB."""
    best = dict.fromkeys(STEPS, math.inf)
    count = ports = 0
    for _ in range(3 if boxes >= 100_000 else 7):
        seconds = {}
        seconds["nest"], whole = _timed(lambda: nested(shape, boxes, depth))
        seconds["flatten"], first = _timed(whole.flatten)
        second = whole.flatten()
        seconds["normal form"], _ = _timed(lambda first=first: first.normal_form)
        second.normal_form  # noqa: B018  # computed once, here
        seconds["equality"], _ = _timed(lambda first=first, second=second: first == second)
        best = {step: min(best[step], seconds[step]) for step in STEPS}
        count, ports = len(first.boxes), sum(len(box.ports) for box in first.boxes.values())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return best | {"boxes": count, "ports": ports, "peak": peak}


def _run(shape: str, boxes: int, depth: int) -> dict[str, float]:
    nothing = dict.fromkeys((*STEPS, "boxes", "ports", "peak"), math.nan)
    return run(f"benchmarks.size:measure({shape!r}, {boxes}, {depth})", LIMIT, nothing)


def _slope(rows: list[dict[str, float]], step: str) -> float:
    """Slope of log(seconds) over log(ports) from 10³ boxes on."""
    large = [row for row in rows if row["boxes"] > 500]
    return exponent([row["ports"] for row in large], [row[step] for row in large])


def table(out: Path | None = None) -> str:
    """Measure all, and draw the chart if a folder is given; a Markdown table."""
    lines = ["| shape | levels | boxes | ports | " + " | ".join(f"{step} [s]" for step in STEPS) + " | peak [MB] |"]
    lines.append("| --- " * (len(STEPS) + 5) + "|")
    series: dict[str, list[dict[str, float]]] = {}
    for shape in SHAPES:
        for name, depth in DEPTHS.items():
            rows = [_run(shape, boxes, depth) for boxes in SIZES]
            series[f"{shape}, {name} levels"] = rows
            for row in rows:
                times = " | ".join(f"{row[step]:.3g}" for step in STEPS)
                counts = f"{row['boxes']:.0f} | {row['ports']:.0f}"
                lines.append(f"| {shape} | {name} | {counts} | {times} | {row['peak']:.0f} |")
    lines += ["", "| shape, levels | exponent of flatten | of normal form | of equality |", "| --- " * 4 + "|"]
    for name, rows in series.items():
        slopes = " | ".join(f"{_slope(rows, step):.2f}" for step in STEPS[1:])
        lines.append(f"| {name} | {slopes} |")
    if out is not None:
        _chart(series, out)
    return "\n".join(lines)


def _chart(series: dict[str, list[dict[str, float]]], out: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for name, rows in series.items():
        axes.loglog([row["ports"] for row in rows], [row["flatten"] for row in rows], marker="o", label=name)
    first, last = (sizes * 2 for sizes in (SIZES[0], SIZES[-1]))
    axes.loglog([first, last], [first * 5e-6, last * 5e-6], color="0.6", ls=":", label="linear")
    axes.set(xlabel="ports when flat", ylabel="seconds to flatten")
    axes.legend(frameon=False, fontsize=8)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "size.svg", metadata={"Date": None})
