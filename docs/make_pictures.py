"""Make the pictures of the README: ``python docs/make_pictures.py``, from the project's root."""

from pathlib import Path

import numpy as np

import ephs
from ephs.show import draw, write_video

HERE = Path(__file__).parent
STATIC = HERE / "_static"
FRAMES, RATE = 60, 25.0


def main() -> None:
    """Write the pattern of the slider-crank and one turn of its motion."""
    STATIC.mkdir(exist_ok=True)
    scene = ephs.load(HERE.parent / "scenes" / "slider-crank.toml")
    draw(scene.system()).save(STATIC / "slider-crank-pattern.svg")
    whole = ephs.simulate(scene, 1.0, step=1e-3)
    angle = whole.joint("bearing").coordinate[:, 0]
    turn = float(np.interp(angle[0] + 2.0 * np.pi * np.sign(angle[-1] - angle[0]), angle, whole.t))
    sol = ephs.simulate(scene, turn, step=turn / 600, save_at=np.linspace(0.0, turn, FRAMES + 1)[:-1])
    write_video(sol, STATIC / "slider-crank.gif", fps=RATE, duration=(FRAMES - 1) / RATE)


if __name__ == "__main__":
    main()
