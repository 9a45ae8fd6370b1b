"""`live_page`: a page that simulates a scene while its sliders move, without Python and without a network."""

import base64
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np

from ephs.exporting.errors import ExportError
from ephs.exporting.image import ImageNumber, image_of
from ephs.exporting.linking import webassembly
from ephs.exporting.module import exported
from ephs.mechanics.runs.simulate import simulate
from ephs.mechanics.scene.build import component_path, node_boxes
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import names, read
from ephs.show.motions.player import player
from ephs.show.motions.stage import stage_of
from ephs.show.shared.page import Page, asset
from ephs.show.shared.palette import CYCLE

KEYS: Final = ("mass", "friction", "stiffness", "damping", "gravity[2]")
"""Default numbers for sliders, in this order."""
MOST: Final = 6
"""Default number of sliders."""
CURVES: Final = 8
"""So many coordinates are plotted."""
FRAMES: Final = 30.0
"""Frames a second."""


def live_page(
    scene: Scene, *, parameters: Sequence[str] | None = None, inputs: Sequence[str] = (), until: float = 5.0
) -> Page:
    """Return a page that simulates a scene: its motion, plots, and sliders for parameters and forces.

    Parameters
    ----------
    parameters
        Paths of numbers, as of `ephs.export`; left out, some masses, stiffnesses and frictions of the scene.
    inputs
        Joints on which a force is given by a slider.
    until
        Length of the motion in s.

    Raises
    ------
    ExportError
        The scene does not allow it, or there is no linker of WebAssembly.
    """
    chosen = _candidates(scene) if parameters is None else list(parameters)
    made = exported(image_of(scene, inputs=inputs, parameters=chosen, until=until), "live")
    times = np.linspace(0.0, until, round(FRAMES * until) + 1)
    solution = simulate(scene, until, method="rk87", save_at=times, audit="off")
    stage = stage_of(solution, fps=FRAMES, duration=until)
    places, nodes = {each.name: each.place for each in made.outputs}, node_boxes(scene)
    scalar = [each for each in made.outputs if each.name.endswith(".coordinate")][:CURVES]
    curves = [
        {"name": each.name, "at": each.place, "panel": "coordinates [rad, m]", "colour": CYCLE[k % len(CYCLE)]}
        for k, each in enumerate(scalar)
    ]
    rates = [each for each in made.outputs if each.name.endswith(".rate")][:CURVES]
    curves += [
        {"name": each.name, "at": each.place, "panel": "rates [rad/s, m/s]", "colour": CYCLE[k % len(CYCLE)]}
        for k, each in enumerate(rates)
    ]
    energy = {"name": "energy", "at": places["energy"], "panel": "energy [J]", "colour": CYCLE[0]}
    weight = sum(body.mass for _, body in scene.all_bodies()) * float(np.linalg.norm(scene.world.gravity) or 1.0)
    told = {
        "name": made.name,
        "wasm": base64.b64encode(webassembly(made)).decode("ascii"),
        "bytes": made.bytes,
        "outputs": len(made.outputs),
        "times": stage.frames.times.tolist(),
        "poses": [places[f"{nodes.get(name, component_path('bodies', name))}.quaternion.w"] for name in stage.bodies],
        "curves": [*curves, energy],
        "panels": list(dict.fromkeys(str(curve["panel"]) for curve in (*curves, energy))),
        "parameters": [_slider(each, _span(each)) for each in made.parameters],
        "inputs": [_slider(each, 4.0 * abs(each.start) or weight * stage.size()) for each in made.inputs],
    }
    data = json.dumps(told, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    title = html.escape(scene.name)
    return Page(
        "\n".join([
            "<!DOCTYPE html>", '<html lang="en">',
            f'<head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>',
            f'<link rel="icon" href="data:,"><style>{asset("report.css")}{asset("uplot.css")}{_own("live.css")}',
            f"</style></head><body><h1>{title}</h1>",
            '<p class="lead">Move a slider: this page computes the new motion.</p>',
            player(stage, scene.name), '<p id="said"></p><div id="sliders"></div><div id="live-plots"></div>',
            f'<script type="application/json" id="live">{data}</script>',
            f"<script>{asset('uplot.js')}</script><script>{asset('plots.js')}</script>",
            f"<script>{_own('live.js')}</script></body></html>", "",
        ]),
        scene.name,
    )  # fmt: skip


def _candidates(scene: Scene) -> list[str]:
    """Numbers for sliders: the first few that the program can change."""
    known = names(scene)
    found = [path for key in KEYS for path in known if path.endswith(f".{key}") and read(scene, path)]
    kept: list[str] = []
    for path in found:
        if len(kept) == MOST:
            break
        try:
            image_of(scene, parameters=[*kept, path])
        except ExportError:
            continue
        kept.append(path)
    return kept


def _span(variable: ImageNumber) -> float:
    return 0.8 * abs(variable.start) if variable.start else 1.0


def _slider(variable: ImageNumber, span: float) -> dict[str, Any]:
    start = variable.start
    high = 3.0 * start if start > 0.0 and variable.unit == "" and span < start else start + span
    return {"name": variable.name, "unit": variable.unit, "low": start - span, "high": high, "start": start}


def _own(name: str) -> str:
    return files("ephs.exporting").joinpath("assets", name).read_text(encoding="utf-8")
