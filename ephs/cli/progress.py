"""Progress of a run: a bar with the remaining time on a terminal, lines elsewhere."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from ephs.cli.input import complain

FIRST, LONGER = 5.0, 1.5
"""Seconds until the first line of progress, and how many times longer than the one before each further wait is."""


def seldom(
    say: Callable[[str], None], clock: Callable[[], float] = time.perf_counter
) -> Callable[[Callable[[float], str]], None]:
    """Lines ever rarer, some 7 in a minute, 17 in an hour, 25 in a day; each made of the seconds since the start."""
    begin = clock()
    due = begin + FIRST

    def line(words: Callable[[float], str]) -> None:
        nonlocal due
        now = clock()
        if now >= due:
            due = now + (LONGER - 1.0) * (now - begin)
            say(f"{words(now - begin)}, after {now - begin:.0f} s")

    return line


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[float, float, Mapping[str, Any]], None]]:
    """Show a bar with the remaining time and the program being compiled; a line every so often without a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from ephs.semantics.stage.objects import telling

    console = Console(stderr=True)
    if not console.is_terminal:
        line = seldom(complain)
        yield lambda t, until, stats: line(
            lambda spent: f"{name}: {said_of(t, until, stats, float(stats.get('integrate_s') or spent))}"
        )
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
