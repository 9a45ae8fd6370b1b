"""The command line: parses, calls, prints.

Exit codes: 0 done; 1 a law fails (``check``); 2 bad input; 3 the run failed part-way; 130 interrupted.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from ephs.cli_animate import animate
from ephs.cli_charts import charts
from ephs.cli_input import (
    AS_CHOSEN,
    AS_GIVEN,
    TEXTS,
    BadInput,
    Loading,
    Stepping,
    addressed,
    heard,
    initial_values,
    load_model,
    naming,
    noted,
    positive,
    say,
)
from ephs.cli_linear import linearizing
from ephs.cli_nearest import did_you_mean
from ephs.cli_new import news
from ephs.cli_next import after, known_command, welcome, with_examples
from ephs.cli_progress import progress_bar
from ephs.cli_results import write_results
from ephs.cli_sweep import sweeps

if TYPE_CHECKING:
    from ephs import Solution

__all__ = ["main"]

_PICTURES = (".svg", ".tex", ".png")


def _version() -> str:
    from importlib.metadata import version

    return version("ephs")


app = App(
    name="ephs",
    help="Compose physical models by pattern, simulate them with both laws of thermodynamics exact.",
    version=_version,
    help_format="plaintext",
    exit_on_error=False,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


KEPT = 500
"""Intervals at whose ends results are kept where steps are chosen."""


app.command(animate)
app.command(charts)
app.command(sweeps)
app.command(linearizing)
app.command(news)
app.register_install_completion_command(help="Teach your shell the names of commands and options.")


@app.default
def _welcome() -> int:
    """Say what one can do next."""
    print(welcome(app))
    return 0


@app.command
def run(
    scene: str,
    /,
    *,
    until: Annotated[float, Parameter(validator=positive)],
    stepping: Stepping = AS_CHOSEN,
    initial: list[str] | None = None,
    out: Path | None = None,
    loading: Loading = AS_GIVEN,
) -> int:
    """Simulate a scene and write its result folder.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    until
        End of the simulated time, in seconds; without --step 501 even instants of it are kept.
    initial
        Initial value of a state, PATH=NUMBER or PATH=NUMBER,NUMBER,...; may be given several times.
    out
        Result folder; out/NAME unless given.
    """
    import ephs

    model = load_model(scene, loading)
    name = model.name if isinstance(model, ephs.Scene) else scene.rpartition(":")[2]
    folder = out or Path("out", name)
    with addressed(scene, folder):
        folder.mkdir(parents=True, exist_ok=True)
    chosen = stepping.options()
    if initial:
        chosen["initial"] = initial_values(initial)
    if stepping.step is None:  # steps that are chosen may be long: pictures want more
        chosen["save_at"] = [until * k / KEPT for k in range(KEPT + 1)]
    try:
        with addressed(scene, folder), progress_bar(name) as progress:
            solution = ephs.simulate(model, until, progress=progress, **chosen)
    except ephs.SimulationError as error:
        if error.partial is None:
            raise BadInput(naming(scene, str(error))) from error
        stopped = isinstance(error, ephs.Interrupted)
        if stopped:
            _complain(TEXTS["interrupted"].format(file=scene, at=f" at t = {error.partial.t[-1]:.6g} s"))
        else:
            _complain(TEXTS["failed"].format(file=scene, found=error))
        with addressed(scene, folder):
            _write(error.partial, folder)
        _complain(f"saved what was computed: {folder}")
        return 130 if stopped else 3
    with addressed(scene, folder):
        _write(solution, folder)
    return 0


@app.command
def check(scene: str, /, *, initial: list[str] | None = None, loading: Loading = AS_GIVEN) -> int:
    """Check the model, not the trajectory; exit code 1 if a law fails.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    initial
        Initial value of a state, PATH=NUMBER or PATH=NUMBER,NUMBER,...; may be given several times.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    model = load_model(scene, loading)
    with addressed(scene):
        from ephs.mechanics.check import check_model

        report = check_model(model, initial_values(initial or []))
    table = Table("law", "", "detail", title=scene, title_justify="left", box=None, pad_edge=False)
    for name, holds, detail in report.items:
        verdict = Text("holds", "green") if holds else Text("FAILS", "bold red")
        table.add_row(Text(name), verdict, Text(detail))
    Console().print(table)
    return 0 if report.ok else 1


@app.command
def equations(
    scene: str,
    /,
    *,
    form: Literal["relation", "descriptor", "reduced"] = "reduced",
    latex: bool = False,
    loading: Loading = AS_GIVEN,
) -> int:
    """Print the equations, with the names of junctions.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    form
        relation: what the pattern says of each junction and each component of its ports; descriptor: efforts of
        storages, balances and conditions; reduced: interface variables eliminated.
    latex
        As LaTeX, an align environment.
    """
    import ephs

    model = load_model(scene, loading)
    with addressed(scene):
        system = model.system() if isinstance(model, ephs.Scene) else model
        found = system.equations(form)
    print(found.latex() if latex else found)
    return 0


@app.command
def reduce(scene: str, /, *, loading: Loading = AS_GIVEN) -> int:
    """List what the reduction takes out, why it may, and how many unknowns are left.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    """
    import ephs

    model = load_model(scene, loading)
    with addressed(scene):
        found = ephs.reduce(model)
    print(found)
    return 0


@app.command
def draw(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    flat: bool = False,
    opened: bool = False,
    loading: Loading = AS_GIVEN,
) -> int:
    """Draw the interconnection pattern.

    Parameters
    ----------
    scene
        A scene file (.toml), a model (.urdf, .xml, .sdf), or FILE.py:NAME.
    output
        The picture to write; its ending chooses SVG, TikZ or PNG: .svg, .tex, .png.
    flat
        Draw the flattened pattern instead of the outermost level.
    opened
        Draw what is inside the composites of the outermost level.
    """
    import ephs

    if output.suffix not in _PICTURES:
        hint = did_you_mean(output.suffix, _PICTURES)
        raise BadInput(TEXTS["suffix"].format(found=output, expected=", ".join(_PICTURES)) + hint)
    model = load_model(scene, loading)
    with addressed(scene, output):
        from ephs.show import draw as draw_pattern

        system = model.system() if isinstance(model, ephs.Scene) else model
        output.parent.mkdir(parents=True, exist_ok=True)
        drawing = draw_pattern(system.flatten() if flat else system, output, opened=opened)
    print(output)
    if drawing.faults:
        print(f"names and wires that lie on something else, as there is no room: {len(drawing.faults)}")
    return 0


@app.command
def convert(
    model: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    loading: Loading = AS_GIVEN,
) -> int:
    """Write a model in another format as a scene file.

    Parameters
    ----------
    model
        A URDF (.urdf), an MJCF (.xml) or an SDF (.sdf).
    output
        The scene file (.toml) to write.
    """
    with addressed(model, output), heard():
        from ephs.mechanics.imports import convert as convert_model

        output.parent.mkdir(parents=True, exist_ok=True)
        convert_model(model, output, loading.base, loading.adjust, loading.inertia or "warn")
    print(output)
    return 0


with_examples(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line on the words after the program's name, those of the process unless given.

    Returns the exit code, see the module.
    """
    from rich.console import Console

    try:
        known_command(app, sys.argv[1:] if arguments is None else arguments)
        with noted(_complain):
            return int(app(arguments, error_console=Console(stderr=True)) or 0)
    except CycloptsError:
        return 2
    except BadInput as error:
        _complain(str(error))
        return 2
    except KeyboardInterrupt:
        _complain("interrupted")
        return 130


def _write(solution: "Solution", folder: Path) -> None:
    """Write the result folder and say what to look at next."""
    report = write_results(solution, folder, _complain)
    say("next:", *after(app, folder, moves=solution.scene is not None, report=report))


def _complain(message: str) -> None:
    print(message, file=sys.stderr)
