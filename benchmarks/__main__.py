"""``python -m benchmarks [order] [balance]``: prints the tables as Markdown."""

import sys

from benchmarks import balance, order

TABLES = {"order": order.table, "balance": balance.table}


def main(names: list[str]) -> int:
    """Measure what is named, everything where nothing is."""
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        print(f"{', '.join(unknown)}: no such benchmark; there are {', '.join(TABLES)}", file=sys.stderr)
        return 2
    for name in names or TABLES:
        print(f"\n## {name}\n\n{TABLES[name]()}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
