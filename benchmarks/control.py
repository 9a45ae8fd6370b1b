"""A loop of computed torques around an arm of six joints: how much faster than time it runs, by sampling rate.

In each period the state is read, the forces are found by inverse dynamics, and one step of the arm is taken under them.
MuJoCo does the same by `mj_inverse` and a step of its RK4, called from Python likewise. Both run in turn within one
process, and the median counts; what is left of the way at the end says that they do the same.
"""

import sys
import time
from collections.abc import Callable
from importlib import import_module
from statistics import median
from typing import Any

import numpy as np

import ephs
from benchmarks import families
from benchmarks.peers.mujoco import mujoco_model
from benchmarks.peers.scene import peer_scene
from benchmarks.report import Report, table_of
from ephs.mechanics.scene.model import Scene

__all__ = ["measure", "report"]

JOINTS, SPAN, BLOCKS = 6, 2.0, 7
RATES = (100.0, 200.0, 500.0, 1000.0)
"""Samples a second."""
STIFFNESS, DAMPING = 36.0, 12.0
Loop = Callable[[float], float]
"""From a period in s to the farthest that a joint is from where it should be after the span, in rad."""


def own(scene: Scene) -> Loop:
    """The loop over dynamics functions."""
    model = ephs.dynamics(scene)
    goal = model.state(np.linspace(0.2, 0.6, JOINTS), np.zeros(JOINTS))

    def run(period: float) -> float:
        now = model.state0
        for _ in range(round(SPAN / period)):
            forces = model.computed_torque(now, goal, stiffness=STIFFNESS, damping=DAMPING)
            now = model.step(now, period, forces=forces)
        return float(np.abs(model.difference(now, goal)).max())

    return run


def peer(scene: Scene) -> Loop:
    """The same by MuJoCo."""
    mujoco: Any = import_module("mujoco")
    goal = np.linspace(0.2, 0.6, JOINTS)

    def run(period: float) -> float:
        model, data = mujoco_model(peer_scene(scene), "RK4", period)
        for _ in range(round(SPAN / period)):
            data.qacc[:] = STIFFNESS * (goal - data.qpos) - DAMPING * data.qvel
            mujoco.mj_inverse(model, data)
            data.qfrc_applied[:] = data.qfrc_inverse
            mujoco.mj_step(model, data)
        return float(np.abs(goal - data.qpos).max())

    return run


def measure(rate: float) -> dict[str, Any]:
    """Seconds of motion in a second of processor time of either loop, at a rate in 1/s."""
    scene = families.scene("revolute-chain", JOINTS)
    loops = {"ephs": own(scene), "mujoco": peer(scene)}
    row: dict[str, Any] = {"rate": rate}
    times: dict[str, list[float]] = {name: [] for name in loops}
    for _ in range(BLOCKS):
        for name, loop in loops.items():
            begin = time.process_time()
            row[f"{name} left"] = loop(1.0 / rate)
            times[name].append(time.process_time() - begin)
    row |= {name: SPAN / median(values) for name, values in times.items()}
    return row | {"ratio": row["mujoco"] / row["ephs"]}


def report() -> Report:
    """Times faster than real time, and by how much MuJoCo is faster, by sampling rate."""
    rows: list[dict[str, Any]] = []
    for rate in RATES:
        rows.append(measure(rate))
        print(rows[-1], file=sys.stderr, flush=True)
    columns = {
        "samples/s": ("rate", 1.0), "ephs [× real time]": ("ephs", 1.0), "mujoco [× real time]": ("mujoco", 1.0),
        "ratio": ("ratio", 1.0), "left, ephs [rad]": ("ephs left", 1.0), "left, mujoco [rad]": ("mujoco left", 1.0),
    }  # fmt: skip
    return Report(table_of(rows, columns), rows)
