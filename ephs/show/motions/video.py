"""The moving schematic of a mechanism as a file: GIF by Pillow, MP4 and WebM by ffmpeg."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from ephs.show.motions.motion import Array, best_side
from ephs.show.motions.overlays import Tones
from ephs.show.motions.sketch import sketch
from ephs.show.motions.stage import stage_of
from ephs.show.motions.still import draw_bars, draw_still
from ephs.show.shared.errors import ShowError
from ephs.show.shared.figures import new_figure

VIDEOS: Final = {".gif": "pillow", ".mp4": "ffmpeg", ".webm": "ffmpeg"}
"""File endings and the writers of matplotlib for them."""
LONGEST, DPI = 6.4, 100
"""Width and largest height in inches, and pixels of an inch."""
BELOW = 0.2
"""Room for bars of colours below the picture, relative to its height."""
ROOM = 0.04
"""Margin about all that moves, relative to its diagonal."""


def write_video(
    sol: Any, path: str | Path, *, colour: str | None = None, fps: float = 25.0, duration: float | None = None
) -> None:
    """Write the motion of a mechanism as its schematic, seen from one side, with a fixed frame.

    Parameters
    ----------
    sol : Solution
        Of a scene, or of a system with bodies.
    path : str or Path
        A file ending in ``.gif``, ``.mp4`` or ``.webm``; the latter two need the program ffmpeg.
    colour : str, optional
        What bodies, beams and shells have as colour, with a bar: as of `animate`.
    fps : float
        Frames a second of playing time.
    duration : float, optional
        Playing time in s; by default the model's own time.

    Raises
    ------
    ShowError
        If the ending is another one, ffmpeg is missing, the solution has no bodies, no instants or nothing of the
        colour, or `fps` or `duration` is not positive.
    """
    from matplotlib.animation import writers

    name = VIDEOS.get(Path(path).suffix)
    if name is None:
        raise ShowError("video", found=Path(path).name, expected=", ".join(VIDEOS))
    if not writers.is_available(name):
        raise ShowError("ffmpeg", found=Path(path).suffix)
    stage = stage_of(sol, colour=colour, fps=fps, duration=duration)
    frames, scene = stage.frames, sol.outline
    count = len(frames.times)
    poses = [{body: rows[k] for body, rows in frames.poses.items()} for k in range(count)]
    way = best_side(stage.places()[0].reshape(-1, 3))
    extent = stage.size()
    low, high = _bounds(scene, poses, way, extent)
    low[1] -= BELOW * (high[1] - low[1]) * bool(stage.shades)
    wide, tall = high - low
    figure = new_figure(LONGEST, _even(min(LONGEST, LONGEST * float(tall / wide))))
    figure.set_layout_engine("none")
    writer: Any = writers[name](fps=1.0 / frames.pause if frames.pause else fps)  # pyright: ignore[reportArgumentType] - any number
    with writer.saving(figure, str(path), DPI):
        for frame, now in enumerate(poses):
            figure.clear()
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            draw_still(axes, scene, now, way, extent, Tones(stage.shades, frame))
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            draw_bars(axes, stage.shades)
            writer.grab_frame()


def _bounds(scene: Any, poses: list[dict[str, Array]], way: Array, extent: float) -> tuple[Array, Array]:
    """Corners (2,) of all that is ever drawn, with a margin."""
    ends = [sketch(scene, now, way, extent).bounds() for now in poses]
    low, high = np.min([a for a, _ in ends], axis=0), np.max([b for _, b in ends], axis=0)
    room = ROOM * float(np.linalg.norm(high - low))
    return low - room, high + room


def _even(inches: float) -> float:
    """Inches of an even number of pixels, which video codecs require."""
    return 2.0 * max(1, round(0.5 * inches * DPI)) / DPI
