"""`ephs plot`: chosen signals of a result folder as a figure."""

from collections import defaultdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ephs.cli.input import addressed, require_ending, say, solution_of

_FIGURES = (".svg", ".png", ".pdf")


def plot(
    folder: Path,
    /,
    *signals: str,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> int:
    """Plot signals of a run; without any, list their names.

    Parameters
    ----------
    folder
        Result folder of ephs run, or a saved solution (.nc).
    signals
        Names such as joints.bearing.rate, bodies.rod.position.x or energy.
    output
        Figure to write, .svg, .png or .pdf. Default: signals.svg in the result folder or beside the file.
    """
    from ephs.show.plots.chosen import plot_signals, signal_names

    target = output or (folder.parent if folder.suffix == ".nc" else folder) / "signals.svg"
    require_ending(target, _FIGURES)
    sol = solution_of(folder)
    if not signals:
        say(*_listing(dict.fromkeys(signal_names(sol))))
        return 0
    with addressed(str(folder), target):
        target.parent.mkdir(parents=True, exist_ok=True)
        plot_signals(sol, *signals).savefig(target)
    say(str(target))
    return 0


def _listing(names: dict[str, None]) -> list[str]:
    """Names of signals, those of one joint or body on one line."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name in names:
        thing, _, what = name.rpartition(".")
        groups[thing].append(what)
    ledgers = groups.pop("", [])
    lines = [
        f"{thing}.{whats[0]}" if len(whats) == 1 else f"{thing}.{{{', '.join(whats)}}}"
        for thing, whats in groups.items()
    ]
    return ["signals:", *lines, *ledgers]
