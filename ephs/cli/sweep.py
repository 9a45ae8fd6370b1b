"""`ephs sweep`: simulations over a grid of parameter values, as one table."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from ephs.cli.input import (
    AS_CHOSEN,
    AS_GIVEN,
    BadInput,
    LoadOptions,
    Stepping,
    addressed,
    complain,
    load_model,
    positive,
    say,
)
from ephs.cli.progress import seldom

if TYPE_CHECKING:
    import xarray as xr

_TEXTS = {
    "vary": "--vary {found}: expected PATH=FROM:TO:COUNT or PATH=VALUE,VALUE,..., as in bodies.crank.mass=0.1:0.5:9",
    "none": "ephs sweep {file}: found nothing to vary, expected --vary PATH=FROM:TO:COUNT, bodies.crank.mass=0.1:0.5:9",
    "twice": "--vary {path}: found twice, expected all values of a path in one, PATH=VALUE,VALUE,...",
    "dask": "--dask {address}: {found}; start a scheduler there, then run again",
}
LISTED = 5
"""Largest number of printed reasons of failure."""

sweeps = App(name="sweep", help="Run an ensemble of a model, in parallel.")


@sweeps.default
def sweep(
    scene: str,
    /,
    *,
    vary: list[str] | None = None,
    until: Annotated[float, Parameter(validator=positive)],
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    paired: bool = False,
    output_of: Annotated[list[str] | None, Parameter(name=["--output-of"])] = None,
    instants: Annotated[int, Parameter(validator=positive)] = 100,
    stepping: Stepping = AS_CHOSEN,
    workers: Annotated[int | None, Parameter(validator=positive)] = None,
    dask: str | None = None,
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Simulate a model over a grid of parameter values; writes sweep.nc into a folder.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME.
    vary
        PATH=FROM:TO:COUNT or PATH=VALUE,VALUE,...; may be given several times.
    until
        End of the simulated time in seconds.
    output
        Folder for the table.
    paired
        Pair the values of all paths, first with first; by default all combinations are run.
    output_of
        Output, such as joints.pin.rate or energy; may be given several times. Default: coordinates and rates of
        joints, heat and work.
    instants
        Number of equal intervals at whose ends outputs are kept.
    workers
        Number of threads. Default: the number of cores.
    dask
        Address of a Dask scheduler, such as tcp://127.0.0.1:8786.
    """
    if not vary:
        raise BadInput(_TEXTS["none"].format(file=scene))
    values: dict[str, list[float]] = {}
    for path, numbers in map(_values, vary):
        if path in values:
            raise BadInput(_TEXTS["twice"].format(path=path))
        values[path] = numbers
    model = load_model(scene, loading)
    with addressed(scene, output):
        output.mkdir(parents=True, exist_ok=True)
    import numpy as np

    from ephs.mechanics.sweep.sweep import SweepInterrupted
    from ephs.mechanics.sweep.sweep import sweep as run

    stopped = False
    with addressed(scene, output), _client(dask) as client, _progress() as progress:
        try:
            table = run(
                model, values, until, save_at=until * np.arange(instants + 1) / instants, outputs=output_of,
                paired=paired, workers=workers, client=client, progress=progress, **stepping.options(),
            )  # fmt: skip
        except SweepInterrupted as error:
            table, stopped = error.partial, True
    with addressed(scene, output):
        _write(table, output)
    return 130 if stopped else 3 if int(table.attrs["failed"]) else 0


def _values(entry: str) -> tuple[str, list[float]]:
    path, separator, text = entry.partition("=")
    try:
        if not (separator and path):
            raise ValueError
        if ":" not in text:
            return path, [float(word) for word in text.split(",")]
        first, last, count = text.split(":")
        low, high, n = float(first), float(last), int(count)
        if n < 1:
            raise ValueError
        return path, [low + (high - low) * k / max(n - 1, 1) for k in range(n)]
    except ValueError:
        raise BadInput(_TEXTS["vary"].format(found=entry)) from None


@contextmanager
def _client(address: str | None) -> Iterator[Any]:
    if address is None:
        yield None
        return
    from distributed import Client

    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise BadInput(_TEXTS["dask"].format(address=address, found=error)) from error
    with client:
        yield client


@contextmanager
def _progress() -> Iterator[Callable[[int, int, int], None]]:
    """Progress bar with finished members, failures and remaining time; a line every so often without a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        line = seldom(complain)
        yield lambda done, members, failed: line(lambda _: f"{done} of {members} members, {failed} failed")
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("members", total=None, note="")

        def progress(done: int, members: int, failed: int) -> None:
            bar.update(task, total=members, completed=done, note=f"{done} of {members}, {failed} failed")

        yield progress


def _write(table: "xr.Dataset", folder: Path) -> None:
    from ephs.solve.result.guard import named_for_file

    file = folder / "sweep.nc"
    named_for_file(table).to_netcdf(file, engine="h5netcdf")
    members, failed, seconds = (table.attrs[key] for key in ("members", "failed", "seconds"))
    reasons = Counter(str(text) for text in table["status"].values.ravel() if text != "done")
    say(
        f"{members} members, {failed} failed, in {seconds:.2f} s: {members / seconds:.0f} a second",
        *(f"{count} × {text}" for text, count in reasons.most_common(LISTED)),
        f"table: {file}",
    )
