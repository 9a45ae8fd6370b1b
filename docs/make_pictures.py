"""Make the picture of the README: ``python docs/make_pictures.py``, from the project's root."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageSequence

import ephs
from ephs.show import draw, write_video

HERE = Path(__file__).parent
STATIC = HERE / "_static"
FRAMES, RATE = 50, 25.0
SIZE, DOTS = (9.6, 4.2), 100  # inches, dots per inch
MOTION, HEAT, INK = "#a9cdee", "#f3a8a0", "#1a1a1a"


def main() -> None:
    """Write the pattern of the slider-crank, one turn of its motion, and its balance of energy, as one film."""
    STATIC.mkdir(exist_ok=True)
    scene = ephs.load(HERE.parent / "scenes" / "slider-crank.toml")
    pattern = Image.open(io.BytesIO(draw(scene.system()).png))
    whole = ephs.simulate(scene, 1.0, step=1e-3)
    angle = whole.joint("bearing").coordinate[:, 0]
    turn = float(np.interp(angle[0] + 2.0 * np.pi * np.sign(angle[-1] - angle[0]), angle, whole.t))
    sol = ephs.simulate(scene, turn, step=turn / 600, save_at=np.linspace(0.0, turn, FRAMES))
    film = STATIC / "slider-crank.gif"
    write_video(sol, film, fps=RATE, duration=(FRAMES - 1) / RATE)
    with Image.open(film) as shown:
        views = [frame.convert("RGB") for frame in ImageSequence.Iterator(shown)]
    pages = [_page(pattern, view, sol, k) for k, view in enumerate(views)]
    colours = pages[0].quantize(64)
    pages = [page.quantize(palette=colours, dither=Image.Dither.NONE) for page in pages]
    pages[0].save(film, save_all=True, append_images=pages[1:], duration=1e3 / RATE, loop=0, optimize=True)


def _page(pattern: Image.Image, view: Image.Image, sol: ephs.Solution, now: int) -> Image.Image:
    """The pattern, and beside it an instant of the motion, above the balance of energy up to there."""
    figure = Figure(SIZE, dpi=DOTS)
    for image, place in ((pattern, (0.005, 0.0, 0.49, 1.0)), (view, (0.5, 0.5, 0.5, 0.5))):
        axes = figure.add_axes(place)
        axes.imshow(np.asarray(image), interpolation="antialiased")
        axes.axis("off")
    _balance(figure.add_axes((0.565, 0.115, 0.42, 0.37)), sol, now)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _balance(axes: Any, sol: ephs.Solution, now: int) -> None:
    """Work of the drive beside what it becomes."""
    t, heat = 1e3 * sol.t, 1e3 * sol.heat
    motion = 1e3 * (sol.kinetic + sol.potential - sol.kinetic[0] - sol.potential[0])
    until = slice(0, now + 1)
    axes.fill_between(t[until], heat[until], (heat + motion)[until], color=MOTION, lw=0.0, label="energy of motion")
    axes.fill_between(t[until], 0.0, heat[until], color=HEAT, lw=0.0, label="heat, which never falls")
    axes.plot(t, 1e3 * sol.work, color=INK, lw=1.2, label="work of the drive: their sum, at every instant")
    axes.plot(t[now], 1e3 * sol.work[now], "o", color=INK, ms=4.0)
    axes.set(xlim=(0.0, t[-1]), ylim=(0.0, None), ylabel="energy [mJ]")
    axes.set_xlabel("time [ms]", loc="right", fontsize=8)
    axes.legend(frameon=False, fontsize=8, loc="upper left", borderaxespad=0.0)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    main()
