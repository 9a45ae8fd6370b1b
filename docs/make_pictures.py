"""Make the pictures of the README: ``python docs/make_pictures.py``, from the project's root."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

import ephs
from ephs.show import draw

HERE = Path(__file__).parent
STATIC = HERE / "_static"
FRAMES, RATE = 60, 25
COLOURS = ("#5b8fc7", "#e0a030", "#7aa974")


def outline(body: ephs.Solution, shape: dict, k: int) -> np.ndarray:
    """Corners (n, 2) in the plane x, z of a body's box or cylinder at instant k."""
    if "box" in shape:
        half = 0.5 * np.array(shape["box"])
        points = half * np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    else:
        radius, length = shape["cylinder"]
        turns = np.linspace(0.0, 2.0 * np.pi, 24)
        ring = radius * np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
        points = np.vstack([ring + np.array([0.0, 0.0, s * length / 2]) for s in (-1, 1)])
    there = points @ body.rotation[k].T + body.position[k]
    flat = there[:, [0, 2]]
    return flat[ConvexHull(flat).vertices]


def main() -> None:
    """Write the pattern of the slider-crank and one turn of its motion."""
    STATIC.mkdir(exist_ok=True)
    scene = ephs.load(HERE.parent / "scenes" / "slider-crank.toml")
    draw(scene.system()).save(STATIC / "slider-crank-pattern.svg")
    whole = ephs.simulate(scene, 1.0, step=1e-3)
    angle = whole.joint("bearing").coordinate[:, 0]
    turn = float(np.interp(angle[0] + 2.0 * np.pi * np.sign(angle[-1] - angle[0]), angle, whole.t))
    sol = ephs.simulate(scene, turn, step=turn / 600, save_at=np.linspace(0.0, turn, FRAMES + 1)[:-1])
    figure, axes = plt.subplots(figsize=(4.4, 3.3), dpi=90, layout="constrained")
    bodies = {name: (sol.body(name), body.shape) for name, body in scene.bodies.items() if body.shape}
    every = np.vstack([outline(body, shape, k) for body, shape in bodies.values() for k in range(FRAMES)])
    low, high = every.min(axis=0) - 0.015, every.max(axis=0) + 0.015
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.axis("off")
    axes.axhline(0.0, color="#bbbbbb", linewidth=1.0, linestyle=(0, (6, 4)), zorder=0)
    patches = {
        name: axes.add_patch(Polygon(outline(*entry, 0), facecolor=colour, edgecolor="#333333", linewidth=1.0))
        for (name, entry), colour in zip(bodies.items(), COLOURS, strict=True)
    }
    pins = [sol.body(j.body2).position * 0.0 for j in scene.joints.values()]
    for i, j in enumerate(scene.joints.values()):
        pins[i] = sol.point(j.body2, j.frame2[4:])
    (dots,) = axes.plot([], [], "o", color="#222222", markersize=4)

    def show(k: int) -> list:
        for name, entry in bodies.items():
            patches[name].set_xy(outline(*entry, k))
        dots.set_data([pin[k, 0] for pin in pins], [pin[k, 2] for pin in pins])
        return [*patches.values(), dots]

    FuncAnimation(figure, show, frames=FRAMES).save(STATIC / "slider-crank.gif", writer=PillowWriter(fps=RATE))


if __name__ == "__main__":
    main()
