"""Eliminated variables, justification and remaining unknowns of a reduction: a value that prints itself as a table."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from ephs.mechanics.rewrite.rewrite import Strength

WIDTH = 120
SHOWN = 6


@final
@dataclass(frozen=True, slots=True)
class Step:
    """One step of a reduction.

    Parameters
    ----------
    name
        What was done.
    strength
        What it left as it was.
    where
        Paths of the components, names of the joints or bodies, that it is about.
    reason
        Why it may be done, in words.
    before, after
        Unknowns of the equations.
    """

    name: str
    strength: Strength
    where: tuple[str, ...]
    reason: str
    before: int
    after: int


@final
@dataclass(frozen=True, slots=True)
class Reduction:
    """The steps from the paper's equations of a model to the least that serve.

    Parameters
    ----------
    name
        Of the model.
    steps
        In the order in which they are done.
    """

    name: str
    steps: tuple[Step, ...]

    @property
    def before(self) -> int:
        """Unknowns of the paper's equations."""
        return self.steps[0].before if self.steps else 0

    @property
    def after(self) -> int:
        """Unknowns in the end."""
        return self.steps[-1].after if self.steps else 0

    def __repr__(self) -> str:
        rows = [("step", "unknowns", "preserves", "")]
        rows += [(s.name, f"{s.before} → {s.after}", str(s.strength), s.reason) for s in self.steps]
        widths = [max(len(row[i]) for row in rows) for i in range(3)]
        lines = [f"{self.name}: {self.before} unknowns of the equations as flattened, {self.after} in the end"]
        indent = " " * 4
        for row in rows:
            lines.append("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip())
            lines += textwrap.wrap(row[3], WIDTH, initial_indent=indent, subsequent_indent=indent)
        return "\n".join(lines)


def listed(names: Sequence[str]) -> str:
    """Names with commas and an "and", the many counted."""
    few = list(names[:SHOWN]) + ([f"{len(names) - SHOWN} more"] if len(names) > SHOWN else [])
    return few[0] if len(few) == 1 else f"{', '.join(few[:-1])} and {few[-1]}" if few else "none"
