"""The quick set: what people wait for, each as a case of a fraction of a second.

A case is made once a process, with everything compiled; called, it does its work.
"""

import atexit
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import ephs
from benchmarks import cells, families, size
from benchmarks.evaluation import ENGINES
from ephs.mechanics.methods.registry import METHODS

__all__ = ["CASES", "OTHERS", "Work"]

Work = Callable[[], object]
"""Does a case's work once."""

ROOT = Path(__file__).resolve().parents[1]
CHAIN = "revolute-chain"
RUNS = {
    "natural": (0.01, 3.0),
    "natural4": (0.02, 1.0),
    "variational": (0.02, 0.5),
    "radau": (0.02, 1.0),
    "rk54": (0.01, 20.0),
    "rk87": (0.02, 20.0),
    "semi": (0.01, 10.0),
}
"""Constant step and time in s of the methods on one window of four bars, so that steps cost more than setting up; those
that are not here choose their steps."""


def _folder() -> Path:
    """A folder that is there as long as the process is."""
    folder = Path(mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _shipped(name: str) -> ephs.Scene:
    return ephs.load(ROOT / "scenes" / f"{name}.toml")


def _evaluation(engine: str, family: str, count: int) -> Callable[[], Work]:
    def make() -> Work:
        block, evaluated = ENGINES[engine](families.scene(family, count))
        rounds = max(1, 2000 // (evaluated * count))
        return lambda: block(rounds)

    return make


def _motion(method: str) -> Callable[[], Work]:
    def make() -> Work:
        scene, (step, until) = families.scene("four-bar-windows", 1), RUNS.get(method, (None, 1.0))
        return lambda: ephs.simulate(scene, until, method=method, step=step)

    return make


def _chosen_steps() -> Work:
    scene = families.scene(CHAIN, 16)
    return lambda: ephs.simulate(scene, 20.0, rtol=1e-6, atol=1e-6, save_at=[20.0])


def _friction() -> Work:
    scene = _shipped("slider-crank")
    return lambda: ephs.simulate(scene, 0.3, step=1e-3)


def _ladder(steps: int) -> Callable[[], Work]:
    def make() -> Work:
        system, inputs = cells.ladder(200), {"q0": {"effort": 1.0}}
        return lambda: ephs.simulate(system, steps * cells.STEP, inputs=inputs, step=cells.STEP)

    return make


def _set_up(count: int) -> Callable[[], Work]:
    def make() -> Work:
        scene = families.scene(CHAIN, count)
        return lambda: ephs.simulate(scene, 1e-3, method="rk87", rtol=1e-6, atol=1e-6, save_at=[1e-3])

    return make


def _load() -> Work:
    file = _folder() / "chain.toml"
    file.write_text(families.text(CHAIN, 64), encoding="utf-8")
    return lambda: ephs.load(file)


def _sweep(path: str, count: int) -> Callable[[], Work]:
    def make() -> Work:
        scene, vary = families.scene(CHAIN, 4), {path: np.linspace(1.0, 1.5, count)}
        return lambda: ephs.sweep(scene, vary, 0.5, save_at=[0.5], workers=1, rtol=1e-6, atol=1e-6)

    return make


def _flatten() -> Work:
    return lambda: size.nested("chain", 10_000, 5).flatten()


def _normal_form() -> Work:
    nesting = size.nested("tree", 3_000, 5)
    return lambda: nesting.flatten().normal_form


def _isomorphism() -> Work:
    first = size.nested("chain", 100, 2).flatten()
    second = first.rename(junctions={name: f"x{k}" for k, name in enumerate(first.junctions)})
    return lambda: first.isomorphic(second)


def _relation() -> Work:
    from examples.motor_crank import START, motor_crank

    relation = motor_crank.relation()
    return lambda: relation.at(START).projector


def _check() -> Work:
    scene = _shipped("four-bar")
    return lambda: ephs.check_model(scene)


def _equations() -> Work:
    from examples.physics import cylinder

    return lambda: str(cylinder.equations("reduced"))


def _reduce() -> Work:
    scene = _shipped("four-bar")
    return lambda: ephs.reduce(scene)


def _linearize() -> Work:
    scene = _shipped("four-bar")
    return lambda: ephs.linearize(scene)


def _dynamics() -> Work:
    model = ephs.dynamics(families.scene(CHAIN, 16))
    return lambda: [model.derivatives(model.state0) for _ in range(10)]


def _solution() -> ephs.Solution:
    return ephs.simulate(_shipped("body"), 0.2, step=1e-3)


def _report() -> Work:
    from ephs.show.report import write_report

    solution, folder = _solution(), _folder()
    return lambda: write_report(solution, folder)


def _save() -> Work:
    solution, file = _solution(), _folder() / "solution.nc"

    def work() -> None:
        solution.save(file)
        ephs.load_solution(file)

    return work


def _draw() -> Work:
    from ephs.show import draw

    system = _shipped("slider-crank").system()
    return lambda: draw(system).svg


def _process(*words: str) -> Callable[[], Work]:
    return lambda: lambda: subprocess.run([sys.executable, *words], check=True, cwd=ROOT, capture_output=True)


def _numpy() -> Work:
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((60, 60)), rng.standard_normal(60)
    return lambda: [np.linalg.solve(a, b) for _ in range(100)]


def _python() -> Work:
    return lambda: sorted({str(k): k for k in range(20_000)})


CASES: Mapping[str, Callable[[], Work]] = {
    "import ephs": _process("-c", "import ephs"),
    "ephs alone": _process("-m", "ephs"),
    "load a chain of 64": _load,
    "import a URDF": lambda: lambda: ephs.load(ROOT / "examples" / "arm.urdf"),
    "set up a chain of 4": _set_up(4),
    "set up a chain of 64": _set_up(64),
    "set up a circuit of 200 cells": _ladder(1),
    "evaluate a chain of 4": _evaluation("ephs", CHAIN, 4),
    "evaluate a chain of 64": _evaluation("ephs", CHAIN, 64),
    "evaluate a spherical chain of 16": _evaluation("ephs", "spherical-chain", 16),
    "evaluate 10 windows": _evaluation("ephs", "four-bar-windows", 10),
    **{f"step a window by {name}": _motion(name) for name in METHODS},
    "step a chain of 16, steps chosen": _chosen_steps,
    "step the slider-crank, with friction and heat": _friction,
    "step a circuit of 200 cells": _ladder(500),
    "sweep 50 starts": _sweep("joints.j0.coordinate", 50),
    "sweep 50 masses": _sweep("bodies.rod0.mass", 50),
    "flatten 10 000 boxes": _flatten,
    "order 3 000 boxes": _normal_form,
    "compare 100 boxes up to names": _isomorphism,
    "glue the relation of motor and crank": _relation,
    "check the four-bar": _check,
    "reduce the four-bar": _reduce,
    "write the equations of two gases": _equations,
    "linearize the four-bar": _linearize,
    "derivatives of a chain of 16": _dynamics,
    "draw the slider-crank": _draw,
    "write a report": _report,
    "save and read a solution": _save,
    "python: sort 20 000 words": _python,
    "numpy: solve 60 equations": _numpy,
    "pin: evaluate a chain of 64": _evaluation("pin", CHAIN, 64),
    "pin: evaluate a spherical chain of 16": _evaluation("pin", "spherical-chain", 16),
    "mujoco: step a chain of 64": _evaluation("mujoco", CHAIN, 64),
    "mujoco: step 10 windows": _evaluation("mujoco", "four-bar-windows", 10),
}
OTHERS = tuple(name for name in CASES if name.partition(":")[0] in ("python", "numpy", "pin", "mujoco"))
"""What is not ephs: by this the speed of the machine is told from that of the package."""
