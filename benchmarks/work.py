"""What an error costs: seconds of integration until the end states are good to 1e-3, 1e-6, 1e-9, ours beside others'.

A cell is a scene with a target. Every method and every other program that is installed runs from coarse to fine
settings until it meets the finest target, or takes longer than what met all targets before. The least time of a run
that meets the target wins; a run does not count whose method does worse by more than ten times the target at a finer
setting, which had luck. What a folder holds already is not measured again, so that an interrupted run can go on.
"""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from benchmarks import families
from benchmarks.peers.measure import work_precision
from benchmarks.report import Report, table_of
from ephs.show.charts.measure import Point
from ephs.show.charts.reference import shipped_reference
from ephs.show.charts.runs import RunEnding

__all__ = ["CELLS", "OWN", "TARGETS", "best", "cell", "collect", "report"]

TARGETS = (1e-3, 1e-6, 1e-9)
CELLS = {
    "revolute-chain-1": 10.0,
    "revolute-chain-2": 10.0,
    "revolute-chain-4": 10.0,
    "revolute-chain-16": 10.0,
    "revolute-chain-64": 2.0,
    "spherical-chain-2": 10.0,
    "spherical-chain-8": 10.0,
    "four-bar-windows-1": 10.0,
    "four-bar-windows-10": 10.0,
    "four-bar-windows-40": 10.0,
    "andrews-squeezer": 0.03,
    "heavy-top": 2.0,
    "tumbling-body": 10.0,
}
"""Scene -> end in s."""
OWN = ("rk87", "rk54", "auto", "natural4", "natural")
"""Our methods, first those that are likely to win: what cannot win is not refined."""
OTHERS = ("pin DOP853", "mujoco RK4", "pin LSODA", "pin soft DOP853", "mujoco Euler")
TOLERANCES = tuple(float(10.0 ** (-k / 2.0)) for k in range(4, 27))
STEPS = tuple(round(25 * 2 ** (k / 2.0)) for k in range(33))
"""Into how many steps the time is divided."""
LIMIT = 16.0
"""Seconds of a method on a scene: one run takes at most a quarter."""
LUCK = 10.0
MARGIN = 1.5
"""A run that takes so many times what has won already cannot win by noise."""
REPEATS = 5


@final
@dataclass(frozen=True, slots=True)
class Run:
    """One run: who, at which setting, its error and its seconds; NaN where it failed."""

    scene: str
    method: str
    kind: str
    value: float
    error: float
    seconds: float
    steps: int
    message: str = ""

    def as_json(self) -> dict[str, Any]:
        """Its fields; numbers that are none as null."""
        fields = {name: getattr(self, name) for name in self.__slots__}
        return {name: None if value != value else value for name, value in fields.items()}

    @staticmethod
    def of_json(data: Mapping[str, Any]) -> "Run":
        """The run of `as_json`."""
        fields: dict[str, Any] = {key: np.nan if value is None else value for key, value in data.items()}
        return Run(**fields)


def best(runs: Iterable[Run], target: float) -> Run | None:
    """The fastest run that meets a target, and not by luck."""
    everything = list(runs)

    def lucky(run: Run) -> bool:
        finer = [
            other
            for other in everything
            if (other.scene, other.method, other.kind) == (run.scene, run.method, run.kind) and other.value < run.value
        ]
        return any(not other.error <= LUCK * target for other in finer if other.message != RunEnding.SLOW)

    able = [run for run in everything if run.error <= target and not lucky(run)]
    return min(able, key=lambda run: run.seconds, default=None)


def measure(name: str, method: str, rivals: list[Run], targets: Sequence[float] = TARGETS) -> list[Run]:
    """The runs of a method on a scene until it meets all targets, or can beat its rivals at no more of them."""
    scene, until = families.named(name), CELLS[name]
    reference, _ = shipped_reference(Path(__file__).parent / "reference" / f"{name}.json", scene, until)
    found: list[Run] = []

    def enough(point: Point) -> bool:
        message = str(point.outcome) if point.outcome is RunEnding.SLOW else point.message
        error = point.error if point.outcome is RunEnding.DONE else np.nan
        kind, value = point.setting.kind, point.setting.value
        found.append(Run(name, method, kind, value, float(error), point.seconds, point.steps, message))
        open_targets = [target for target in targets if not error <= target]
        times = [won.seconds if (won := best(rivals, target)) else np.inf for target in open_targets]
        return not open_targets or point.seconds > MARGIN * max(times)

    work_precision(
        scene,
        until,
        [method],
        reference=reference,
        repeats=REPEATS,
        limit=LIMIT,
        tolerances=TOLERANCES,
        steps=STEPS,
        enough=enough,
    )
    return found


def report(out: Path | None = None, cells: Iterable[str] = tuple(CELLS)) -> Report:
    """The least seconds of ours and of the others by scene and target.

    Parameters
    ----------
    out
        Folder whose file ``work.jsonl`` holds what was measured before, and takes what is measured now.
    """
    runs = collect(None if out is None else out / "work.jsonl", cells, (OWN, OTHERS))
    rows = [cell(name, target, runs) for name in cells for target in TARGETS]
    columns = {
        "scene": ("scene", 1.0), "error": ("target", 1.0), "ephs [s]": ("own", 1.0), "by": ("own method", 1.0),
        "best peer [s]": ("peer", 1.0), "with": ("peer method", 1.0), "ratio": ("ratio", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)


def collect(
    file: Path | None, cells: Iterable[str], sides: Sequence[Sequence[str]], targets: Sequence[float] = TARGETS
) -> list[Run]:
    """The runs of all methods on some scenes.

    Parameters
    ----------
    file
        Holds what was measured before, and takes what is measured now.
    sides
        Groups of methods: one is not refined where another of its group has won.
    """
    runs, done = _read(file)
    for name in cells:
        for side in sides:
            for method in side:
                if (name, method) in done:
                    continue
                rivals = [run for run in runs if run.scene == name and run.method in side]
                found = measure(name, method, rivals, targets)
                runs += found
                last = ", ".join(f"{run.error:.0e} {run.seconds:.2g} s {run.message[:60]}" for run in found[-3:])
                print(f"{name}, {method}: {last}", file=sys.stderr, flush=True)
                if file is not None:
                    file.parent.mkdir(parents=True, exist_ok=True)
                    lines = [run.as_json() for run in found] + [{"scene": name, "method": method, "done": True}]
                    with file.open("a", encoding="utf-8") as sheet:
                        sheet.writelines(json.dumps(line) + "\n" for line in lines)
    return runs


def cell(name: str, target: float, runs: Iterable[Run], others: Sequence[str] = OTHERS) -> dict[str, Any]:
    """Who won on a scene at a target, of ours and of the others, and the ratio of their times."""
    here = [run for run in runs if run.scene == name]
    row: dict[str, Any] = {"scene": name, "target": target}
    sides = {"own": [r for r in here if r.method not in others], "peer": [r for r in here if r.method in others]}
    times: dict[str, float] = {}
    for key, side in sides.items():
        run = best(side, target)
        row[key] = None if run is None else run.seconds
        row[f"{key} method"] = None if run is None else f"{run.method}, {run.value:.1e}"
        times[key] = np.nan if run is None else run.seconds
    ratio = times["own"] / times["peer"]
    return row | {"ratio": None if np.isnan(ratio) else ratio}


def _read(file: Path | None) -> tuple[list[Run], set[tuple[str, str]]]:
    if file is None or not file.is_file():
        return [], set()
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    done = {(line["scene"], line["method"]) for line in lines if line.get("done")}
    runs = [Run.of_json(line) for line in lines if not line.get("done")]
    return [run for run in runs if (run.scene, run.method) in done], done
