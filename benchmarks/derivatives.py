"""Time of derivatives of motions beside that of the motion: four parameters at once, by each method that has tangents.

Ways are interleaved and the least processor time counts; all is compiled before.
"""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import ephs
from ephs.mechanics.scene.parameters import names, read

__all__ = ["table"]

ROOT = Path(__file__).parents[1]

CASES: dict[str, tuple[list[str], float, float]] = {
    "four-bar": (
        ["bodies.coupler.mass", "joints.main.friction", "joints.main.drive", "bodies.rocker.inertia[2]"], 0.5, 0.005,
    ),
    "slider-crank": (
        ["bodies.rod.mass", "joints.bearing.friction", "thermal.housing.capacity", "joints.bearing.rate"], 0.5, 0.005,
    ),
    "chain": (
        ["bodies.rod1.mass", "joints.j0.coordinate", "bodies.rod3.inertia[0]", "joints.j1.rate"], 0.5, 0.005,
    ),
    "heavy-top": (
        ["bodies.top.mass", "bodies.top.inertia[0]", "world.gravity[2]", "joints.tip.rate[1]"], 0.5, 0.0005,
    ),
}  # fmt: skip
"""Scene -> parameters, time in s, step in s of the natural method, which takes twenty."""
REPEATS = 3


COUNTS = (1, 8, 32)
"""Numbers of parameters of a gradient."""
LONG = 2000
"""Steps of the run that a gradient is taken of."""


def table() -> str:
    """Tables of derivatives by four parameters, and of gradients."""
    return f"{_tangents()}\n\n{_gradients()}"


def _gradients() -> str:
    """Milliseconds of a run, of the gradient of its end and of derivatives along the run; less the model's tables.

    How the tables change with the parameters takes as long for one step as for many.
    """
    lines = [
        "| scene | parameters | run [ms] | gradient [ms] | ratio | sensitivity [ms] | ratio | tables besides [ms] |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    scene = ephs.load(ROOT / "scenes" / "chain.toml")
    given = [path for path in names(scene) if path.startswith("bodies.") and "velocity" not in path]
    given += [path for path in names(scene) if path.startswith("joints.") and path.endswith(("coordinate", "rate"))]
    paths = [path for path in given if not path.startswith("bodies.") or read(scene, path)]
    run: dict[str, Any] = {"method": "rk87", "step": 0.002}
    one, end = run["step"], LONG * run["step"]
    weights = {"joints.j0.coordinate": [1.0]}
    for count in COUNTS:
        chosen = paths[:count]
        ways: list[Callable[[], object]] = [
            lambda: ephs.simulate(scene, end, audit="off", **run),
            *(partial(ephs.gradient, scene, chosen, [until], weights, **run) for until in (one, end)),
            *(partial(ephs.sensitivity, scene, chosen, until, **run) for until in (one, end)),
        ]
        plain, tables, back, start, along = _least(ways)
        back, along = back - tables, along - start
        lines.append(
            f"| chain | {len(chosen)} | {1e3 * plain:.0f} | {1e3 * back:.0f} | {back / plain:.1f} "
            f"| {1e3 * along:.0f} | {along / plain:.1f} | {1e3 * tables:.0f} |"
        )
    return "\n".join(lines)


def _tangents() -> str:
    """Milliseconds of a run and of its derivatives by four parameters, and of a linearisation."""
    lines = [
        "| scene | method | run [ms] | with derivatives [ms] | ratio | linearise [ms] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, (paths, end, step) in CASES.items():
        scene = ephs.load(ROOT / "scenes" / f"{name}.toml")
        for method, until, control in (
            ("rk87", end, {"rtol": 1e-9, "atol": 1e-11}),
            ("natural", 20 * step, {"step": step}),
        ):
            run: dict[str, Any] = {"method": method, **control}
            ways: list[Callable[[], object]] = [
                lambda scene=scene, until=until, run=run: ephs.simulate(scene, until, audit="off", **run),
                lambda scene=scene, paths=paths, until=until, run=run: ephs.sensitivity(scene, paths, until, **run),
                lambda scene=scene: ephs.linearize(scene),
            ]
            plain, along, linear = _least(ways)
            lines.append(
                f"| {name} | {method} | {1e3 * plain:.0f} | {1e3 * along:.0f} | {along / plain:.1f} "
                f"| {1e3 * linear:.0f} |"
            )
    return "\n".join(lines)


def _least(ways: list[Callable[[], object]]) -> list[float]:
    """Least processor time in s of each way."""
    found = [float("inf")] * len(ways)
    for turn in range(REPEATS + 1):
        for i, way in enumerate(ways):
            start = time.process_time()
            way()
            if turn:
                found[i] = min(found[i], time.process_time() - start)
    return found
