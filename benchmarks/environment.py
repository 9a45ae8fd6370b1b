"""Steps of an environment: an arm of six joints under random torques, held over periods of 20 ms.

MuJoCo takes ten steps of 2 ms a period by its default integrator, or five of 4 ms by its RK4, called from Python
likewise. Errors are those of the joint angles after the last period, against rk87 with a tolerance of 1e-12 under the
same torques. All run in turn within one process, and the median counts.
"""

import sys
import time
from collections.abc import Callable
from importlib import import_module
from statistics import median
from typing import Any

import numpy as np

from benchmarks import families
from benchmarks.peers.mujoco import mujoco_model
from benchmarks.peers.scene import peer_scene
from benchmarks.report import Report, table_of
from ephs.exporting.environment import Environment, Environments, EnvironmentTask
from ephs.mechanics.scene.model import Scene
from ephs.semantics.bundles.bundle import Array

__all__ = ["measure", "report"]

JOINTS, PERIOD, ACTIONS, BLOCKS, SIDE_BY_SIDE = 6, 0.02, 50, 7, 64
OWN = {"rk54, rtol 1e-3": {"rtol": 1e-3}, "rk54, rtol 1e-6": {"rtol": 1e-6}, "rk54, step 20 ms": {"step": PERIOD}}
PEERS = {"MuJoCo, Euler 2 ms": ("Euler", 10), "MuJoCo, RK4 4 ms": ("RK4", 5)}
Episode = Callable[[], Array]
"""Run all actions; the joint angles at the end."""


def task(scene: Scene, **options: Any) -> EnvironmentTask:
    """The scene as a task without reward."""
    inputs = [f"joints.{name}" for name in scene.joints]
    return EnvironmentTask(scene, inputs=inputs, reward=_nothing, limits=5.0, period=PERIOD, horizon=ACTIONS, **options)


def _nothing(seen: Array, action: Array) -> float:
    return 0.0


def angles(made: EnvironmentTask) -> list[int]:
    """Places of the joint angles in an observation."""
    return [k for k, name in enumerate(made.names) if name.endswith(".coordinate")]


def own(scene: Scene, actions: Array, options: dict[str, Any]) -> Episode:
    """Episodes of an environment."""
    made = task(scene, **options)
    environment, where = Environment(made), angles(made)

    def run() -> Array:
        seen, _ = environment.reset()
        for action in actions:
            seen, *_ = environment.step(action)
        return seen[where]

    return run


def many(scene: Scene, actions: Array, options: dict[str, Any]) -> Episode:
    """Episodes of many environments on two threads."""
    made = task(scene, **options)
    environments, where = Environments(made, SIDE_BY_SIDE, threads=2), angles(made)

    def run() -> Array:
        seen, _ = environments.reset()
        for action in actions:
            seen, *_ = environments.step(np.tile(action, (SIDE_BY_SIDE, 1)))
        return seen[0, where]

    return run


def peer(scene: Scene, actions: Array, method: str, steps: int) -> Episode:
    """Episodes of MuJoCo."""
    mujoco: Any = import_module("mujoco")
    model, data = mujoco_model(peer_scene(scene), method, PERIOD / steps)
    start = np.array(data.qpos), np.array(data.qvel)

    def run() -> Array:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = start
        for action in actions:
            data.qfrc_applied[:] = action
            mujoco.mj_step(model, data, steps)
        return np.array(data.qpos)

    return run


def measure() -> list[dict[str, Any]]:
    """Time of a period and error at the end, by method."""
    scene = families.scene("revolute-chain", JOINTS)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (ACTIONS, JOINTS))
    exact = own(scene, actions, {"method": "rk87", "rtol": 1e-12})()
    runs = {name: own(scene, actions, options) for name, options in OWN.items()}
    runs |= {name: peer(scene, actions, *how) for name, how in PEERS.items()}
    runs[f"rk54, rtol 1e-3, {SIDE_BY_SIDE} on 2 threads"] = many(scene, actions, OWN["rk54, rtol 1e-3"])
    times: dict[str, list[float]] = {name: [] for name in runs}
    errors: dict[str, float] = {}
    for _ in range(BLOCKS):
        for name, run in runs.items():
            begin = time.perf_counter()
            found = run()
            count = SIDE_BY_SIDE if "threads" in name else 1
            times[name].append((time.perf_counter() - begin) / ACTIONS / count)
            errors[name] = float(np.abs(found - exact).max())
    base = median(times[next(iter(PEERS))])
    return [
        {"method": name, "time": median(values), "error": errors[name], "ratio": median(values) / base}
        for name, values in times.items()
    ]


def report() -> Report:
    """Times of a period, errors, and ratios to MuJoCo's default."""
    rows = measure()
    for row in rows:
        print(row, file=sys.stderr, flush=True)
    columns = {
        "method": ("method", 1.0), "period [µs]": ("time", 1e6), "error [rad]": ("error", 1.0),
        "time beside MuJoCo's default": ("ratio", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
