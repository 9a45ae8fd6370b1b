"""The audit's share of a run: the time that it and the search of inputs for jumps take, by that of the rest."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ephs
from benchmarks.report import Report, table_of
from ephs.solve.posing.probe import SignalProbe
from ephs.solve.running import ending

SCENES = Path(__file__).parents[1] / "scenes"
RUNS: dict[str, dict[str, Any]] = {
    "auto": {},
    "rk54": {"rtol": 1e-8},
    "rk87": {"rtol": 1e-10},
    "radau": {},
    "natural": {"step": 1e-3},
    "natural4": {"step": 2e-3},
}
"""Method -> how its steps are taken."""
CASES = {"slider-crank": ("bearing", 5.0), "four-bar": ("main", 2.0)}
"""Scene -> the joint that is driven, and the end in s."""
ROUNDS = 2
COLUMNS = {
    "scene": ("scene", 1.0),
    "method": ("method", 1.0),
    "driven": ("driven", 1.0),
    "steps": ("steps", 1.0),
    "run [s]": ("seconds", 1.0),
    "audit [ms]": ("audit", 1e3),
    "share [%]": ("share", 1e2),
}


def report() -> Report:
    """Every method on every scene, left alone and driven by a function of time; the least share of some rounds."""
    rows: list[dict[str, Any]] = []
    for name, (joint, until) in CASES.items():
        scene = ephs.load(SCENES / f"{name}.toml")
        for method, options in RUNS.items():
            for driven in ("", joint):
                given = {"inputs": {f"joints.{driven}": _push}} if driven else {}
                found = [_measured(scene, until, {**options, **given, "method": method}) for _ in range(ROUNDS)]
                best = min(found, key=lambda row: row["share"])
                rows.append({"scene": name, "method": method, "driven": driven or None, **best})
    return Report(table_of(rows, COLUMNS), rows)


def _push(t: float) -> float:
    return 0.01 if t < 1.0 else -0.01


def _measured(scene: ephs.Scene, until: float, options: dict[str, Any]) -> dict[str, Any]:
    """One run: its processor time without the audit, those of the audit, and their ratio."""
    spent: list[float] = []
    with _timed(ending, "audit", spent), _timed(SignalProbe, "look", spent):
        begin = time.process_time()
        sol = ephs.simulate(scene, until, audit="off", **options)
        rest = time.process_time() - begin - sum(spent)
    return {"steps": sol.stats["steps"], "seconds": rest, "audit": sum(spent), "share": sum(spent) / rest}


@contextmanager
def _timed(owner: Any, name: str, spent: list[float]) -> Iterator[None]:
    """The seconds of each call of a function, while it lasts."""
    function: Callable[..., Any] = getattr(owner, name)

    def measured(*given: Any) -> Any:
        begin = time.process_time()
        try:
            return function(*given)
        finally:
            spent.append(time.process_time() - begin)

    setattr(owner, name, measured)
    try:
        yield
    finally:
        setattr(owner, name, function)
