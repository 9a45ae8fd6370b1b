"""`ephs animate`: the moving mechanism of a result folder as one page."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ephs.cli.input import TEXTS, BadInput, addressed, solution_of

__all__ = ["animate"]

Flag = Annotated[bool, Parameter(negative=())]


def animate(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    wrenches: Flag = False,
    heat: Flag = False,
    strain: Flag = False,
    fps: float = 30.0,
    duration: float | None = None,
) -> int:
    """Write the moving mechanism as one page, which needs no network.

    Parameters
    ----------
    folder
        Result folder of ephs run, or a saved solution (.nc).
    output
        Page to write, FILE.html.
    wrenches
        Draw joint forces and moments, and contact forces, as arrows.
    heat
        Colour bodies by the temperature of their thermal nodes.
    strain
        Colour beams by their strain energy per length, where heat is not asked for.
    fps
        Frames a second.
    duration
        Playing time in seconds. Default: the simulated time.
    """
    from rich.console import Console

    from ephs.show import animate as animated

    if output.suffix != ".html":
        raise BadInput(TEXTS["suffix"].format(found=output, ending=output.suffix or "none", expected=".html"))
    sol = solution_of(folder)
    with addressed(str(folder), output):
        animated(sol, output, wrenches=wrenches, heat=heat, strain=strain, fps=fps, duration=duration)
    Console().print(str(output), highlight=False, markup=False, soft_wrap=True)
    return 0
