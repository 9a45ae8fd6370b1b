"""How one evaluation, the set-up and the memory grow with the mechanism, each size in a process of its own."""

import resource
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks import families
from benchmarks.process import run
from benchmarks.report import Report, exponent, table_of

__all__ = ["measure", "report"]

SIZES = {
    "revolute-chain": (16, 32, 64, 128, 256, 512, 1024),
    "spherical-chain": (16, 32, 64, 128, 256, 512, 1024),
    "four-bar-windows": (10, 20, 40, 80, 160, 320),
}
LARGEST = ("revolute-chain", 10_000)
LIMIT = 240.0
"""Seconds of a process."""
QUANTITIES = {"evaluation": 1.0, "setup": 1.0, "memory": 1.0}


def measure(family: str, size: int) -> dict[str, Any]:
    """Seconds of an evaluation, of the processor for the set-up, and bytes; in this process, which compiled before.

    The set-up is what goes before the first step: the scene is read, its system made, its tables filled.
    """
    import ephs
    from benchmarks.evaluation import own

    small = families.scene(family, 2)
    own(small)[0](1)
    ephs.simulate(small, 1e-3, method="rk87", rtol=1e-6, atol=1e-6, save_at=[1e-3])
    file = Path(families.write(family, size))
    before, begin = _resident(), time.process_time()
    scene = ephs.load(file)
    loaded = time.process_time()
    block, count = own(scene)
    ready, taken = time.process_time(), _resident() - before
    file.unlink()
    block(1)
    rounds = max(1, int(0.2 / max(block(1), 1e-6)))
    evaluation = min(block(rounds) for _ in range(5)) / (rounds * count)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    bodies = families.bodies(family, size)
    return {
        "family": family, "size": size, "bodies": bodies, "evaluation": evaluation, "load": loaded - begin,
        "setup": ready - begin, "memory": taken, "memory of a body": taken / bodies, "peak": peak,
    }  # fmt: skip


def _resident() -> int:
    """Bytes of this process that are in memory."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()


def report() -> Report:
    """Rows by family and size, and exponents by least squares over the larger half of the sizes."""
    rows: list[dict[str, Any]] = []
    slopes: list[dict[str, Any]] = []
    for family, sizes in SIZES.items():
        own: list[dict[str, Any]] = []
        for size in (*sizes, *((LARGEST[1],) if LARGEST[0] == family else ())):
            own.append(run(f"benchmarks.growth:measure({family!r}, {size})", LIMIT, {"family": family, "size": size}))
            print(own[-1], file=sys.stderr, flush=True)
        rows += own
        slopes.append({"family": family})
        for key in QUANTITIES:
            known = [row for row in own if row.get(key)][-4:]
            slopes[-1][key] = exponent([row["bodies"] for row in known], [row[key] for row in known])
    columns = {
        "family": ("family", 1.0), "size": ("size", 1.0), "bodies": ("bodies", 1.0),
        "evaluation [µs]": ("evaluation", 1e6), "read [s]": ("load", 1.0), "set up [s]": ("setup", 1.0),
        "memory [MB]": ("memory", 1e-6), "a body [kB]": ("memory of a body", 1e-3), "": ("failure", 1.0),
    }  # fmt: skip
    exponents = {"family": ("family", 1.0)} | {f"exponent of {key}": (key, 1.0) for key in QUANTITIES}
    return Report(table_of(rows, columns) + "\n\n" + table_of(slopes, exponents), [*rows, *slopes])
