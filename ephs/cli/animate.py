"""`ephs animate`: the moving mechanism of a result folder as one page."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ephs.cli.input import TEXTS, BadInput, addressed

__all__ = ["animate"]

Flag = Annotated[bool, Parameter(negative=())]


def animate(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    wrenches: Flag = False,
    heat: Flag = False,
    fps: float = 30.0,
    duration: float | None = None,
) -> int:
    """Make one page with the moving mechanism, which needs no network.

    Parameters
    ----------
    folder
        A result folder, as run writes it.
    output
        The page to write, FILE.html.
    wrenches
        Draw joint forces and moments as arrows.
    heat
        Colour what thermal nodes warm.
    fps
        Frames a second.
    duration
        Playing time, in seconds; that of the model unless given.
    """
    from rich.console import Console

    import ephs
    from ephs.show import animate as animated

    file = folder / "solution.nc"
    if not file.is_file():
        raise BadInput(TEXTS["no-result"].format(found=folder))
    if output.suffix != ".html":
        raise BadInput(TEXTS["suffix"].format(found=output, expected=".html"))
    try:
        sol = ephs.load_solution(file)
    except ValueError as error:
        raise BadInput(str(error)) from error
    with addressed(str(file), output):
        animated(sol, output, wrenches=wrenches, heat=heat, fps=fps, duration=duration)
    Console().print(str(output), highlight=False, markup=False, soft_wrap=True)
    return 0
