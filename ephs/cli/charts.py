"""`ephs chart`: work-precision and stability charts of the methods, with their data."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from cyclopts import App, Parameter

from ephs.cli.input import BadInput, addressed, load_model, say

if TYPE_CHECKING:
    from ephs import Scene
    from ephs.show.charts import Cell, Family, Point, ReferenceMotion

_TEXTS = {
    "method": "--method {found}: expected some of {expected}",
    "none": "ephs chart work-precision: found no scene, expected a scene file (.toml) or FILE.py:NAME",
    "system": "{file}: found a System, expected a Scene: these charts compare how bodies move",
    "one": "--reference {file}: found {found} scenes, expected one; measure them one by one",
    "family": "{found}: expected a scene file, FILE.py:NAME, or one of the families {expected}",
    "time": "--until {found}: found no number of seconds above 0",
    "twice": "{found}: found two of this name, expected different names, after which the files are called",
}
UNTIL = 1.0
"""Default simulated time in s."""
LIMIT = 1.5
"""Default limit of processor time in s of a run in a stability chart."""

charts = App(name="chart", help="Measure and draw work-precision or stability charts of the methods.")
Model = TypeVar("Model", bound=Any)  # a Scene or a Family, loaded when they are needed
Output = Annotated[Path, Parameter(name=["--output", "-o"])]


@charts.command
def work_precision(
    *scenes: str,
    output: Output,
    until: float | None = None,
    method: list[str] | None = None,
    reference: Path | None = None,
) -> int:
    """Draw error against wall time and against evaluations, for every method.

    Parameters
    ----------
    scenes
        Scene files (.toml), or FILE.py:NAME.
    output
        Folder for the figures (PNG, SVG) and the data (CSV, JSON).
    until
        End of the simulated time in seconds. Default: 1 s, or the reference's earliest time.
    method
        Method to measure; may be given several times. Default: all.
    reference
        JSON with the bodies' states at some times. Default: a run with tight tolerances.
    """
    if not scenes:
        raise BadInput(_TEXTS["none"])
    from ephs.mechanics.methods.registry import METHODS

    known = [name for name, entry in METHODS.items() if entry.scenes]
    for name in method or []:
        if name not in known:
            raise BadInput(_TEXTS["method"].format(found=name, expected=", ".join(known)))
    if reference is not None and len(scenes) != 1:
        raise BadInput(_TEXTS["one"].format(file=reference, found=len(scenes)))
    _check_time(until)
    models = _named({file: _scene(file) for file in scenes})
    with addressed(str(output), output):
        output.mkdir(parents=True, exist_ok=True)
    for file, scene in models.items():
        with addressed(file, output), _status(scene.name) as note:
            from ephs.show.charts import draw_work_precision, tight_reference
            from ephs.show.charts import work_precision as measured

            note("reference")
            truth, time = _given(reference, scene, until)
            truth = truth or tight_reference(scene, time)
            points = measured(scene, time, method, reference=truth, note=note)
            title = f"{scene.name}, t = {time:g} s; reference: {_short(truth.source)}, to {truth.cross_check:.0e}"
            files = draw_work_precision(points, title, output, f"work-precision-{scene.name}")
        best = min((p.error for p in points if p.outcome == "done"), default=float("nan"))
        failed = sum(p.outcome != "done" for p in points)
        said = f"{scene.name}: {len(points)} runs, {failed} failed, least error {best:.1e}"
        say(said, *_reasons(points), *map(str, files))
    return 0


@charts.command
def stability(
    *families: str,
    output: Output,
    until: float = UNTIL,
    quick: bool = False,
    limit: float = LIMIT,
    resume: bool = False,
) -> int:
    """Draw the outcome of every method on scenes of growing difficulty.

    Parameters
    ----------
    families
        Names of families, or scene files, whose parameter is then the step. Default: all families.
    output
        Folder for the figures (PNG, SVG) and the data (CSV, JSON).
    until
        End of the simulated time of given scene files, in seconds.
    quick
        Only the easiest and the most difficult value of each family.
    limit
        Processor time of one run, in seconds.
    resume
        Continue an interrupted command in its folder.
    """
    _check_time(until)
    chosen = _named({name: _family(name, until) for name in families or _all()})
    with addressed(str(output), output):
        output.mkdir(parents=True, exist_ok=True)
        from ephs.show.charts.keeping import KeptCells

        kept = KeptCells(output / "stability.jsonl", resume=resume)
    from ephs.show.charts import SILENT, draw_stability, write_cells
    from ephs.show.charts import stability as measured

    cells = []
    for name, family in chosen.items():
        with addressed(name, output), _status(family.name) as note:
            found = measured(family, quick=quick, limit=limit, note=note, kept=kept)
            files = draw_stability(found, family, output, f"stability-{family.name}")
            cells += found
        counts = Counter(cell.outcome.value for cell in found)
        said = f"{family.name}: {', '.join(f'{n} {outcome}' for outcome, n in counts.items())}"
        say(said, *_reasons(found), *map(str, files))
    silent = sum(cell.outcome in SILENT for cell in cells)
    say(f"silent failures, wrong and neither refused nor flagged: {silent} of {len(cells)}")
    with addressed(str(output), output):
        say("messages, errors, counts:", *map(str, write_cells(cells, output, "stability")))
    return 0


def _reasons(records: "Sequence[Point | Cell]") -> list[str]:
    """The first reasons of failed runs; the figure lists all."""
    from ephs.show.charts.reasons import LISTED, reasons

    found = [str(each) for each in reasons(records).values()]
    return [*found[:LISTED], *([f"and {len(found) - LISTED} other reasons"] if len(found) > LISTED else [])]


def _scene(file: str) -> "Scene":
    import ephs

    model = load_model(file)
    if not isinstance(model, ephs.Scene):
        raise BadInput(_TEXTS["system"].format(file=file))
    return model


def _all() -> list[str]:
    from ephs.show.charts import FAMILIES

    return list(FAMILIES)


def _family(name: str, until: float) -> "Family":
    from ephs.show.charts import FAMILIES
    from ephs.show.charts.families import scene_family

    if name in FAMILIES:
        return FAMILIES[name]
    if not (Path(name).is_file() or name.endswith(".toml") or ".py:" in name):
        raise BadInput(_TEXTS["family"].format(found=name, expected=", ".join(FAMILIES)))
    return scene_family(_scene(name), until)


def _named(models: dict[str, Model]) -> dict[str, Model]:
    """The same, after a check that no two have the same output files."""
    for name, count in Counter(model.name for model in models.values()).items():
        if count > 1:
            raise BadInput(_TEXTS["twice"].format(found=name))
    return models


def _given(file: Path | None, scene: "Scene", until: float | None) -> "tuple[ReferenceMotion | None, float]":
    if file is None:
        return None, UNTIL if until is None else until
    from ephs.show.charts import shipped_reference

    return shipped_reference(file, scene, until)


def _check_time(until: float | None) -> None:
    if until is not None and not 0.0 < until < float("inf"):
        raise BadInput(_TEXTS["time"].format(found=until))


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:39] + "…"


@contextmanager
def _status(name: str) -> Iterator[Callable[[str], None]]:
    """Show the current measurement, on a terminal only."""
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text(name)) as status:
        yield lambda what: status.update(Text(f"{name}: {what}"))
