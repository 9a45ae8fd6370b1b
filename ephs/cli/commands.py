"""The command line: parses, calls, prints.

Exit codes: 0 done; 1 a law fails (``check``); 2 bad input; 3 the run failed part-way; 4 its result
does not pass its audit; 130 interrupted.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from ephs.cli.animate import animate
from ephs.cli.charts import charts
from ephs.cli.equilibrium import resting
from ephs.cli.export import exports, units
from ephs.cli.info import info
from ephs.cli.input import (
    AS_GIVEN,
    TEXTS,
    BadInput,
    LoadOptions,
    addressed,
    complain,
    heard,
    initial_values,
    load_drawable,
    load_model,
    noted,
    require_ending,
)
from ephs.cli.linear import linearizing
from ephs.cli.nearest import did_you_mean
from ephs.cli.new import news
from ephs.cli.next import known_command, welcome, with_examples
from ephs.cli.plot import plot
from ephs.cli.run import run
from ephs.cli.sweep import sweeps
from ephs.cli.view import view

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


app.command(run)
app.command(info)
app.command(plot)
app.command(animate)
app.command(view)
app.command(charts)
app.command(sweeps)
app.command(linearizing)
app.command(resting)
app.command(exports)
app.command(units)
app.command(news)
app.register_install_completion_command(help="Install completion of commands and options in your shell.")


@app.default
def _welcome() -> int:
    """Print an overview of the commands."""
    print(welcome(app))
    return 0


@app.command
def check(scene: str, /, *, initial: list[str] | None = None, loading: LoadOptions = AS_GIVEN) -> int:
    """Check the laws of a model in its initial state; exit code 1 if one fails.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    initial
        Initial value of a state, PATH=NUMBER or PATH=NUMBER,NUMBER,...; may be given several times.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    model = load_model(scene, loading)
    with addressed(scene):
        from ephs.mechanics.runs.check import check_model

        report = check_model(model, initial_values(initial or []))
    table = Table("law", "", "detail", title=scene, title_justify="left", box=None, pad_edge=False)
    colours = {"holds": "green", "doubt": "yellow", "FAILS": "bold red"}
    for item in report.items:
        table.add_row(Text(item.name), Text(item.verdict, colours[item.verdict]), Text(item.detail))
    Console().print(table)
    return 0 if report.ok else 1


@app.command
def equations(
    scene: str,
    /,
    *,
    form: Literal["paper", "folded", "relation", "descriptor", "reduced"] = "reduced",
    latex: bool = False,
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Print the equations, with the names of junctions.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    form
        paper, or relation: equations of each junction and component; folded: the same, without transformers and
        junctions that store nothing; descriptor: effort functions of storages, balances and constraints; reduced:
        interface variables eliminated.
    latex
        Print a LaTeX align environment.
    """
    import ephs

    model = load_model(scene, loading)
    with addressed(scene):
        system = model.system() if isinstance(model, ephs.Scene) else model
        if form == "folded":
            from ephs.mechanics.rewrite.folding import FOLD
            from ephs.mechanics.rewrite.rewrite import rewrite

            system = rewrite(system, [FOLD]).system
        found = system.equations("relation" if form in ("paper", "folded") else form)
    print(found.latex() if latex else found)
    return 0


@app.command
def reduce(scene: str, /, *, loading: LoadOptions = AS_GIVEN) -> int:
    """List the eliminated variables, the justification, and the unknowns that remain.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
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
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Draw the interconnection pattern.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME of a System, Scene or Pattern.
    output
        Picture to write: .svg, .tex (TikZ) or .png.
    flat
        Draw the flattened pattern instead of the outermost level.
    opened
        Draw the contents of the composites of the outermost level.
    """
    import ephs

    require_ending(output, _PICTURES, did_you_mean(output.suffix, _PICTURES))
    model = load_drawable(scene, loading)
    if flat and isinstance(model, ephs.Pattern):
        raise BadInput(TEXTS["no-parts"].format(found=scene))
    with addressed(scene, output):
        from ephs.show import draw as draw_pattern

        system = model.system() if isinstance(model, ephs.Scene) else model
        output.parent.mkdir(parents=True, exist_ok=True)
        drawing = draw_pattern(
            system.flatten() if flat and isinstance(system, ephs.System) else system, output, opened=opened
        )
    print(output)
    if drawing.faults:
        print(f"overlapping names and wires: {len(drawing.faults)}")
    return 0


@app.command
def convert(
    model: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Write a model in another format as a scene file.

    Parameters
    ----------
    model
        URDF (.urdf), MJCF (.xml) or SDF (.sdf).
    output
        Scene file (.toml) to write.
    """
    with addressed(model, output), heard():
        from ephs.mechanics.imports import convert as convert_model

        output.parent.mkdir(parents=True, exist_ok=True)
        convert_model(model, output, loading.base, loading.adjust, loading.inertia or "warn", contact=loading.contact)
    print(output)
    return 0


with_examples(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line on these arguments, by default the process's own.

    Returns the exit code; see the module.
    """
    from rich.console import Console

    try:
        known_command(app, sys.argv[1:] if arguments is None else arguments)
        with noted(complain):
            return int(app(arguments, error_console=Console(stderr=True)) or 0)
    except CycloptsError:
        return 2
    except BadInput as error:
        complain(str(error))
        return 2
    except KeyboardInterrupt:
        complain("interrupted")
        return 130
