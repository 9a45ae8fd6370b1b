"""Ensembles: members of one sweep a second, beside MuJoCo's rollout on as many threads, at equal error.

Every member of revolute-chain-4 starts at rest from its own angles and runs for a second. An engine's setting is the
coarsest with which the worst of some members meets the error, against a run with tight tolerances; then all members are
run with it. What both do to set up is counted.
"""

import os
import sys
import time
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import ephs
from benchmarks.peers.mujoco import mujoco_model, silent
from benchmarks.peers.scene import peer_scene
from benchmarks.report import Report, table_of
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array

__all__ = ["report"]

SCENE = Path(__file__).parent / "scenes" / "revolute-chain-4.toml"
MEMBERS, SAMPLE, UNTIL = 10_000, 40, 1.0
TARGETS = (1e-3, 1e-6, 1e-9)
TOLERANCES = tuple(float(10.0 ** (-k / 2.0)) for k in range(4, 27))
STEPS = tuple(round(25 * 2 ** (k / 2.0)) for k in range(24))
Ends = Callable[[Array, float], Array]


def own(scene: Scene, threads: int) -> Ends:
    """Angles (members, joints) at the end, from those at the beginning and a tolerance."""
    names = [f"joints.{name}.coordinate" for name, _ in scene.all_joints()]

    def ends(angles: Array, tolerance: float) -> Array:
        table = ephs.sweep(
            scene, dict(zip(names, angles.T, strict=True)), UNTIL, save_at=[UNTIL], paired=True, outputs=names,
            workers=threads, rtol=tolerance, atol=tolerance,
        )  # fmt: skip
        return np.column_stack([table[name].values[:, 0] for name in names])

    return ends


def rollout(scene: Scene, threads: int) -> Ends:
    """The same of MuJoCo's RK4, from the angles and a number of steps."""
    mujoco: Any = import_module("mujoco")
    runner: Any = import_module("mujoco.rollout")
    mujoco.set_mju_user_warning(silent)  # else it writes a log file into the working folder
    given = peer_scene(scene)

    def ends(angles: Array, steps: float) -> Array:
        model, _ = mujoco_model(given, "RK4", UNTIL / steps)
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        start = np.zeros((len(angles), size))
        start[:, 1 : 1 + model.nq] = angles
        data = [mujoco.MjData(model) for _ in range(threads)]
        states, _ = runner.rollout(model, data, start, nstep=round(steps))
        return states[:, -1, 1 : 1 + model.nq]

    return ends


def report(members: int = MEMBERS, targets: Iterable[float] = TARGETS) -> Report:
    """Members a second by error, and the ratio of seconds."""
    scene, threads = ephs.load(SCENE), os.cpu_count() or 1
    angles = np.random.default_rng(0).uniform(-1.0, 1.0, (members, len(dict(scene.all_joints()))))
    engines: dict[str, tuple[Ends, tuple[float, ...]]] = {
        "ephs": (own(scene, threads), TOLERANCES),
        "mujoco": (rollout(scene, threads), tuple(map(float, STEPS))),
    }
    exact = own(scene, threads)(angles[:SAMPLE], 1e-13)
    rows: list[dict[str, Any]] = []
    for target in targets:
        row: dict[str, Any] = {"error": target, "members": members, "threads": threads}
        for name, (ends, settings) in engines.items():
            setting = next((s for s in settings if np.abs(ends(angles[:SAMPLE], s) - exact).max() <= target), None)
            row[name] = row[f"{name} setting"] = None
            if setting is not None:
                begin = time.perf_counter()
                ends(angles, setting)
                row[name], row[f"{name} setting"] = time.perf_counter() - begin, setting
        both = row["ephs"] and row["mujoco"]
        row |= {f"{name} rate": members / row[name] if row[name] else None for name in engines}
        row["ratio"] = row["ephs"] / row["mujoco"] if both else None
        rows.append(row)
        print(row, file=sys.stderr, flush=True)
    columns = {
        "error": ("error", 1.0), "ephs [members/s]": ("ephs rate", 1.0), "mujoco [members/s]": ("mujoco rate", 1.0),
        "rtol": ("ephs setting", 1.0), "steps": ("mujoco setting", 1.0), "time ratio": ("ratio", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
