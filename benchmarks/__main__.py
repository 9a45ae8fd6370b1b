"""``python -m benchmarks [NAME ...] [--out DIR]`` prints the tables as Markdown, charts go into DIR."""

import sys
from pathlib import Path

from benchmarks import accuracy, balance, cells, long, order, orders, size, traced

TABLES = {
    "order": lambda _: order.table(),
    "orders": lambda _: orders.table(),
    "balance": lambda _: balance.table(),
    "size": size.table,
    "cells": cells.table,
    "traced": lambda _: traced.table(),
    "accuracy": lambda _: accuracy.table(),
    "long": long.table,
}


def main(words: list[str]) -> int:
    """Measure what is named, everything where nothing is."""
    out: Path | None = None
    names = list(words)
    if "--out" in names:
        at = names.index("--out")
        if at + 1 == len(names):
            print("--out: found nothing after it, expected a folder", file=sys.stderr)
            return 2
        out = Path(names.pop(at + 1))
        names.pop(at)
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        print(f"{', '.join(unknown)}: no such benchmark; there are {', '.join(TABLES)}", file=sys.stderr)
        return 2
    for name in names or TABLES:
        print(f"\n## {name}\n\n{TABLES[name](out)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
