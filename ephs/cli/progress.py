"""Progress bar of a run: remaining time, steps a second, energy defect so far."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[float, float, Mapping[str, Any]], None]]:
    """Show a bar with the remaining time and the program being compiled, on a terminal only."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from ephs.semantics.stage.objects import telling

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda t, until, stats: None
        return
    note = TextColumn("{task.fields[note]}", markup=False)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=20),
        note,
        TimeRemainingColumn(compact=True),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(name, total=1.0, note="")
        begin = time.perf_counter()

        def progress(t: float, until: float, stats: Mapping[str, Any]) -> None:
            spent = float(stats.get("integrate_s") or time.perf_counter() - begin)
            bar.update(task, total=until, completed=t, note=said_of(t, until, stats, spent))

        def say(program: str) -> None:
            bar.update(task, note=f"compiling {program}, kept for the next run" if program else "")

        with telling(say):
            yield progress


def said_of(t: float, until: float, stats: Mapping[str, Any], spent: float) -> str:
    """Progress of a run in words: time, steps, steps a second, and the energy defect so far."""
    words = [f"t = {t:.3g} of {until:g} s"]
    if "steps" in stats:
        words.append(f"{stats['steps']} steps")
        if spent > 0.0:
            words.append(f"{stats['steps'] / spent:.3g}/s")
    if "energy_error" in stats:
        words.append(f"energy error {stats['energy_error']:.0e}")
    return ", ".join(words)
