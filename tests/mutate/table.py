"""What was found, as Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

from tests.mutate.mutants import Mutant


def table(
    chosen: Mapping[str, Sequence[Mutant]],
    known: Mapping[str, Mapping[str, Any]],
    explained: Mapping[str, tuple[str, str]],
) -> str:
    """One row a group: mutants made, killed, equivalent, and both shares."""
    rows = [
        "| group | mutants | made | killed | lived, equivalent | lived | killed | killed or equivalent | s each |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, mutants in chosen.items():
        made = [entry for m in mutants if (entry := known.get(f"{m.name}: {m.change}")) is not None]
        killed = sum(entry["killed"] for entry in made)
        equivalent = sum(not entry["killed"] and entry["name"] in explained for entry in made)
        seconds = sum(entry["seconds"] for entry in made)
        count = max(len(made), 1)
        rows.append(
            f"| {name} | {len(mutants)} | {len(made)} | {killed} | {equivalent} | {len(made) - killed - equivalent} | "
            f"{killed / count:.1%} | {(killed + equivalent) / count:.1%} | {seconds / count:.1f} |"
        )
    return "\n".join(rows)


def survivors(lived: Mapping[str, Sequence[Mutant]], explained: Mapping[str, tuple[str, str]]) -> str:
    """Those that lived, with why where that is known."""
    return "\n".join(
        f"- {name}: `{m.name}`: {m.change}" + (f" ({explained[m.name][1]})" if m.name in explained else "")
        for name, mutants in lived.items()
        for m in mutants
    )
