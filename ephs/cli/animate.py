"""`ephs animate`: the moving mechanism of a result folder as one page, or as a video."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ephs.cli.input import BadInput, addressed, require_ending, solution_of

Flag = Annotated[bool, Parameter(negative=())]


def animate(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    wrenches: Flag = False,
    colour: str | None = None,
    fps: float = 30.0,
    duration: float | None = None,
) -> int:
    """Write the moving mechanism as one page, which needs no network, or as a video of its schematic.

    Parameters
    ----------
    folder
        Result folder of ephs run, or a saved solution (.nc).
    output
        Page to write, FILE.html, or video: FILE.gif, or FILE.mp4 or FILE.webm, which need ffmpeg.
    wrenches
        Draw joint forces and moments, and contact forces, as arrows; pages only.
    colour
        Show by colour: temperature (of thermal nodes), energy (strain of beams and shells), or the size of a force or
        moment of shells: membrane, moment, shear.
    fps
        Frames a second.
    duration
        Playing time in seconds. Default: the simulated time.
    """
    from rich.console import Console

    from ephs.show import animate as animated
    from ephs.show import write_video
    from ephs.show.motions.video import VIDEOS

    require_ending(output, (".html", *VIDEOS))
    if output.suffix in VIDEOS and wrenches:
        raise BadInput(f"--wrenches: found a video, {output}, expected a page, FILE.html; leave the option out")
    sol = solution_of(folder)
    with addressed(str(folder), output):
        if output.suffix in VIDEOS:
            write_video(sol, output, colour=colour, fps=fps, duration=duration)
        else:
            animated(sol, output, wrenches=wrenches, colour=colour, fps=fps, duration=duration)
    Console().print(str(output), highlight=False, markup=False, soft_wrap=True)
    return 0
