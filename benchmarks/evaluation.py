"""One evaluation of the accelerations, ours beside those of Pinocchio and MuJoCo, in one process.

Repeats are interleaved, so that what else the machine does falls on all alike, and the median counts. The states change
from evaluation to evaluation, so that none is answered from a cache. Pinocchio's trees are evaluated in batches in
compiled code; its closed loops one by one from Python, less the time of such a call for a pendulum, by both of its
algorithms: constraintDynamics, and lcaba, whose time is linear in the number of loops. MuJoCo takes Euler
steps in compiled code, which costs it little more than the accelerations; its loops are soft constraints.
"""

import sys
import time
from collections.abc import Callable
from importlib import import_module
from statistics import median
from typing import Any

import numpy as np

from benchmarks import families
from benchmarks.peers.mujoco import mujoco_model, silent
from benchmarks.peers.pinocchio import PinModel
from benchmarks.peers.scene import PeerError, peer_scene
from benchmarks.report import Report, table_of
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.tree.equations.equations import ReducedEquations

__all__ = ["ENGINES", "own", "report"]

SIZES = {
    "revolute-chain": (1, 4, 16, 64, 256),
    "spherical-chain": (1, 4, 16, 64, 256),
    "four-bar-windows": (1, 10, 40, 80),
}
REPEATS = 9
BLOCK = 0.02
"""Seconds that a repeat takes at least."""
SLOW = 5e-3
"""An evaluation that takes longer, in s, is repeated less often."""

Block = Callable[[int], float]
"""Seconds of so many rounds of evaluations."""
STATES = 16
"""Different states that are evaluated in turn."""


def own(scene: Scene) -> tuple[Block, int]:
    """Our accelerations: a block of rounds, and how many evaluations a round has."""
    equations = ReducedEquations(problem_of_scene(scene), 0.0)
    state, rng = equations.start(0.0), np.random.default_rng(0)
    q = np.array([state.q] * STATES)
    r = np.array([state.r + 0.1 * rng.standard_normal(equations.n) for _ in range(STATES)])
    call = equations.engine.bind("evaluations", q, r, np.zeros(equations.size), np.zeros((STATES, equations.n)), 1)

    def block(rounds: int) -> float:
        begin = time.perf_counter()
        call(rounds)
        return time.perf_counter() - begin

    return block, STATES


def _pin(scene: Scene) -> tuple[Block, int]:
    model = PinModel(peer_scene(scene))
    pin, rng = model.pin, np.random.default_rng(0)
    nv = int(model.model.nv)
    if model.loops:
        return _pin_loops(model, "constraintDynamics"), 1
    count = max(16, 4096 // nv)
    at = model.start[: model.nq]
    q = np.asfortranarray([pin.integrate(model.model, at, 0.1 * rng.standard_normal(nv)) for _ in range(count)]).T
    q, v = np.asfortranarray(q), np.asfortranarray(0.1 * rng.standard_normal((nv, count)))
    force, out = np.zeros((nv, count), order="F"), np.zeros((nv, count), order="F")
    pool = pin.ModelPool(model.model, 1)

    def block(rounds: int) -> float:
        begin = time.perf_counter()
        for _ in range(rounds):
            pin.abaInParallel(1, pool, q, v, force, out)
        return time.perf_counter() - begin

    return block, count


def _pin_lcaba(scene: Scene) -> tuple[Block, int]:
    model = PinModel(peer_scene(scene))
    if not model.loops:
        raise PeerError("a tree, which aba evaluates")
    return _pin_loops(model, "lcaba"), 1


def _pin_loops(model: PinModel, algorithm: str) -> Block:
    pin, rng = model.pin, np.random.default_rng(0)
    nv = int(model.model.nv)
    at, speed = model.start[: model.nq], model.start[model.nq :]
    states = [
        (pin.integrate(model.model, at, 1e-3 * rng.standard_normal(nv)), speed + 1e-3 * rng.standard_normal(nv))
        for _ in range(8)
    ]
    one = PinModel(peer_scene(families.scene("revolute-chain", 1)))
    still = one.start[:1].copy()

    def calls(of: PinModel, arguments: list[tuple[Any, Any]], rounds: int) -> float:
        evaluate, wanted = getattr(pin, algorithm), (of.constraints, of.workspace, of.settings)
        begin = time.perf_counter()
        for i in range(rounds):
            q, v = arguments[i % len(arguments)]
            evaluate(of.model, of.data, q, v, of.force, *wanted)
        return time.perf_counter() - begin

    for each in (model, one):
        if algorithm == "lcaba":
            pin.computeJointMinimalOrdering(each.model, each.data, each.constraints)
        else:
            pin.initConstraintDynamics(each.model, each.data, each.constraints, each.workspace)

    def block(rounds: int) -> float:
        return max(calls(model, states, rounds) - calls(one, [(still, still)], rounds), 0.0)

    return block


def _mujoco(scene: Scene) -> tuple[Block, int]:
    mujoco: Any = import_module("mujoco")
    mujoco.set_mju_user_warning(silent)  # else it writes a log file into the working folder
    model, data = mujoco_model(peer_scene(scene), "Euler", 1e-7)
    count = 10

    def block(rounds: int) -> float:
        begin = time.perf_counter()
        mujoco.mj_step(model, data, rounds * count)
        return time.perf_counter() - begin

    return block, count


ENGINES: dict[str, Callable[[Scene], tuple[Block, int]]] = {
    "ephs": own,
    "pin": _pin,
    "pin lcaba": _pin_lcaba,
    "mujoco": _mujoco,
}


def measure(scene: Scene, repeats: int = REPEATS) -> dict[str, float | None]:
    """Seconds of an evaluation by engine; None of one that cannot do the scene or is not installed."""
    found: dict[str, tuple[Block, int, int]] = {}
    for name, make in ENGINES.items():
        try:
            block, count = make(scene)
        except (PeerError, ImportError) as error:
            print(f"{scene.name}: {name}: {error}", file=sys.stderr)
            continue
        block(1)
        once = max(block(1), 1e-7)
        found[name] = block, count, max(1, int(BLOCK / once))
    slowest = max(block(1) / count for block, count, _ in found.values())
    times: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(repeats if slowest < SLOW else 3):
        for name, (block, count, rounds) in found.items():
            times[name].append(block(rounds) / (rounds * count))
    return {name: median(times[name]) if name in times else None for name in ENGINES}


def report() -> Report:
    """Microseconds of an evaluation by family and size, and ours relative to the best of the others."""
    rows: list[dict[str, Any]] = []
    for family, sizes in SIZES.items():
        for size in sizes:
            seconds = measure(families.scene(family, size))
            peers = {name: s for name, s in seconds.items() if s is not None and name != "ephs"}
            best = min(peers, key=lambda name: peers[name]) if peers else None
            ours = seconds["ephs"]
            ratio = ours / peers[best] if best is not None and ours is not None else None
            rows.append({"scene": f"{family}-{size}", **seconds, "best": best, "ratio": ratio})
            print(rows[-1], file=sys.stderr, flush=True)
    columns = {f"{name} [µs]": (name, 1e6) for name in ENGINES} | {"best peer": ("best", 1.0), "ratio": ("ratio", 1.0)}
    return Report(table_of(rows, {"scene": ("scene", 1.0)} | columns), rows)
