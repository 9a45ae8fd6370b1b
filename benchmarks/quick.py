"""``python -m benchmarks.quick [--update]``: the quick set, held against `baseline.json`.

Every case is repeated in several processes, in an order that is drawn anew each time, so that what else the machine
does falls on all alike. The processor's time is taken, which does not run while others have the processor; the least
counts. What looks slower is measured once more, beside cases that do not, and named
only if it looks so again. Exit code 0: nothing got slower. 1: something did, or could not be measured. 2: bad input.
"""

import gc
import json
import platform
import random
import resource
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks import process
from benchmarks.peers.scene import PeerError
from benchmarks.quick_cases import CASES, OTHERS, Work
from benchmarks.verdict import EVERYTHING, Timing, Verdict, compare, in_both, timing

__all__ = ["main", "measure"]

HERE = Path(__file__).parent
BASELINE, OUT = HERE / "baseline.json", HERE.parent / "out" / "bench.json"
PROCESSES, ROUNDS = 4, 3
BLOCK, FIRST = 0.04, 1.0
"""Seconds that a measurement takes at least, nearly: shorter work is repeated. Work is done twice before it is
measured, but once where that took longer than FIRST."""
LIMIT = 900.0
"""Seconds for a process; the first one of an installation compiles."""
BESIDE = 3
"""In a second look, every third of the cases that are not in doubt is measured, too."""
PACKAGES = ("ephs", "numpy", "scipy", "llvmlite", "sympy", "pin", "mujoco-core")


def measure(names: Sequence[str], rounds: int, seed: int) -> dict[str, Any]:
    """Make cases and measure each so many times, in this process.

    Returns
    -------
    dict
        ``seconds``: case -> its measurements; ``absent`` and ``failed``: case -> why it has none.
    """
    found: dict[str, dict[str, Any]] = {"seconds": {}, "absent": {}, "failed": {}}
    works: dict[str, Work] = {}
    once: dict[str, float] = {}
    for name in names:
        try:
            work = CASES[name]()
            once[name] = _took(work)
            if once[name] < FIRST:  # it may have imported and compiled
                once[name] = _took(work)
            works[name] = work
        except (ImportError, PeerError) as error:
            found["absent"][name] = str(error)
        except Exception as error:  # one case does not keep the others from being measured
            found["failed"][name] = f"{type(error).__name__}: {error}"
    draw = random.Random(seed)
    for _ in range(rounds):
        for name in draw.sample(list(works), len(works)):
            count = max(1, int(BLOCK / once[name]))
            found["seconds"].setdefault(name, []).append(_took(works[name], count))
    return found


def _took(work: Work, count: int = 1) -> float:
    """Seconds of a processor that work takes in the mean, its own processes included."""
    gc.collect()
    gc.disable()
    begin = _spent()
    for _ in range(count):
        work()
    spent = _spent() - begin
    gc.enable()
    return max(spent / count, 1e-9)


def _spent() -> float:
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime


def look(names: Collection[str], seed: int = 0) -> tuple[dict[str, Timing], dict[str, dict[str, str]]]:
    """Measure cases in several processes: their timings, and which are absent or failed."""
    seconds: dict[str, list[list[float]]] = {}
    without: dict[str, dict[str, str]] = {"absent": {}, "failed": {}}
    for number in range(-1, PROCESSES):  # the first one fills the caches
        call = f"benchmarks.quick:measure({list(names)!r}, {ROUNDS if number >= 0 else 0}, {seed + number})"
        found = process.run(call, LIMIT, {"seconds": {}, "absent": {}, "failed": {}})
        if "failure" in found:
            without["failed"]["the process"] = found["failure"]
        for kind, reasons in without.items():
            reasons.update(found[kind])
        for name, measured in found["seconds"].items():
            seconds.setdefault(name, []).append(measured)
        print(f"measured {len(found['seconds'])} cases", file=sys.stderr, flush=True)
    return {name: timing(of) for name, of in seconds.items()}, without


def machine() -> dict[str, Any]:
    """What the numbers hold for."""
    versions: dict[str, str] = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {"processor": _processor(), "system": platform.system(), "python": platform.python_version(), **versions}


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.is_file() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def _verdict(now: Mapping[str, Timing], then: Mapping[str, Timing]) -> Verdict:
    """Compare, and look again at what seems slower."""
    first = compare(now, then, OTHERS)
    doubtful = set(first.slower)
    if not doubtful:
        return first
    clear = [name for name in now if name not in doubtful and name not in OTHERS]
    beside = clear if EVERYTHING in doubtful else clear[::BESIDE]
    again, _ = look([name for name in CASES if name in {*doubtful, *beside, *OTHERS} and name in now], seed=100)
    return in_both(first, compare(again, then, OTHERS, beside))


def main(words: Sequence[str]) -> int:
    """Measure, write `OUT`, and compare with `BASELINE`, or replace it."""
    if [word for word in words if word != "--update"]:
        print(f"{' '.join(words)}: expected nothing, or --update to take a new baseline", file=sys.stderr)
        return 2
    now, without = look(list(CASES))
    run = {"machine": machine(), "cases": {name: asdict(now[name]) for name in CASES if name in now}, **without}
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(run, indent=1) + "\n", encoding="utf-8")
    for kind, reasons in without.items():
        for name, why in reasons.items():
            print(f"{kind}: {name}: {why}")
    if words:
        BASELINE.write_text(json.dumps({key: run[key] for key in ("machine", "cases")}, indent=1) + "\n", "utf-8")
        print(f"the baseline: {BASELINE}")
        return 1 if without["failed"] else 0
    known = json.loads(BASELINE.read_text(encoding="utf-8"))
    verdict = _verdict(now, {name: Timing(**case) for name, case in known["cases"].items()})
    OUT.write_text(json.dumps({**run, "verdict": asdict(verdict)}, indent=1) + "\n", encoding="utf-8")
    for key, value in run["machine"].items():
        if known["machine"].get(key) != value:
            print(f"another {key}: {value}, the baseline has {known['machine'].get(key)}")
    print(verdict)
    return 1 if verdict.slower or without["failed"] else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
