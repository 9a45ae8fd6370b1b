"""Reasons of failed runs in charts: messages without places and numbers, lettered, with the runs of each."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from string import ascii_lowercase
from typing import final

from ephs.show.charts.measure import Point
from ephs.show.charts.outcomes import ChartOutcome
from ephs.show.charts.runs import RunEnding
from ephs.show.charts.stability import Cell

Key = tuple[str, str]
"""Outcome and cause."""
LISTED = 5
"""Largest number of reasons printed by the command line."""
_FINE = {str(RunEnding.DONE), str(ChartOutcome.RIGHT), str(RunEnding.SLOW)}
_PLACE = re.compile(r"^t = [^:;]*: ")
_LIMIT = re.compile(r" where \S+ is allowed.*")
_REMARK = re.compile(r" ?\([^()]*\)")


@final
@dataclass(frozen=True, slots=True)
class Reason:
    """A reason that failed runs of a chart share.

    Parameters
    ----------
    letter
        Mark of the runs in the chart.
    outcome, text
        The outcome of the runs, and the cause without places, numbers of the run and advice.
    runs
        Method -> number of its runs.
    """

    letter: str
    outcome: str
    text: str
    runs: Mapping[str, int]

    def __str__(self) -> str:
        counts = ", ".join(f"{method} {count}" for method, count in self.runs.items())
        return f"{self.letter}  {self.outcome}: {self.text} ({counts})"


def reason_of(message: str) -> str:
    """The cause in a message of a run, or the violated laws of its audit; empty without a message."""
    found = (_cause(line) for line in message.splitlines())
    return ", ".join(dict.fromkeys(filter(None, found)))


def _cause(line: str) -> str:
    """The first clause of a line, without its time and path; of a finding of the audit the law."""
    clause = line
    while (shorter := _REMARK.sub("", clause)) != clause:
        clause = shorter
    clause = _PLACE.sub("", clause).partition("; ")[0]
    return clause.partition(":")[0] if _LIMIT.search(clause) else clause.strip()


def reasons(records: Iterable[Point | Cell]) -> dict[Key, Reason]:
    """(outcome, cause) -> the reason with its letter, in order of first appearance.

    Runs that took too long, and those without a message, have none.
    """
    runs: dict[Key, dict[str, int]] = {}
    for record in records:
        if key := _key(record):
            counts = runs.setdefault(key, {})
            counts[record.method] = counts.get(record.method, 0) + 1
    return {key: Reason(_letter(i), *key, counts) for i, (key, counts) in enumerate(runs.items())}


def letter_of(record: Point | Cell, found: Mapping[Key, Reason]) -> str:
    """Letter of a record's reason, empty without one."""
    key = _key(record)
    return found[key].letter if key else ""


def _key(record: Point | Cell) -> Key | None:
    text = reason_of(record.message)
    outcome = str(record.outcome)
    return (outcome, text) if text and outcome not in _FINE else None


def _letter(index: int) -> str:
    """a … z, aa, ab, …"""
    more, at = divmod(index, len(ascii_lowercase))
    return (_letter(more - 1) if more else "") + ascii_lowercase[at]


def reasons_table(found: Sequence[Reason]) -> str:
    """Reasons with the numbers of their runs, in Markdown; empty without reasons."""
    if not found:
        return ""
    rows = [["outcome", "reason", "runs"], ["---"] * 3]
    for each in found:
        runs = ", ".join(f"{method} {count}" for method, count in each.runs.items())
        rows.append([each.outcome, each.text.replace("|", r"\|"), runs])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n"
