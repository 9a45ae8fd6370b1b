"""``python -m benchmarks [NAME ...] [--out DIR] [--json FILE]`` prints tables as Markdown.

Charts go into DIR, the numbers of those benchmarks that compare with other programs into FILE.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks import (
    abreast,
    accuracy,
    audit,
    balance,
    beams,
    cells,
    charts,
    choice,
    closing,
    commands,
    contact,
    control,
    cost,
    derivatives,
    ensemble,
    environment,
    evaluation,
    growth,
    honesty,
    implicit,
    imports,
    ladders,
    lawful,
    laws,
    long,
    memory,
    order,
    orders,
    parts,
    rigid,
    rows,
    shells,
    size,
    specialised,
    stabilised,
    staged,
    stages,
    start,
    steps,
    traced,
    work,
)
from benchmarks.report import Report

TABLES: dict[str, Callable[[Path | None], str | Report]] = {
    "order": lambda _: order.table(),
    "orders": lambda _: orders.table(),
    "balance": lambda _: balance.table(),
    "beams": lambda _: beams.report(),
    "shells": lambda _: shells.report(),
    "audit": lambda _: audit.report(),
    "honesty": honesty.report,
    "cost": lambda _: cost.report(),
    "contact": lambda _: contact.report(),
    "derivatives": lambda _: derivatives.table(),
    "size": size.table,
    "cells": cells.table,
    "imports": lambda _: imports.table(),
    "charts": charts.report,
    "ladders": ladders.report,
    "closing": lambda _: closing.report(),
    "control": lambda _: control.report(),
    "environment": lambda _: environment.report(),
    "parts": lambda _: parts.report(),
    "rigid": rigid.report,
    "abreast": lambda _: abreast.report(),
    "choice": lambda _: choice.report(),
    "rows": lambda _: rows.report(),
    "traced": lambda _: traced.table(),
    "staged": lambda _: staged.table(),
    "stages": lambda _: stages.report(),
    "accuracy": lambda _: accuracy.table(),
    "long": long.table,
    "memory": memory.table,
    "ensemble": lambda _: ensemble.report(),
    "evaluation": lambda _: evaluation.report(),
    "specialised": lambda _: specialised.report(),
    "steps": lambda _: steps.report(),
    "work": work.report,
    "growth": lambda _: growth.report(),
    "start": lambda _: start.report(),
    "commands": lambda _: commands.report(),
    "lawful": lambda _: lawful.table(),
    "laws": lambda _: laws.report(),
    "implicit": lambda _: implicit.report(),
    "stabilised": lambda _: stabilised.report(),
}


def main(words: list[str]) -> int:
    """Measure what is named, everything where nothing is."""
    names = list(words)
    files: dict[str, Path | None] = {"--out": None, "--json": None}
    for key, what in (("--out", "a folder"), ("--json", "a file")):
        if key in names:
            at = names.index(key)
            if at + 1 == len(names):
                print(f"{key}: found nothing after it, expected {what}", file=sys.stderr)
                return 2
            files[key] = Path(names.pop(at + 1))
            names.pop(at)
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        print(f"{', '.join(unknown)}: no such benchmark; there are {', '.join(TABLES)}", file=sys.stderr)
        return 2
    found: dict[str, object] = {}
    for name in names or TABLES:
        result = TABLES[name](files["--out"])
        if isinstance(result, Report):
            found[name] = list(result.rows)
        print(f"\n## {name}\n\n{result.text if isinstance(result, Report) else result}")
        if files["--json"] is not None:
            files["--json"].write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
